//! The simulated bus runs inside the real-time thread, so after its construction it does not call the heap, whatever
//! happens on it.

use std::sync::Arc;

use takt::Port;
use takt::config::quirks::Quirks;
use takt::faults::{
    DelayPlace, DriveEffect, Effect, FaultProgress, FaultyPort, ForeignFrames, FrameEffect, InterfaceEffect,
    Part, ScenarioFault, Selection, Trigger, Window,
};
use takt::sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
use takt::sim::homing_switches::ReferenceSwitches;
use takt::sim::plant::{Encoder, JointParameters};
use takt::sim::yz_aim::{Gearing, Model, YzAimJoint, YzAimParameters};
use takt::sim::{Defect, Drive, DriveFault, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
use takt_wire::canopen::eds;

use crate::heap;

const JOINT: JointParameters = JointParameters {
    inertia: 0.4,
    viscous_friction: 1.5,
    coulomb_friction: 4.0,
    friction_shape: takt::config::FrictionShape::Constant,
    brake_torque: 110.0,
};

/// A second of a master's life: bring-up by SDO, SYNC, set-points, requests in between, a fault, a power cycle, and
/// more frames than the queues hold.
fn live<P: BusPort>(bus: &mut P, received: &mut usize, mut breaks: impl FnMut(&mut P, u64)) {
    let mut batch = ReceiveBatch::new();
    let request = |node: u8, bytes: [u8; 8]| Frame::of(Id::canopen(0x600, node), bytes);
    let bring_up = [
        [0x2F, 0x60, 0x60, 0, 8, 0, 0, 0],
        [0x2B, 0x17, 0x10, 0, 10, 0, 0, 0],
        [0x2F, 0x00, 0x14, 2, 1, 0, 0, 0],
        [0x2F, 0x00, 0x18, 2, 1, 0, 0, 0],
        [0x40, 0x72, 0x60, 0, 0, 0, 0, 0],
        // A download in segments, and an upload in blocks, which the eRob refuses.
        [0x21, 0x81, 0x60, 0, 4, 0, 0, 0],
        [0x07, 0x11, 0x22, 0x33, 0x44, 0, 0, 0],
        [0xA0, 0x18, 0x10, 1, 127, 0, 0, 0],
        [0xA3, 0, 0, 0, 0, 0, 0, 0],
        [0xA2, 1, 127, 0, 0, 0, 0, 0],
        [0xA1, 0, 0, 0, 0, 0, 0, 0],
    ];
    for cycle in 0..1000u64 {
        let now_ns = cycle * 1_000_000;
        bus.send(now_ns, &[Frame::of(Id::canopen(0x080, 0), [])]);
        let at = cycle as usize / 4;
        for node in 1..=3 {
            if let Some(bytes) = bring_up.get(at) {
                bus.send(now_ns, &[request(node, *bytes)]);
            }
            if cycle == 60 {
                bus.send(now_ns, &[Frame::of(Id::canopen(0x000, 0), [1, node])]);
            }
            let controlword = match cycle {
                0..200 => 0x06,
                200..300 => 0x07,
                _ => 0x0F,
            };
            bus.send(now_ns + 600_000, &[Frame::of(Id::canopen(0x200, node), [controlword, 0])]);
        }
        match cycle {
            800 => {
                bus.send(now_ns + 700_000, &[Frame::of(Id::canopen(0x200, 99), []); 300]);
            }
            _ => breaks(bus, cycle),
        }
        assert!(bus.unconfirmed(now_ns + 900_000) < 5000);
        loop {
            batch.clear();
            bus.receive(now_ns + 999_000, &mut batch);
            *received += batch.len();
            if !batch.is_full() {
                break;
            }
        }
        assert_eq!(bus.health().rx_overruns, 0);
    }
}

/// An eRob: a drive made from a data sheet and a quirk file.
fn drive_with_quirks(node: u8) -> Box<dyn Drive> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("drives/erob-canopen.toml");
    drive(node, takt::config::quirks::load(&path).unwrap())
}

/// A drive made from a data sheet alone.
fn drive_of_a_sheet(node: u8) -> Box<dyn Drive> {
    drive(node, Quirks::default())
}

fn drive(node: u8, quirks: Quirks) -> Box<dyn Drive> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/eds/erob-canopen.eds");
    let axis = Cia402AxisParameters {
        joint: JOINT,
        encoder: Encoder { counts_per_unit: 83_443.0, zero_counts: 0.0 },
        counts_per_turn: 524_288.0,
        initial_position: 0.0,
        rated_torque: 31.0,
        peak_torque: 56.0,
        highest_velocity: 4.0,
        switches: ReferenceSwitches::default(),
        end_stops: None,
    };
    let parameters = Cia402Parameters {
        sheet: eds::load(&path).unwrap().dictionary,
        node,
        quirks,
        axes: vec![axis],
        power_up_ns: 5_000_000,
        feedback_delay_ns: 20_000,
        seed: 7,
    };
    Box::new(Cia402Drive::new(parameters).unwrap())
}

#[test]
fn a_second_on_the_simulated_bus_takes_no_heap_memory() {
    live_without_memory(drive_with_quirks);
}

#[test]
fn a_second_of_drives_made_from_a_data_sheet_takes_no_heap_memory() {
    live_without_memory(drive_of_a_sheet);
}

fn live_without_memory(drive: fn(u8) -> Box<dyn Drive>) {
    let before = heap().calls;
    let drives = [1, 2, 3].map(drive_with_quirks).into();
    let mut bus =
        SimulatedBus::with_drives(WireBitRates { nominal: 1_000_000, data: None }, 5_000_000, drives);
    let built = heap().calls;
    assert!(built > before, "the allocator counts");
    let mut received = 0;
    live(&mut bus, &mut received, |bus, cycle| match cycle {
        500 => bus.inject_fault(1, DriveFault::Encoder).unwrap(),
        600 => bus.power_cycle(2).unwrap(),
        700 => bus.silence(3, true).unwrap(),
        _ => {}
    });
    assert_eq!(heap().calls, built);
    // Two thousand TPDOs and more, so it was not silence that needed no memory.
    assert!(received > 2_000, "{received}");
    assert_eq!(bus.observe(1).unwrap().error_code, 0x7305);
}

fn servo(node: u8) -> Box<dyn Drive> {
    let gearing =
        Gearing { ratio: 10.0, travel_per_turn: std::f64::consts::TAU, is_reversed: false, zero_counts: 0.0 };
    let joint = JointParameters {
        inertia: 0.02,
        viscous_friction: 0.1,
        coulomb_friction: 0.5,
        friction_shape: takt::config::FrictionShape::Constant,
        brake_torque: 0.0,
    };
    let device = takt::family::yz_aim::device();
    let description = (device.dictionary.clone().into(), device.quirks.clone());
    Box::new(YzAimJoint::new(YzAimParameters {
        power_up_ns: 5_000_000,
        special_function: 7,
        ..YzAimParameters::new(description, node, Model::Aim57x30C, gearing, joint)
    }))
}

#[test]
fn a_second_of_interpolation_with_alarms_and_power_cycles_takes_no_heap_memory() {
    let drives = [1, 2, 3].map(servo).into();
    let mut bus =
        SimulatedBus::with_drives(WireBitRates { nominal: 1_000_000, data: None }, 5_000_000, drives);
    let built = heap().calls;
    let mut batch = ReceiveBatch::new();
    let mut received = 0;
    for cycle in 0..500u64 {
        let now_ns = cycle * 2_000_000;
        let sdo = match cycle {
            10 => Some([0x2F, 0x60, 0x60, 0, 7, 0, 0, 0]),
            20 => Some([0x2B, 0x40, 0x60, 0, 0x06, 0, 0, 0]),
            40 => Some([0x2B, 0x40, 0x60, 0, 0x07, 0, 0, 0]),
            60 => Some([0x2B, 0x40, 0x60, 0, 0x0F, 0, 0, 0]),
            300 => Some([0x2B, 0x14, 0x26, 0, 1, 0, 0, 0]),
            _ => None,
        };
        match cycle {
            15 => assert_eq!(bus.send(now_ns, &[Frame::of(Id::canopen(0x000, 0), [1, 0])]), 1),
            200 => bus.inject_fault(1, DriveFault::Stall).unwrap(),
            400 => bus.power_cycle(2).unwrap(),
            _ => {}
        }
        for node in 1..=3 {
            if let Some(request) = sdo {
                bus.send(now_ns, &[Frame::of(Id::canopen(0x600, node), request)]);
            }
            bus.send(now_ns, &[Frame::of(Id::canopen(0x500, node), (cycle as i32 * 100).to_le_bytes())]);
        }
        bus.send(now_ns + 1_000_000, &[Frame::of(Id::canopen(0x080, 0), [])]);
        batch.clear();
        bus.receive(now_ns + 1_999_000, &mut batch);
        received += batch.len();
    }
    assert_eq!(heap().calls, built);
    assert!(received > 2_000, "{received}");
    assert_eq!(bus.observe(1).unwrap().error_code, 0x14);
    assert!(bus.observe(3).unwrap().position_counts > 30_000);
}

/// Every effect, one after the other for 70 ms each.
fn every_effect() -> Vec<Effect> {
    let foreign = |frames| Effect::Foreign(frames);
    let drive = |node, effect| Effect::Drive { node, effect };
    vec![
        Effect::Frames(FrameEffect::Delay { by_ns: 3_300_000, place: DelayPlace::Machine }),
        Effect::Frames(FrameEffect::Duplicate { copies: 8 }),
        Effect::Frames(FrameEffect::Corrupt { bits: 3, part: Part::Payload }),
        Effect::Frames(FrameEffect::Corrupt { bits: 1, part: Part::Identifier }),
        Effect::Frames(FrameEffect::Reorder),
        Effect::Frames(FrameEffect::Drop),
        Effect::Frames(FrameEffect::EchoLoss),
        Effect::Frames(FrameEffect::FullQueue),
        Effect::Interface(InterfaceEffect::BusOff),
        foreign(ForeignFrames::DuplicateNode { node: 1, period_ns: 1_000_000 }),
        foreign(ForeignFrames::SetPoints { id: Id::canopen(0x200, 1), period_ns: 400_000 }),
        foreign(ForeignFrames::Frame {
            frame: Frame::of(Id::canopen(0, 1), [0; 8]),
            period_ns: Some(50_000),
        }),
        drive(1, DriveEffect::Defect(Defect::OtherObjectMapped)),
        drive(2, DriveEffect::Defect(Defect::Alarm { code: 0x2310 })),
        drive(3, DriveEffect::Reboot),
    ]
}

#[test]
fn a_second_with_faults_of_every_kind_takes_no_heap_memory() {
    let drives = [1, 2, 3].map(drive_with_quirks).into();
    let bus = SimulatedBus::with_drives(WireBitRates { nominal: 1_000_000, data: None }, 5_000_000, drives);
    let mut port = Port::Simulated(Box::new(bus));
    let mut all_progress = vec![];
    for (effect, number) in every_effect().into_iter().zip(0..) {
        let window = Window {
            trigger: Trigger::Start,
            after_ns: 1_000_000 * (10 + 65 * number),
            lasts_ns: Some(70_000_000),
        };
        let selection = Selection { probability: 0.5, ..Selection::default() };
        let fault =
            ScenarioFault { kind: "", location: String::new(), line: 1, bus: 0, window, selection, effect };
        let progress = Arc::new(FaultProgress::default());
        all_progress.push(Arc::clone(&progress));
        port = Port::Faulty(Box::new(FaultyPort::new(port, &fault, Arc::default(), progress)));
    }
    let built = heap().calls;
    let mut received = 0;
    live(&mut port, &mut received, |_, _| {});
    assert_eq!(heap().calls, built);
    assert!(received > 1_000, "{received}");
    for (progress, effect) in all_progress.iter().zip(every_effect()) {
        assert!(progress.began_ns().is_some() && !progress.is_impossible(), "{effect:?}");
        let is_of_frames = matches!(effect, Effect::Frames(_) | Effect::Foreign(_));
        assert!(!is_of_frames || progress.frames() > 0, "{effect:?}");
    }
}
