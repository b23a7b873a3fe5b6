//! Describes the PDOs of a YZ-AIM. Their mapping is fixed (manual 5.08).

use takt_rt::Frame;

use super::words;
use crate::family::commission::target::TargetDrive;

/// Describes a PDO; `None` for other frames.
pub fn words(s: &TargetDrive, frame: &Frame) -> Option<String> {
    let id = frame.id().value();
    if frame.id().is_extended() || id & 0x7F != u32::from(s.node) {
        return None;
    }
    let data = frame.payload();
    let i32_at =
        |at: usize| -> Option<i32> { Some(i32::from_le_bytes(data.get(at..at + 4)?.try_into().ok()?)) };
    let u16_at =
        |at: usize| -> Option<u16> { Some(u16::from_le_bytes(data.get(at..at + 2)?.try_into().ok()?)) };
    let status = |name: &str| {
        let (position, word) = (i32_at(0)?, u16_at(4)?);
        Some(format!("{name}: position {position}, statusword 0x{word:04X}: {}", words::statusword(word)))
    };
    let command = |name: &str, target: &str| {
        let (word, mode, value) = (u16_at(0)?, data.get(2)?, i32_at(3)?);
        let (words, mode) = (words::controlword(word), words::mode(i64::from(*mode)).unwrap_or("no mode"));
        Some(format!("{name}: controlword 0x{word:04X}: {words}; {mode}; {target} {value}"))
    };
    match id & 0x780 {
        0x180 => status("TPDO1"),
        0x280 => status("TPDO2"),
        0x380 => Some(format!("TPDO3: position {}, velocity {}", i32_at(0)?, i32_at(4)?)),
        0x480 => status("TPDO4"),
        0x200 => command("RPDO1", "target position"),
        0x300 => Some(format!("RPDO2: target position {}, profile velocity {}", i32_at(0)?, i32_at(4)?)),
        0x400 => command("RPDO3", "target velocity"),
        0x500 => Some(format!("RPDO4: target position {}, held until SYNC", i32_at(0)?)),
        _ => None,
    }
}
