//! Interpolated position on YZ-AIMs as it is on the wire: RPDO4 to every axis, then SYNC, every 2 ms.

use takt::Outcome;
use takt::config::{Config, ProgramTarget};
use takt_rt::Phase;

use crate::drive_modes::wire::{MILLISECOND_NS, counts, counts_per_unit, id, word};
use crate::drive_modes::world::{Sent, Watched, World, load, parse, text_of};

const SYNC: u32 = 0x080;
const HEARTBEAT: u32 = 0x77F;

/// The gantry with its axes at one position in the beginning, which is within the limits of all of them.
fn gantry_at(position: &str) -> Config {
    let simulated =
        format!("[defaults.axis.simulated]\ninitial_position = \"{position}\"\n\n[defaults.axis.joint]");
    let text = text_of("gantry-yz-aim.toml").replace("[defaults.axis.joint]", &simulated);
    parse(&text.replace("[\"-200 mm\", \"0 mm\"]", "[\"-200 mm\", \"600 mm\"]"))
}

/// The first and the last cycle in which the group was enabled, and everything that was handed over in between, from
/// SYNC to SYNC.
fn cycles_while_enabled(config: Config, bus: usize) -> Vec<Vec<Sent>> {
    let mut world = World::new(config);
    let mut span: Option<(usize, usize)> = None;
    let outcome = world.run_to_the_end(|world| {
        let sent = world.port(bus).sent.len();
        if matches!(world.phase(), Phase::Holding | Phase::Moving) {
            span = Some((span.map_or(sent, |(first, _)| first), sent));
        }
    });
    assert_eq!(outcome, Outcome::Finished);
    let (first, last) = span.unwrap();
    let frames = &world.port(bus).sent[first..last];
    let syncs = frames.iter().enumerate().filter(|(_, (_, frame, _))| frame.id().value() == SYNC);
    let at: Vec<usize> = syncs.map(|(at, _)| at).collect();
    at.windows(2).map(|pair| frames[pair[0]..pair[1]].to_vec()).collect()
}

fn ids(cycle: &[Sent]) -> Vec<u32> {
    cycle.iter().map(|(_, frame, _)| frame.id().value()).collect()
}

fn assert_sync_leaves_every(port: &Watched, period_ns: u64) {
    let times: Vec<u64> = port.sent_with(SYNC).iter().map(|(at_ns, _)| *at_ns).collect();
    assert!(times.len() > 1000);
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == period_ns));
}

/// Our heartbeat may follow the targets; nothing comes between them, and nothing waits when SYNC is handed over.
#[test]
fn in_every_cycle_each_axis_gets_its_target_by_rpdo4_and_then_sync_leaves_with_nothing_before_it() {
    let cycles = cycles_while_enabled(load("gantry-yz-aim.toml"), 0);
    assert!(cycles.len() > 2_000);
    for cycle in &cycles {
        let ids = ids(cycle);
        let (head, rest) = ids.split_at(4);
        assert_eq!(head, [SYNC, 0x501, 0x502, 0x503]);
        assert!(rest.is_empty() || rest == [HEARTBEAT], "{rest:x?}");
        assert_eq!(cycle[0].2, 0, "frames wait before SYNC");
    }
}

#[test]
fn sync_leaves_every_2_ms_on_the_divided_bus_and_every_millisecond_on_the_other() {
    let mut world = World::new(load("mixed-arm.toml"));
    assert_eq!(world.run_to_the_end(|_| ()), Outcome::Finished);
    assert_sync_leaves_every(world.port(0), MILLISECOND_NS);
    assert_sync_leaves_every(world.port(1), 2 * MILLISECOND_NS);
    let [arm, wrist] = [0, 1].map(|bus| world.port(bus).sent_with(SYNC));
    assert!(wrist.iter().all(|sync| arm.contains(sync)), "both buses keep one grid");
}

#[test]
fn on_the_divided_bus_too_every_axis_gets_its_target_in_every_cycle() {
    let cycles = cycles_while_enabled(load("mixed-arm.toml"), 1);
    assert!(cycles.len() > 2_000);
    for cycle in &cycles {
        let ids = ids(cycle);
        assert_eq!(ids[..3], [SYNC, 0x501, 0x502]);
        assert!(ids[3..].is_empty() || ids[3..] == [HEARTBEAT], "{ids:x?}");
    }
}

/// Compared are the targets that the drives latch at one SYNC: their distance from the straight line from where the axes
/// stood to the target of the move, in counts, at the place on the line that the axis with the longest way has reached.
#[test]
fn the_targets_of_one_sync_are_within_one_count_of_the_straight_line_of_the_move() {
    let config = load("gantry-yz-aim.toml");
    let scales: Vec<f64> = config.axes.iter().map(counts_per_unit).collect();
    let ends: Vec<Vec<f64>> = config
        .program
        .moves
        .iter()
        .map(|step| match &step.target {
            ProgramTarget::Position(target) => {
                target.iter().zip(&scales).map(|(to, scale)| to * scale).collect()
            }
            other => panic!("{other:?}"),
        })
        .collect();
    let cycles = cycles_while_enabled(config, 0);
    let targets_of = |cycle: &[Sent]| -> Vec<f64> {
        cycle[1..4].iter().map(|(_, frame, _)| f64::from(counts(frame.payload()))).collect()
    };
    let mut start = targets_of(&cycles[0]);
    let mut at = 0;
    let mut on_the_way = vec![0; ends.len()];
    for cycle in &cycles {
        let targets = targets_of(cycle);
        let way: Vec<f64> = ends[at].iter().zip(&start).map(|(to, from)| to - from).collect();
        let longest = (0..3).max_by(|a, b| way[*a].abs().total_cmp(&way[*b].abs())).unwrap();
        let share = (targets[longest] - start[longest]) / way[longest];
        for axis in 0..3 {
            let error = targets[axis] - (start[axis] + share * way[axis]);
            assert!(error.abs() <= 1.0, "axis {axis}, move {at}, {share}: {error}");
        }
        on_the_way[at] += usize::from((0.01..0.99).contains(&share));
        let is_there = targets.iter().zip(&ends[at]).all(|(target, end)| (target - end).abs() <= 0.5);
        if is_there && at + 1 < ends.len() {
            start.clone_from(&ends[at]);
            at += 1;
        }
    }
    assert!(on_the_way.iter().all(|cycles| *cycles > 500), "{on_the_way:?}");
}

/// If one axis latched its target at another SYNC than the others it would be a step of 2 ms behind.
#[test]
fn axes_with_the_same_way_move_as_one() {
    let mut config = gantry_at("0 mm");
    config.program.moves.truncate(1);
    config.program.moves[0].target = ProgramTarget::Position(vec![0.1; 3]);
    let mut world = World::new(config);
    let mut fastest = 0.0_f64;
    let outcome = world.run_to_the_end(|world| {
        let seen = [0, 1, 2].map(|axis| world.observe(axis));
        if world.phase() == Phase::Moving {
            fastest = fastest.max(seen[0].velocity);
        }
        assert!(seen.iter().all(|axis| (axis.position - seen[0].position).abs() < 1e-9), "{seen:?}");
    });
    assert_eq!(outcome, Outcome::Finished);
    assert!(fastest > 0.1);
}

#[test]
fn no_controlword_is_sent_while_nothing_changes() {
    for (name, bus) in [("gantry-yz-aim.toml", 0), ("mixed-arm.toml", 1)] {
        let cycles = cycles_while_enabled(load(name), bus);
        let is_controlword = |id: u32| (0x201..=0x203).contains(&id);
        assert!(!cycles.iter().any(|cycle| ids(cycle).into_iter().any(is_controlword)), "{name}");
    }
}

#[test]
fn on_the_way_up_the_controlwords_are_20_ms_apart() {
    let mut world = World::new(load("gantry-yz-aim.toml"));
    world.run_until(|world| world.phase() == Phase::Enabling);
    world.run_until(|world| world.phase() == Phase::Holding);
    for node in 1..=3 {
        let words: Vec<(u64, u16)> = world
            .port(0)
            .sent_with(id(0x200, node))
            .iter()
            .map(|(at_ns, payload)| (*at_ns, word(payload)))
            .collect();
        let up = words.iter().rposition(|(_, word)| *word == 0x06).unwrap();
        assert_eq!(words[up..].iter().map(|(_, word)| *word).collect::<Vec<_>>(), [0x06, 0x07, 0x0F]);
        assert!(words[up..].windows(2).all(|pair| pair[1].0 - pair[0].0 >= 20 * MILLISECOND_NS), "{words:?}");
    }
}

/// Also in the very first frames, when nothing has been heard of the axis by process data yet.
#[test]
fn until_something_is_to_move_every_target_is_the_actual_position() {
    for answers_sync in [true, false] {
        let mut config = gantry_at("50 mm");
        config.axes.iter_mut().for_each(|axis| axis.answers_sync = answers_sync);
        let mut world = World::new(config);
        world.run_until(|world| world.phase() == Phase::Holding);
        for axis in 0..3 {
            let actual = world.observe(axis).position_counts;
            assert!((f64::from(actual) - 0.05 * counts_per_unit(&world.config.axes[axis])).abs() < 2.0);
            let node = world.config.axes[axis].node;
            let by_rpdo1 = world.port(0).sent_with(id(0x200, node));
            let by_rpdo4 = world.port(0).sent_with(id(0x500, node));
            assert!(!by_rpdo1.is_empty() && by_rpdo4.len() > 10);
            let targets =
                by_rpdo1.iter().map(|(_, data)| &data[3..]).chain(by_rpdo4.iter().map(|(_, data)| &data[..]));
            for target in targets.map(counts) {
                assert!((target - actual).abs() <= 1, "{target} for an axis at {actual}, {answers_sync}");
            }
        }
    }
}
