//! The simulated YZ-AIM servo from the point of view of a master.

mod alarms;
mod defects;
mod homing;
mod interpolation;
mod network;
mod position;
mod set_up;

use std::f64::consts::TAU;
use std::sync::Arc;

use takt::sim::plant::JointParameters;
use takt::sim::yz_aim::{Gearing, Model, Quirks, YzAimJoint, YzAimParameters};

use takt_wire::canopen::eds::ObjectDictionary;
use takt_wire::quirks::Quirks as DriveQuirks;

use super::bench::{Bench, MILLISECOND_NS, NODE};

/// Gear ratio of the joint.
const RATIO: f64 = 10.0;

/// Its data sheet and its quirks.
pub fn description() -> (Arc<ObjectDictionary>, DriveQuirks) {
    let device = takt::family::yz_aim::device();
    (Arc::new(device.dictionary.clone()), device.quirks.clone())
}

/// The drive with other quirks of its node.
fn with_quirks(parameters: YzAimParameters, change: impl FnOnce(&mut DriveQuirks)) -> YzAimParameters {
    let mut device = parameters.device.clone();
    change(&mut device);
    YzAimParameters { device, ..parameters }
}

/// A 57AIM30C behind a gear of 10:1, which boots in 5 ms.
fn parameters(node: u8) -> YzAimParameters {
    let gearing = Gearing { ratio: RATIO, travel_per_turn: TAU, is_reversed: false, zero_counts: 0.0 };
    let joint = JointParameters {
        inertia: 0.02,
        viscous_friction: 0.1,
        coulomb_friction: 0.5,
        friction_shape: takt::config::FrictionShape::Constant,
        brake_torque: 0.0,
    };
    YzAimParameters {
        power_up_ns: 5 * MILLISECOND_NS,
        seed: 7,
        ..YzAimParameters::new(description(), node, Model::Aim57x30C, gearing, joint)
    }
}

/// The same drive without the behaviour of real units that the manual does not describe.
fn by_the_manual(node: u8) -> YzAimParameters {
    let by_the_manual = YzAimParameters { quirks: Quirks::none(), ..parameters(node) };
    with_quirks(by_the_manual, |device| device.is_silent_if_absent = false)
}

fn bench(parameters: YzAimParameters) -> Bench {
    Bench::of(vec![Box::new(YzAimJoint::new(parameters))])
}

/// Position and statusword in the payload of TPDO 1, 2 or 4.
fn decoded(payload: &[u8]) -> (i32, u16) {
    let [a, b, c, d, low, high] = *payload else { panic!("{payload:02X?}") };
    (i32::from_le_bytes([a, b, c, d]), u16::from_le_bytes([low, high]))
}

impl Bench {
    fn control(&mut self, word: u16) {
        self.write(0x6040, 0, 2, word.into()).unwrap();
    }

    fn statusword(&mut self) -> u16 {
        self.read(0x6041, 0).unwrap() as u16
    }

    fn position(&mut self) -> i32 {
        self.read(0x6064, 0).unwrap() as i32
    }

    fn alarm(&mut self) -> u32 {
        self.read(0x260E, 0).unwrap()
    }

    /// Sends the controlwords 06, 07 and 0F at the intervals that real units need.
    fn enable_in_steps(&mut self) {
        for word in [0x06, 0x07, 0x0F] {
            self.control(word);
            self.run_ms(20);
        }
        assert_eq!(self.statusword() & 0x37, 0x37);
    }

    /// Stores the parameters and waits for the end of storing.
    fn save(&mut self) {
        self.write(0x2614, 0, 2, 1).unwrap();
        assert_eq!(self.read(0x2614, 0), Ok(1));
        for _ in 0..100 {
            if self.read(0x2614, 0) == Ok(2) {
                return;
            }
        }
        panic!("never stored");
    }

    fn power_cycle(&mut self) {
        self.bus.power_cycle(NODE).unwrap();
        self.run_ms(10);
        self.heard.clear();
    }

    /// Sends RPDO4 and returns its reply.
    fn hold_target(&mut self, target: i32) -> (i32, u16) {
        self.send_data(0x500 + u32::from(NODE), target.to_le_bytes());
        self.run_ns(500_000);
        let answer = self.take(0x480 + u32::from(NODE)).pop().expect("TPDO4 after RPDO4");
        decoded(&answer)
    }

    /// A cycle of 2 ms: RPDO4, then SYNC. Returns the content of TPDO2 after SYNC.
    fn interpolate(&mut self, target: i32) -> (i32, u16) {
        self.hold_target(target);
        self.send_data(0x080, []);
        self.run_ns(1_500_000);
        let answer = self.take(0x280 + u32::from(NODE)).pop().expect("TPDO2 after SYNC");
        decoded(&answer)
    }
}
