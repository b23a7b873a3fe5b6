//! Stops and their causes.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    ("<0> while <1>; <2>", "<0>（当时状态：<1>）；<2>"),
    ("<0> while <1>; <2>; try: <3>", "<0>（当时状态：<1>）；<2>；建议：<3>"),
    ("category 0: remove power at once", "0 类停止：立即断开动力"),
    ("category 1: decelerate, then remove power", "1 类停止：减速停下后断开动力"),
    ("category 2: decelerate, hold under power", "2 类停止：减速停下后带电保持"),
    ("a stop was requested", "收到停止请求"),
    (
        "{0} would come to rest at {1}, outside its position limit of {2}",
        "{0} 将停在 {1}，超出其位置限值 {2}",
    ),
    ("{0} moved at {1} (allowed: {2})", "{0} 的速度为 {1}（允许：{2}）"),
    ("{0} stood still, and its drive had not reached its target", "{0} 已静止，但驱动器尚未到达目标"),
    ("the set-point of {0} was not a finite number ({1})", "{0} 的设定值不是有限数（{1}）"),
    (
        "the set-point of {0}, {1}, was outside its position limit of {2}",
        "{0} 的设定值 {1} 超出其位置限值 {2}",
    ),
    ("{0} was at {1}, beyond its position limit of {2}", "{0} 位于 {1}，超出其位置限值 {2}"),
    ("the drive of {0} exerted {1} (allowed: {2})", "{0} 的驱动器输出 {1}（允许：{2}）"),
    ("the set-point of {0} asked for {1} (allowed: {2})", "{0} 的设定值要求 {1}（允许：{2}）"),
    ("{0} was {1} from its set-point (allowed: {2})", "{0} 偏离设定值 {1}（允许：{2}）"),
    (
        "the stream of set-points began {0} from where {1} is (allowed: {2})",
        "点流的起点与 {1} 的实际位置相差 {0}（允许：{2}）",
    ),
    (
        "{0} was reported {1} from where it was, farther than it can have moved ({2})",
        "{0} 的反馈位置与此前相差 {1}，超过其可能移动的距离（{2}）",
    ),
    ("the velocity or torque of {0} expired and was not renewed", "{0} 的速度或转矩指令已过期，未被刷新"),
    (
        "the stream of set-points ended: its last command expired and no newer one came",
        "点流中断：最后一条指令已过期，且没有新的指令",
    ),
    ("the stream of set-points did not begin within <0>", "点流未在 <0>内开始"),
    ("{0} has not reported in time for <1> (allowed: {2})", "{0} 已有 <1>未按时上报（允许：{2}）"),
    ("the drive of {0} always answers <1> late", "{0} 的驱动器总是晚 <1>应答"),
    ("the drive of {0} reports a fault without an error code", "{0} 的驱动器报告故障，但没有错误码"),
    ("the drive of {0} reports fault <1>", "{0} 的驱动器报告故障 <1>"),
    (
        "the drive of {0} is no longer in operation enabled (statusword {1})",
        "{0} 的驱动器已不在运行使能状态（状态字 {1}）",
    ),
    ("the drive of {0} is no longer in operation enabled", "{0} 的驱动器已不在运行使能状态"),
    ("the drive of {0} was to be disabled and still shows <1>", "{0} 的驱动器应已去使能，但仍显示<1>"),
    (
        "the drive of {0} has not confirmed that it is disabled: no report for <1>, and <2> before",
        "{0} 的驱动器未确认已去使能：已有 <1>未上报，此前为<2>",
    ),
    (
        "the drive of {0} shows <1> although its group is disabled: something else has enabled it",
        "{0} 的驱动器在所属组去使能时显示<1>：它被其他设备使能",
    ),
    (
        "the drive of {0} does not obey the bus any more: it has cleared its remote bit (statusword {1})",
        "{0} 的驱动器不再受总线控制：它已清除远程位（状态字 {1}）",
    ),
    ("the drive of {0} shows <1> instead of <2>", "{0} 的驱动器显示<1>，而不是<2>"),
    (
        "the drive of {0} has not changed to <1> in time: it shows <2>",
        "{0} 的驱动器未及时切换到<1>：它显示<2>",
    ),
    (
        "a torque or an impedance was wanted of {0}, which is in <1> and takes them in CST alone",
        "要求 {0} 输出转矩或阻抗，但它处于<1>，仅在 CST 模式下接受",
    ),
    ("a stiffness of {0} was wanted of {1} (allowed: 0 to {2})", "要求 {1} 的刚度为 {0}（允许：0 至 {2}）"),
    ("a damping of {0} was wanted of {1} (allowed: 0 to {2})", "要求 {1} 的阻尼为 {0}（允许：0 至 {2}）"),
    ("the drive of {0} did not acknowledge its target within <1>", "{0} 的驱动器未在 <1>内确认目标"),
    ("no heartbeat of {0} has come for <1> (allowed: {2})", "已有 <1>未收到 {0} 的心跳（允许：{2}）"),
    (
        "the node of {0} is no longer operational: its heartbeat shows state {1}",
        "{0} 的节点已不处于 operational 状态：其心跳显示状态 {1}",
    ),
    ("the drive of {0} started anew during its work", "{0} 的驱动器在工作中重新启动"),
    (
        "the drive of {0} sent emergency message <1> and shows no fault",
        "{0} 的驱动器发送了紧急报文 <1>，但未显示故障",
    ),
    (
        "two nodes answer with the node ID of {0}, {1}: its feedback comes twice",
        "有两个节点使用 {0} 的节点 ID {1} 应答：其反馈出现两次",
    ),
    (
        "another master writes to the drive of node {0} on <1>: an SDO request with identifier {2} is not from this controller",
        "<1> 上有其他主站在写入节点 {0} 的驱动器：标识符为 {2} 的 SDO 请求不是本控制器发出的",
    ),
    (
        "another master sends on <0>: a frame with identifier {1} is not from this controller",
        "<0> 上有其他主站在发送：标识符为 {1} 的帧不是本控制器发出的",
    ),
    (
        "the controller misses its slots too often: {0} recently (allowed: {1})",
        "控制器错过时隙过多：最近 {0} 次（允许：{1}）",
    ),
    ("the computer was suspended for {0} s", "计算机休眠了 {0} 秒"),
    ("the callback took {0} µs (allowed: {1} µs)", "回调函数耗时 {0} µs（允许：{1} µs）"),
    ("the callback panicked", "回调函数崩溃（panic）"),
    ("<0> is error-passive: almost no frame gets through", "<0> 处于被动错误状态：几乎没有帧能通过"),
    ("<0> is bus-off: too many of its frames had errors", "<0> 已关闭（bus-off）：出错的帧过多"),
    ("the interface of <0> is down, or has gone", "<0> 的接口已断开或已移除"),
    (
        "{0} did not come to rest to be enabled: it moved at {1} {2}/s (at rest: below {3} {4}/s)",
        "{0} 未静止，无法使能：其速度为 {1} {2}/s（静止：低于 {3} {4}/s）",
    ),
    (
        "the drive of {0} did not reach operation enabled within <1> ({2} s)",
        "{0} 的驱动器未在 <1>（{2} s）内进入运行使能",
    ),
    ("no trajectory within the limits of {0} leads to its target", "在 {0} 的限值内没有通往目标的轨迹"),
    ("no trajectory within the limits leads to the target", "在限值内没有通往目标的轨迹"),
    ("set-points on <0> were not transmitted for <1>", "<0> 上的设定值已有 <1>未能发出"),
];

#[cfg(test)]
mod tests {
    use takt_rt::{Origin, Phase, Rule, StopCategory, StopCause, StopReason};

    use super::super::tests::{is_chinese, machine};
    use takt::telemetry::words;

    #[test]
    fn every_stop_is_chinese_whatever_has_caused_it() {
        let mut machine = machine();
        for plans_own_profile in [false, true] {
            machine.axes[0].plans_own_profile = plans_own_profile;
            for rule in Rule::ALL {
                for (value, limit, origin, category) in [
                    (3.0, 8.0, Origin::Axis(0), StopCategory::One),
                    (1.0, 0.0, Origin::Axis(0), StopCategory::Two),
                    (0.0, 0.0, Origin::Group, StopCategory::Zero),
                    (501.0, 500.0, Origin::Group, StopCategory::One),
                    (6.0, 29.0, Origin::Bus(0), StopCategory::Zero),
                ] {
                    let Some(cause) = StopCause::from_numbers(rule, value, limit) else { continue };
                    let stop = StopReason { category, cause, origin, slot: 9, phase: Phase::Moving };
                    let words = words::stop(&stop, &machine);
                    // A cause of an axis or a bus is not without one.
                    if !words.contains("an axis") && !words.contains("a bus") {
                        is_chinese(&words);
                        is_chinese(&words::stop_cause(&stop, &machine));
                    }
                }
            }
        }
    }
}
