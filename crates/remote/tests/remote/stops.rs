//! A stop overtakes everything that clients have asked for and that has not been carried out.

use super::*;

/// A connection for commands that sends packets as they are given.
struct Raw {
    connection: Packets,
    client: Client,
}

impl Raw {
    fn connect(served: &Served) -> Self {
        let path = format!("{}.command", served.name());
        let connection = Packets::connect_as(Path::new(&path), Role::Commands).unwrap();
        connection.wait_at_most(LONG).unwrap();
        Self { connection, client: served.connect() }
    }

    fn ask(&self, asked_ns: u64, asked: impl Into<Asked>) -> Replied {
        let asked = asked.into();
        self.connection.send(&Demand { number: 1, asked_ns, asked }.packet()).unwrap();
        let mut packet = [0; PACKET_BYTES];
        let Received::Bytes(count) = self.connection.receive(&mut packet, true) else { panic!() };
        Answer::of(&packet[..count]).unwrap().reply
    }
}

#[test]
fn a_stop_overtakes_the_packets_that_wait() {
    let served = Served::start("arm6-erob.toml");
    let raw = Raw::connect(&served);
    let all = RequestTarget::All;
    let home = positions(&raw.client);
    let commands = || {
        let (options, positions) = (MoveOptions::default(), vec![0.2; 6]);
        [
            Asked::from(takt::Command::Move { target: all, options, positions }),
            takt::Command::BeginStream(all).into(),
            Asked::Trajectory { target: all, points: 0, is_timed: true },
            takt::Command::Velocity { axis: 0, velocity: 0.1, valid_for: LONG }.into(),
        ]
    };
    let point = || Asked::Point { target: all, at_ns: now_ns(), axes: vec![AxisPoint::position(0.2); 6] };
    for target in [all, RequestTarget::Group(0)] {
        let asked_ns = now_ns();
        raw.client.of(target).stop(StopCategory::Two).unwrap();
        // The stop has been taken when this returns.
        raw.client.next_cycle(LONG).unwrap();
        for command in commands() {
            assert_eq!(raw.ask(asked_ns, command), Replied::Command(Err(CommandError::Overtaken)));
        }
        assert_eq!(raw.ask(asked_ns, point()), Replied::Points(Err(StreamError::NotStreaming)));
    }
    raw.client.wait_for(Phase::Holding, LONG).unwrap();
    assert_eq!(positions(&raw.client), home);
    let stream = takt::Command::BeginStream(all);
    assert_eq!(raw.ask(now_ns(), stream), Replied::Command(Ok(Reply::Done)));
    assert_eq!(raw.ask(now_ns(), point()), Replied::Points(Ok(())));
}

#[test]
fn a_stop_of_the_own_process_overtakes_the_packets_that_wait() {
    let served = Served::start("arm6-erob.toml");
    let raw = Raw::connect(&served);
    let command = || takt::Command::Move {
        target: RequestTarget::All,
        options: MoveOptions::default(),
        positions: positions(&raw.client),
    };
    let own = served.controller.handle();
    let asked_ns = now_ns();
    thread::sleep(Duration::from_secs(1));
    own.stop(StopCategory::Two).unwrap();
    raw.client.cycle_after(own.state().slot + 5, LONG).unwrap();
    assert_eq!(raw.ask(asked_ns, command()), Replied::Command(Err(CommandError::Overtaken)));
    own.wait_for(Phase::Holding, LONG).unwrap();
    let reply = raw.ask(now_ns(), command());
    assert!(matches!(reply, Replied::Command(Ok(Reply::Motion(_)))), "{reply:?}");
}

#[test]
fn a_client_commands_again_right_after_its_own_stop() {
    let served = Served::start("arm6-erob.toml");
    let client = served.connect();
    for _ in 0..50 {
        client.stop(StopCategory::Two).unwrap();
        let motion = client.move_to(&positions(&client)).unwrap();
        let result = client.wait(motion, LONG);
        // It may come while the stop is not complete, and be refused for that; it is not discarded.
        assert_ne!(result, Err(MotionError::Overtaken));
    }
}

#[test]
fn points_of_a_client_are_taken_while_it_streams_and_refused_at_any_other_time() {
    let served = Served::start("arm6-erob.toml");
    let client = served.connect();
    let (stream, home) = (client.stream(), positions(&client));
    let chunk = vec![home.clone(); 3];
    let refused = |client: &Client| {
        assert_eq!(stream.push_now(&home), Err(StreamError::NotStreaming));
        let chunk = stream.push_chunk(now_ns(), Duration::from_millis(5), &chunk);
        assert_eq!(chunk, Err(StreamError::NotStreaming));
        assert_eq!(client.state().groups()[0].stop.map(|stop| stop.is_requested()), Some(true));
    };
    assert_eq!(stream.push_now(&home), Err(StreamError::NotStreaming));
    for _ in 0..2 {
        client.begin_stream().unwrap();
        assert_eq!(stream.push_now(&home), Ok(()), "right after the grant");
        client.stop(StopCategory::Two).unwrap();
        client.wait_for(Phase::Holding, LONG).unwrap();
        refused(&client);
    }
}

#[test]
fn points_of_a_trajectory_for_other_axes_than_those_of_the_group_are_refused_when_they_come() {
    let served = Served::start("arm6-erob.toml");
    let raw = Raw::connect(&served);
    let points = |count| Asked::Points {
        target: RequestTarget::All,
        points: vec![TrajectoryPoint { positions: vec![0.0; count], ..TrajectoryPoint::default() }; 1],
    };
    assert_eq!(raw.ask(now_ns(), points(6)), Replied::Command(Ok(Reply::Done)));
    let Replied::Command(Err(refused)) = raw.ask(now_ns(), points(8_000)) else { panic!() };
    assert_eq!(refused.to_string(), "point 1: 8000 values of position are given for 6 axes");
}
