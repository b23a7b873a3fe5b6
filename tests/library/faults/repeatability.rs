//! The same scenario gives the same run, bit for bit.

use std::hash::{DefaultHasher, Hash, Hasher};

use takt::VirtualRun;

use crate::faults::arm::{arm, play};

const LOSSY: &str = "
    [[fault]]
    kind = \"drop\"
    bus = \"base\"
    probability = \"1 %\"
    seed = 5

    [[fault]]
    kind = \"corrupt\"
    bus = \"wrist\"
    function = \"heartbeat\"
    probability = \"30 %\"

    [[fault]]
    kind = \"delay\"
    bus = \"wrist\"
    by = \"200 us\"
    probability = \"5 %\"

    [[fault]]
    kind = \"load\"
    axis = \"joint3\"
    torque = \"15 Nm\"
    at = \"0.7 s\"
    for = \"0.2 s\"";

#[test]
fn the_same_scenario_gives_the_same_run_bit_for_bit() {
    let config = arm();
    let (first, second) = (play(&config, LOSSY), play(&config, LOSSY));
    assert_eq!(first.fingerprint, second.fingerprint);
    assert_eq!(format!("{first:?}"), format!("{second:?}"));
    assert!(first.frames[0] > 100, "{:?}", first.frames);
    let other = play(&config, &LOSSY.replace("seed = 5", "seed = 6"));
    assert_ne!(first.fingerprint, other.fingerprint, "the fingerprint detects differences");
}

#[test]
fn a_fault_that_never_begins_changes_nothing() {
    let config = arm();
    let (mut run, mut log) = VirtualRun::simulated(&config).unwrap();
    let mut hasher = DefaultHasher::new();
    run.run(20_000, |_| {
        while log
            .next_record(|record| format!("{:?}{:?}", record.timing, record.axes()).hash(&mut hasher))
            .is_some()
        {}
        while log.take_event().is_some() {}
    });
    let late = play(&config, "[[fault]]\nkind = \"drop\"\nbus = \"base\"\nat = \"1000 s\"");
    assert_eq!(late.fingerprint, hasher.finish());
    assert!(late.events.is_empty(), "{:?}", late.events);
}

#[test]
fn each_beginning_and_end_of_a_fault_is_reported_once_with_location_and_time() {
    let played = play(
        &arm(),
        "\n[[fault]]\nkind = \"drop\"\naxis = \"joint2\"\ncount = 2\n\
         [[fault]]\nkind = \"load\"\naxis = \"joint1\"\ntorque = \"1 Nm\"\nat = \"100 cycles\"\nfor = \"10 ms\"\n\
         [[fault]]\nkind = \"emergency\"\naxis = \"joint1\"\ncode = 0x4210\nat = \"0.2 s\"",
    );
    let expected = [
        "0.0000 s after enabling: fault `drop` on axis joint2 (line 2) has begun",
        "0.0000 s after enabling: fault `drop` on axis joint2 (line 2) has ended; it affected 2 frames",
        "0.1000 s after enabling: fault `load` on axis joint1 (line 6) has begun",
        "0.1100 s after enabling: fault `load` on axis joint1 (line 6) has ended",
        "0.2000 s after enabling: fault `emergency` on axis joint1 (line 12) has begun",
    ];
    let told: Vec<&str> = played.events.iter().map(|events| events.split_once(' ').unwrap().1).collect();
    assert_eq!(told, expected.map(|events| events.split_once(' ').unwrap().1));
    let at_s: Vec<f64> =
        played.events.iter().map(|events| events.split(' ').next().unwrap().parse().unwrap()).collect();
    let due_s = [0.0, 0.0, 0.1, 0.11, 0.2];
    // A fault begins with the next call of the cycle.
    assert!(at_s.iter().zip(due_s).all(|(at_s, due_s)| (0.0..=0.001).contains(&(at_s - due_s))), "{at_s:?}");
}
