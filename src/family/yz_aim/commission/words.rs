//! Names of statusword bits, controlword bits, modes and special functions of a YZ-AIM. Its statusword differs from CiA
//! 402: bits 6, 7, 9 and 11 are missing, and the documented values match none of the CiA 402 states. Therefore each bit
//! is decoded by itself (manual 5.06 to 5.09, tables of 6040h and 6041h).

/// The bits that are set in an enabled drive.
pub const ENABLED: u16 = 0x0037;
/// Bit 2: the motor is energised, with or without a controlword (0404h at power-up, 0014h in homing).
pub const ENERGISED: u16 = 1 << 2;
/// Bit 3: alarm, valid whatever the other bits are.
pub const ALARM: u16 = 1 << 3;
/// Bit 10.
pub const TARGET_REACHED: u16 = 1 << 10;
/// Bit 12, in homing mode only.
pub const HOMING_COMPLETE: u16 = 1 << 12;
/// Bit 13, in homing mode only.
pub const HOMING_ERROR: u16 = 1 << 13;

/// Controlwords of the manual.
pub mod control {
    /// 0006h: not enabled. The manual does not describe its effect on the power stage.
    pub const SHUTDOWN: i64 = 0x0006;
    /// 0007h: switched on, operation not enabled.
    pub const SWITCH_ON: i64 = 0x0007;
    /// 000Fh: enabled; absolute.
    pub const ENABLE: i64 = 0x000F;
    /// 001Fh: enabled; run to the new set-point.
    pub const RUN: i64 = 0x001F;
    /// 002Fh: enabled; every write of the target starts a move at once.
    pub const IMMEDIATE: i64 = 0x002F;
    /// 004Fh: enabled; relative.
    pub const RELATIVE: i64 = 0x004F;
    /// 005Fh: enabled; start a relative move. The drive clears the bit itself.
    pub const RELATIVE_RUN: i64 = 0x005F;
    /// 0080h: clear an alarm.
    pub const RESET: i64 = 0x0080;
    /// 010Fh: enabled; stop, the shaft stays locked.
    pub const HALT: i64 = 0x010F;
}

/// Returns `true` if the drive is enabled by its controlword.
pub const fn is_enabled(statusword: u16) -> bool {
    statusword & ENABLED == ENABLED
}

/// The name of the state.
pub const fn state(statusword: u16) -> &'static str {
    if statusword & ALARM != 0 {
        "alarm"
    } else if is_enabled(statusword) {
        "enabled"
    } else if statusword & ENERGISED != 0 {
        "not enabled, energised"
    } else {
        "not enabled"
    }
}

const STATUS: [(u16, &str); 9] = [
    (1 << 0, "ready to start"),
    (1 << 1, "started"),
    (1 << 2, "operation allowed"),
    (1 << 3, "servo alarm"),
    (1 << 4, "voltage output"),
    (1 << 5, "quick stop allowed"),
    (1 << 10, "target reached"),
    (1 << 12, "homing complete"),
    (1 << 13, "homing error"),
];

const CONTROL: [(u16, &str); 9] = [
    (1 << 0, "start"),
    (1 << 1, "voltage output"),
    (1 << 2, "allow quick stop"),
    (1 << 3, "allow operation"),
    (1 << 4, "run to the new set-point"),
    (1 << 5, "target effective immediately"),
    (1 << 6, "relative"),
    (1 << 7, "fault reset"),
    (1 << 8, "halt"),
];

fn set(bits: &[(u16, &str)], word: u16) -> String {
    let words: Vec<&str> = bits.iter().filter(|(bit, _)| word & bit != 0).map(|(_, name)| *name).collect();
    if words.is_empty() { "no bit".to_owned() } else { words.join(", ") }
}

/// The names of the set bits of a statusword.
pub fn statusword(word: u16) -> String {
    set(&STATUS, word)
}

/// The names of the set bits of a controlword.
pub fn controlword(word: u16) -> String {
    set(&CONTROL, word)
}

/// The name of a mode, object 6060.
pub const fn mode(value: i64) -> Option<&'static str> {
    Some(match value {
        1 => "position",
        3 => "velocity",
        6 => "homing",
        7 => "CANopen interpolation",
        _ => return None,
    })
}

/// The name of the save flag, object 2614.
pub const fn save_flag(value: i64) -> Option<&'static str> {
    Some(match value {
        0 => "not stored",
        1 => "storing",
        2 => "stored",
        _ => return None,
    })
}

/// The name of a special function, object 2619.
pub fn special_function(value: i64) -> String {
    match value {
        0 => "pulse and direction".to_owned(),
        2 => "follow an encoder (A/B)".to_owned(),
        3 => "velocity by PWM duty cycle".to_owned(),
        6 => "return to the multi-turn zero at power-up: the motor moves by itself".to_owned(),
        7 => "interpolation over CANopen".to_owned(),
        30..=32_768 => {
            let degrees = (value as f64 * 3600.0 / 32_768.0).round() / 10.0;
            format!("turn to {degrees}° at power-up: the motor moves by itself")
        }
        _ => "not described".to_owned(),
    }
}

/// The values of object 260A that are command keys, not numerators.
pub const fn gear_key(value: i64) -> Option<&'static str> {
    Some(match value {
        0 => "communication control from power-up",
        60_006 => "multi-turn zero, step 1",
        60_016 => "multi-turn zero, step 2",
        _ => return None,
    })
}

/// The meaning of object 1016:1.
pub fn consumer_heartbeat(value: u32) -> String {
    match value & 0xFFFF {
        0 => "heartbeat watchdog off".to_owned(),
        time_ms => format!("monitors the heartbeat of node {}, timeout {time_ms} ms", value >> 16 & 0x7F),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuswords_of_the_manual_are_decoded_bit_by_bit() {
        assert_eq!((state(0x0437), is_enabled(0x0437)), ("enabled", true));
        assert_eq!((state(0x0404), is_enabled(0x0404)), ("not enabled, energised", false));
        assert_eq!(state(0x0014), "not enabled, energised");
        assert_eq!(state(0x043F), "alarm");
        assert_eq!(statusword(0x1414), "operation allowed, voltage output, target reached, homing complete");
        assert_eq!(statusword(0), "no bit");
    }

    #[test]
    fn a_special_function_above_29_is_an_angle() {
        assert_eq!(special_function(32_768), "turn to 360° at power-up: the motor moves by itself");
        assert_eq!(special_function(8), "not described");
    }
}
