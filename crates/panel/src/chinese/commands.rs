//! Why a command is not carried out, and how a motion ends.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // Of pages.
    ("there is no mode {0}", "没有模式 {0}"),
    ("{0} is in <1>, which takes no <2> from here", "{0} 处于<1>，在此不接受<2>指令"),
    ("torque", "转矩"),
    ("the motion has ended; begin it again", "该运动已结束，请重新开始"),
    ("a stop has discarded the command before it began", "停止在指令开始之前将其取消"),
    ("too many commands wait for the controller", "等待控制器的指令过多"),
    (
        "something is done with a drive already: wait for its end, or end it",
        "正在操作驱动器：请等待结束或先结束它",
    ),
    // Of the controller.
    (
        "the request was refused; the reason is no longer known, because many later requests were refused",
        "请求被拒绝；此后又有许多请求被拒绝，原因已无法得知",
    ),
    ("the group has stopped: <0>", "该组已停止：<0>"),
    ("{0} values were given for {1} axes", "给出了 {0} 个值，而共有 {1} 个轴"),
    ("there is no axis {0}: the controller has {1} axes", "没有轴 {0}：控制器共有 {1} 个轴"),
    ("there is no group {0}: <1>", "没有组 {0}：<1>"),
    ("all axes are one group, without a name", "所有轴属于同一个无名的组"),
    ("the groups are: {0}", "现有的组：{0}"),
    ("{0}: {1} is not within its limits, {2} to {3}", "{0}：{1} 超出其限值 {2} 至 {3}"),
    ("{0} is not in <1>", "{0} 不处于<1>"),
    ("profile velocity, mode = \"pv\"", "轮廓速度模式（mode = \"pv\"）"),
    ("profile torque, mode = \"pt\"", "轮廓转矩模式（mode = \"pt\"）"),
    ("a mode that follows set-points", "跟随设定值的模式"),
    ("{0} requests are already waiting", "已有 {0} 个请求在等待"),
    ("the motion is not a trajectory under way", "该运动不是正在执行的轨迹"),
    (
        "the answer to the request is no longer known, because many requests have followed it",
        "此后又有许多请求，该请求的结果已无法得知",
    ),
    ("a stop has discarded the request before it began", "停止在请求开始之前将其取消"),
    (
        "the process of the controller has not answered for {0}: it is paused, or overloaded; the command may still be carried out",
        "控制器进程已有 {0} 未应答：它被暂停或过载；该指令仍可能被执行",
    ),
    (
        "the process of the controller has not answered for {0}: it is paused, or overloaded",
        "控制器进程已有 {0} 未应答：它被暂停或过载",
    ),
    ("the controller has ended", "控制器已结束"),
    // Of another process.
    (
        "process {0} commands this controller, until {1} ms after its last command; to command in its place, take it over",
        "进程 {0} 正在控制该控制器，其最后一条指令后 {1} ms 才释放；要代替它控制，请先接管",
    ),
    (
        "process {0} has taken over from this client; to command again, take it over",
        "进程 {0} 已接管控制；要重新控制，请再次接管",
    ),
    (
        "this process may observe the controller, and not command it: it may not write to its socket",
        "本进程只能观察控制器，不能控制：它无权写入控制器的套接字",
    ),
    ("too many clients are connected to the controller", "连接到控制器的客户端过多"),
    (
        "the lease has ended before all points of the trajectory came: send it again",
        "轨迹的点尚未全部到达，控制权已失效：请重新发送轨迹",
    ),
    // Of points.
    ("there are {0} axes, and the point has entries for {1}", "共有 {0} 个轴，而该点含有 {1} 个轴的数据"),
    ("point {0}, <1>: <2>", "点 {0}，<1>：<2>"),
    ("axis {0}", "轴 {0}"),
    ("the <0> and must be a finite number", "<0>，而它必须是有限数"),
    ("position is {0},", "位置为 {0}"),
    ("velocity is {0},", "速度为 {0}"),
    ("torque is {0},", "转矩为 {0}"),
    ("a number is too large: {0}, beyond {1}", "数值过大：{0}，超过 {1}"),
    (
        "a torque or an impedance needs mode \"cst\", and the axis is in {0}",
        "转矩或阻抗需要模式 \"cst\"，而该轴处于 {0}",
    ),
    ("a torque of {0} is beyond the limit of {1}", "转矩 {0} 超出限值 {1}"),
    (
        "no stream is running: begin one first; every stop ends it",
        "没有正在进行的点流：请先开始点流；任何停止都会结束点流",
    ),
    ("too many points wait for the controller", "等待控制器的点过多"),
    // How a motion ends.
    ("the callback has panicked (<0>): <1>", "回调函数崩溃（<0>）：<1>"),
    ("a stop has discarded the motion before it began", "停止在运动开始之前将其取消"),
    ("a later motion has replaced the motion", "该运动已被后来的运动取代"),
    (
        "the result of the motion is no longer known, because many motions have followed it",
        "此后又有许多运动，该运动的结果已无法得知",
    ),
    ("the motion has not ended in time, and goes on", "运动未及时结束，仍在继续"),
    ("what was waited for has not happened in time", "等待的事情未及时发生"),
];

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use takt_rt::{AxisPoint, OperationMode, Phase, RejectReason, RequestError, RequestKind};

    use super::super::super::command::CommandRefusal;
    use super::super::tests::{is_chinese, machine};
    use takt::command::{CommandError, LeaseError, MotionError, PointRefusal, Refused, StreamError};

    #[test]
    fn every_refusal_of_a_command_is_chinese() {
        let axis = || "slide".to_owned();
        let after = Duration::from_millis(300);
        let reason = RejectReason::PositionLimit { position: 1.25, limit: 0.8 };
        let refusal =
            RequestError { request: RequestKind::Move, reason, axis: Some(1), phase: Phase::Moving };
        let leases = [
            LeaseError::Held { process: 4711, expires_in: after },
            LeaseError::TakenOver { process: 4711 },
            LeaseError::ReadOnly,
            LeaseError::TooManyClients,
            LeaseError::Lost,
        ];
        let of_controller = [
            CommandError::Count { given: 1, axes: 2 },
            CommandError::NoSuchAxis { axis: 7, axes: 2 },
            CommandError::NoSuchGroup { name: "left".to_owned(), groups: vec!["left".to_owned()] },
            CommandError::NoSuchGroup { name: "left".to_owned(), groups: vec![] },
            CommandError::OutsideLimits { axis: axis(), value: 2.0, lowest: -1.0, highest: 1.0 },
            CommandError::Full { waiting: 16 },
            CommandError::SeveralGroups { groups: vec!["left".to_owned()] },
            CommandError::NoTrajectory,
            CommandError::Refused(Refused::new(Some(refusal), &machine())),
            CommandError::Refused(Refused::new(None, &machine())),
            CommandError::Unanswered,
            CommandError::Overtaken,
            CommandError::NoReply { after },
            CommandError::Ended,
        ];
        let wrong_modes = takt::command::needed::ALL
            .map(|needed| CommandError::WrongMode { axis: axis(), needed: needed.to_owned() });
        let motions = [
            MotionError::Overtaken,
            MotionError::Replaced,
            MotionError::Forgotten,
            MotionError::NotInTime,
            MotionError::Ended,
        ];
        let points = [
            PointRefusal::NotFinite { value: AxisPoint::Velocity(f64::NAN) },
            PointRefusal::NotFinite { value: AxisPoint::Torque(f64::NAN) },
            PointRefusal::TooLarge { number: 1e10, largest: 1e9 },
            PointRefusal::NoTorqueInMode { mode: OperationMode::Homing },
            PointRefusal::Torque { torque: 9.0, limit: 3.0 },
        ];
        let streams =
            points.map(|reason| StreamError::Refused { point: 0, axis: 1, reason }).into_iter().chain([
                StreamError::Count { given: 1, axes: 2 },
                StreamError::NotStreaming,
                StreamError::Full,
                StreamError::NoReply { after },
                StreamError::Ended,
            ]);
        let own = [
            CommandRefusal::NoSuchGroup { group: 3, groups: 2 },
            CommandRefusal::NoSuchMode { mode: 77 },
            CommandRefusal::WrongMode { axis: axis(), mode: "profile position", quantity: "velocity" },
            CommandRefusal::WrongMode { axis: axis(), mode: "no mode", quantity: "torque" },
            CommandRefusal::NothingToRenew,
            CommandRefusal::Discarded,
            CommandRefusal::Busy,
            CommandRefusal::BusyWithDrive,
        ];
        let all = own
            .into_iter()
            .chain(of_controller.into_iter().chain(wrong_modes).map(CommandRefusal::from))
            .chain(leases.map(CommandError::from).map(CommandRefusal::from))
            .chain(motions.map(CommandRefusal::from))
            .chain(streams.map(CommandRefusal::from));
        all.for_each(|refusal| is_chinese(&refusal.to_string()));
    }
}
