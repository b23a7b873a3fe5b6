//! How a procedure of commissioning ends: failures with their advice, notes, and what a report says in words.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // Failures.
    ("interrupted", "已中断"),
    ("node {0} does not answer", "节点 {0} 不应答"),
    ("<0>; the last state that it has reported is <1>", "<0>；它最后上报的状态是<1>"),
    ("<0>, but it did answer the <1>", "<0>，但它应答了<1>"),
    ("reading {0}: <1>", "读取 {0}：<1>"),
    ("writing {0} to {1}: <2>", "将 {0} 写入 {1}：<2>"),
    ("reading {0} back after writing {1}: <2>", "写入 {1} 后读回 {0}：<2>"),
    ("reading {0}: expected {1} bytes, got {2}", "读取 {0}：应为 {1} 字节，实际收到 {2} 字节"),
    ("{0} does not fit the {1} bits of {2}", "{0} 超出 {2} 的 {1} 位范围"),
    ("{0}: {1} was written and accepted, {2} is read back", "{0}：写入 {1} 并被接受，但读回 {2}"),
    ("timeout waiting for <0> after {1} ms; {2} is {3}", "等待“<0>”超时（{1} ms）；{2} 为 {3}"),
    (
        "another drive answers: its vendor ID (1018:01) is {0}, a {1} has {2}",
        "应答的是另一种驱动器：其厂商 ID (1018:01) 为 {0}，而 {1} 应为 {2}",
    ),
    ("the drive is in a fault: <0>", "驱动器处于故障：<0>"),
    ("the drive is in a fault: <0>; <1>", "驱动器处于故障：<0>；<1>"),
    ("the fault persists: <0>", "故障仍然存在：<0>"),
    ("the fault persists: <0>; <1>", "故障仍然存在：<0>；<1>"),
    ("the drive is enabled: disable it first", "驱动器已使能：请先去使能"),
    ("the drive is no longer enabled (statusword {0})", "驱动器已失去使能（状态字 {0}）"),
    ("{0} lies outside the limits of the axis, {1} to {2}", "{0} 超出该轴的限值 {1} 至 {2}"),
    ("stopped at the limit of the axis: {0} of {1} to {2}", "在该轴的限值处停止：{0}（范围 {1} 至 {2}）"),
    ("<0> must be given: <1>", "须给出 <0>：<1>"),
    ("the axis has moved by {0} counts while it was being enabled", "该轴在使能过程中移动了 {0} 个计数"),
    ("<0>; add {1} to do it", "<0>；加上 {1} 以执行"),
    ("homing failed: <0>", "回零失败：<0>"),
    // Advice.
    (
        "check the node ID (`--node`), the drive's supply, the wiring and the termination of the bus, and its bit rate",
        "检查节点 ID（`--node`）、驱动器电源、总线接线与终端电阻及波特率",
    ),
    (
        "the drive no longer answers: check its supply, the wiring and the bus load",
        "驱动器不再应答：检查其电源、接线和总线负载",
    ),
    (
        "the drive refuses this in its present state: disable it, or clear its fault",
        "驱动器在当前状态下拒绝此操作：请去使能或清除故障",
    ),
    ("the drive has no such object", "驱动器没有该对象"),
    ("clear it with `clear-fault`", "用 `clear-fault` 清除"),
    ("check the node ID and the family", "检查节点 ID 和系列"),
    // NMT states.
    ("boot-up", "启动 (boot-up)"),
    ("stopped", "停止 (stopped)"),
    ("operational", "运行 (operational)"),
    ("pre-operational", "预运行 (pre-operational)"),
    // SDO.
    ("no reply within {0} ms in {1} attempts", "{0} ms 内无应答，共尝试 {1} 次"),
    ("<0>, one frame received did not belong to it", "<0>，收到 1 个不属于它的帧"),
    ("<0>, {1} frames received did not belong to it", "<0>，收到 {1} 个不属于它的帧"),
    ("abort {0} (<1>)", "SDO 中止 {0}（<1>）"),
    ("the toggle bit of a segment did not alternate", "分段的翻转位未交替"),
    ("{0} bytes received, but {1} were announced", "收到 {0} 字节，而声明的是 {1} 字节"),
    ("the object is longer than {0} bytes", "对象超过 {0} 字节"),
    ("an empty segment was received that is not the last one", "收到一个并非最后的空分段"),
    ("the CRC is {0}, but that of the received data is {1}", "CRC 为 {0}，而所收数据的 CRC 为 {1}"),
    (
        "blocks were lost repeatedly, or segments were acknowledged that had not been sent",
        "数据块多次丢失，或确认了未发送的分段",
    ),
    ("toggle bit not alternated", "翻转位未交替"),
    ("SDO protocol timed out", "SDO 协议超时"),
    ("client/server command specifier not valid or unknown", "命令字无效或未知"),
    ("invalid block size", "块大小无效"),
    ("invalid sequence number", "序号无效"),
    ("CRC error", "CRC 错误"),
    ("out of memory", "内存不足"),
    ("unsupported access to the object", "不支持对该对象的访问"),
    ("attempt to read a write-only object", "试图读取只写对象"),
    ("attempt to write a read-only object", "试图写入只读对象"),
    ("object does not exist in the object dictionary", "对象字典中没有该对象"),
    ("object cannot be mapped to the PDO", "对象不能映射到 PDO"),
    ("number and length of the mapped objects would exceed the PDO", "映射对象的数量和长度超出 PDO"),
    ("general parameter incompatibility", "参数不兼容"),
    ("general internal incompatibility in the device", "设备内部不兼容"),
    ("access failed due to a hardware error", "硬件错误导致访问失败"),
    ("data type does not match, length of the parameter does not match", "数据类型不符，参数长度不符"),
    ("data type does not match, parameter too long", "数据类型不符，参数过长"),
    ("data type does not match, parameter too short", "数据类型不符，参数过短"),
    ("sub-index does not exist", "子索引不存在"),
    ("invalid value for the parameter", "参数值无效"),
    ("value of the parameter too high", "参数值过大"),
    ("value of the parameter too low", "参数值过小"),
    ("maximum value is less than the minimum value", "最大值小于最小值"),
    ("resource not available: SDO connection", "资源不可用：SDO 连接"),
    ("general error", "一般错误"),
    ("data cannot be transferred or stored to the application", "数据无法传送或存入应用程序"),
    ("data cannot be transferred or stored because of local control", "由于本地控制，数据无法传送或存储"),
    (
        "data cannot be transferred or stored because of the present device state",
        "由于设备当前状态，数据无法传送或存储",
    ),
    ("no object dictionary is present or its generation failed", "没有对象字典或其生成失败"),
    ("no data available", "没有可用数据"),
    ("manufacturer-specific code", "厂商自定义代码"),
    // Modbus.
    ("slave {0}: <1>: <2>", "从站 {0}：<1>：<2>"),
    ("{0}: slave {1}: <2>", "{0}：从站 {1}：<2>"),
    ("reading register {0}", "读取寄存器 {0}"),
    ("reading {0} registers from {1}", "从 {1} 起读取 {0} 个寄存器"),
    ("writing {0} to register {1}", "将 {0} 写入寄存器 {1}"),
    ("writing {0} registers from {1}", "从 {1} 起写入 {0} 个寄存器"),
    (
        "no reply (check address, bit rate, power, and whether A and B are exchanged)",
        "无应答（检查地址、波特率、电源以及 A、B 是否接反）",
    ),
    (
        "the reply ended after {0} bytes (check bit rate, wiring and termination)",
        "应答在 {0} 字节后中断（检查波特率、接线和终端电阻）",
    ),
    ("<0> (check bit rate, wiring, termination, and addresses)", "<0>（检查波特率、接线、终端电阻和地址）"),
    (
        "the line is never silent (is there a second master, or noise without a termination?)",
        "线路始终不空闲（是否有第二个主站，或缺少终端电阻导致干扰？）",
    ),
    ("the reply is damaged: its CRC is wrong", "应答损坏：CRC 错误"),
    ("the reply is of slave {0}", "应答来自从站 {0}"),
    ("the reply is to function {0}", "应答对应功能码 {0}"),
    ("the reply has another length than was asked for", "应答长度与请求不符"),
    ("the reply confirms something else than was written", "应答确认的内容与写入的不符"),
    ("Modbus exception {0}, <1>", "Modbus 异常 {0}，<1>"),
    ("the slave does not have this function", "从站不支持该功能码"),
    ("the slave does not have such a register, or not for this access", "从站没有该寄存器，或不允许这种访问"),
    ("the slave does not take this value, or this number of registers", "从站不接受该值或该寄存器数量"),
    ("the slave could not carry it out", "从站未能执行"),
    ("the slave has accepted it, and needs a long time for it", "从站已接受，需要较长时间"),
    ("the slave is busy", "从站忙"),
    ("the memory of the slave has a parity error", "从站的存储器有奇偶校验错误"),
    ("the gateway has no path to the slave", "网关没有通往从站的路径"),
    ("the slave behind the gateway does not reply", "网关后的从站不应答"),
    // What is waited for.
    ("the acknowledgement of the set-point", "设定点的确认"),
    ("the end of the acknowledgement", "确认的结束"),
    ("the end of homing", "回零结束"),
    ("the end of the fault", "故障消除"),
    ("the mode", "模式"),
    ("standstill", "静止"),
    ("a state without torque", "无转矩状态"),
    ("enabled", "已使能"),
    ("not enabled", "未使能"),
    // Motions and modes.
    ("this drive has no homing (6098)", "该驱动器没有回零功能 (6098)"),
    (
        "set `zero_counts` in the configuration, if its encoder is absolute",
        "若编码器为绝对式，请在配置中设置 `zero_counts`",
    ),
    ("the drive reports a homing error (statusword bit 13)", "驱动器报告回零错误（状态字位 13）"),
    ("the drive holds no homing method (6098 is 0)", "驱动器中未设置回零方法（6098 为 0）"),
    ("this drive does not list homing method {0}", "该驱动器未列出回零方法 {0}"),
    ("60E3 names {0}", "60E3 列出 {0}"),
    (
        "CiA 402 defines no homing method {0}; add --force for a method of the manufacturer",
        "CiA 402 未定义回零方法 {0}；若为厂商自定义方法，请加 --force",
    ),
    (
        "a torque command does not limit the velocity, and without a configuration the axis has no known limits",
        "转矩指令不限制速度，而没有配置时该轴的限值未知",
    ),
    ("the drive does not report its rated torque (6076)", "驱动器不提供额定转矩 (6076)"),
    ("say it in the configuration: [axis.joint] rated_torque", "请在配置中给出：[axis.joint] rated_torque"),
    ("without a configuration nothing is known of the axis' limits", "没有配置时该轴的限值未知"),
    ("this drive does not show its velocity (606C)", "该驱动器不提供速度 (606C)"),
    ("move it to a position, which its own profile limits", "请改为运动到某一位置，由其自身的曲线限制"),
    ("a continuous move has no target", "连续运动没有目标"),
    ("a move needs a velocity other than zero", "运动需要非零的速度"),
    ("the drive's profile velocity (6081) is 0", "驱动器的轮廓速度 (6081) 为 0"),
    ("this drive has no <0> mode", "该驱动器没有<0>模式"),
    ("6502 names {0}", "6502 列出 {0}"),
    ("its data sheet tells which modes it has", "其数据手册列出所支持的模式"),
    ("{0} counts do not fit the drive's 32 bits", "{0} 个计数超出驱动器的 32 位范围"),
    (
        "the drive takes whole numbers only: {0} becomes {1}, {2} in its unit",
        "驱动器只接受整数：{0} 变为 {1}（按其单位为 {2}）",
    ),
    // Notes.
    ("the axis stays enabled", "该轴保持使能"),
    ("the axis may still be moving: <0>; use the emergency stop", "该轴可能仍在运动：<0>；请使用急停"),
    ("the axis is at {0}, <1>", "该轴位于 {0}，<1>"),
    ("the axis is at {0}", "该轴位于 {0}"),
    (
        "node 127 cannot use the heartbeat watchdog: if this program ends unexpectedly, the drive keeps moving",
        "节点 127 不能使用心跳监视：若本程序意外结束，驱动器会继续运动",
    ),
    (
        "this drive has no heartbeat watchdog (1016): if this program ends unexpectedly, the drive keeps moving",
        "该驱动器没有心跳监视 (1016)：若本程序意外结束，驱动器会继续运动",
    ),
    (
        "the vendor ID is not that of {0}: check that this is the intended drive",
        "厂商 ID 与 {0} 不符：请确认这是要操作的驱动器",
    ),
    (
        "the drive holds another value than was written: it may be a command object, or limit the value",
        "驱动器中的值与写入的不同：它可能是命令对象，或对值做了限制",
    ),
    // Reports.
    ("none, nothing to clear", "无，没有需要清除的故障"),
    ("yes", "是"),
    ("no", "否"),
    ("empty", "空"),
    ("{0} counts", "{0} 个计数"),
    ("{0} ({1} counts)", "{0}（{1} 个计数）"),
    ("{0} ({1}) ({2} counts)", "{0}（{1}，{2} 个计数）"),
    ("warning", "警告"),
    ("internal limit", "内部限位"),
];

#[cfg(test)]
mod tests {
    use super::super::tests::is_chinese;
    use takt::config::Quantity;
    use takt::family::commission::Failure;
    use takt::procedure::Access;
    use takt_wire::canopen::nmt::NmtState;
    use takt_wire::canopen::object::{DataType, Object};
    use takt_wire::canopen::sdo::{AbortCode, SdoError};

    const STATUSWORD: Object = Object::new(0x6041, 0, DataType::U16, "6041");

    #[test]
    fn every_failure_and_its_advice_is_chinese() {
        let (object, family) = (STATUSWORD, "slide");
        let (value, low, high, quantity) = (2.0, -1.0, 1.0, Quantity::ANGLE);
        let mut failures = vec![
            Failure::Interrupted,
            Failure::Silent { node: 5, reported: None, other_protocol: None },
            Failure::TextTransfer { object: object.address, error: SdoError::ToggleNotAlternated },
            Failure::Length { object, received: 3 },
            Failure::DoesNotFit { object, value: 70_000 },
            Failure::NotKept { object, written: 1, received: 2 },
            Failure::OtherDrive { family, expected: 1, received: 2 },
            Failure::Faulted { what: "0x8611 (following error)".to_owned(), advice: None },
            Failure::FaultPersists {
                what: "0x8611 (following error)".to_owned(),
                advice: Some("check the supply and its cable"),
            },
            Failure::Enabled,
            Failure::Disabled { statusword: 0x1250 },
            Failure::OutsideLimits { quantity, value, low, high },
            Failure::AtLimit { quantity, value, low, high },
            Failure::Missing { what: "--velocity", why: "the drive's profile velocity (6081) is 0" },
            Failure::Jumped { counts: 300 },
            Failure::Homing("the drive reports a homing error (statusword bit 13)"),
        ];
        let states = [NmtState::BootUp, NmtState::Stopped, NmtState::Operational, NmtState::PreOperational];
        failures.extend(states.map(|state| Failure::Silent {
            node: 5,
            reported: Some(state),
            other_protocol: None,
        }));
        for what in [
            "the acknowledgement of the set-point",
            "the end of the acknowledgement",
            "the end of homing",
            "the end of the fault",
            "the target",
            "the mode",
            "standstill",
            "a state without torque",
        ] {
            failures.push(Failure::NotInTime { object, what, last: 0, waited_ns: 500_000_000 });
        }
        let aborts = AbortCode::LISTED.iter().copied().chain([AbortCode::Other(7)]).map(SdoError::Aborted);
        let silences = [0, 1, 5].map(|unusable| SdoError::NoReply {
            attempts: 3,
            reply_timeout_ns: 500_000_000,
            unusable,
        });
        for error in aborts.chain(silences) {
            for access in [Access::Read, Access::Write(3), Access::ReadBack(3)] {
                failures.push(Failure::Transfer { object, access, error });
            }
        }
        for failure in failures {
            is_chinese(&failure.to_string());
            failure.advice().into_iter().for_each(is_chinese);
        }
    }
}
