//! Who observes, who commands, and who stops.

use super::*;

#[test]
fn one_client_commands_and_another_takes_over_only_explicitly() {
    let options = ServeOptions::default().with_lease(Duration::from_millis(300));
    let served = Served::with("arm6-erob.toml", options);
    let (first, second) = (served.connect(), served.connect());
    assert_eq!(first.lease(), None);
    let motion = first.move_to(&moved(&first, 0.3)).unwrap();
    first.next_cycle(LONG).unwrap();
    first.next_cycle(LONG).unwrap();
    assert_eq!(second.lease().map(|holder| holder.process), Some(std::process::id()));
    let held = second.move_to(&positions(&second)).unwrap_err();
    assert!(matches!(held, CommandError::Lease(LeaseError::Held { .. })), "{held}");
    assert!(matches!(second.stream().push_now(&[0.0; 6]), Err(StreamError::Lease(LeaseError::Held { .. }))));

    second.take_over().unwrap();
    let taken_over = Err(CommandError::Lease(LeaseError::TakenOver { process: std::process::id() }));
    assert_eq!(first.take_lease(), taken_over);
    assert_eq!(first.wait(motion, LONG), Ok(()), "what moves goes on, beyond the end of every lease");
    assert_eq!(second.lease(), None);
    assert_eq!(first.take_lease(), taken_over, "even when the lease is free");
    assert_eq!(second.take_lease(), Ok(()));
    second.release().unwrap();
    first.take_over().unwrap();
    assert_eq!(first.move_to(&positions(&first)).map(drop), Ok(()));

    first.release().unwrap();
    assert_eq!(second.take_lease(), Ok(()), "what is given back is free at once");
}

#[test]
fn a_thousand_clients_that_fight_for_the_lease_leave_one_that_commands() {
    let served = Served::start("single-erob.toml");
    let commanded = AtomicBool::new(false);
    thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..125 {
                    let client = served.connect();
                    client.take_over().unwrap();
                    match client.move_to(&positions(&client)) {
                        Ok(_) => commanded.store(true, Ordering::Relaxed),
                        Err(CommandError::Lease(
                            LeaseError::TakenOver { .. } | LeaseError::TooManyClients,
                        )) => {}
                        Err(error) => panic!("{error}"),
                    }
                }
            });
        }
    });
    assert!(commanded.load(Ordering::Relaxed));
    let last = served.connect();
    // The controller may not have seen yet that the one before is gone.
    last.take_over().unwrap();
    let motion = last.move_to(&moved(&last, 0.05)).unwrap();
    assert_eq!(last.wait(motion, LONG), Ok(()));
}

#[test]
fn any_client_stops_the_arm_without_the_lease_and_past_commands_that_wait() {
    let served = Served::start("arm6-erob.toml");
    let (commanding, other) = (served.connect(), served.connect());
    let motion = commanding.move_to(&moved(&commanding, 0.8)).unwrap();
    commanding.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    other.stop(StopCategory::Two).unwrap();
    let Err(MotionError::Stopped(stopped)) = commanding.wait(motion, LONG) else { panic!("no stop") };
    assert_eq!(stopped.reason.category, StopCategory::Two);
    commanding.wait_for(Phase::Holding, LONG).unwrap();
    assert!(matches!(other.take_lease(), Err(CommandError::Lease(LeaseError::Held { .. })) | Ok(())));

    // A flood of commands that are not received, on a connection of its own.
    let flooding =
        Packets::connect_as(Path::new(&format!("{}.command", served.name())), Role::Commands).unwrap();
    let mut number = 0;
    let asked = Asked::from(takt::Command::Lease { is_taken_over: false });
    while flooding.send(&Demand { number, asked_ns: 0, asked: asked.clone() }.packet()).is_ok() {
        number += 1;
    }
    let motion = commanding.take_over().and_then(|()| commanding.move_to(&moved(&commanding, 0.8))).unwrap();
    commanding.wait_until(LONG, |state| (state.groups()[0].phase == Phase::Moving).then_some(())).unwrap();
    other.stop(StopCategory::Two).unwrap();
    assert!(matches!(commanding.wait(motion, LONG), Err(MotionError::Stopped(_))));
}

#[test]
fn a_name_is_served_once_and_again_after_its_end() {
    let mut served = Served::start("single-erob.toml");
    let again = serve(served.controller.handle(), &served.name(), ServeOptions::default());
    assert!(matches!(again, Err(ServeError::InUse { .. })));
    let client = served.connect();
    served.server = None;
    assert_eq!(client.move_to(&[0.0]), Err(CommandError::Ended));
    assert_eq!(client.next_cycle(LONG), Err(WaitError::Ended));
    assert!(matches!(connect(&served.name()), Err(ConnectError::NotServed { .. })));
    served.server = Some(serve(served.controller.handle(), &served.name(), ServeOptions::default()).unwrap());
    assert_eq!(client.move_to(&[0.0]), Err(CommandError::Ended), "it stays with the server that it knew");
    let motion = served.connect().move_to(&[0.01]).unwrap();
    assert_eq!(served.connect().wait(motion, LONG), Ok(()));
    for name in ["", "a b", "ä", "/", &"n".repeat(200)] {
        let refused = serve(served.controller.handle(), name, ServeOptions::default());
        assert!(matches!(refused, Err(ServeError::Name { .. })), "{name}");
        assert!(matches!(connect(name), Err(ConnectError::Name { .. })), "{name}");
    }
    let refused = serve(served.controller.handle(), "x", ServeOptions::default().with_mode(0o755));
    assert!(matches!(refused, Err(ServeError::Mode { .. })));
}

#[test]
fn file_permissions_say_who_observes_and_who_commands() {
    // For root there are no permissions: another user observes then.
    let (mode, is_root) = if geteuid().is_root() { (0o604, true) } else { (0o400, false) };
    let served = Served::with("single-erob.toml", ServeOptions::default().with_mode(mode));
    let permissions =
        |end: &str| fs::metadata(format!("{}.{end}", served.name())).unwrap().permissions().mode() & 0o777;
    let expected = if is_root { [0o606, 0o600] } else { [0o600, 0] };
    assert_eq!([permissions("observe"), permissions("command")], expected);
    if !is_root {
        return only_observes(&served.connect());
    }
    let status = served.other_user("lease::observe").0.wait().unwrap();
    assert!(status.success());
    let closed = serve(
        served.controller.handle(),
        &format!("{}-closed", served.name()),
        ServeOptions::default().with_mode(0o200),
    );
    assert!(closed.is_ok());
}

fn only_observes(client: &Client) {
    assert!(client.next_cycle(LONG).unwrap().slot > 0);
    let refused = Err(CommandError::Lease(LeaseError::ReadOnly));
    assert_eq!(client.move_to(&[0.0]).map(drop), refused);
    assert_eq!(client.stop(StopCategory::Two), refused);
    assert_eq!(client.take_over(), refused);
}

#[test]
#[ignore = "it is the other process of another test"]
fn observe() {
    only_observes(&connect(&env::var(NAME).unwrap()).unwrap());
}
