//! Drives whose own mapping counts: the controller reads it back and works with it, or says why it cannot.

use std::path::Path;

use takt::Outcome;
use takt::config::Config;
use takt::sim::yz_aim::YzAimJoint;
use takt::sim::{Drive, SimulatedBus, WireBitRates};
use takt_wire::canopen::dcf::DeviceConfiguration;
use takt_wire::canopen::eds;
use takt_wire::canopen::object::ObjectAddress;

use crate::drive_modes::one_yz_aim::one_yz_aim;
use crate::drive_modes::wire::{counts_per_unit, id, word};
use crate::drive_modes::world::{World, load, parse, text_of};

/// A PDO as a DCF configures it: on with this transmission type and these objects, or off.
fn pdo(direction: char, number: u32, node: u32, content: Option<(u8, &[u32])>) -> String {
    let (communication, mapping, first) = match direction {
        'R' => (0x1400 + number - 1, 0x1600 + number - 1, 0x200),
        _ => (0x1800 + number - 1, 0x1A00 + number - 1, 0x180),
    };
    let entry = |index: u32, subindex: usize, data_type: u8, value: u32| {
        format!(
            "[{index:04X}sub{subindex}]\nParameterName=p\nObjectType=7\nDataType={data_type}\nAccessType=rw\n\
             ParameterValue=0x{value:X}\n"
        )
    };
    let cob_id = first + 0x100 * (number - 1) + node;
    let Some((transmission_type, objects)) = content else {
        return entry(communication, 1, 7, cob_id | 1 << 31);
    };
    let mut text = entry(communication, 1, 7, cob_id) + &entry(communication, 2, 5, transmission_type.into());
    text += &entry(mapping, 0, 5, objects.len() as u32);
    for (place, object) in (1..).zip(objects) {
        text += &entry(mapping, place, 7, *object);
    }
    text
}

/// The joint on the desk with what a file has put into it, and `mapping = "as-stored"`.
fn stored(keys: &str, pdos: &[String]) -> Config {
    let text =
        text_of("single-erob.toml").replace("mode = \"csp\"", &format!("mapping = \"as-stored\"\n{keys}"));
    let mut config = parse(&text);
    let dictionary = eds::parse("mapped.dcf", pdos.concat().as_bytes()).unwrap().dictionary;
    config.axes[0].dcf = Some(DeviceConfiguration::of(Path::new("mapped.dcf"), &dictionary, 1));
    config
}

fn refusal(config: Config) -> String {
    let mut world = World::new(config);
    let outcome = world.run_to_the_end(|_| {});
    let Outcome::BringUpFailed(error) = outcome else { panic!("{outcome:?}") };
    let text = error.to_string();
    assert!(text.contains("axis `joint` (node 1 on bus `can`), PDO mapping: "), "{text}");
    for function in [0x200, 0x300, 0x400, 0x500] {
        assert!(world.port(0).sent_with(id(function, 1)).is_empty(), "nothing was commanded");
    }
    text
}

const OFF: Option<(u8, &[u32])> = None;
const CONTROLWORD: u32 = 0x6040_0010;
const TARGET: u32 = 0x607A_0020;
const STATUSWORD: u32 = 0x6041_0010;
const POSITION: u32 = 0x6064_0020;

#[test]
fn an_erob_that_carries_its_objects_in_another_order_and_others_too_gets_to_its_target() {
    let config = stored(
        "mode = \"csp\"",
        &[
            pdo('R', 1, 1, OFF),
            // The target first, and a torque offset that nobody asked for.
            pdo('R', 2, 1, Some((1, &[TARGET, 0x60B2_0010, CONTROLWORD]))),
            pdo('T', 1, 1, OFF),
            // The torque between position and statusword.
            pdo('T', 3, 1, Some((1, &[POSITION, 0x6077_0010, STATUSWORD]))),
        ],
    );
    let mut world = World::new(config);
    let mut farthest = 0.0_f64;
    let outcome = world.run_to_the_end(|world| farthest = farthest.max(world.observe(0).position));
    assert_eq!(outcome, Outcome::Finished, "{:?}", world.stops());
    assert!(world.stops().is_empty());
    assert!((farthest - 90_f64.to_radians()).abs() < 1e-3, "{farthest}");
    assert!(world.observe(0).position.abs() < 1e-4);
    assert!(world.port(0).sent_with(id(0x200, 1)).is_empty(), "RPDO 1 is off");
    let sent = world.port(0).sent_with(id(0x300, 1));
    assert!(sent.len() > 1000);
    for (_, payload) in &sent {
        assert_eq!(payload.len(), 8);
        assert_eq!(payload[4..6], [0, 0], "no torque offset");
        assert!(word(&payload[6..]) <= 0x8F, "{payload:02X?}");
    }
}

#[test]
fn statusword_and_position_may_come_in_two_frames_where_two_were_counted() {
    let split = [
        pdo('R', 1, 1, Some((1, &[CONTROLWORD, 0x6060_0008, TARGET]))),
        pdo('T', 1, 1, Some((1, &[STATUSWORD, 0x6078_0010]))),
        pdo('T', 2, 1, Some((1, &[POSITION, 0x606C_0020]))),
    ];
    // Velocity beside statusword and position takes two PDOs, whoever maps them.
    let mut world = World::new(stored("mode = \"csp\"\nfeedback = [\"velocity\"]", &split));
    assert_eq!(world.run_to_the_end(|_| {}), Outcome::Finished, "{:?}", world.stops());
    assert!(world.observe(0).position.abs() < 1e-4);
    let text = refusal(stored("mode = \"csp\"", &split));
    assert!(text.contains("the drive exchanges 2 TPDOs, but the bus load was checked with 1"), "{text}");
    assert!(text.contains("`feedback`"), "{text}");
}

#[test]
fn the_factorys_mapping_has_no_target_and_is_refused_by_the_object() {
    let text = refusal(stored("mode = \"csp\"", &[pdo('T', 4, 1, OFF)]));
    assert!(text.contains("no valid RPDO carries 607A:00 (target position), which the axis needs"), "{text}");
    assert!(text.contains("mapping = \"written\""), "{text}");
}

#[test]
fn what_does_not_suit_the_mode_is_refused_by_object_type_and_number() {
    let command = pdo('R', 1, 1, Some((1, &[CONTROLWORD, TARGET])));
    let feedback = pdo('T', 1, 1, Some((1, &[STATUSWORD, POSITION])));
    for (mode, pdos, words) in [
        ("csv", vec![command.clone(), feedback.clone()], "no valid RPDO carries 60FF:00 (target velocity)"),
        (
            "csp",
            vec![command.clone(), pdo('T', 1, 1, Some((1, &[STATUSWORD])))],
            "no valid TPDO carries 6064:00 (position)",
        ),
        (
            "csp",
            vec![command.clone(), pdo('T', 1, 1, Some((255, &[STATUSWORD, POSITION])))],
            "TPDO 1 has the transmission type 255, expected 1",
        ),
        (
            "csp",
            vec![pdo('R', 1, 1, Some((10, &[CONTROLWORD, TARGET]))), feedback.clone()],
            "RPDO 1 has the transmission type 10, expected 1",
        ),
        (
            "csp",
            vec![pdo('R', 1, 1, Some((1, &[CONTROLWORD, TARGET, 0x6086_0010]))), feedback.clone()],
            "RPDO 1 also carries 6086:00, for which there is no value to send",
        ),
    ] {
        let text = refusal(stored(&format!("mode = \"{mode}\""), &pdos));
        assert!(text.contains(words), "{words} is not in: {text}");
    }
}

#[test]
fn the_mapping_of_a_yz_aim_cannot_be_written() {
    let text = one_yz_aim("ip", "to = 0").replace("mode = \"ip\"", "mode = \"ip\"\nmapping = \"written\"");
    let error = Config::parse("test.toml", &text).unwrap_err();
    let shown = format!("{:?}", miette::Report::new(error));
    assert!(shown.contains("as-stored") && shown.contains("fixed"), "{shown}");
}

/// Drives whose firmware reports the statusword before the position, unlike the manual.
fn state_first(config: Config) -> World {
    let drives = config.axes.iter().map(|axis| -> Box<dyn Drive> {
        let mut parameters = takt::family::yz_aim::simulated_parameters(axis, 1_000_000, &config.simulation);
        for (index, objects) in [
            (0x1A00, [0x6041_0010, 0x6064_0020]),
            (0x1A01, [0x6041_0010, 0x6064_0020]),
            (0x1A02, [0x606C_0020, 0x6041_0010]),
            (0x1A03, [0x6041_0010, 0x6064_0020]),
        ] {
            let addresses = (1..).map(|subindex| ObjectAddress::new(index, subindex));
            parameters.device.values.extend(addresses.zip(objects));
        }
        Box::new(YzAimJoint::new(parameters))
    });
    let rates = WireBitRates { nominal: 1_000_000, data: None };
    let bus = SimulatedBus::with_drives(rates, config.simulation.longest_gap_ns, drives.collect());
    World::on(config, vec![bus])
}

#[test]
fn yz_aims_of_another_edition_are_decoded_by_what_they_tell() {
    let mut config = load("gantry-yz-aim.toml");
    config.program.moves.remove(0);
    let mut world = state_first(config);
    let outcome = world.run_to_the_end(|_| {});
    assert_eq!(outcome, Outcome::Finished, "{:?}", world.stops());
    for axis in 0..3 {
        let error = world.observe(axis).position * counts_per_unit(&world.config.axes[axis]);
        assert!(error.abs() <= 2.0, "{error}");
    }
    let first =
        world.port(0).received.iter().find(|(_, frame)| frame.id().value() == id(0x280, 1)).unwrap().1;
    assert_eq!(word(first.payload()), 0x0400, "the statusword comes first: {first:?}");
    // In profile velocity as well, where TPDO3 has lost its position.
    let mut world = state_first(parse(&one_yz_aim("pv", "speed = \"50 mm/s\"\nfor = \"0.5 s\"")));
    assert_eq!(world.run_to_the_end(|_| {}), Outcome::Finished, "{:?}", world.stops());
    assert!(world.observe(0).position > 0.02);
}
