//! Calls of a handle and of another process, and the time of day of each, for the latencies of the fronts in the laboratory
//! (`guest/front_latency.sh`).
//!
//! A hundred times a small move is commanded at rest, then a hundred times a stop at full speed, then a hundred times a stream has a point elsewhere. The
//! first axis moves. Each line is a command, and CLOCK_REALTIME before the call; that of a point has the lag of the stream as well. "calls begin" on
//! stderr comes before the first.
//!
//!     front_calls CONFIG --bus NAME=INTERFACE...       a handle of a controller of its own
//!     front_calls connect NAME                         a client of `takt run --serve NAME`

mod run_arguments;

use std::error::Error;
use std::thread::sleep;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use takt::{Controller, MotionId, Phase, StopCategory};
use takt_remote::connect;

use run_arguments::arguments;

type Result<T = ()> = std::result::Result<T, Box<dyn Error>>;

const CALLS: u32 = 100;
/// rad
const STEP: f64 = 0.0005;
const FAR: f64 = 0.3;
const PATIENCE: Duration = Duration::from_secs(30);

/// What is called, whoever carries it out.
struct Front<'a> {
    move_to: &'a dyn Fn(&[f64]) -> Result<MotionId>,
    wait: &'a dyn Fn(MotionId) -> Result,
    stop: &'a dyn Fn() -> Result,
    begin_stream: &'a dyn Fn() -> Result,
    push_now: &'a dyn Fn(&[f64]) -> Result,
    lag_ns: &'a dyn Fn() -> u64,
}

fn main() -> Result {
    let given: Vec<String> = std::env::args().collect();
    match given.get(1).map(String::as_str) {
        Some("connect") => of_another_process(given.get(2).ok_or("connect NAME")?),
        _ => of_this_process(),
    }
}

fn of_this_process() -> Result {
    let (config, options, _) = arguments()?;
    let arm = Controller::start(config, options)?;
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let (stream, handle) = (arm.stream(), arm.handle());
    call(
        &Front {
            move_to: &|there| Ok(handle.move_to(there)?),
            wait: &|motion| Ok(handle.wait(motion, PATIENCE)?),
            stop: &|| Ok(handle.stop(StopCategory::Two)?),
            begin_stream: &|| Ok(handle.begin_stream()?),
            push_now: &|there| Ok(stream.push_now(there)?),
            lag_ns: &|| handle.state().groups()[0].stream.counts.lag_ns,
        },
        &home,
    )?;
    arm.finish()?;
    Ok(())
}

fn of_another_process(name: &str) -> Result {
    let arm = connect(name)?;
    arm.wait_for(Phase::Holding, PATIENCE)?;
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let stream = arm.stream();
    call(
        &Front {
            move_to: &|there| Ok(arm.move_to(there)?),
            wait: &|motion| Ok(arm.wait(motion, PATIENCE)?),
            stop: &|| Ok(arm.stop(StopCategory::Two)?),
            begin_stream: &|| Ok(arm.begin_stream()?),
            push_now: &|there| Ok(stream.push_now(there)?),
            lag_ns: &|| arm.state().groups()[0].stream.counts.lag_ns,
        },
        &home,
    )
}

fn call(front: &Front, home: &[f64]) -> Result {
    let away = |by: f64| {
        let mut there = home.to_vec();
        there[0] += by;
        there
    };
    eprintln!("calls begin");
    for number in 0..CALLS {
        pause(5, number);
        let there = away(if number % 2 == 0 { STEP } else { 0.0 });
        noted("move", "");
        (front.move_to)(&there)?;
    }
    for number in 0..CALLS {
        pause(5, number);
        (front.move_to)(&away(if number % 2 == 0 { FAR } else { -FAR }))?;
        pause(5, number);
        noted("stop", "");
        (front.stop)()?;
    }
    pause(5, 0);
    (front.wait)((front.move_to)(home)?)?;
    (front.begin_stream)()?;
    for _ in 0..20 {
        (front.push_now)(home)?;
        pause(5, 0);
    }
    for number in 0..CALLS {
        let (here, there) = if number % 2 == 0 { (0.0, STEP) } else { (STEP, 0.0) };
        for _ in 0..4 {
            (front.push_now)(&away(here))?;
            pause(5, 0);
        }
        pause(0, number);
        let (lag_ns, there) = ((front.lag_ns)(), away(there));
        noted("point", &format!(" {lag_ns}"));
        (front.push_now)(&there)?;
        pause(5, 0);
    }
    // The last point comes after the lag of the stream.
    pause(50, 0);
    (front.stop)()
}

/// So many milliseconds, and a part of one that is another one each time, so that the calls come all over the cycle.
fn pause(milliseconds: u64, number: u32) {
    sleep(Duration::from_millis(milliseconds) + Duration::from_micros(u64::from(number * 37 % 100) * 10));
}

fn noted(command: &str, more: &str) {
    let at = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    println!("{command} {}.{:06}{more}", at.as_secs(), at.subsec_micros());
}
