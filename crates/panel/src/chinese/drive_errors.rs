//! The error codes that drives share (CiA 301, CiA 402), and what clears them.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // Codes with their own name.
    ("no error", "无错误"),
    ("short circuit or earth leakage at the input", "输入侧短路或对地漏电"),
    ("earth leakage at the input", "输入侧对地漏电"),
    ("earth leakage, phase L1", "L1 相对地漏电"),
    ("earth leakage, phase L2", "L2 相对地漏电"),
    ("earth leakage, phase L3", "L3 相对地漏电"),
    ("short circuit at the input", "输入侧短路"),
    ("internal current no. 1", "内部电流 1"),
    ("internal current no. 2", "内部电流 2"),
    ("over-current in the ramp function", "斜坡功能过流"),
    ("over-current in the sequence", "运行序列过流"),
    ("continuous over-current inside the device", "设备内部持续过流"),
    ("short circuit or earth leakage inside the device", "设备内部短路或对地漏电"),
    ("earth leakage inside the device", "设备内部对地漏电"),
    ("short circuit inside the device", "设备内部短路"),
    ("continuous over-current at the motor", "电机持续过流"),
    ("current at the motor no. 1", "电机电流 1"),
    ("current at the motor no. 2", "电机电流 2"),
    ("short circuit or earth leakage at the motor", "电机侧短路或对地漏电"),
    ("earth leakage at the motor", "电机侧对地漏电"),
    ("earth leakage at the motor, phase U", "电机 U 相对地漏电"),
    ("earth leakage at the motor, phase V", "电机 V 相对地漏电"),
    ("earth leakage at the motor, phase W", "电机 W 相对地漏电"),
    ("short circuit at the motor", "电机侧短路"),
    ("overload (I²t, thermal state) at the motor", "电机过载（I²t 热状态）"),
    ("mains over-voltage", "电网过压"),
    ("mains under-voltage", "电网欠压"),
    ("phase failure", "缺相"),
    ("mains frequency", "电网频率异常"),
    ("DC link over-voltage", "母线过压"),
    ("DC link under-voltage", "母线欠压"),
    ("load error", "负载错误"),
    ("output over-voltage", "输出过压"),
    ("armature circuit", "电枢回路"),
    ("field circuit", "励磁回路"),
    ("excess ambient temperature", "环境温度过高"),
    ("too low ambient temperature", "环境温度过低"),
    ("excess temperature of the device", "设备温度过高"),
    ("too low temperature of the device", "设备温度过低"),
    ("excess temperature of the drive", "驱动器温度过高"),
    ("too low temperature of the drive", "驱动器温度过低"),
    ("excess temperature of the supply", "电源温度过高"),
    ("±15 V supply", "±15 V 电源"),
    ("+24 V supply", "+24 V 电源"),
    ("+5 V supply", "+5 V 电源"),
    ("measurement circuit", "测量电路"),
    ("computing circuit", "运算电路"),
    ("operating unit", "操作单元"),
    ("output stages", "输出级"),
    ("input stages", "输入级"),
    ("contact no. 1", "触点 1"),
    ("non-volatile memory (EEPROM)", "非易失存储器 (EEPROM) 错误"),
    ("software reset (watchdog)", "软件复位（看门狗）"),
    ("loss of parameters", "参数丢失"),
    ("parameter error", "参数错误"),
    ("parameter initialisation error", "参数初始化错误"),
    ("brake chopper", "制动斩波器"),
    ("failure of the brake chopper", "制动斩波器失效"),
    ("over-current of the brake chopper", "制动斩波器过流"),
    ("protective circuit of the brake chopper", "制动斩波器保护电路"),
    ("motor blocked", "电机堵转"),
    ("motor error or wrong commutation", "电机错误或换相错误"),
    ("motor tilted", "电机倾覆失步"),
    ("tachometer fault", "测速机故障"),
    ("tachometer with wrong polarity", "测速机极性错误"),
    ("resolver 1 fault", "旋转变压器 1 故障"),
    ("resolver 2 fault", "旋转变压器 2 故障"),
    ("incremental sensor 1 fault", "增量编码器 1 故障"),
    ("incremental sensor 2 fault", "增量编码器 2 故障"),
    ("incremental sensor 3 fault", "增量编码器 3 故障"),
    ("speed sensor", "速度传感器"),
    ("position sensor", "位置传感器"),
    ("sensor position difference", "传感器位置偏差"),
    ("computation circuit", "计算电路"),
    ("communication module", "通信模块"),
    ("serial interface no. 1", "串行接口 1"),
    ("serial interface no. 2", "串行接口 2"),
    ("data storage", "数据存储"),
    ("CAN overrun, messages lost", "CAN 溢出，报文丢失"),
    ("CAN in error passive mode", "CAN 处于被动错误状态"),
    ("heartbeat or life guard of the master lost", "主站心跳或生命守护丢失"),
    ("recovered from bus off", "从总线关闭状态恢复"),
    ("CAN identifier collision", "CAN 标识符冲突"),
    ("PDO not processed, wrong length", "PDO 长度错误，未处理"),
    ("PDO length exceeded", "PDO 超长"),
    ("DAM MPDO not processed, no such object", "DAM MPDO 的对象不存在，未处理"),
    ("unexpected SYNC data length", "SYNC 数据长度异常"),
    ("RPDO not received in time", "RPDO 接收超时"),
    ("excess torque", "转矩过大"),
    ("excess difference between target and actual speed", "目标速度与实际速度偏差过大"),
    ("following error", "跟随误差"),
    ("reference limit reached", "到达位置限位"),
    // Classes of codes.
    ("error reset", "错误已复位"),
    ("generic error", "一般错误"),
    ("current at the input", "输入侧电流"),
    ("current inside the device", "设备内部电流"),
    ("current at the output", "输出侧电流"),
    ("current", "电流"),
    ("mains voltage", "电网电压"),
    ("voltage inside the device", "设备内部电压"),
    ("output voltage", "输出电压"),
    ("voltage", "电压"),
    ("ambient temperature", "环境温度"),
    ("temperature of the device", "设备温度"),
    ("temperature of the drive", "驱动器温度"),
    ("temperature of the supply", "电源温度"),
    ("temperature", "温度"),
    ("supply of the electronics", "电子部分供电"),
    ("control electronics", "控制电路"),
    ("power section", "功率部分"),
    ("device hardware", "设备硬件"),
    ("internal software", "内部软件"),
    ("user software", "用户软件"),
    ("data set", "数据集"),
    ("device software", "设备软件"),
    ("power module", "功率模块"),
    ("measurement circuit module", "测量电路模块"),
    ("sensor", "传感器"),
    ("computation module", "计算模块"),
    ("data storage module", "数据存储模块"),
    ("additional module", "附加模块"),
    ("communication", "通信"),
    ("protocol", "协议"),
    ("torque control", "转矩控制"),
    ("speed control", "速度控制"),
    ("position control", "位置控制"),
    ("positioning controller", "定位控制器"),
    ("monitoring", "监控"),
    ("external error", "外部错误"),
    ("additional function", "附加功能"),
    ("specific to the manufacturer", "厂商自定义"),
    ("unknown error", "未知错误"),
    // Cures.
    (
        "`takt drive … info` reads what the drive knows of it, and `clear-fault` clears it",
        "用 `takt drive … info` 读取驱动器的详细信息，用 `clear-fault` 清除故障",
    ),
    (
        "remove its cause, then `takt drive … clear-fault`; if it stays, power-cycle the drive",
        "消除原因后执行 `takt drive … clear-fault`；若仍存在，将驱动器断电重启",
    ),
    ("free the joint, then `takt drive … clear-fault`", "解除关节卡阻，然后执行 `takt drive … clear-fault`"),
    (
        "make sure that the controller runs and its heartbeat reaches the drive; the next bring-up clears it",
        "确认控制器正在运行且其心跳能到达驱动器；下次启动时会自动清除",
    ),
    (
        "look for a blocked or overloaded joint, and lower its acceleration; then `takt drive … clear-fault`",
        "检查关节是否卡阻或过载，并降低加速度；然后执行 `takt drive … clear-fault`",
    ),
    (
        "move the joint back inside its range by hand or with `takt drive … move`, and check its limits",
        "用手或 `takt drive … move` 将关节移回行程范围内，并检查其限值",
    ),
    ("let the drive cool, and lower load and acceleration", "让驱动器冷却，并降低负载和加速度"),
    (
        "look for a blocked joint and a damaged motor cable, and lower load and acceleration",
        "检查关节是否卡阻、电机电缆是否损坏，并降低负载和加速度",
    ),
    (
        "check the supply; a hard deceleration raises it: lower the deceleration or fit a brake resistor",
        "检查电源；急减速会抬高母线电压：降低减速度或加装制动电阻",
    ),
    ("check the supply and its cable: it falls under load", "检查电源及其电缆：带载时电压跌落"),
    ("check the supply and its cable", "检查电源及其电缆"),
    (
        "let the drive cool, and check load, cooling and ambient temperature",
        "让驱动器冷却，并检查负载、散热和环境温度",
    ),
    (
        "power-cycle the drive; if it stays, its memory needs the vendor's service",
        "将驱动器断电重启；若仍存在，其存储器需由厂商维修",
    ),
    (
        "power-cycle the drive; if it stays, it needs the vendor's service",
        "将驱动器断电重启；若仍存在，需由厂商维修",
    ),
    (
        "check the parameters that were written to the drive, or restore its defaults, then power-cycle it",
        "检查写入驱动器的参数，或恢复出厂设置，然后断电重启",
    ),
    (
        "check the encoder and its cable, then power-cycle the drive",
        "检查编码器及其电缆，然后将驱动器断电重启",
    ),
    (
        "check wiring, termination and load of the bus, then `takt drive … clear-fault`",
        "检查总线的接线、终端电阻和负载，然后执行 `takt drive … clear-fault`",
    ),
    (
        "look for a blocked joint, and check limits and gains; then `takt drive … clear-fault`",
        "检查关节是否卡阻，并检查限值和增益；然后执行 `takt drive … clear-fault`",
    ),
];

#[cfg(test)]
mod tests {
    use super::super::tests::is_chinese;
    use takt::family;

    #[test]
    fn every_error_code_and_every_cure_of_every_family_is_chinese() {
        let families = family::all().into_iter().map(|family| Some(family.word()));
        let mut sentences = std::collections::BTreeSet::new();
        for family in families.chain([None]) {
            for code in 0..=u16::MAX {
                let words = family::error_words(family, code);
                // Codes of the same class differ in their number alone.
                let number = format!("{code:04X}");
                let words = words.replace(&number, "1234").replace(&format!("error {code} "), "error 7 ");
                sentences.insert(words.replace(&format!("alarm {code:02X}h"), "alarm 77h"));
                sentences.insert(family::error_cure(family, code).to_owned());
            }
        }
        assert!(sentences.len() > 180, "{}", sentences.len());
        sentences.iter().for_each(|sentence| is_chinese(sentence));
    }
}
