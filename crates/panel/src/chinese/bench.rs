//! What the panel of commissioning says itself.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    ("a page has stopped everything", "有页面停止了所有轴"),
    (
        "{0} may still have torque: it could not be disabled. Use the emergency stop",
        "{0} 可能仍有转矩：未能去使能。请使用急停",
    ),
    ("{0}: {1} found", "{0}：找到 {1} 个"),
    ("<0>, interrupted", "<0>，扫描已中断"),
    ("no drive has this number, or none that takt can move", "没有该编号的驱动器，或 takt 不能驱动它"),
    ("there is no such bus", "没有这条总线"),
    ("the family {0} is on a CAN bus, not on a serial line", "系列 {0} 用于 CAN 总线，而不是串行线"),
    ("a drive has torque: disable it first", "有驱动器带有转矩：请先去使能"),
    ("{0} has torque. Nothing was sent: disable it first", "{0} 带有转矩。未发送任何帧：请先去使能"),
    ("a serial line carries no frames", "串行线上没有 CAN 帧"),
    ("{0} was not taken by the interface", "接口未接受 {0}"),
    ("a drive of {0} needs a configuration", "{0} 的驱动器需要配置"),
    ("node {0} is in the list already", "节点 {0} 已在列表中"),
    ("a communication cycle has at most {0} µs", "通信周期最多 {0} µs"),
    ("{0} is below zero: a limit and a profile have no direction", "{0} 小于零：限值和运动参数没有方向"),
    ("{0} s: a time is 0 s to {1} s", "{0} s：时间须为 0 s 至 {1} s"),
    // A frame as it is written.
    (
        "there is no `#` between the identifier and the data: 123#DEADBEEF",
        "标识符与数据之间缺少 `#`：123#DEADBEEF",
    ),
    (
        "the identifier has {0} digits: an 11-bit one has 3 (07F), a 29-bit one has 8 (0000007F)",
        "标识符有 {0} 位数字：11 位标识符为 3 位 (07F)，29 位标识符为 8 位 (0000007F)",
    ),
    ("identifier {0} is out of range: expected 0 to {1}", "标识符 {0} 超出范围：应为 0 至 {1}"),
    ("`{0}` is no hexadecimal digit", "`{0}` 不是十六进制数字"),
    (
        "one hexadecimal digit of flags belongs behind `##`: 0, or 1 for bit-rate switching (123##1DEAD)",
        "`##` 之后须有一位十六进制标志：0，或 1 表示切换波特率 (123##1DEAD)",
    ),
    (
        "behind `R` belongs nothing, or a length from 0 to 8: 701#R, 601#R8",
        "`R` 之后须为空，或为 0 至 8 的长度：701#R、601#R8",
    ),
    (
        "a length code behind `_` is not supported: the data has the length",
        "不支持 `_` 之后的长度码：长度由数据决定",
    ),
    ("the last byte has one digit instead of two", "最后一个字节只有一位数字，应为两位"),
    (
        "{0} bytes: a classic frame has at most 8; one of CAN FD begins with `##` and its flags",
        "{0} 字节：经典帧最多 8 字节；CAN FD 帧以 `##` 及其标志开头",
    ),
    (
        "{0} bytes: a CAN FD frame has 0 to 8, 12, 16, 20, 24, 32, 48 or 64; append zeros",
        "{0} 字节：CAN FD 帧为 0 至 8、12、16、20、24、32、48 或 64 字节；请补零",
    ),
];

#[cfg(test)]
mod tests {
    use super::super::tests::is_chinese;

    #[test]
    fn what_commissioning_says_is_chinese() {
        for sentence in [
            "slide may still have torque: it could not be disabled. Use the emergency stop",
            "left: 3 found, interrupted",
            "slide has torque. Nothing was sent: disable it first",
            "slide: the drive is no longer enabled (statusword 0x1250)",
            "-3 s: a time is 0 s to 86400 s",
        ] {
            is_chinese(sentence);
        }
    }
}
