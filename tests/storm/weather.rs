//! Random faults of every kind, as a user would write them down.

use takt::config::{Axis, Config, Travel};

use crate::dice::Dice;

/// Every kind of `configs/faults/reference.toml` but disobedience, which has storms of its own.
pub const KINDS: [&str; 35] = [
    "drop",
    "delay",
    "duplicate",
    "corrupt",
    "reorder",
    "echo-loss",
    "full-queue",
    "bus-off",
    "error-passive",
    "interface-down",
    "foreign-sync",
    "foreign-set-points",
    "foreign-nmt",
    "duplicate-node",
    "foreign-frame",
    "flood",
    "stall",
    "stuck-brake",
    "load",
    "encoder-jump",
    "silent-node",
    "reboot",
    "stuck-sdo",
    "wrong-mapping",
    "statusword",
    "mode-display",
    "torque-off",
    "alarm",
    "emergency",
    "over-current",
    "over-voltage",
    "under-voltage",
    "over-temperature",
    "encoder-failure",
    "battery",
];

/// Those that only the simulated eRob can have.
pub const NEEDS_EROB: [&str; 4] = ["stuck-brake", "mode-display", "torque-off", "emergency"];

/// What a fault names beside its kind.
enum Place {
    Bus,
    Axis,
}

/// When a fault comes, in a storm of so many milliseconds: anywhere from the opening of the buses to the end.
pub fn when(dice: &mut Dice, length_ms: usize) -> String {
    let (cue, at_most_ms) = dice.pick(&[
        ("start", 400),
        ("start", 1200),
        ("enabled", length_ms),
        ("enabled", length_ms / 4),
        ("moving", length_ms),
        ("moving", length_ms),
        ("moving", length_ms / 4),
        ("moving", length_ms / 2),
        ("stopping", 300),
    ]);
    format!("when = \"{cue}\"\nat = \"{} ms\"", dice.below(at_most_ms.max(1)))
}

/// One fault of a kind.
pub fn fault(dice: &mut Dice, config: &Config, kind: &str, when: &str) -> String {
    let axis = &config.axes[dice.below(config.axes.len())];
    let bus = &config.buses[axis.bus].name;
    let (place, lasts, keys) = particulars(dice, axis, kind);
    let place = match place {
        Place::Bus => format!("bus = \"{bus}\""),
        Place::Axis => format!("axis = \"{}\"", axis.name),
    };
    let lasts = match lasts && dice.chance(0.7) {
        true => format!("for = \"{} ms\"", 1 + dice.below(600)),
        false => String::new(),
    };
    format!("[[fault]]\nkind = \"{kind}\"\n{place}\n{keys}\n{when}\n{lasts}\n")
}

/// A drive that does not obey its controlword.
pub fn disobedience(dice: &mut Dice, config: &Config, when: &str) -> String {
    let able: Vec<&Axis> = config.axes.iter().filter(|axis| axis.drive.word == "erob-canopen").collect();
    let axis = &able[dice.below(able.len())].name;
    let how = dice.pick(&["keeps-state", "keeps-state", "enables-itself", "local"]);
    let lasts = match dice.chance(0.5) {
        true => format!("for = \"{} ms\"", 1 + dice.below(3000)),
        false => String::new(),
    };
    format!("[[fault]]\nkind = \"disobedience\"\naxis = \"{axis}\"\nhow = \"{how}\"\n{when}\n{lasts}\n")
}

/// One fault that concerns a drive with a protocol of its own: the pre-defined connection set has no functions for its frames.
pub fn fault_of_own_protocol(dice: &mut Dice, config: &Config, when: &str) -> String {
    const KINDS: [&str; 7] = ["drop", "delay", "duplicate", "corrupt", "reboot", "torque-off", "stuck-sdo"];
    let own = config.axes.iter().filter(|axis| axis.drive.protocol.own_identifiers().is_some()).collect();
    fault_beside_the_cycle(dice, own, &KINDS, when)
}

/// One fault that concerns a drive on a serial line.
pub fn fault_on_a_line(dice: &mut Dice, config: &Config, when: &str) -> String {
    const KINDS: [&str; 6] = ["drop", "delay", "corrupt", "reboot", "torque-off", "stuck-sdo"];
    let own = config.axes.iter().filter(|axis| axis.drive.protocol.is_of_serial_line()).collect();
    fault_beside_the_cycle(dice, own, &KINDS, when)
}

/// One fault of these kinds of one of these axes. What its drive is asked and replies may be later than a few cycles.
fn fault_beside_the_cycle(dice: &mut Dice, own: Vec<&Axis>, kinds: &[&str], when: &str) -> String {
    let axis = &own[dice.below(own.len())].name;
    let kind = dice.pick(kinds);
    let mut keys = vec![format!("kind = \"{kind}\"\naxis = \"{axis}\"\n{when}")];
    let is_event = matches!(kind, "reboot" | "torque-off");
    if matches!(kind, "drop" | "delay" | "duplicate" | "corrupt") {
        keys.push(format!("direction = \"{}\"", dice.pick(&["sent", "received", "received", "both"])));
        keys.push(format!("seed = {}\nprobability = \"{} %\"", dice.below(1000), 1 + dice.below(100)));
    }
    match kind {
        "delay" => keys.push(format!("by = \"{} us\"", 1 + dice.below(40_000))),
        "duplicate" => keys.push(format!("copies = {}", 1 + dice.below(8))),
        "corrupt" => keys.push(format!("bits = {}", 1 + dice.below(8))),
        _ => {}
    }
    if !is_event && dice.chance(0.8) {
        keys.push(format!("for = \"{} ms\"", 1 + dice.below(600)));
    }
    format!("[[fault]]\n{}\n", keys.join("\n"))
}

/// Where, whether it may end, and the keys of a fault.
fn particulars(dice: &mut Dice, axis: &Axis, kind: &str) -> (Place, bool, String) {
    let somewhere = if dice.chance(0.6) { Place::Axis } else { Place::Bus };
    match kind {
        "drop" => (somewhere, true, frames(dice, true)),
        "delay" => (somewhere, true, format!("{}\nby = \"{} us\"", frames(dice, true), 1 + dice.below(3000))),
        "duplicate" => (somewhere, true, format!("{}\ncopies = {}", frames(dice, true), 1 + dice.below(8))),
        "corrupt" => {
            let (bits, part) = (1 + dice.below(8), dice.pick(&["payload", "identifier"]));
            (somewhere, true, format!("{}\nbits = {bits}\npart = \"{part}\"", frames(dice, true)))
        }
        "reorder" => (Place::Bus, true, frames(dice, true)),
        "echo-loss" | "full-queue" => (Place::Bus, true, frames(dice, false)),
        "bus-off" => {
            let restart = if dice.chance(0.5) { "restart = \"100 ms\"" } else { "" };
            (Place::Bus, false, restart.to_owned())
        }
        "error-passive" | "interface-down" => (Place::Bus, true, String::new()),
        "foreign-sync" => (Place::Bus, true, format!("period = \"{} us\"", 500 + dice.below(5000))),
        "foreign-set-points" => (Place::Axis, true, String::new()),
        "foreign-nmt" => {
            let command =
                dice.pick(&["start", "stop", "pre-operational", "reset-node", "reset-communication"]);
            (somewhere, false, format!("command = \"{command}\""))
        }
        "duplicate-node" => (Place::Axis, true, format!("period = \"{} ms\"", 10 + dice.below(200))),
        "foreign-frame" => {
            (Place::Bus, true, format!("id = {}\ndata = [1, 2, 3]\nperiod = \"3 ms\"", dice.below(0x800)))
        }
        "flood" => (Place::Bus, true, format!("period = \"{} us\"", 50 + dice.below(400))),
        "stall" | "stuck-brake" | "silent-node" | "stuck-sdo" => (Place::Axis, true, String::new()),
        "load" => {
            let unit = if axis.travel == Travel::Rotary { "Nm" } else { "N" };
            let torque = dice.between(-0.8, 0.8) * axis.limits.torque;
            (Place::Axis, true, format!("torque = \"{torque:.2} {unit}\""))
        }
        "encoder-jump" => {
            let unit = if axis.travel == Travel::Rotary { "deg" } else { "mm" };
            (Place::Axis, false, format!("by = \"{:.3} {unit}\"", dice.between(-8.0, 8.0)))
        }
        "wrong-mapping" => (Place::Axis, true, format!("contents = \"{}\"", dice.pick(&["other", "short"]))),
        "statusword" => {
            let (set, clear) = (1 << dice.below(16), 1 << dice.below(16));
            (Place::Axis, true, format!("set = {set}\nclear = {clear}"))
        }
        "mode-display" => (Place::Axis, true, format!("mode = {}", dice.pick(&[0, 1, 2, 3, 6, 8]))),
        "alarm" => {
            let codes: &[u16] = match axis.drive.word {
                "yz-aim" => &[0x10, 0x12, 0x14, 0x15, 0x20],
                _ => &[0x2310, 0x4310, 0x7500, 0xFF01],
            };
            (Place::Axis, false, format!("code = {}", dice.pick(codes)))
        }
        "emergency" => (Place::Axis, false, "code = 0x4210".to_owned()),
        _ => (Place::Axis, false, String::new()),
    }
}

/// Which frames, how many of them.
fn frames(dice: &mut Dice, has_direction: bool) -> String {
    let mut keys = vec![format!("seed = {}", dice.below(1000))];
    if dice.chance(0.6) {
        let functions: &[&str] = match has_direction {
            true => &["tpdo", "rpdo", "heartbeat", "sync", "emergency", "sdo", "nmt", "tpdo", "rpdo"],
            false => &["rpdo", "sync"],
        };
        keys.push(format!("function = \"{}\"", dice.pick(functions)));
    }
    if dice.chance(0.6) {
        keys.push(format!("probability = \"{} %\"", 1 + dice.below(99)));
    }
    if dice.chance(0.3) {
        keys.push(format!("count = {}", 1 + dice.below(40)));
    }
    keys.join("\n")
}
