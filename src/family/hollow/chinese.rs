//! What a scan says of these motors, in Chinese.

use crate::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    ("hollow-shaft motor", "空心轴电机"),
    ("hollow-shaft motor with CAN FD", "空心轴电机 (CAN FD)"),
    ("<0> in normal mode", "<0>（普通模式）"),
    ("<0> in extended mode", "<0>（扩展模式）"),
    ("motor commands on CAN", "CAN 电机指令"),
    ("motor commands on CAN FD", "CAN FD 电机指令"),
    (
        "a motor in MIT mode answers alike (drive = \"bit-fields\"): its name plate tells which it is",
        "MIT 模式的电机应答相同（`drive = \"bit-fields\"`）：请看铭牌区分",
    ),
    ("its replies have the identifier {0}", "其应答的标识符为 {0}"),
    (
        "it is behind a converter in its Modbus mode, which is too slow for an axis; with one of its switches on, the converter is a bus: \
         {0}",
        "它位于 Modbus 模式的转换器之后，作为轴速度不够；拨上转换器的一个开关后，它就是一条总线：{0}",
    ),
    (
        "it has not been commanded since it was switched on: the converter has no reply of it yet",
        "上电后尚未收到指令：转换器还没有它的应答",
    ),
    ("no motor has the ID {0}", "没有 ID 为 {0} 的电机"),
    (
        "check the motor ID (`--node`), the converter's switches (all off) and the wiring",
        "检查电机 ID（`--node`）、转换器的开关（全部拨下）和接线",
    ),
];
