//! What drives of bit fields say, in Chinese.

use crate::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    ("error {0} of the drive", "驱动器错误 {0}"),
    (
        "remove its cause, then reset the fault; if it stays, power-cycle the drive",
        "消除原因后清除故障；若仍存在，将驱动器断电重启",
    ),
    // What fails.
    (
        "the drive replies, but shows torque though it has been told to have none",
        "驱动器有应答，但在命令其无转矩后仍显示有转矩",
    ),
    ("cut its supply", "切断其电源"),
    (
        "<0>: the drive replies as it does before it is set up, so it has lost its supply meanwhile",
        "<0>：驱动器的应答与初始化之前相同，说明期间曾断电",
    ),
    ("check its supply; the next command sets it up again", "检查其电源；下一条指令会重新初始化它"),
    (
        "the drive speaks another protocol or mode: check `drive` and what is configured of it",
        "驱动器使用其他协议或模式：检查 `drive` 及其配置",
    ),
    ("the drive has not replied for {0} ms", "驱动器已有 {0} ms 未应答"),
    (
        "it has no watchdog and may still follow its last command: cut its supply",
        "它没有通信监视，可能仍在执行最后一条指令：请切断其电源",
    ),
    ("the motor has taken its torque away by itself", "电机自行取消了转矩"),
    (
        "check its supply and its load; `info` shows what it says of itself",
        "检查其电源和负载；`info` 可显示其自身信息",
    ),
    ("the joint is {0} away from its set-point, where {1} is permitted", "关节偏离设定值 {0}，允许 {1}"),
    (
        "see whether something blocks it; then check `kp`, `kd` and `following_error`",
        "检查是否受阻；然后检查 `kp`、`kd` 和 `following_error`",
    ),
    ("the motor does not start", "电机未启动"),
    ("check its supply; `info` shows what it says of itself", "检查其电源；`info` 可显示其自身信息"),
    ("the joint is at {0} and does not reach {1}", "关节位于 {0}，未能到达 {1}"),
    (
        "the motor's position loop has no integral part: a load needs a higher `kp`",
        "电机位置环没有积分项：带载时需要更大的 `kp`",
    ),
    ("the motor does not reply to what it was told", "电机对指令没有应答"),
    ("try again; if it stays, power-cycle the motor", "请重试；若仍存在，将电机断电重启"),
    // What is missing.
    (
        "the limits of the axis, in a configuration or by `--set limits.velocity=\"2 rad/s\"` and the like",
        "该轴的限值（在配置中，或用 `--set limits.velocity=\"2 rad/s\"` 等）",
    ),
    (
        "takt plans the motion of such a motor, and sends its limits with each command",
        "这种电机的运动由 takt 规划，限值随每条指令发送",
    ),
    ("a {0} does not follow a {1} with these settings", "在当前设置下 {0} 不接受 {1} 指令"),
    ("its modes are: {0}", "其模式为：{0}"),
    ("`kp` and `kd` of the axis", "该轴的 `kp` 和 `kd`"),
    (
        "the gains of the motor's position loop go with each command, and are 0",
        "电机位置环的增益随每条指令发送，而现在为 0",
    ),
    ("such a motor has an ID from {0} to {1}, not {2}", "这种电机的 ID 为 {0} 至 {1}，而不是 {2}"),
    (
        "nothing is known of such a drive without its scales: name an axis of a configuration, or give them by --set",
        "缺少换算比例时无法使用这种驱动器：请指明配置中的轴，或用 --set 给出",
    ),
    ("the protocol has no homing", "该协议没有回零功能"),
    (
        "`zero` makes the present position the zero, until the motor's power is off; `zero_counts` in the configuration lasts",
        "`zero` 将当前位置设为零点，断电后失效；配置中的 `zero_counts` 长期有效",
    ),
    ("the protocol has no entries that are read or written", "该协议没有可读写的条目"),
    (
        "`info` shows everything that a reply has; `gains` and `mode` set what can be set",
        "`info` 显示应答中的全部内容；`gains` 和 `mode` 设置可设置的内容",
    ),
    ("the protocol has no frame that clears a fault", "该协议没有清除故障的帧"),
    ("remove its cause, then power-cycle the motor", "消除原因后将电机断电重启"),
    // Notes.
    (
        "the motor keeps its torque and holds its last command: it has no watchdog",
        "电机保持转矩并维持最后一条指令：它没有通信监视",
    ),
    (
        "this protocol has no request that only reads: the motor has been told to have no torque, and has replied to that",
        "该协议没有只读请求：已命令电机无转矩，以得到其应答",
    ),
];
