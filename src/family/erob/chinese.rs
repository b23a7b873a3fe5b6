//! What the families of eRobs say, in Chinese: all of them are the same module.

use crate::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // Errors of the drive.
    ("battery voltage of the multi-turn encoder low", "多圈编码器电池电压低"),
    ("{0} (the drive refuses to be enabled: <1>)", "{0}（驱动器拒绝使能：<1>）"),
    ("the drive refuses to be enabled, and does not say why", "驱动器拒绝使能，且未说明原因"),
    ("the list is in the eRob user manual, appendix 2", "见 eRob 用户手册附录 2"),
    ("{0} (<1>, if it is a code of CiA 402; <2>)", "{0}（若为 CiA 402 代码则是：<1>；<2>）"),
    ("RS-485 communication time-out", "RS-485 通信超时"),
    ("the drive has refused to be prepared or enabled", "驱动器拒绝准备或使能"),
    ("the drive has not kept its communication time-out", "驱动器未保持写入的通信超时"),
    ("error {0}, <1>", "错误 {0}，<1>"),
    ("error {0}", "错误 {0}"),
    ("not allowed while the motor moves", "电机运动时不允许"),
    ("not allowed while the motor is enabled", "电机使能时不允许"),
    ("the commutation is not complete after power-on", "上电后换相尚未完成"),
    ("no motion can start while the motor is disabled", "电机未使能时不能开始运动"),
    ("no motion can start in this motion mode", "该运动模式下不能开始运动"),
    ("the command needs an argument", "该命令需要参数"),
    ("the command takes no argument", "该命令不带参数"),
    ("the relay is not active yet", "继电器尚未吸合"),
    ("the drive controls no brake", "驱动器未控制制动器"),
    // Cures.
    (
        "replace the battery, then use `clear-fault --yes`; this also clears the turn count, so the joint's zero must be set again",
        "更换电池，然后执行 `clear-fault --yes`；这也会清除圈数，须重新设置关节零点",
    ),
    (
        "mend the cause, then use `clear-fault`; switch the power off and on if the error stays",
        "消除原因后执行 `clear-fault`；若错误仍存在，断电后重新上电",
    ),
    (
        "see why the master was silent, or set a longer time in register 0x0002; then clear the fault",
        "检查主站为何未通信，或在寄存器 0x0002 中设置更长时间；然后清除故障",
    ),
    (
        "replace the battery, then reset the encoder; this also wipes the count of turns, so the joint's zero must be set again",
        "更换电池，然后复位编码器；这也会清除圈数，须重新设置关节零点",
    ),
    (
        "see its state with `takt drive … info`, and whether another master commands it; then switch it off and on",
        "用 `takt drive … info` 查看其状态，并检查是否有其他主站在控制它；然后断电重启",
    ),
    (
        "write another `communication_timeout`, or \"0 ms\" if its firmware has none; without it nothing stops the drive when the line is cut",
        "设置其他 `communication_timeout`，若固件不支持则写 \"0 ms\"；没有它，断线时驱动器不会停止",
    ),
    ("stop the motor first", "请先停止电机"),
    ("disable the motor first", "请先将电机去使能"),
    ("wait until 8 s after power-on, then try again", "上电 8 s 后重试"),
    (
        "enable the motor before the start; if it cannot be enabled, read the error code 0x001F, mend the fault and enable again",
        "开始运动前先使能电机；若不能使能，读取错误码 0x001F，消除故障后再使能",
    ),
    ("check the motion mode, index 0x008D: 0, 1 or 2", "检查运动模式（索引 0x008D）：0、1 或 2"),
    ("send the command with its argument, in six bytes", "命令须带参数，共六字节"),
    ("send the command alone, in two bytes", "命令须单独发送，共两字节"),
    (
        "set the brake type \"electromagnetic friction\" in eTunner, page \"set motor\", if there is a brake",
        "若有制动器，请在 eTunner 的电机设置页中选择电磁摩擦制动器",
    ),
    (
        "read the error code of the drive with `info`: it does not say why it refuses this",
        "用 `info` 读取驱动器的错误码：它未说明拒绝的原因",
    ),
    // Requests.
    ("command {0}: <1>", "命令 {0}：<1>"),
    ("no reply", "无应答"),
    ("refused", "被拒绝"),
    ("the reply {0} does not belong to it", "应答 {0} 与请求不符"),
    ("{0} was set to {1} and shows {2}", "{0} 设为 {1}，却显示 {2}"),
    ("try again: it is busy for some seconds after power-on", "请重试：上电后数秒内它处于忙状态"),
    ("see the state of the drive with `info`", "用 `info` 查看驱动器状态"),
    // Motions.
    (
        "the drive was told to enable its motor, which is off: see its safety inputs and its supply",
        "已命令驱动器使能，但电机仍未通电：检查其安全输入和电源",
    ),
    (
        "the joint has not arrived in the time that its profile allows; it is at {0} counts",
        "关节未在运动曲线允许的时间内到达；它位于 {0} 个计数",
    ),
    (
        "the joint was told to stop and still moves at {0} counts/s",
        "已命令关节停止，但它仍以 {0} counts/s 运动",
    ),
    (
        "check whether something blocks the joint, and the profile in the drive",
        "检查关节是否受阻以及驱动器中的运动参数",
    ),
    ("use the emergency stop: the protocol has no command for it", "请使用急停：该协议没有急停命令"),
    (
        "`takt drive … emergency-stop` stops it in less than 50 ms",
        "`takt drive … emergency-stop` 可在 50 ms 内使其停止",
    ),
    ("the profile velocity of the drive is 0", "驱动器的轮廓速度为 0"),
    ("--acceleration and --deceleration", "--acceleration 和 --deceleration"),
    ("those of the drive are 0", "驱动器中的值为 0"),
    ("without a configuration the axis has no known limits", "没有配置时该轴的限值未知"),
    (
        "without a limit the joint turns as fast as the current makes it",
        "没有限值时关节会以电流所能达到的最高速度旋转",
    ),
    (
        "the rated torque of the axis ([axis.joint] rated_torque)",
        "该轴的额定转矩（[axis.joint] rated_torque）",
    ),
    (
        "the drive takes a current, and does not tell its torque; with `--raw` the value is a current in mA",
        "驱动器接受的是电流，且不提供转矩；用 `--raw` 时数值为电流 (mA)",
    ),
    ("{0} mA is more than the drive's peak current, {1} mA", "{0} mA 超过驱动器的峰值电流 {1} mA"),
    (
        "the manual advises an acceleration of at most three times the velocity in a second, here {0}",
        "手册建议加速度不超过每秒三倍速度，此处为 {0}",
    ),
    ("{0} does not fit the drive's 32 bits", "{0} 超出驱动器的 32 位范围"),
    ("the drive cannot be enabled yet: it takes 8 s after power-on", "驱动器暂不能使能：上电后需要 8 s"),
    (
        "this protocol has no watchdog: if this program ends unexpectedly, the drive goes on with what it does",
        "该协议没有通信监视：若本程序意外结束，驱动器会继续当前动作",
    ),
    (
        "the communication time-out is off: if this program ends unexpectedly, the drive goes on with what it does; `communication-timeout` sets it",
        "通信超时已关闭：若本程序意外结束，驱动器会继续当前动作；可用 `communication-timeout` 设置",
    ),
    ("motor off", "电机断电"),
    ("motor on", "电机通电"),
    ("target reached", "到达目标"),
    ("settling", "正在整定"),
    ("velocity control", "速度控制"),
    ("stopping reciprocation", "正在停止往复"),
    ("continuous", "连续"),
    ("target position", "目标位置"),
    ("reciprocating", "往复"),
    // What it does not do.
    (
        "homing method {0} needs switches, which an eRob joint does not have",
        "回零方法 {0} 需要限位开关，而 eRob 关节没有",
    ),
    ("method 35 or 37 takes the present position as zero", "方法 35 或 37 将当前位置作为零点"),
    ("this drive does not declare homing: 6502 names <0>", "该驱动器未声明回零功能：6502 列出<0>"),
    (
        "its encoder is absolute: set `zero_counts` in the configuration, or use `zero`",
        "其编码器为绝对式：在配置中设置 `zero_counts`，或使用 `zero`",
    ),
    (
        "its encoder is absolute: set `zero_counts` in the configuration",
        "其编码器为绝对式：在配置中设置 `zero_counts`",
    ),
    ("its encoder is absolute", "其编码器为绝对式"),
    ("the own protocol of an eRob has no homing", "eRob 自有协议没有回零功能"),
    ("an eRob with Modbus-RTU has no homing", "Modbus-RTU 的 eRob 没有回零功能"),
    (
        "the battery of the multi-turn encoder is empty or was disconnected; clearing this fault (2242 = 1) clears the count of turns \
         too, and the joint's zero must be set again",
        "多圈编码器电池耗尽或曾断开；清除该故障（2242 = 1）也会清除圈数，须重新设置关节零点",
    ),
    (
        "the protocol has no command that clears it: mend the cause, then switch the power off and on; after a battery alarm of a \
         multi-turn model use `zero`",
        "该协议没有清除命令：消除原因后断电重启；多圈型号电池报警后请使用 `zero`",
    ),
    (
        "an eRob with its own protocol has a node ID from 1 to 64, not {0}",
        "自有协议的 eRob 节点 ID 为 1 至 64，而不是 {0}",
    ),
    ("a slave has an address from 1 to 247, not {0}", "从站地址为 1 至 247，而不是 {0}"),
    (
        "an eRob with Modbus-RTU is on a serial line: name it, for example --bus serial:/dev/ttyUSB0",
        "Modbus-RTU 的 eRob 位于串行线上：请指明，例如 --bus serial:/dev/ttyUSB0",
    ),
    // Scans.
    ("vendor's custom CAN protocol", "厂商自定义 CAN 协议"),
    ("CANopen", "CANopen 协议"),
    (
        "its firmware has no CANopen: name it with `--family erob-can`, or load CANopen firmware into it",
        "其固件不支持 CANopen：请用 `--family erob-can` 指明，或为其刷入 CANopen 固件",
    ),
    (
        "its firmware is the one for CANopen: name it with `--family erob-canopen`",
        "其固件为 CANopen 固件：请用 `--family erob-canopen` 指明",
    ),
    ("eRob's own protocol", "eRob 自有协议"),
    (
        "its firmware is too old to tell model and serial number (before X5061715X)",
        "固件过旧（早于 X5061715X），无法提供型号和序列号",
    ),
    (
        "the firmware is too old to tell serial number and model (index 0232, from firmware X5061715X on)",
        "固件过旧，无法提供序列号和型号（索引 0232，自固件 X5061715X 起支持）",
    ),
    ("its {0} is not decoded: <1>", "其 {0} 无法解码：<1>"),
    ("the manual knows no {0}", "手册中没有 {0}"),
];

#[cfg(test)]
mod tests {
    use super::PHRASES;

    #[test]
    fn the_battery_and_the_codes_of_the_own_protocol_have_chinese_words() {
        for english in ["battery voltage of the multi-turn encoder low", "RS-485 communication time-out"] {
            assert!(PHRASES.iter().any(|(own, _)| *own == english), "{english}");
        }
        for code in takt_wire::erob_can::error_code::ErrorCode::ALL {
            for english in [code.words(), code.cure()].into_iter().flatten() {
                assert!(PHRASES.iter().any(|(own, _)| *own == english), "{english}");
            }
        }
    }
}
