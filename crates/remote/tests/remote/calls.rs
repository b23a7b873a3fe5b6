//! The calls of a client are those of a handle.

use super::*;

#[test]
fn a_client_sees_and_moves_the_arm_with_the_calls_of_a_handle() {
    let served = Served::start("arm6-erob.toml");
    let client = served.connect();
    assert_eq!(client.machine(), served.controller.machine());
    let own = served.controller.handle();
    for (number, axis) in own.axes().iter().enumerate() {
        assert_eq!(client.limits(number), Some(axis.limits));
        assert_eq!(client.axis_properties(number), own.axis_properties(number));
    }
    assert_eq!((client.axis_properties(6), client.period_ns()), (None, own.period_ns()));
    let (mut events, target) = (client.events(), moved(&client, 0.05));
    let motion = client.move_to(&target).unwrap();
    assert_eq!(client.wait(motion, LONG), Ok(()));
    assert_eq!(client.result_of(motion), Some(Ok(())));
    assert_eq!(positions(&client), target);
    let finished = EventKind::MotionFinished { request: motion.request() };
    while events.wait(LONG).unwrap().kind != finished {}
    assert_eq!(events.missed(), 0);

    let by = client.move_by(&[0.01; 6], MoveOptions::default()).unwrap();
    assert_eq!(client.wait(by, LONG), Ok(()));
    for (position, before) in positions(&client).iter().zip(&target) {
        assert!((position - before - 0.01).abs() < 1e-9, "{position} from {before}");
    }
    let through = client.move_through(&[moved(&client, 0.02), moved(&client, -0.02)]).unwrap();
    assert_eq!(client.wait(through, LONG), Ok(()));
    let (first, last) = (positions(&client), moved(&client, 0.05));
    let point = |time_s: f64, part: f64| TrajectoryPoint {
        time_s,
        positions: first.iter().zip(&last).map(|(from, to)| from + (to - from) * part).collect(),
        ..TrajectoryPoint::default()
    };
    // More points than a packet has room for.
    let points: Vec<TrajectoryPoint> = (0..=2000)
        .map(|number| {
            let part = f64::from(number) / 2000.0;
            point(3.0 * part, part * part * part * (10.0 - 15.0 * part + 6.0 * part * part))
        })
        .collect();
    let trajectory = client.execute(&points).unwrap();
    let progress = client.trajectory_progress(trajectory).unwrap().unwrap();
    assert!(progress.of_s == 3.0 && progress.rate == 1.0, "{progress:?}");
    assert_eq!(client.trajectory_progress(through), Ok(None));
    client.set_speed(trajectory, 0.5).unwrap();
    client.pause(trajectory).unwrap();
    client.resume(trajectory).unwrap();
    assert_eq!(client.wait(trajectory, LONG), Ok(()));
    for (position, last) in positions(&client).iter().zip(&last) {
        assert!((position - last).abs() < 1e-9, "{position} for {last}");
    }

    client.disable().unwrap();
    client.wait_for(Phase::Disabled, LONG).unwrap();
    client.enable().unwrap();
    client.wait_for(Phase::Holding, LONG).unwrap();
    assert_eq!(client.fault(), None);
    let before = client.state().slot;
    assert!(client.advance(3).unwrap().slot >= before + 3);
    assert!(client.cycle_after(before, LONG).unwrap().slot > before);

    served.controller.finish().unwrap();
    assert_eq!(client.wait_for(Phase::Moving, LONG), Err(WaitError::Ended));
    assert!(client.has_ended());
    assert_eq!(client.move_to(&target), Err(CommandError::Ended));
    assert_eq!(client.stop(StopCategory::Two), Err(CommandError::Ended));
    assert_eq!(client.next_cycle(LONG), Err(WaitError::Ended));
    while events.next().is_some() {}
    assert_eq!(events.wait(LONG), Err(WaitError::Ended));
}

#[test]
fn what_is_refused_has_the_same_words_as_in_the_own_process() {
    for name in ["arm6-erob.toml", "erob-modes/erob-pv.toml"] {
        let served = Served::start(name);
        let client = served.connect();
        let (any_client, own): (AnyHandle, AnyHandle) =
            (client.clone().into(), served.controller.handle().into());
        let axes = client.machine().axes.len();
        let here = positions(&client);
        let far: Vec<f64> = here.iter().map(|position| position + 1e3).collect();
        let point = |time_s: f64, positions: &[f64]| TrajectoryPoint {
            time_s,
            positions: positions.to_vec(),
            ..TrajectoryPoint::default()
        };
        let trajectories = [
            vec![],
            vec![point(0.0, &here), point(1.0, &here[1..])],
            vec![point(-1.0, &here)],
            vec![point(2.0, &here), point(1.0, &here)],
            vec![point(1.0, &vec![f64::NAN; axes])],
            vec![point(0.0, &far), point(1.0, &here)],
            vec![point(0.001, &far)],
            vec![TrajectoryPoint { velocities: vec![0.1; axes + 1], ..point(3.0, &here) }],
            vec![TrajectoryPoint { accelerations: vec![0.1; axes], ..point(3.0, &here) }],
        ];
        let motion = client.move_to(&here).unwrap();
        client.wait(motion, LONG).unwrap();
        let ask = |asked: &AnyHandle| -> Vec<Option<String>> {
            let mut errors = vec![
                asked.move_with(&far, MoveOptions::default()).err(),
                asked.move_with(&[0.0; 40], MoveOptions::default()).err(),
                asked.velocity(0, 1e3, LONG).err(),
                asked.torque(0, f64::INFINITY, LONG).err(),
                asked.velocity(77, 0.1, LONG).err(),
                asked.change_axis_mode(99, OperationMode::Homing).err(),
                asked.set_speed(motion, 2.0).err(),
                asked.pause(motion).err(),
                asked.enable().err(),
            ];
            errors.extend(trajectories.iter().map(|points| asked.execute(points).err()));
            errors.extend([
                asked.move_through(std::slice::from_ref(&far)).err(),
                asked.move_through(&[]).err(),
            ]);
            let refused =
                asked.move_with(&here, MoveOptions { velocity_scale: 7.0, ..MoveOptions::default() });
            let result = asked.wait(refused.unwrap(), LONG);
            let Err(MotionError::Refused(refused)) = result else { panic!("{name}: {result:?}") };
            errors.push(Some(refused.into()));
            // A number that is none is not equal to itself.
            errors.into_iter().map(|error| error.map(|error: CommandError| error.to_string())).collect()
        };
        let (of_client, of_handle) = (ask(&any_client), ask(&own));
        assert_eq!(of_client, of_handle, "{name}");
        assert!(of_client.iter().all(Option::is_some), "{name}: {of_client:?}");
        let push = |asked: &AnyHandle, entries: &[AxisPoint]| asked.stream().push(1, entries).err();
        for entries in [
            vec![AxisPoint::default(); axes + 1],
            vec![AxisPoint::Torque(1.0); axes],
            vec![AxisPoint::position(0.0).with_torque(1.0); axes],
            vec![AxisPoint::position(0.0).with_impedance(-1.0, 0.0); axes],
        ] {
            let of_client = push(&any_client, &entries);
            assert!(of_client.is_some());
            assert_eq!(of_client, push(&own, &entries), "{name}");
        }
        let NotFinite(of_client) = NotFinite::of(push(&any_client, &vec![f64::NAN.into(); axes]));
        assert_eq!(of_client, NotFinite::of(push(&own, &vec![f64::NAN.into(); axes])).0);
    }
}

/// A refusal with a number that is not equal to itself.
struct NotFinite(String);

impl NotFinite {
    fn of(error: Option<StreamError>) -> Self {
        let error = error.unwrap();
        assert!(matches!(error, StreamError::Refused { point: 0, axis: 0, .. }), "{error}");
        Self(error.to_string())
    }
}

#[test]
fn groups_are_moved_apart_and_named_alike() {
    let served = Served::start("arm-and-gripper.toml");
    let client = served.connect();
    let arm = client.group("arm").unwrap();
    assert_eq!(arm.axis_numbers(), served.controller.group("arm").unwrap().axis_numbers());
    assert_eq!(client.group("leg").err(), served.controller.group("leg").err());
    let several = client.execute(&[]).unwrap_err();
    assert!(matches!(several, CommandError::SeveralGroups { .. }));
    assert_eq!(several, served.controller.execute(&[]).unwrap_err());
    let motion = arm.move_to(&[0.1, -0.1, 0.1]).unwrap();
    assert_eq!(arm.group_state().phase, served.controller.group("arm").unwrap().group_state().phase);
    client.group("gripper").unwrap().stop(StopCategory::Two).unwrap();
    assert_eq!(client.wait(motion, LONG), Ok(()));
    let motion = arm.move_to(&[0.5, -0.1, 0.1]).unwrap();
    client.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    arm.stop(StopCategory::Two).unwrap();
    assert!(matches!(client.wait(motion, LONG), Err(MotionError::Stopped(_))));
}

#[test]
fn a_stream_of_a_client_that_stops_sending_comes_to_rest_and_goes_on_without_a_stop() {
    let served = Served::start("arm6-erob.toml");
    let client = served.connect();
    client.begin_stream().unwrap();
    let (stream, home) = (client.stream(), positions(&client));
    let mut events = client.events();
    for _ in 0..2 {
        let begun = positions(&client);
        for number in 0..100 {
            let part = 0.05 * f64::from(number) / 100.0;
            let wanted: Vec<f64> = begun.iter().map(|position| position + part).collect();
            stream.push_now(&wanted).unwrap();
            thread::sleep(Duration::from_millis(2));
        }
        let dry = |kind: EventKind| kind == EventKind::Stream { state: StreamState::Dry };
        while !dry(events.wait(LONG).unwrap().kind) {}
        let at_rest = |state: &takt::Snapshot| {
            state.axes().iter().all(|axis| axis.velocity_set.abs() < 1e-9).then(|| state.groups()[0])
        };
        let group = client.wait_until(LONG, at_rest).unwrap();
        assert_eq!((group.phase, group.stop), (Phase::Streaming, None));
    }
    let gone = positions(&client).iter().zip(&home).all(|(now, then)| now - then > 0.05);
    assert!(gone && stream.report().counts.points >= 200);

    let chunk: Vec<Vec<f64>> = (0..300).map(|_| positions(&client)).collect();
    stream.push_chunk(now_ns(), Duration::from_millis(1), &chunk[..100]).unwrap();
    let too_many = vec![positions(&client); 20_000];
    assert_eq!(stream.push_chunk(now_ns(), Duration::from_millis(1), &too_many), Err(StreamError::Full));
}

#[test]
fn a_question_that_only_reads_is_sent_without_a_lease_and_any_other_frame_is_refused() {
    let logs = TempDir::new().unwrap();
    let mut config = config("arm6-erob.toml");
    config.telemetry.is_candump_written = true;
    config.telemetry.directory = logs.path().to_owned();
    let served = Served::with_config(config, ServeOptions::default());
    let (client, own) = (served.connect(), served.controller.handle());
    let sdo = |node, bytes: [u8; 8]| Frame::of(Id::canopen(0x600, node), bytes);
    let upload = |node| sdo(node, [0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    let own_node = own.axes()[0].node;
    let probe = Frame::of(Id::base(0x640 + u32::from(own_node)).unwrap(), [0, 1, 0, 4]);
    for (bus, frame) in [
        (2, upload(99)),
        (0, upload(own_node)),
        (0, probe),
        (0, sdo(99, [0x23, 0x81, 0x60, 0, 1, 0, 0, 0])),
        (0, Frame::of(Id::canopen(0, 0), [1, 99])),
        (0, Frame::of(Id::canopen(0x200, 99), [0; 6])),
    ] {
        let refused = own.ask_device(bus, frame);
        assert!(matches!(refused, Err(CommandError::Question(_))), "{frame:?}: {refused:?}");
        assert_eq!(client.ask_device(bus, frame), refused);
    }
    assert_eq!(client.ask_device(1, upload(99)), Ok(()));
    assert_eq!(client.ask_device(1, upload(98)), Ok(()));
    client.advance(50).unwrap();
    assert!(client.lease().is_none() && client.state().groups()[0].phase == Phase::Holding);
    served.controller.finish().unwrap();
    let log = fs::read_dir(logs.path())
        .unwrap()
        .flatten()
        .find(|file| file.path().extension().is_some_and(|kind| kind == "log"));
    let log = fs::read_to_string(log.unwrap().path()).unwrap();
    let asked = ["663#4018100100000000", "662#4018100100000000"].map(|frame| log.matches(frame).count());
    assert_eq!(asked, [1, 1]);
    for refused in ["663#23", "263#", "000#0163"] {
        assert_eq!(log.matches(refused).count(), 0, "{refused}");
    }
}
