//! A family of drives that takt does not know lives in one folder (`belt_servo/`), and touches no other file. See
//! `docs/new-family.md`.

mod belt_servo;

use std::sync::Once;

use takt::{Config, family};
use takt::{Outcome, VirtualRun};

const CONFIGURATION: &str = "name = \"belt\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"belt\"\nbus = \"can\"\nnode = 4\n\
    drive = \"belt-servo\"\npulley = \"large\"\ntravel = \"linear\"\nlead = \"100 mm\"\n\
    limits = { position = [0, 0.5], velocity = 0.2, acceleration = 1, torque = 100 }\n\
    [[program.move]]\nto = \"300 mm\"\n[[program.move]]\nto = \"0 mm\"\n";

fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| family::register(&belt_servo::BeltServo).unwrap());
}

#[test]
fn a_family_of_ones_own_is_configured_brought_up_moved_and_shut_down() {
    register();
    let config = Config::parse("belt.toml", CONFIGURATION).unwrap();
    assert_eq!(config.axes[0].counts_per_turn, 8192.0, "its own key chose the large pulley");
    let mut run = VirtualRun::simulated(&config).unwrap().0;
    let mut farthest = 0.0_f64;
    let outcome = run.run(60_000, |run| farthest = farthest.max(run.snapshot().axes[0].position));
    assert_eq!(outcome, Some(Outcome::Finished));
    assert!((0.29..0.31).contains(&farthest), "{farthest}");
}

#[test]
fn a_wrong_value_of_its_own_key_is_refused_at_its_line() {
    register();
    let text = CONFIGURATION.replace("\"large\"", "\"huge\"");
    let error = format!("{:?}", Config::parse("belt.toml", &text).unwrap_err());
    assert!(error.contains("pulley") && error.contains("huge") && error.contains("small"), "{error}");
}

#[test]
fn a_second_family_of_the_same_name_is_refused() {
    register();
    let taken = family::register(&belt_servo::BeltServo).unwrap_err();
    assert_eq!(taken.to_string(), "there is a family \"belt-servo\" already");
}

#[test]
fn its_error_codes_have_its_own_words_and_cures() {
    register();
    assert_eq!(family::error_words(Some("belt-servo"), 0xFF01).to_string(), "0xFF01 (belt torn)");
    assert!(family::error_cure(Some("belt-servo"), 0xFF01).contains("new belt"));
}
