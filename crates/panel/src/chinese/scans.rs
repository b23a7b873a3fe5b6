//! What a scan finds and remarks.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // Devices.
    ("CANopen node", "CANopen 节点"),
    ("CANopen node (<0>)", "CANopen 节点（<0>）"),
    ("answers SDO requests of another master", "应答其他主站的 SDO 请求"),
    ("boot-up message", "启动报文"),
    ("heartbeat: NMT stopped", "心跳：NMT 停止"),
    ("heartbeat: operational", "心跳：运行"),
    ("heartbeat: pre-operational", "心跳：预运行"),
    ("emergency message", "紧急报文"),
    ("process data", "过程数据"),
    ("device without a profile", "无设备协议的设备"),
    ("inputs and outputs (CiA 401)", "输入输出模块 (CiA 401)"),
    ("measuring device (CiA 404)", "测量设备 (CiA 404)"),
    ("programmable controller (CiA 405)", "可编程控制器 (CiA 405)"),
    ("encoder (CiA 406)", "编码器 (CiA 406)"),
    ("hydraulic drive (CiA 408)", "液压驱动 (CiA 408)"),
    ("inclinometer (CiA 410)", "倾角仪 (CiA 410)"),
    ("battery (CiA 418)", "电池 (CiA 418)"),
    ("battery charger (CiA 419)", "电池充电器 (CiA 419)"),
    ("device of profile {0}", "协议 {0} 的设备"),
    ("frequency converter (CiA 402)", "变频器 (CiA 402)"),
    ("servo drive (CiA 402)", "伺服驱动器 (CiA 402)"),
    ("stepper drive (CiA 402)", "步进驱动器 (CiA 402)"),
    ("drive (CiA 402)", "驱动器 (CiA 402)"),
    ("device without a node ID", "没有节点 ID 的设备"),
    ("Modbus slave", "Modbus 从站"),
    ("<0>, heard", "<0>（监听到）"),
    ("Modbus-RTU at {0} bit/s", "Modbus-RTU，速率 {0} bit/s"),
    ("not asked", "未询问"),
    // Remarks on a device.
    ("it answers SDO requests now and then: <0>", "它只是偶尔应答 SDO 请求：<0>"),
    ("its device type (1000) cannot be read: <0>", "无法读取其设备类型 (1000)：<0>"),
    ("it is no CiA 402 drive: takt leaves it alone", "它不是 CiA 402 驱动器：takt 不会操作它"),
    ("it reports an error: <0>", "它报告错误：<0>"),
    ("it has restarted {0} times meanwhile", "期间它重新启动了 {0} 次"),
    (
        "in the NMT state stopped it has no SDO server, so that it tells nothing of itself; a configuration with it starts it",
        "在 NMT 停止状态下它没有 SDO 服务器，无法提供自身信息；将它写入配置即可启动",
    ),
    (
        "two devices answer with this node ID, and what stands here may be of either: give one of them another ID",
        "有两个设备使用该节点 ID 应答，此处的信息可能来自其中任一个：请为其中一个设置其他 ID",
    ),
    (
        "give it one: takt lss --bus … --device {0} set-id N",
        "请为它设置一个：takt lss --bus … --device {0} set-id N",
    ),
    ("it is no drive that takt knows", "它不是 takt 已知的驱动器"),
    (
        "it is no drive that takt knows; register 0 is refused: <0>",
        "它不是 takt 已知的驱动器；寄存器 0 被拒绝：<0>",
    ),
    // Remarks on a bus.
    (
        "not every node was asked by {0}: a drive is heard that speaks {1}, and the question (identifier {2}) could be a command to it",
        "未用 {0} 询问所有节点：监听到使用 {1} 的驱动器，询问帧（标识符 {2}）可能被它当作命令",
    ),
    ("a master is active: {0} of its frames were heard", "有主站正在工作：监听到它的 {0} 帧"),
    (
        "the bus is flooded: {0} frames/s were heard, so that answers may be missing; `takt monitor --stats` shows who sends them",
        "总线拥塞：监听到 {0} 帧/s，可能缺失应答；`takt monitor --stats` 可显示发送者",
    ),
    (
        "frames that belong to nothing known here, by identifier: {0}; `takt monitor` shows them",
        "不属于任何已知设备的帧（按标识符）：{0}；`takt monitor` 可显示它们",
    ),
    (
        "something answered address {0}, and it could not be read (<1>): two slaves may have this address, or the bit rate is another one",
        "地址 {0} 有应答但无法读取（<1>）：可能有两个从站使用该地址，或波特率不符",
    ),
    ("the search for devices without a node ID ended early: <0>", "搜索没有节点 ID 的设备时提前结束：<0>"),
    ("the search for devices without a node ID failed: <0>", "搜索没有节点 ID 的设备失败：<0>"),
    (
        "a device answers every request of the scan, so that an identity of zeros was found",
        "有设备应答扫描的每个请求，因此得到全零的身份",
    ),
    ("the scan found a device again", "扫描重复找到同一设备"),
    ("the scan found an identity that its device does not confirm", "扫描得到的身份未被设备确认"),
    ("the interface went down: nothing more could be sent or heard", "接口已断开：无法继续发送或监听"),
    (
        "the interface is off the bus (bus-off): check wiring, termination and bit rate, then scan again",
        "接口处于总线关闭（bus-off）：检查接线、终端电阻和波特率，然后重新扫描",
    ),
    (
        "nobody acknowledges a frame: is it plugged in and terminated, is the power of the drives on, is the bit rate right?",
        "没有节点应答帧：是否已接线并安装终端电阻？驱动器是否上电？波特率是否正确？",
    ),
    (
        "{0} requests still wait for the bus: it is too busy, or nobody acknowledges a frame (power, wiring, bit rate)",
        "仍有 {0} 个请求在等待总线：总线过忙，或没有节点应答帧（电源、接线、波特率）",
    ),
    ("{0} frames were lost before they were read: scan again", "有 {0} 帧在读取前丢失：请重新扫描"),
];

#[cfg(test)]
mod tests {
    use super::super::tests::is_chinese;
    use takt::family::scan::Answered;

    #[test]
    fn what_a_scan_says_is_chinese() {
        for sentence in [
            "left: a master is active: 12 of its frames were heard",
            "left: 300 frames were lost before they were read: scan again",
            "it reports an error: 0x4310 (excess temperature of the drive)",
            "it answers SDO requests now and then: no reply within 500 ms in 3 attempts",
            "CANopen node (heartbeat: pre-operational)",
            "not every node was asked by CANopen: a drive is heard that speaks Modbus, and the question (identifier 0x601) could be a \
             command to it",
            "servo drive (CiA 402)",
        ] {
            is_chinese(sentence);
        }
        is_chinese(&Answered::Heard("CANopen").words());
        is_chinese(&Answered::OfController.words());
    }
}
