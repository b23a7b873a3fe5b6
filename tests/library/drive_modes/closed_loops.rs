//! The loops that takt closes over the bus, in CSV and CST: stable at every period with their default gains, and with all
//! gains that a configuration may have.

use proptest::prelude::*;
use takt::Outcome;
use takt::config::Config;
use takt_rt::Phase;

use crate::drive_modes::world::{World, parse};

/// One eRob that moves by half a radian, with these keys of its axis.
fn one_erob(mode: &str, period_ms: u64, loops: &str) -> String {
    format!(
        r#"
name = "one"
[cycle]
period = "{period_ms} ms"
[[bus]]
name = "can"
[[axis]]
name = "joint"
bus = "can"
node = 1
drive = "erob-canopen"
mode = "{mode}"
{loops}
[axis.limits]
position = [-1, 1]
velocity = 1.5
acceleration = 6
jerk = 60
torque = "87 Nm"
[[program.move]]
to = 0.5
"#
    )
}

/// How a run ends, how far the joint goes beyond its target, and how much it still moves from half a second after its
/// set-point rests.
struct Motion {
    outcome: Outcome,
    beyond: f64,
    rest: [f64; 2],
    off: f64,
}

fn moved(config: Config) -> Motion {
    let period_s = config.cycle.period_ns as f64 / 1e9;
    let mut world = World::new(config);
    let (mut beyond, mut held_s) = (0.0_f64, 0.0);
    let mut rest = [f64::INFINITY, f64::NEG_INFINITY];
    let mut off = f64::NAN;
    let outcome = world.run_to_the_end(|world| {
        let snapshot = world.run.snapshot();
        let position = world.observe(0).position;
        if world.finished_motions() == 1 && snapshot.groups[0].phase == Phase::Holding {
            held_s += period_s;
            off = position - 0.5;
            if held_s > 0.5 {
                rest = [rest[0].min(position), rest[1].max(position)];
            }
        }
        beyond = beyond.max(position - 0.5);
    });
    Motion { outcome, beyond, rest, off }
}

/// A long dwell leaves time to see whether a joint swings.
fn with_dwell(text: &str) -> Config {
    parse(&text.replace("to = 0.5\n", "to = 0.5\ndwell = \"2 s\"\n"))
}

#[test]
fn default_gains_bring_a_joint_to_rest_at_its_target_at_every_period() {
    for mode in ["csv", "cst"] {
        for period_ms in [1, 2, 4, 8, 10, 20] {
            let config = with_dwell(&one_erob(mode, period_ms, ""));
            let tolerance = config.axes[0].target_tolerance;
            let motion = moved(config);
            let what = format!("{mode} at {period_ms} ms");
            assert_eq!(motion.outcome, Outcome::Finished, "{what}");
            assert!(motion.off.abs() <= tolerance, "{what}: {} off, {tolerance} allowed", motion.off);
            assert!(motion.beyond < 0.01, "{what}: {} beyond", motion.beyond);
            let [low, high] = motion.rest;
            assert!(high - low < 1e-4, "{what}: swings by {}", high - low);
        }
    }
}

#[test]
fn a_program_that_leaves_a_joint_off_its_target_has_not_finished() {
    let soft =
        "target_tolerance = \"0.1 deg\"\n[axis.torque_loop]\nbandwidth = \"4 1/s\"\ncoulomb_friction = 0";
    let motion = moved(parse(&one_erob("cst", 1, soft)));
    let Outcome::OffTarget { axis: 0, distance, tolerance } = motion.outcome else {
        panic!("{:?}", motion.outcome)
    };
    assert!(distance.abs() > tolerance && (tolerance - 0.1_f64.to_radians()).abs() < 1e-12, "{distance}");
    assert!((distance - motion.off).abs() < 1e-3, "{distance}, {}", motion.off);
}

#[test]
fn gains_that_are_unstable_at_the_period_are_refused_with_the_highest_that_is_not() {
    for (mode, period_ms, loops, key, highest) in [
        (
            "csv",
            1,
            "[axis.velocity_loop]\nposition_gain = 1000",
            "axis.velocity_loop.position_gain",
            "at most 230.0",
        ),
        (
            "csv",
            20,
            "[axis.velocity_loop]\nposition_gain = 60",
            "axis.velocity_loop.position_gain",
            "at most 26.1",
        ),
        ("cst", 10, "[axis.torque_loop]\nbandwidth = 40", "axis.torque_loop.bandwidth", "at most 20."),
        ("cst", 1, "[axis.torque_loop]\nstiffness = 1e8", "axis.torque_loop.stiffness", "at most"),
        ("cst", 1, "[axis.torque_loop]\ndamping = 1e6", "axis.torque_loop.damping", "at most"),
    ] {
        let error = Config::parse("test.toml", &one_erob(mode, period_ms, loops)).unwrap_err();
        let [problem] = error.problems() else { panic!("{loops}: {:?}", error.problems()) };
        let (said, help) = (problem.to_string(), problem.kind.help());
        assert!(said.starts_with(&format!("`{key}` cannot be")), "{loops}: {said}");
        let period = format!("a period of {period_ms} ms");
        for part in [highest, &period, "unstable"] {
            assert!(help.contains(part), "{loops}: {part:?} is not in {help:?}");
        }
        // The loops of other modes are not judged: the mode is changed in one line.
        assert!(Config::parse("test.toml", &one_erob("csp", period_ms, loops)).is_ok(), "{loops}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Gains over the whole range that a configuration may have: those that are taken let no joint swing.
    #[test]
    fn gains_that_are_taken_never_let_a_joint_swing(
        is_csv in any::<bool>(), period in 0_usize..6, gain in 0.0_f64..1.0, damping in 0.0_f64..1.0,
    ) {
        let period_ms = [1, 2, 4, 8, 10, 20][period];
        let per_period = 1e3 / period_ms as f64;
        let (mode, loops) = if is_csv {
            let gain = 5.0 * (1.2 * per_period / 5.0).powf(gain);
            ("csv", format!("[axis.velocity_loop]\nposition_gain = {gain}"))
        } else {
            // By the damping of the loop without delay: 0.1 to 3.
            let bandwidth = 5.0 * (0.5 * per_period / 5.0).max(1.1).powf(gain);
            let damping = 2.0 * bandwidth * 0.1 * 30.0_f64.powf(damping);
            ("cst", format!("[axis.torque_loop]\nstiffness = {}\ndamping = {damping}", bandwidth * bandwidth))
        };
        let tolerance = "target_tolerance = 0.1\n";
        let text = one_erob(mode, period_ms, &format!("{tolerance}{loops}"));
        prop_assume!(Config::parse("test.toml", &text).is_ok());
        let motion = moved(with_dwell(&text));
        prop_assert_eq!(&motion.outcome, &Outcome::Finished, "{} at {} ms: {}", mode, period_ms, loops);
        let [low, high] = motion.rest;
        prop_assert!(high - low < 0.005, "{mode} at {period_ms} ms swings by {}: {loops}", high - low);
    }
}
