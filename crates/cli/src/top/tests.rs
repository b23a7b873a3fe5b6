//! The view of simulated machines in virtual time: keys go in, requests are carried out on the machine, pictures are compared.

use std::path::Path;
use std::time::Duration;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::style::Color;
use takt_rt::{AxisPoint, Event, EventKind, Nanoseconds, Phase, RequestTarget, StopCategory};

use super::jog::Jog;
use super::model::{Key, Model, SILENT, Seen};
use super::request::Request;
use super::view::{self, Palette};
use takt::command::Events;
use takt::command::LeaseHolder;
use takt::config::Config;
use takt::controller::VirtualController;

const MS: u64 = 1_000_000;
/// The process of the view, and another one.
const OWN: u32 = 100;
const OTHER: u32 = 200;
/// How often the view looks.
const LOOK_MS: u64 = 10;

struct Bench {
    arm: VirtualController,
    events: Events,
    model: Model,
    lease: Option<LeaseHolder>,
    silent_for: Duration,
    is_connected: bool,
    /// Everything that was asked for.
    asked: Vec<Request>,
}

fn held_by(process: u32) -> Option<LeaseHolder> {
    Some(LeaseHolder { process, expires_in: Duration::from_secs(1) })
}

fn seen(arm: &VirtualController, lease: Option<LeaseHolder>, silent_for: Duration) -> Seen {
    Seen { snapshot: arm.state(), timing: arm.timing(), lease, silent_for, has_ended: arm.has_ended() }
}

/// What is left of a velocity at rest (rad/s): a stream that has run dry ends by rounding.
const REST: f64 = 1e-9;

impl Bench {
    fn new(config: &str) -> Self {
        let config = Config::load(&Path::new("../../configs").join(config)).unwrap();
        let arm = VirtualController::start(&config, None).unwrap();
        let handle = arm.handle();
        let machine = handle.machine().clone();
        let limits =
            (0..machine.axes.len()).map(|axis| handle.axis_properties(axis).map(|own| own.limits)).collect();
        let groups = (0u8..)
            .zip(&machine.groups)
            .map(|(group, _)| handle.of(RequestTarget::Group(group)).axis_numbers());
        let groups = groups.collect();
        let now = (seen(&arm, None, Duration::ZERO), arm.handle().now_ns());
        let model = Model::new("arm", machine, (limits, groups), OWN, now);
        let events = handle.events();
        Self {
            arm,
            events,
            model,
            lease: None,
            silent_for: Duration::ZERO,
            is_connected: true,
            asked: vec![],
        }
    }

    fn now_ns(&self) -> Nanoseconds {
        self.arm.handle().now_ns()
    }

    fn look(&mut self) {
        self.events.by_ref().for_each(|event| self.model.happened(&event));
        self.model.observe(self.now_ns(), seen(&self.arm, self.lease, self.silent_for));
    }

    fn carry_out(&mut self, requests: Vec<Request>) {
        for request in requests {
            self.asked.push(request.clone());
            if !self.is_connected {
                continue;
            }
            let arm = self.arm.handle();
            let answer = match &request {
                Request::Stop { target, category } => arm.of(*target).stop(*category),
                Request::TakeLease | Request::TakeOver | Request::RenewLease => {
                    self.lease = held_by(OWN);
                    Ok(())
                }
                Request::Release => {
                    self.lease = None;
                    Ok(())
                }
                Request::Enable(target) => arm.of(*target).enable(),
                Request::Disable(target) => arm.of(*target).disable(),
                Request::ClearFaults(target) => arm.of(*target).reset_faults(),
                Request::BeginStream(target) => arm.of(*target).begin_stream(),
                Request::Velocities { target, at_ns, velocities } => {
                    let axes: Vec<AxisPoint> = velocities.iter().map(|v| AxisPoint::Velocity(*v)).collect();
                    arm.of(*target).stream().push(*at_ns, &axes).unwrap();
                    Ok(())
                }
                Request::ProfileVelocity { axis, velocity, valid_for, .. } => {
                    arm.velocity(*axis, *velocity, *valid_for).map(|_| ())
                }
                Request::Quit => Ok(()),
            };
            let answer = answer.map_err(|error| error.to_string());
            self.model.answered(self.now_ns(), &request, answer);
        }
    }

    fn press(&mut self, key: Key) {
        let requests = self.model.key(self.now_ns(), key);
        self.carry_out(requests);
        self.look();
    }

    fn pass(&mut self, ms: u64) {
        for _ in 0..ms.div_ceil(LOOK_MS) {
            self.arm.pass(Duration::from_millis(LOOK_MS));
            self.look();
            let requests = self.model.pass(self.now_ns());
            self.carry_out(requests);
        }
    }

    /// Holds a key as a keyboard does: the first repeat after half a second, then every 30 ms.
    fn hold(&mut self, key: Key, ms: u64) {
        self.press(key);
        self.pass(500);
        for _ in 0..ms / 30 {
            self.press(key);
            self.pass(30);
        }
    }

    fn position(&self, axis: usize) -> f64 {
        self.arm.state().axes()[axis].position
    }

    fn fastest(&self) -> f64 {
        self.arm.state().axes().iter().map(|axis| axis.velocity_set.abs()).fold(0.0, f64::max)
    }

    fn message(&self) -> &str {
        self.model.message.as_ref().map_or("", |(words, _)| words)
    }

    fn picture(&self, width: u16, height: u16, has_colours: bool) -> (String, Vec<Color>) {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let palette = Palette { has_colours };
        terminal.draw(|frame| view::draw(frame, &self.model, self.now_ns(), palette)).unwrap();
        let buffer = terminal.backend().buffer();
        let rows = buffer.content().chunks(width.into());
        let text = rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>() + "\n").collect();
        (text, buffer.content().iter().flat_map(|cell| [cell.fg, cell.bg]).collect())
    }

    fn text(&self, width: u16, height: u16) -> String {
        self.picture(width, height, false).0
    }
}

#[test]
fn to_look_asks_for_nothing_and_without_the_lease_no_key_does_but_a_stop() {
    let mut bench = Bench::new("arm-and-gripper.toml");
    bench.pass(2_000);
    let keys = "jkg+-edcyrR?1 ".chars().filter(|letter| !" r".contains(*letter)).map(Key::Letter);
    for key in keys.chain([Key::Up, Key::Down, Key::Escape]) {
        bench.press(key);
        bench.pass(50);
    }
    bench.hold(Key::Right, 500);
    assert_eq!(bench.asked, []);
    assert!(bench.message().contains("take the lease with t"), "{}", bench.message());
    assert_eq!(bench.arm.state().groups()[0].phase, Phase::Holding);
}

#[test]
fn the_space_bar_stops_all_axes_whatever_is_shown_or_asked_and_without_the_lease() {
    let mut bench = Bench::new("first.toml");
    let stop = Request::Stop { target: RequestTarget::All, category: StopCategory::Two };
    bench.press(Key::Letter(' '));
    bench.press(Key::Letter('?'));
    bench.press(Key::Letter(' '));
    bench.press(Key::Letter('?'));
    bench.press(Key::Letter('T'));
    assert!(bench.model.question.is_some());
    bench.press(Key::Letter(' '));
    assert_eq!(bench.asked, vec![stop; 3]);
    assert_eq!(bench.model.question, None, "a question does not outlive a stop");

    bench.press(Key::Letter('t'));
    bench.hold(Key::Right, 300);
    assert!(bench.fastest() > 0.0);
    bench.press(Key::Letter(' '));
    bench.pass(1_000);
    assert!(bench.fastest() < REST && bench.model.jog == Jog::Off, "{}", bench.fastest());
    assert_eq!(bench.arm.state().groups()[0].phase, Phase::Holding);
}

#[test]
fn what_changes_the_power_is_asked_first_and_done_by_y_alone_and_not_later_than_5_s() {
    let mut bench = Bench::new("first.toml");
    bench.press(Key::Letter('t'));
    bench.press(Key::Letter('d'));
    assert!(
        bench.text(80, 24).contains("bring to rest and disable all axes? y does it"),
        "{}",
        bench.text(80, 24)
    );
    bench.press(Key::Letter('n'));
    bench.press(Key::Letter('y'));
    bench.press(Key::Letter('d'));
    bench.pass(5_100);
    bench.press(Key::Letter('y'));
    let is_disabling = |request: &Request| matches!(request, Request::Disable(_));
    assert!(!bench.asked.iter().any(is_disabling), "{:?}", bench.asked);
    bench.press(Key::Letter('d'));
    bench.press(Key::Letter('y'));
    bench.pass(2_000);
    assert_eq!(bench.arm.state().groups()[0].phase, Phase::Disabled);
    bench.hold(Key::Left, 100);
    assert!(bench.message().contains("enable them with e first"), "{}", bench.message());
    bench.press(Key::Letter('e'));
    bench.press(Key::Letter('y'));
    bench.pass(2_000);
    assert_eq!(bench.arm.state().groups()[0].phase, Phase::Holding);
}

#[test]
fn a_held_key_moves_the_selected_axis_alone_at_a_twentieth_of_its_limit_and_lets_it_come_to_rest() {
    let mut bench = Bench::new("arm6-erob.toml");
    bench.press(Key::Letter('t'));
    bench.press(Key::Down);
    let before: Vec<f64> = (0..6).map(|axis| bench.position(axis)).collect();
    let limit = bench.model.limits[1].unwrap().velocity;
    bench.hold(Key::Right, 2_000);
    assert!((bench.fastest() - 0.05 * limit).abs() < 1e-6, "{}", bench.fastest());
    assert!(bench.text(80, 24).contains("JOGGING joint2 +: let the key go to stop"));
    bench.pass(700);
    assert!(bench.fastest() < REST, "at rest 700 ms after the last repeat: {}", bench.fastest());
    let moved: Vec<f64> = (0..6).map(|axis| bench.position(axis) - before[axis]).collect();
    assert!(moved[1] > 1.5 * 0.05 * limit, "{moved:?}");
    assert!(moved.iter().enumerate().all(|(axis, by)| axis == 1 || by.abs() < 1e-3), "{moved:?}");
    assert_eq!(bench.arm.state().groups()[0].stop, None);
    bench.hold(Key::Left, 600);
    bench.pass(1_000);
    assert!(bench.position(1) < before[1] + moved[1]);
}

#[test]
fn an_axis_that_is_jogged_against_its_limit_comes_to_rest_there_without_a_stop() {
    let mut bench = Bench::new("arm6-erob.toml");
    bench.press(Key::Letter('t'));
    (0..10).for_each(|_| bench.press(Key::Letter('+')));
    bench.hold(Key::Right, 9_000);
    let limit = bench.model.limits[0].unwrap().position_max;
    let set = bench.arm.state().axes()[0].position_set;
    assert!((limit - 1e-3..=limit).contains(&set), "{set} of {limit}");
    assert_eq!(bench.arm.state().groups()[0].stop, None);
}

#[test]
fn a_view_that_is_cut_off_while_it_jogs_leaves_an_axis_that_comes_to_rest() {
    let mut bench = Bench::new("arm6-erob.toml");
    bench.press(Key::Letter('t'));
    bench.hold(Key::Right, 500);
    assert!(bench.fastest() > 0.0);
    bench.is_connected = false;
    bench.arm.pass(Duration::from_millis(600));
    assert!(bench.fastest() < REST, "{}", bench.fastest());
    assert_eq!(bench.arm.state().groups()[0].stop, None);
}

#[test]
fn a_jog_ends_when_another_process_takes_over_and_when_the_controller_falls_silent() {
    let mut bench = Bench::new("arm6-erob.toml");
    bench.press(Key::Letter('t'));
    bench.hold(Key::Right, 300);
    bench.lease = held_by(OTHER);
    bench.pass(200);
    assert_eq!(bench.model.jog, Jog::Off);
    assert!(bench.message().contains("process 200 has taken over"), "{}", bench.message());
    assert!(bench.text(80, 24).contains("observing; process 200 has the lease"));
    bench.pass(1_000);
    assert!(bench.fastest() < REST, "{}", bench.fastest());
    assert_eq!(bench.lease, held_by(OTHER), "the view does not take it back by itself");

    bench.press(Key::Letter('T'));
    bench.press(Key::Letter('y'));
    bench.hold(Key::Right, 300);
    bench.silent_for = SILENT;
    bench.pass(50);
    assert!(bench.model.jog.moving().is_none());
    bench.hold(Key::Right, 300);
    assert!(bench.message().contains("shows no cycles"), "{}", bench.message());
}

#[test]
fn a_lease_is_renewed_while_it_is_wanted_and_given_back_by_r() {
    let mut bench = Bench::new("first.toml");
    bench.press(Key::Letter('t'));
    bench.pass(3_000);
    let renewals = bench.asked.iter().filter(|request| **request == Request::RenewLease).count();
    assert!((9..=10).contains(&renewals), "{renewals}");
    assert!(bench.text(80, 24).contains("COMMANDING"));
    bench.press(Key::Letter('r'));
    let asked = bench.asked.len();
    bench.pass(1_000);
    assert_eq!((bench.asked.len(), bench.lease), (asked, None));
}

#[test]
fn an_axis_in_profile_velocity_is_jogged_by_velocities_that_expire() {
    let mut bench = Bench::new("erob-modes/erob-pv.toml");
    bench.press(Key::Letter('t'));
    let before = bench.position(0);
    bench.hold(Key::Left, 1_000);
    assert!(
        bench
            .asked
            .iter()
            .any(|request| matches!(request, Request::ProfileVelocity { velocity, .. } if *velocity < 0.0))
    );
    bench.pass(3_000);
    assert!(bench.position(0) < before - 0.01, "{} {before}", bench.position(0));
    let group = bench.arm.state().groups()[0];
    assert_eq!((group.phase, group.stop), (Phase::Holding, None));
}

#[test]
fn a_group_is_jogged_and_commanded_apart_from_the_others() {
    let mut bench = Bench::new("arm-and-gripper.toml");
    bench.press(Key::Letter('t'));
    bench.hold(Key::Right, 500);
    let of_arm = |request: &Request| match request {
        Request::Velocities { target, velocities, .. } => {
            *target == RequestTarget::Group(0)
                && velocities.len() == bench.arm.group("arm").unwrap().axis_numbers().len()
        }
        _ => true,
    };
    assert!(bench.model.jog.moving().is_some() && bench.asked.iter().all(of_arm), "{:?}", bench.asked);
    assert_eq!(bench.arm.state().groups()[1].phase, Phase::Holding);
    bench.pass(1_000);
    (0..9).for_each(|_| bench.press(Key::Down));
    bench.press(Key::Letter('g'));
    bench.press(Key::Letter('d'));
    bench.press(Key::Letter('y'));
    bench.pass(3_000);
    let phases: Vec<Phase> = bench.arm.state().groups().iter().map(|group| group.phase).collect();
    assert_eq!(phases, [Phase::Streaming, Phase::Disabled], "the stream of the arm has run dry");
}

const SIZES: [(u16, u16); 6] = [(60, 20), (80, 20), (80, 24), (100, 30), (200, 20), (200, 60)];

#[test]
fn a_window_may_be_as_small_as_it_likes_and_a_small_one_still_says_how_to_stop() {
    let mut bench = Bench::new("arm-and-gripper.toml");
    bench.press(Key::Letter('t'));
    for size in 1..40 {
        bench.text(2 * size, size.div_ceil(2));
        bench.text(size, 20);
    }
    assert!(bench.text(40, 10).contains("SPACE stops"));
    bench.press(Key::Letter('?'));
    bench.text(20, 5);
}

#[test]
fn every_size_shows_the_selected_axis_the_state_the_lease_and_how_to_stop() {
    for config in ["first.toml", "arm6-erob.toml", "arm-and-gripper.toml", "axes32-erob.toml"] {
        let mut bench = Bench::new(config);
        bench.pass(1_500);
        for (width, height) in SIZES {
            let text = bench.text(width, height);
            let name = &bench.model.machine.axes[bench.model.axis].name;
            for word in [
                format!("▶{name}"),
                "HOLDING".to_owned(),
                "observing".to_owned(),
                "SPACE stops".to_owned(),
                "EVENTS".to_owned(),
            ] {
                assert!(text.contains(&word), "{config} {width}×{height} lacks {word:?}:\n{text}");
            }
            bench.press(Key::Down);
        }
        (0..40).for_each(|_| bench.press(Key::Down));
        let last = bench.model.machine.axes.last().unwrap().name.clone();
        assert!(bench.text(60, 20).contains(&format!("▶{last}")), "{}", bench.text(60, 20));
    }
}

#[test]
fn more_columns_show_more_of_each_axis_and_bus() {
    let mut bench = Bench::new("arm6-erob.toml");
    bench.pass(1_500);
    let (narrow, usual, wide) = (bench.text(60, 20), bench.text(80, 24), bench.text(200, 40));
    assert!(narrow.contains("enabled") && narrow.contains('●'), "{narrow}");
    assert!(usual.contains("follow.err") && usual.contains("wake-up") && usual.contains("tx/s"), "{usual}");
    assert!(!wide.contains("torque"), "no drive of this arm reports it: {wide}");
    for axis in &mut bench.model.seen.snapshot.axes {
        (axis.torque, axis.temperature, axis.current_per_mille) = (Some(1.5), Some(41.0), Some(-123));
    }
    let wide = bench.text(200, 40);
    for word in ["+1.50 Nm", "41 °C", "-12.3 %", "velocity", "CSP", "age", "p99", "load", "error active"] {
        assert!(wide.contains(word), "{word}: {wide}");
    }
    assert!(!wide.contains("- %"), "{wide}");
    assert!(wide.contains(" max  BUS"), "the histograms are whole beside the buses: {wide}");
    assert!(
        wide.contains("TIMING   1µ  10µ  100µ    1m "),
        "no label of the scale touches another one: {wide}"
    );
}

#[test]
fn without_colours_there_are_none_and_the_words_are_the_same() {
    let mut bench = Bench::new("arm6-erob.toml");
    bench.pass(300);
    bench.press(Key::Letter('t'));
    bench.press(Key::Letter('?'));
    for key in [Key::Escape, Key::Letter('e'), Key::Letter('x')] {
        bench.press(key);
        bench.pass(300);
        for (width, height) in SIZES {
            let (plain, colours) = bench.picture(width, height, false);
            assert!(colours.iter().all(|colour| *colour == Color::Reset));
            assert_eq!(bench.picture(width, height, true).0, plain);
        }
    }
}

#[test]
fn what_is_stale_is_called_so() {
    let mut bench = Bench::new("first.toml");
    bench.pass(100);
    let axis = &mut bench.model.seen.snapshot.axes[0];
    axis.feedback_age = 3;
    axis.feedback_ns = bench.arm.handle().now_ns() - 320 * MS;
    assert!(bench.text(80, 24).contains("STALE 320 ms"), "{}", bench.text(80, 24));
    bench.model.seen.snapshot.axes[0].is_heard = false;
    assert!(bench.text(80, 24).contains("NO REPORT"));
    bench.silent_for = Duration::from_secs(3);
    bench.look();
    let text = bench.text(80, 24);
    assert!(text.contains("SILENT for 3 s") && text.contains("STALE"), "{text}");
    bench.model.seen.has_ended = true;
    assert!(bench.text(80, 24).contains("ENDED"));
}

#[test]
fn a_drive_fault_is_told_in_words_with_its_cure() {
    let mut bench = Bench::new("arm6-erob.toml");
    let kind = EventKind::Emergency { axis: 1, code: 0x7305, register: 0x21, manufacturer: [0; 5] };
    bench.model.happened(&Event { slot: 1, at_ns: bench.now_ns(), group: Some(0), kind });
    let text = bench.text(80, 24).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("! joint2: emergency message: error 0x7305"), "{text}");
    assert!(text.contains("try: check the encoder and its cable, then power-cycle the drive"), "{text}");
}

#[test]
fn a_name_may_be_left_out_where_one_controller_is_served() {
    let only = |names: &[&str]| super::only(names.iter().map(|name| (*name).to_owned()).collect());
    assert_eq!(only(&["arm"]).as_deref(), Ok("arm"));
    assert!(only(&[]).unwrap_err().contains("takt run CONFIG --serve NAME"));
    assert!(only(&["arm", "leg"]).unwrap_err().ends_with("name one of them: arm, leg"));
}
