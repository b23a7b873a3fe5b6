//! The cures of faults.

use takt::family::ChinesePhrase;

pub const PHRASES: &[ChinesePhrase] = &[
    (
        "find the division or the missing value in the program that sends set-points",
        "检查发送设定值的程序中是否有除零或缺失值",
    ),
    (
        "command a position within the limits; look at `limits.position`",
        "给出限值内的位置；检查 `limits.position`",
    ),
    ("command less, or look at `limits.velocity`", "降低指令，或检查 `limits.velocity`"),
    (
        "command a smoother motion, or look at `limits.acceleration`",
        "使运动更平滑，或检查 `limits.acceleration`",
    ),
    (
        "look for an obstacle or a brake that is not released; then clear the fault and move more slowly",
        "检查障碍物或未松开的制动器；然后清除故障并放慢运动",
    ),
    (
        "the program that commanded this axis has stopped to renew it; clear the fault and begin again",
        "控制该轴的程序停止了刷新；清除故障后重新开始",
    ),
    ("push points at once after the stream has begun, and clear the fault", "点流开始后立即发送点；清除故障"),
    (
        "check the power of the drive, its cable and the termination of the bus; after a loss of power, bring it up again",
        "检查驱动器电源、电缆和总线终端电阻；断电后重新启动该驱动器",
    ),
    (
        "another master or an adapter delays its frames: end it, or give the bus a longer cycle",
        "其他主站或适配器延迟了其帧：结束它，或延长总线周期",
    ),
    (
        "see the cure of the drive's error; clear the fault when its cause is gone",
        "参照驱动器错误的处理办法；原因消除后清除故障",
    ),
    (
        "look at the drive's inputs, its supply and its safe torque off",
        "检查驱动器输入、电源和安全转矩关断 (STO)",
    ),
    ("no other program may command this drive; clear the fault", "不得有其他程序控制该驱动器；清除故障"),
    (
        "check the drive's supply and its enable input; wait after power-on, then enable again",
        "检查驱动器电源与使能输入；上电后稍等再使能",
    ),
    ("choose a target that the limits allow", "选择限值允许的目标"),
    (
        "look for a short circuit, the termination and the bit rate; clear the fault when the bus works again",
        "检查短路、终端电阻和波特率；总线恢复后清除故障",
    ),
    (
        "set the interface up, or plug the adapter in again, and bring the drives up again; an adapter on a serial line needs another run",
        "启用接口或重新插上适配器，然后重新启动驱动器；若适配器接在串行线路上，请重新开始运行",
    ),
    (
        "the bus is blocked by other frames or errors; look at its load and its cable",
        "总线被其他帧或错误阻塞；检查负载与电缆",
    ),
    (
        "check that the drive is in the mode that is configured; clear the fault",
        "检查驱动器是否处于配置的模式；清除故障",
    ),
    (
        "check the power of the drive and its cable, and bring it up again",
        "检查驱动器电源与电缆，并重新启动该驱动器",
    ),
    (
        "no other master may send NMT commands; bring the drive up again",
        "不得有其他主站发送 NMT 指令；重新启动该驱动器",
    ),
    ("check the supply of the drive, and bring it up again", "检查驱动器电源，并重新启动该驱动器"),
    ("give one of the two drives another node ID", "为其中一个驱动器设置其他节点 ID"),
    ("end the other master, or disconnect it", "结束或断开另一个主站"),
    (
        "keep the computer awake while drives are under power (`systemd-inhibit`); then bring the drives up again",
        "驱动器带电时保持计算机不休眠 (`systemd-inhibit`)；然后重新启动驱动器",
    ),
    ("`takt doctor` says what this computer lacks for real time", "运行 `takt doctor` 查看本机实时性的不足"),
    ("begin the stream where the axis is", "从轴的当前位置开始点流"),
    ("command a smoother motion, or look at `limits.jerk`", "使运动更平滑，或检查 `limits.jerk`"),
    ("check the cable, the termination and the bit rate", "检查电缆、终端电阻和波特率"),
    ("check the encoder and `counts_per_turn`", "检查编码器与 `counts_per_turn`"),
    ("make the callback faster, or give it a larger budget", "加快回调，或增大其时间预算"),
    ("mend the callback; its message is in the log", "修复回调；详细信息见日志"),
    ("change the axis to CST", "将该轴切换到 CST"),
    ("command less, or look at `stiffness_max`", "降低指令，或检查 `stiffness_max`"),
    ("command less, or look at `damping_max`", "降低指令，或检查 `damping_max`"),
    (
        "check that the drive has this mode; most change it only while disabled",
        "确认驱动器支持该模式；多数仅在去使能时切换",
    ),
    (
        "keep away from the joint and cut the supply of its drive; clear the fault when the drive reports again that it is disabled",
        "远离关节并切断其驱动器电源；驱动器重新上报已去使能后清除故障",
    ),
    (
        "keep away from the joint; end the other master or the vendor's tool that enables its drive, then clear the fault",
        "远离关节；结束使能该驱动器的其他主站或厂商工具，然后清除故障",
    ),
    (
        "keep away from the joint; end the vendor's tool or the local input that controls its drive, then clear the fault",
        "远离关节；结束控制其驱动器的厂商工具或本地输入，然后清除故障",
    ),
    (
        "keep away from the joint; look for what moves it against its drive, and at the drive's own deceleration and limits",
        "远离关节；检查是什么在推动它，以及驱动器自身的减速度和限值",
    ),
    (
        "keep away from the joint; look at the load, at the drive's own limits, and at `limits.velocity`",
        "远离关节；检查负载、驱动器自身的限值以及 `limits.velocity`",
    ),
    (
        "look for an obstacle or a brake that is not released, or look at `limits.torque`; then clear the fault",
        "检查障碍物或未松开的制动器，或检查 `limits.torque`；然后清除故障",
    ),
    ("hold the joint still, or set its brake; then enable again", "保持关节静止或启用其制动器；然后重新使能"),
];
