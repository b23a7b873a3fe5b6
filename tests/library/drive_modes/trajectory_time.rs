//! Axes on buses with different cycles are at the same point of the common path.

use std::collections::BTreeMap;

use takt_rt::Phase;

use crate::drive_modes::wire::{MILLISECOND_NS, counts, counts_per_unit, id};
use crate::drive_modes::world::{World, parse, text_of};

const SYNC: u32 = 0x080;

/// The target that a drive has latched at each of its SYNCs, in the joint's units, by the time of SYNC.
fn latched(world: &mut World, axis: usize) -> BTreeMap<u64, f64> {
    let (bus, node, function, from) = {
        let axis = &world.config.axes[axis];
        let (function, from) = if axis.bus == 0 { (0x200, 2) } else { (0x500, 0) };
        (axis.bus, axis.node, function, from)
    };
    let scale = counts_per_unit(&world.config.axes[axis]);
    let mut newest = None;
    let mut latched = BTreeMap::new();
    for (at_ns, frame, _) in &world.port(bus).sent {
        if frame.id().value() == id(function, node) {
            newest = Some(f64::from(counts(&frame.payload()[from..from + 4])) / scale);
        } else if let (SYNC, Some(target)) = (frame.id().value(), newest) {
            latched.insert(*at_ns, target);
        }
    }
    latched
}

/// A target latched at a SYNC of the bus with 1 ms is reached 1 ms later, one of the bus with 2 ms 2 ms later.
#[test]
fn erobs_at_1_ms_and_yz_aims_at_2_ms_are_to_reach_the_same_point_of_a_straight_line_at_the_same_time() {
    let text = text_of("mixed-arm.toml");
    let mut config = parse(&text);
    config.program.moves.truncate(1);
    let mut world = World::new(config);
    let mut span: Option<(u64, u64)> = None;
    world.run_to_the_end(|world| {
        let at_ns = world.run.snapshot().at_ns;
        if world.phase() == Phase::Moving {
            span = Some((span.map_or(at_ns, |(first, _)| first), at_ns));
        }
    });
    let goals = [40.0_f64, -30.0, 60.0, 90.0, -45.0].map(f64::to_radians);
    let targets: Vec<BTreeMap<u64, f64>> = (0..5).map(|axis| latched(&mut world, axis)).collect();
    let (first_ns, last_ns) = span.unwrap();
    let (mut compared, mut largest) = (0, 0.0_f64);
    for (sync_ns, target) in targets[3].range(first_ns..last_ns) {
        let reached_ns = sync_ns + 2 * MILLISECOND_NS;
        let way = target / goals[3];
        for axis in [0, 1, 2, 4] {
            let latched_ns = if axis < 3 { reached_ns - MILLISECOND_NS } else { *sync_ns };
            // SYNC leaves at the start of its slot, on one bus after the other.
            let (_, other) = targets[axis].range(latched_ns - 1000..).next().unwrap();
            // A count of either is not the same part of its way.
            largest = largest.max((other / goals[axis] - way).abs());
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared}");
    // A cycle of the controller at full speed is 700 times as much.
    assert!(largest < 5e-5, "{largest} of the way");
}
