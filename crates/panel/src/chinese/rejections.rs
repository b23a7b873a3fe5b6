//! Requests that the real-time thread rejects.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    ("<0> was rejected: not possible while <1>", "<0>被拒绝：在“<1>”状态下不可行"),
    ("<0> was rejected while <1>: <2>", "<0>被拒绝（当时状态：<1>）：<2>"),
    ("not possible while <0>", "在“<0>”状态下不可行"),
    // Requests.
    ("switching SYNC", "切换 SYNC"),
    ("the time of day", "时间同步"),
    ("the rated torque", "额定转矩"),
    ("the process data", "过程数据"),
    ("the reported position", "上报的位置"),
    ("activating", "激活"),
    ("the move", "运动"),
    ("the target", "目标"),
    ("the change of the mode", "模式切换"),
    ("the stream", "点流"),
    ("the trajectory", "轨迹"),
    ("the callback", "回调函数"),
    ("the stop", "停止"),
    ("the fault reset", "清除故障"),
    ("the bring-up", "启动驱动器"),
    ("confirming the bring-up", "确认驱动器已启动"),
    ("inhibiting enable", "禁止使能"),
    ("the shutdown", "关闭"),
    // Reasons.
    (
        "the group has stopped for a fault of {0} (<1>), which must be reset first",
        "该组因 {0} 的故障（<1>）已停止，须先清除故障",
    ),
    (
        "the group has stopped for a fault (<0>), which must be reset first",
        "该组因故障（<0>）已停止，须先清除故障",
    ),
    ("the run is ending", "运行正在结束"),
    (
        "{0} slots were missed recently, and a stream or a callback needs fewer than {1}",
        "最近错过了 {0} 个时隙，而点流或回调函数要求少于 {1} 个",
    ),
    ("there is no axis {0}: there are {1}, counted from 0", "没有轴 {0}：共有 {1} 个轴，从 0 开始编号"),
    ("{0} is in <1>, which takes no such target", "{0} 处于<1>，不接受这种目标"),
    ("the number given for {0} is not finite ({1})", "为 {0} 给出的数不是有限数（{1}）"),
    ("{0} cannot go to {1}, beyond its position limit of {2}", "{0} 不能运动到 {1}，超出其位置限值 {2}"),
    ("{0} is beyond the velocity limit of {1}, {2}", "{0} 超出 {1} 的速度限值 {2}"),
    ("{0} is beyond the torque limit of {1}, {2}", "{0} 超出 {1} 的转矩限值 {2}"),
    (
        "at such a speed {0} comes to rest only at {1}, beyond its position limit of {2}",
        "以这样的速度，{0} 要到 {1} 才能停下，超出其位置限值 {2}",
    ),
    (
        "{0} is not a fraction of the velocity limits, above 0 up to 1",
        "{0} 不是速度限值的比例（应大于 0 且不超过 1）",
    ),
    (
        "{0} is not a fraction of the acceleration limits, above 0 up to 1",
        "{0} 不是加速度限值的比例（应大于 0 且不超过 1）",
    ),
    ("{0} s is not a possible shortest duration", "{0} s 不能作为最短时长"),
    ("there is no group {0}: there are {1}, counted from 0", "没有组 {0}：共有 {1} 个组，从 0 开始编号"),
    ("it is for one group, and must name it: {0}", "该请求只针对一个组，须指明是哪一组：{0}"),
    ("{0} is in the group {1}, not in {2}", "{0} 属于组 {1}，不属于 {2}"),
    ("no trajectory within the limits of {0} leads there", "在 {0} 的限值内没有可行轨迹"),
    ("{0} is not a possible rated torque of {1}", "{0} 不能作为 {1} 的额定转矩"),
    ("{0} would have no PDO in one direction", "{0} 将有一个方向没有 PDO"),
    ("a PDO of {0} has too many objects", "{0} 的一个 PDO 中对象过多"),
    ("{0} of {1} bits cannot be in a PDO of {2}", "{1} 位的对象 {0} 不能放入 {2} 的 PDO"),
    ("identifier {0} for {1} is in use", "{1} 的标识符 {0} 已被占用"),
    (
        "the bus of {0} would need {1} frames in a cycle, and {2} fit",
        "{0} 的总线每个周期需要 {1} 帧，而只能容纳 {2} 帧",
    ),
    ("the drives are not told the time (`time` of [master])", "未配置向驱动器发送时间（[master] 的 `time`）"),
    ("there is no such trajectory", "没有这条轨迹"),
    ("there is no such callback", "没有这个回调函数"),
    (
        "it begins at {0} while {1} is at {2}, or at another velocity",
        "它从 {0} 开始，而 {1} 位于 {2}，或速度不同",
    ),
    ("the cycle at which it was to begin has passed", "预定开始的周期已经过去"),
    ("the mode of operation is being changed", "正在切换运行模式"),
    ("{0} cannot be in <1>: it is not among its `modes`", "{0} 不能进入<1>：它不在该轴的 `modes` 中"),
    (
        "{0} is not in the PDOs of {1}, and a change of its mode needs it",
        "{0} 不在 {1} 的 PDO 中，而切换其模式需要它",
    ),
    (
        "the last bring-up of the drives has failed or is not finished: call `bring_up`",
        "上次启动驱动器失败或尚未完成：请重新启动驱动器（`bring_up`）",
    ),
    ("the drive of {0} must be disabled for it", "为此须先将 {0} 的驱动器去使能"),
    ("{0} is not at rest, or has not been for some cycles ({1})", "{0} 未静止，或静止时间还不够（{1}）"),
    (
        "{0} is {1} from its set-point (allowed: {2}), and would be pulled there",
        "{0} 偏离设定值 {1}（允许：{2}），使能后会被拉过去",
    ),
    (
        "{0} is at {1}, where the count of its drive may have wrapped: turn it by hand to its limit of {2}",
        "{0} 位于 {1}，其驱动器的计数可能已回绕：请手动将其转到限值 {2}",
    ),
    ("another trajectory is already to take the place of the present one", "已有另一条轨迹等待接替当前轨迹"),
    // Rules, by the keys that they have in reports.
    ("not_finite", "设定值不是有限数"),
    ("position_limit", "超出位置限值"),
    ("velocity_limit", "超出速度限值"),
    ("acceleration_limit", "超出加速度限值"),
    ("following_error", "跟随误差过大"),
    ("stale_command", "指令过期"),
    ("missed_feedback", "驱动器未上报"),
    ("drive_fault", "驱动器报告故障"),
    ("drive_disabled", "驱动器自行去使能"),
    ("mode_changed", "驱动器改变了模式"),
    ("enable_timeout", "驱动器未能及时使能"),
    ("no_trajectory", "没有可行轨迹"),
    ("bus_lost", "总线丢失"),
    ("not_transmitted", "设定值未发出"),
    ("not_acknowledged", "目标未被确认"),
    ("node_lost", "心跳丢失"),
    ("node_not_operational", "节点未处于运行状态"),
    ("unexpected_boot_up", "驱动器意外重启"),
    ("emergency_message", "驱动器发送了紧急报文"),
    ("duplicate_node", "两个节点 ID 相同"),
    ("foreign_master", "总线上有其他主站"),
    ("timing_unfit", "控制器错过时隙"),
    ("start_pose", "点流起点过远"),
    ("jerk_limit", "超出加加速度限值"),
    ("bus_error_passive", "总线被动错误"),
    ("implausible_feedback", "反馈位置不合理"),
    ("callback_overrun", "回调超时"),
    ("callback_panicked", "回调崩溃"),
    ("no_torque_in_mode", "该模式不接受转矩"),
    ("stiffness_limit", "超出刚度限值"),
    ("damping_limit", "超出阻尼限值"),
    ("mode_not_shown", "驱动器未切换模式"),
    ("not_disabled", "驱动器可能仍有转矩"),
    ("drive_enabled", "驱动器被其他设备使能"),
    ("drive_local", "驱动器不再受总线控制"),
    ("measured_position", "实测位置超出限值"),
    ("measured_velocity", "实测速度超出限值"),
    ("measured_torque", "实测转矩超出限值"),
    ("not_at_rest", "关节未静止，无法使能"),
];

#[cfg(test)]
mod tests {
    use takt_rt::{Phase, RejectReason, RequestError, RequestKind, Rule};

    use super::super::tests::{is_chinese, machine};
    use takt::telemetry::words;

    #[test]
    fn every_rejection_is_chinese_whatever_was_asked() {
        let request = RequestKind::Move;
        let mut all: Vec<RequestError> = RejectReason::all()
            .map(|reason| RequestError { request, reason, axis: Some(0), phase: Phase::Holding })
            .collect();
        let (axis, reason) = (None, RejectReason::StopLatched { rule: Rule::FollowingError });
        all.push(RequestError { request, reason, axis, phase: Phase::Disabled });
        all.extend(RequestKind::ALL.map(|request| {
            let reason = RejectReason::TooLate;
            RequestError { request, reason, axis, phase: Phase::Holding }
        }));
        all.iter().for_each(|rejected| is_chinese(&words::rejection(rejected, &machine())));
    }
}
