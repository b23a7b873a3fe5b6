//! Embeds the controller in a program of one's own: runs a configuration in real time, looks on while it runs, asks it to
//! stop after three seconds, and reads what is left.
//!
//! ```text
//! cargo run --release --example embed configs/arm6-erob.toml
//! ```

use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use takt::config::Config;
use takt::controller::Interrupt;
use takt::controller::session::{self, SessionOptions};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).map_or_else(|| PathBuf::from("configs/arm6-erob.toml"), PathBuf::from);
    let config = Config::load(&path).map_err(miette::Report::new)?;
    let begun = Instant::now();
    let mut said = String::new();
    let session = session::run(&config, SessionOptions::default(), Box::new(|_| {}), |_, progress| {
        if progress.what != said {
            println!("{:5.2} s  {}", begun.elapsed().as_secs_f64(), progress.what);
            said = progress.what;
        }
        (begun.elapsed() > Duration::from_secs(3)).then_some(Interrupt::Controlled)
    })?;
    println!("{:?} after {} cycles", session.outcome, session.log.statistics.cycles);
    for (axis, state) in config.axes.iter().zip(session.snapshot.axes) {
        println!("{:<10} {:+.4}", axis.name, state.position);
    }
    Ok(())
}
