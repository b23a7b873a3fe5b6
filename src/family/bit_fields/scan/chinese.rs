//! What a scan says of drives with a description, in Chinese.

use crate::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    ("drive that sends heartbeats", "发送心跳的驱动器"),
    ("motor with registers", "带寄存器的电机"),
    ("its description is {0}", "其描述文件为 {0}"),
    (
        "it does not tell its mode and its master ID (it answers now and then): scan again",
        "未告知其模式和主站 ID（仅偶尔应答）：请重新扫描",
    ),
    ("its replies have the identifier {0}", "其应答的标识符为 {0}"),
    (
        "CANopen nodes take such replies for commands of their master: give it a master ID of its own",
        "CANopen 节点会把此类应答当作主站的指令：请为其设置独立的主站 ID",
    ),
    ("there is no description for its mode ({0})", "没有适用于其模式（{0}）的描述文件"),
    ("it does not tell its {0}", "未告知其 {0}"),
];
