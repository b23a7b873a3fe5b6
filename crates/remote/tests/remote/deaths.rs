//! Processes that end at any instant.

use super::*;

#[test]
fn clients_that_are_killed_at_any_instant_leave_a_controller_that_takes_commands() {
    let served = Served::start("arm6-erob.toml");
    let watching = served.connect();
    let mut random = Random(0x5EED);
    for round in 0..25 {
        let mut other = other_process("deaths::command_without_end", &served.name());
        let begun = served.connect();
        // From before its first command on.
        thread::sleep(Duration::from_millis(random.below(60)));
        if round % 2 == 0 {
            let _ = begun.wait_until(LONG, |_| begun.lease().map(drop));
            thread::sleep(Duration::from_micros(random.below(20_000)));
        }
        other.0.kill().unwrap();
        other.0.wait().unwrap();
        within_limits(&watching);
        let next = served.connect();
        bring_to_rest(&next);
        assert!(
            served.controller.state().groups[0].stop.is_none_or(|stop| stop.rule() == takt::Rule::Requested)
        );
        let motion = insist(&next, || next.move_to(&[0.0; 6]));
        assert_eq!(next.wait(motion, LONG), Ok(()), "round {round}");
        within_limits(&watching);
    }
    assert!(!served.controller.has_ended());
}

/// Takes command, and stops the arm.
fn bring_to_rest(client: &Client) {
    client.take_over().unwrap();
    client.stop(StopCategory::Two).unwrap();
    // It is handed to the loop then, which takes it in one of these cycles.
    insist(client, || client.take_lease());
    client.next_cycle(LONG).unwrap();
    client.next_cycle(LONG).unwrap();
    // Where the thread is late for some cycles in a row, a stop that is under way takes the power.
    let rests = client.wait_until(LONG, |state| {
        let phase = state.groups[0].phase;
        matches!(phase, Phase::Holding | Phase::Disabled).then_some(phase)
    });
    if rests == Ok(Phase::Disabled) {
        insist(client, || client.enable());
    }
    let holds = client.wait_for(Phase::Holding, LONG);
    assert!(holds.is_ok(), "{holds:?}, {:?}", client.state().groups[0].stop);
}

/// A command of a client that takes over again where it was taken over from. What a killed process has sent is whole, and may be carried
/// out after its end, its take-over too.
fn insist<T>(client: &Client, command: impl Fn() -> Result<T, CommandError>) -> T {
    loop {
        match command() {
            Err(CommandError::Lease(LeaseError::TakenOver { .. })) => client.take_over().unwrap(),
            done => return done.unwrap(),
        }
    }
}

#[test]
#[ignore = "it is the other process of another test"]
fn command_without_end() {
    let client = connect(&env::var(NAME).unwrap()).unwrap();
    let mut random = Random(u64::from(std::process::id()) << 20 | 1);
    client.take_over().unwrap();
    loop {
        let away = 0.2 * random.below(1000) as f64 / 1000.0 - 0.1;
        let target = vec![away; 6];
        let _ = match random.below(6) {
            0 => client.move_to(&target).map(drop),
            1 => client.move_through(&[vec![away / 2.0; 6], target]).map(drop),
            2 => {
                let point = TrajectoryPoint { time_s: 3.0, positions: target, ..TrajectoryPoint::default() };
                client.execute(&vec![point; 500]).map(drop)
            }
            3 => client.begin_stream(),
            4 => {
                let chunk: Vec<Vec<f64>> = (0..40).map(|_| target.clone()).collect();
                let _ = client.stream().push_chunk(now_ns(), Duration::from_millis(5), &chunk);
                Ok(())
            }
            _ => client.stop(StopCategory::Two),
        };
    }
}

/// A client sees its memory only, and that of the controller it cannot write to: nothing but a system call of its has an effect elsewhere. So one
/// that is killed before or after each of its system calls has been killed at every instruction, as far as a controller can tell.
#[test]
fn a_client_that_is_killed_before_or_after_any_of_its_system_calls_leaves_a_controller_that_takes_commands() {
    let served = Served::start("single-erob.toml");
    let watching = served.connect();
    let (mut kills, mut has_ended) = (0, false);
    while !has_ended {
        let mut traced = Traced::start("deaths::command_in_every_way", &served.name());
        has_ended = !(0..kills).all(|_| traced.run_to_next_boundary());
        traced.kill();
        within_limits(&watching);
        let next = served.connect();
        next.take_over().unwrap();
        insist(&next, || next.take_lease());
        let stop = served.controller.state().groups[0].stop;
        assert!(stop.is_none_or(|stop| stop.rule() == takt::Rule::Requested), "{kills}: {stop:?}");
        kills += 1;
    }
    assert!(kills > 60, "{kills}");
    let last = served.connect();
    bring_to_rest(&last);
    let motion = insist(&last, || last.move_to(&[0.0]));
    assert_eq!(last.wait(motion, LONG), Ok(()));
}

#[test]
#[ignore = "it is the other process of another test"]
fn command_in_every_way() {
    // SAFETY: both have numbers alone, and this process is there to be traced.
    unsafe {
        libc::ptrace(libc::PTRACE_TRACEME, 0, 0, 0);
        libc::raise(libc::SIGSTOP);
    }
    let client = connect(&env::var(NAME).unwrap()).unwrap();
    // It may be killed after any of them, and the next one begins where that has left the controller.
    let _ = client.take_over();
    let _ = client.stop(StopCategory::Two);
    let _ = client.move_to(&[0.01]);
    let point = TrajectoryPoint { time_s: 3.0, positions: vec![0.02], ..TrajectoryPoint::default() };
    let _ = client.execute(&[point]);
    let _ = client.begin_stream();
    let _ = client.stream().push_now(&[0.0]);
    let _ = client.stream().push_chunk(now_ns(), Duration::from_millis(5), &[[0.0]; 20]);
    let _ = client.release();
}

/// A process one of whose threads is stopped before and after each of its system calls.
struct Traced {
    process: Other,
    thread: libc::pid_t,
}

impl Traced {
    fn start(test: &str, name: &str) -> Self {
        let mut traced = Self { process: other_process(test, name), thread: -1 };
        traced.thread = traced.next_stop().expect("it stops itself");
        traced
    }

    /// Waits until the thread has stopped; `None` if it has ended. Only this thread waits for it.
    fn next_stop(&self) -> Option<libc::pid_t> {
        let mut status = 0;
        // SAFETY: `status` is a local variable.
        let stopped =
            unsafe { libc::waitpid(self.thread, &raw mut status, libc::__WALL | libc::__WNOTHREAD) };
        assert!(stopped > 0);
        libc::WIFSTOPPED(status).then_some(stopped)
    }

    /// Lets it run into its next system call, or out of one. Returns `false` if it has ended instead.
    fn run_to_next_boundary(&self) -> bool {
        // SAFETY: it is a thread that this one traces, and that has stopped.
        assert_eq!(unsafe { libc::ptrace(libc::PTRACE_SYSCALL, self.thread, 0, 0) }, 0);
        self.next_stop().is_some()
    }

    fn kill(&mut self) {
        self.process.0.kill().unwrap();
        // SAFETY: a traced thread is there until its tracer has seen its end, unless it has seen it.
        unsafe { libc::waitpid(self.thread, std::ptr::null_mut(), libc::__WALL | libc::__WNOTHREAD) };
        self.process.0.wait().unwrap();
    }
}
