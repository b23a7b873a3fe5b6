//! Events, and the words that they share with other sentences: phases, states, modes.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // What sentences are put together by.
    ("<0>; try: <1>", "<0>；建议：<1>"),
    ("<0>; <1>", "<0>；<1>"),
    ("{0}: <1>", "{0}：<1>"),
    ("<0>, <1>", "<0>、<1>"),
    ("<0> (<1>)", "<0>（<1>）"),
    ("bus {0}", "总线 {0}"),
    ("1 cycle", "1 个周期"),
    ("{0} cycles", "{0} 个周期"),
    ("none", "无"),
    // Events.
    ("<0> → <1>", "状态：<0> → <1>"),
    ("stop: <0>", "停止：<0>"),
    ("motion {0} finished", "运动 {0} 已完成"),
    ("stream: over", "点流：已结束"),
    ("stream: awaited", "点流：等待开始"),
    ("stream: followed", "点流：正在跟随"),
    ("stream: the points have run out, the axes come to rest", "点流：点已用完，各轴正在停稳"),
    ("a callback leads the axes", "回调函数正在控制各轴"),
    ("{0}: <1> (statusword {2})", "{0}：<1>（状态字 {2}）"),
    ("{0}: changed to <1>", "{0}：已切换到<1>"),
    ("{0}: emergency message: no error any more", "{0}：紧急报文：错误已消除"),
    (
        "{0}: emergency message: error <1>, register {2}, manufacturer {3}; try: <4>",
        "{0}：紧急报文：错误 <1>，错误寄存器 {2}，厂商字节 {3}；建议：<4>",
    ),
    ("missed slots: normal again", "错过的时隙：恢复正常"),
    ("missed slots: many", "错过的时隙：较多"),
    ("missed slots: too many to begin a stream", "错过的时隙：过多，不能开始点流"),
    ("missed slots: too many to go on", "错过的时隙：过多，无法继续"),
    ("1 slot was missed: the thread was late", "错过 1 个时隙：线程运行过晚"),
    ("{0} slots were missed: the thread was late", "错过 {0} 个时隙：线程运行过晚"),
    ("{0} events were missed: they came too fast", "丢失了 {0} 个事件：事件产生过快"),
    // Phases.
    ("passive", "被动"),
    ("disabled", "未使能"),
    ("enabling", "使能"),
    ("holding", "保持"),
    ("moving", "运动中"),
    ("streaming", "跟随点流"),
    ("stopping", "正在停止"),
    ("disabling", "去使能"),
    // States of a drive (CiA 402).
    ("not ready to switch on", "未准备好接通"),
    ("switch on disabled", "禁止接通"),
    ("ready to switch on", "准备接通"),
    ("switched on", "已接通"),
    ("operation enabled", "运行使能"),
    ("quick stop active", "快速停止中"),
    ("fault reaction active", "故障反应中"),
    ("fault", "故障"),
    ("no state of CiA 402", "非 CiA 402 状态"),
    // Modes of operation (object 6060).
    ("mode {0}", "模式 {0}"),
    ("mode {0} (<1>)", "模式 {0}（<1>）"),
    ("no mode", "无模式"),
    ("profile position", "轮廓位置"),
    ("velocity", "速度"),
    ("profile velocity", "轮廓速度"),
    ("profile torque", "轮廓转矩"),
    ("homing", "回零"),
    ("interpolated position", "插补位置"),
    ("cyclic synchronous position", "周期同步位置"),
    ("cyclic synchronous velocity", "周期同步速度"),
    ("cyclic synchronous torque", "周期同步转矩"),
];

#[cfg(test)]
mod tests {
    use takt_rt::{
        DriveState, Event, EventKind, OperationMode, Phase, RejectReason, RequestError, RequestId,
        RequestKind, StreamState, TimingLevel,
    };

    use super::super::tests::{is_chinese, machine};
    use takt::telemetry::words;

    #[test]
    fn every_event_is_chinese() {
        let mut kinds = vec![
            EventKind::MotionFinished { request: RequestId(7) },
            EventKind::MissedSlots { count: 1 },
            EventKind::MissedSlots { count: 30 },
            EventKind::Emergency { axis: 1, code: 0, register: 0, manufacturer: [0; 5] },
            EventKind::Emergency { axis: 1, code: 0x7305, register: 0x21, manufacturer: [1, 2, 3, 4, 0xFF] },
        ];
        kinds.extend(Phase::ALL.map(|to| EventKind::PhaseChanged { from: Phase::Enabling, to }));
        kinds.extend(StreamState::ALL.map(|state| EventKind::Stream { state }));
        kinds.extend(TimingLevel::ALL.map(|level| EventKind::Timing { level }));
        kinds.extend(OperationMode::ALL.map(|mode| EventKind::Mode { axis: 0, mode }));
        kinds.extend(DriveState::ALL.map(|state| EventKind::DriveState {
            axis: 0,
            state,
            statusword: 0x1637,
        }));
        kinds.extend(RequestKind::ALL.map(|request| {
            let reason = RejectReason::Phase;
            EventKind::Rejected(RequestError { request, reason, axis: None, phase: Phase::Moving })
        }));
        for kind in kinds {
            is_chinese(&words::event(&Event { slot: 1, at_ns: 2, group: Some(0), kind }, &machine()));
        }
    }
}
