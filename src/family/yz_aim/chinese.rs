//! What the family says, in Chinese.

use crate::family::{ChinesePhrase, ChineseTerm};

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    // Alarms.
    ("alarm <0>", "报警 <0>"),
    ("battery power lost, multi-turn position lost", "电池断电，多圈位置丢失"),
    ("blocked rotor", "堵转"),
    ("loss of speed (stall)", "失速"),
    ("over-voltage, above 52 V", "过压，高于 52 V"),
    ("communication lost (heartbeat timeout)", "通信丢失（心跳超时）"),
    ("not described", "手册未说明"),
    ("alarm <0>, the supply is at {1} V", "报警 <0>，电源电压 {1} V"),
    // Cures.
    (
        "check the battery, move the axis to its zero, then use `clear-fault --yes` to set the multi-turn zero",
        "检查电池，将轴移到零点，然后执行 `clear-fault --yes` 设置多圈零点",
    ),
    ("free the shaft, then `clear-fault`", "解除轴的卡阻，然后执行 `clear-fault`"),
    ("reduce the load or the acceleration, then `clear-fault`", "降低负载或加速度，然后执行 `clear-fault`"),
    (
        "lower the supply or fit a discharge module, then `clear-fault`; if it stays, power-cycle the drive",
        "降低电源电压或加装泄放模块，然后执行 `clear-fault`；若仍存在，将驱动器断电重启",
    ),
    (
        "use `clear-fault`: it sends the heartbeat that the drive waits for",
        "执行 `clear-fault`：它会发送驱动器所等待的心跳",
    ),
    (
        "`clear-fault` tries a reset; if it stays, power-cycle the drive",
        "`clear-fault` 会尝试复位；若仍存在，将驱动器断电重启",
    ),
    // Clearing.
    (
        "the multi-turn position is lost; clearing this alarm makes the present position the multi-turn zero",
        "多圈位置已丢失；清除该报警会将当前位置设为多圈零点",
    ),
    ("no alarm", "无报警"),
    (
        "the drive does not monitor its master any more (1016:01 = 0, it was {0}) until a master sets it, or it is reset: do not store that",
        "驱动器不再监视主站（1016:01 = 0，原为 {0}），直到主站重新设置或驱动器复位：请勿保存该值",
    ),
    (
        "the drive did not set the multi-turn zero in {0} attempts: check that this model has a battery",
        "驱动器尝试 {0} 次仍未设置多圈零点：请确认该型号带有电池",
    ),
    ("the position is {0} counts, the alarm is <1>: repeating", "位置为 {0} 个计数，报警为 <1>：正在重试"),
    ("the numerator", "分子"),
    // Homing.
    (
        "it says which input the switch is on: 17 negative limit on DIR, 18 positive limit on PU, 19 and 21 home switch on DIR",
        "它指明开关接在哪个输入：17 为 DIR 上的负限位，18 为 PU 上的正限位，19 和 21 为 DIR 上的原点开关",
    ),
    (
        "the manual names this method but does not describe it: the direction is not known",
        "手册列出了该方法但未说明：方向未知",
    ),
    ("this drive has no homing method {0}", "该驱动器没有回零方法 {0}"),
    ("it has 17, 18, 19 and 21", "它支持 17、18、19 和 21"),
    ("the home position was not found in time; the axis was halted", "未及时找到原点，轴已停止"),
    (
        "no motion in homing mode: starting it with controlword 000Fh and 001Fh",
        "回零模式下没有运动：改用控制字 000Fh 和 001Fh 启动",
    ),
    // Motion.
    ("a YZ-AIM has no torque mode", "YZ-AIM 没有转矩模式"),
    ("its current is limited by 261D (maximum allowed current)", "其电流由 261D（最大允许电流）限制"),
    ("no motion after the set-point: it is repeated", "给出设定点后没有运动：正在重发"),
    ("not enabled, energised", "未使能，已通电"),
    ("alarm", "报警"),
    ("ready to start", "准备启动"),
    ("started", "已启动"),
    ("operation allowed", "允许运行"),
    ("servo alarm", "伺服报警"),
    ("voltage output", "电压输出"),
    ("quick stop allowed", "允许快速停止"),
];

/// Names and words in the meanings of frames.
pub const TERMS: &[ChineseTerm] = &[
    // Objects.
    ("Modbus enable", "Modbus 使能"),
    ("drive output enable", "驱动输出使能"),
    ("flux-weakening angle", "弱磁角度"),
    ("DIR polarity", "DIR 极性"),
    ("electronic gear numerator", "电子齿轮分子"),
    ("electronic gear denominator", "电子齿轮分母"),
    ("incremental position", "增量位置"),
    ("alarm code", "报警代码"),
    ("system temperature", "系统温度"),
    ("system output PWM", "系统输出 PWM"),
    ("parameter save flag", "参数保存标志"),
    ("device address", "设备地址"),
    ("maximum output at standstill", "静止时最大输出"),
    ("special function", "特殊功能"),
    ("CAN sync control word", "CAN 同步控制字"),
    ("maximum allowed current", "最大允许电流"),
    ("multi-turn battery level", "多圈电池电量"),
    ("actual velocity", "实际速度"),
    ("actual current", "实际电流"),
    ("system voltage", "系统电压"),
    ("motor acceleration", "电机加速度"),
    ("velocity loop proportional gain", "速度环比例增益"),
    ("velocity loop integration time", "速度环积分时间"),
    ("position loop proportional gain", "位置环比例增益"),
    ("velocity feed-forward", "速度前馈"),
    ("digital input state", "数字输入状态"),
    // Bits of statusword and controlword.
    ("homing complete", "回零完成"),
    ("homing error", "回零错误"),
    ("allow quick stop", "允许快速停止"),
    ("allow operation", "允许运行"),
    ("run to the new set-point", "运行到新设定点"),
    ("target effective immediately", "目标立即生效"),
    ("no bit", "无置位"),
    // Values.
    ("CANopen interpolation", "CANopen 插补"),
    ("held until SYNC", "保持到 SYNC"),
    ("not stored", "未保存"),
    ("stored", "已保存"),
    ("pulse and direction", "脉冲加方向"),
    ("follow an encoder (A/B)", "跟随编码器 (A/B)"),
    ("velocity by PWM duty cycle", "由 PWM 占空比给定速度"),
    ("return to the multi-turn zero at power-up", "上电时返回多圈零点"),
    ("the motor moves by itself", "电机会自行运动"),
    ("interpolation over CANopen", "通过 CANopen 插补"),
    ("turn to", "转到"),
    ("at power-up", "（上电时）"),
    ("communication control from power-up", "上电即通信控制"),
    ("multi-turn zero, step 1", "多圈零点，第 1 步"),
    ("multi-turn zero, step 2", "多圈零点，第 2 步"),
];

#[cfg(test)]
mod tests {
    use super::super::Alarm;
    use super::PHRASES;

    #[test]
    fn the_cure_of_every_alarm_is_chinese() {
        for code in 0..=0x20 {
            if let Some(cure) = Alarm::of(code).advice() {
                assert!(PHRASES.iter().any(|(own, _)| *own == cure), "{cure}");
            }
        }
    }
}
