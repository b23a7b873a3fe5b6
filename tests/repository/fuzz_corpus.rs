//! What is fuzzed for hours elsewhere (`fuzz/run`), for a moment here: the inputs that are kept in `fuzz/seeds`, and some
//! thousands of random ones.

use std::path::Path;

use proptest::prelude::*;
use takt::config::DriveFamily;
use takt::family::{EROB_CANOPEN, YZ_AIM};
use takt_rt::{OperationMode, Phase, Rule};

#[path = "../../fuzz/subjects/mod.rs"]
mod subjects;

use subjects::engine::Journey;

fn seeds(name: &str) -> Vec<Vec<u8>> {
    let folder = match name {
        // The descriptions that come with takt.
        "field_description" => "drives/bit-fields".to_owned(),
        name => format!("fuzz/seeds/{name}"),
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "no seeds for {name}");
    paths.into_iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// A seed with some bytes replaced and its end cut off: what lies near something sound goes further than noise does.
fn mutated(name: &str) -> impl Strategy<Value = Vec<u8>> + use<> {
    let changes = proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8);
    (prop::sample::select(seeds(name)), changes, any::<prop::sample::Index>(), any::<bool>()).prop_map(
        |(mut bytes, changes, cut, is_cut)| {
            for (at, byte) in changes {
                let at = at.index(bytes.len().max(1));
                if let Some(place) = bytes.get_mut(at) {
                    *place = byte;
                }
            }
            if is_cut {
                bytes.truncate(cut.index(bytes.len() + 1));
            }
            bytes
        },
    )
}

/// Any characters that mean something in a TOML file.
const TOML: &str = "[\\[\\]=\", .0-9a-z_\n#'{}-]{0,200}";

#[test]
fn every_kept_input_is_borne() {
    type Subject = fn(&[u8]);
    let subjects: [(&str, Subject); 14] = [
        ("configuration", subjects::configuration::run),
        ("scenario", subjects::scenario::run),
        ("device_description", subjects::device_description::run),
        ("recording", subjects::recording::run),
        ("problem_lines", subjects::problem_lines::run),
        ("lines", subjects::lines::run),
        ("bus_logs", subjects::bus_logs::run),
        ("wire", subjects::wire::run),
        ("modbus", subjects::modbus::run),
        ("packets", |bytes| _ = subjects::packets::run(bytes)),
        ("field_description", subjects::field_description::run),
        ("erob_can", subjects::erob_can::run),
        ("journal", |bytes| _ = subjects::journal::run(bytes)),
        ("engine", |bytes| drop(subjects::engine::run(bytes))),
    ];
    for (name, run) in subjects {
        seeds(name).iter().for_each(|bytes| run(bytes));
    }
}

/// A change of the encoding makes them noise.
#[test]
fn every_kept_packet_and_journal_is_decoded() {
    assert!(seeds("packets").iter().all(|bytes| subjects::packets::run(bytes)));
    assert!(seeds("journal").iter().all(|bytes| subjects::journal::run(bytes)));
}

/// Else it would be no wonder that nothing goes wrong.
#[test]
fn the_kept_inputs_lead_the_group_through_every_phase_and_move_it_in_every_mode() {
    let journeys: Vec<Journey> = seeds("engine").iter().map(|bytes| subjects::engine::run(bytes)).collect();
    for phase in Phase::ALL {
        assert!(journeys.iter().any(|journey| journey.phases.contains(&phase)), "{phase:?}");
    }
    let moved = |mode: OperationMode, family: DriveFamily| {
        journeys.iter().any(|journey| journey.modes_in_motion.contains(&(mode, family.clone())))
    };
    for mode in [
        OperationMode::CyclicSynchronousPosition,
        OperationMode::CyclicSynchronousVelocity,
        OperationMode::CyclicSynchronousTorque,
        OperationMode::InterpolatedPosition,
        OperationMode::ProfilePosition,
        OperationMode::ProfileVelocity,
        OperationMode::ProfileTorque,
    ] {
        assert!(moved(mode, EROB_CANOPEN), "{mode:?}");
    }
    for mode in
        [OperationMode::InterpolatedPosition, OperationMode::ProfilePosition, OperationMode::ProfileVelocity]
    {
        assert!(moved(mode, YZ_AIM), "{mode:?} of a YZ-AIM");
    }
    assert!(journeys.iter().any(|journey| journey.refused > 0 && journey.refused < journey.taken));
    assert!(journeys.iter().any(|journey| journey.calls > 100), "a callback is called");
    for rule in [Rule::CallbackOverrun, Rule::CallbackPanicked] {
        assert!(journeys.iter().any(|journey| journey.stops.contains(rule.key())), "{rule:?}");
    }
    assert!(journeys.iter().any(|journey| journey.are_apart), "one group moves, and another one does not");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_text_is_a_configuration_or_is_explained(text in TOML, seed in mutated("configuration")) {
        subjects::configuration::run(text.as_bytes());
        subjects::configuration::run(&seed);
    }

    #[test]
    fn any_text_is_a_scenario_or_is_explained(text in TOML, seed in mutated("scenario")) {
        subjects::scenario::run(text.as_bytes());
        subjects::scenario::run(&seed);
    }

    #[test]
    fn any_text_describes_a_device_or_is_explained(text in TOML, seed in mutated("device_description")) {
        subjects::device_description::run(text.as_bytes());
        subjects::device_description::run(&seed);
    }

    #[test]
    fn any_file_is_a_recording_or_is_explained(seed in mutated("recording")) {
        subjects::recording::run(&seed);
    }

    #[test]
    fn any_text_is_a_trajectory_problem_or_is_explained(text in TOML, seed in mutated("problem_lines")) {
        subjects::problem_lines::run(text.as_bytes());
        subjects::problem_lines::run(&seed);
    }

    #[test]
    fn any_frames_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("wire")) {
        subjects::wire::run(&bytes);
        subjects::wire::run(&seed);
    }

    #[test]
    fn any_bytes_of_a_serial_line_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("lines")) {
        subjects::lines::run(&bytes);
        subjects::lines::run(&seed);
    }

    #[test]
    fn any_log_is_read_or_explained_and_any_frames_have_a_meaning(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("bus_logs")) {
        subjects::bus_logs::run(&bytes);
        subjects::bus_logs::run(&seed);
        subjects::bus_logs::decode(&bytes);
    }

    #[test]
    fn any_bytes_on_a_modbus_line_are_borne(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("modbus")) {
        subjects::modbus::run(&bytes);
        subjects::modbus::run(&seed);
    }

    #[test]
    fn any_journal_is_read_and_replayed_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("journal")) {
        subjects::journal::run(&bytes);
        subjects::journal::run(&seed);
    }

    #[test]
    fn any_packets_are_decoded_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("packets")) {
        subjects::packets::run(&bytes);
        subjects::packets::run(&seed);
    }

    #[test]
    fn any_text_describes_a_drive_of_bit_fields_or_is_explained(text in TOML, seed in mutated("field_description")) {
        subjects::field_description::run(text.as_bytes());
        subjects::field_description::run(&seed);
    }

    #[test]
    fn the_engine_bears_anything(bytes in proptest::collection::vec(any::<u8>(), 0..400), seed in mutated("engine")) {
        subjects::engine::run(&bytes);
        subjects::engine::run(&seed);
    }
}

proptest! {
    // Each of them is seconds of a drive.
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn whoever_speaks_to_an_erob_bears_any_bus(bytes in proptest::collection::vec(any::<u8>(), 0..4000), seed in mutated("erob_can")) {
        subjects::erob_can::run(&bytes);
        subjects::erob_can::run(&seed);
    }
}
