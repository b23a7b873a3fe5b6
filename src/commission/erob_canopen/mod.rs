//! ZeroErr eRob with CANopen firmware (eRunner manual 1.7, chapter 5, and what real units add to it), by SDO alone.

mod enabling;
mod fault;
mod homing;
mod info;
mod motion;
mod objects;
mod reading;
mod state;
mod upkeep;

pub use objects::{OBJECTS, meaning, process_data_words};

use super::conversation::Conversation;
use super::failure::Failure;
use super::report::Report;
use super::request::{Course, Request};
use super::subject::Subject;

/// Does what is asked for. Reading and writing objects is the same for every family and not done here.
pub(super) async fn carry_out(c: &Conversation, s: &Subject, request: Request) -> Result<Report, Failure> {
    match request {
        Request::Info => info::info(c, s).await,
        Request::Watch { every_ns, duration_ns } => reading::watch(c, s, every_ns, duration_ns).await,
        Request::Enable { hold_ns, keeps_enabled } => motion::enable(c, s, hold_ns, keeps_enabled).await,
        Request::Disable => enabling::disable(c, s).await,
        Request::Move { course: Course::Continuous { is_forward, duration_ns }, pace, keeps_enabled } => {
            motion::continuous(c, s, is_forward, pace, duration_ns, keeps_enabled).await
        }
        Request::Move { course, pace, keeps_enabled } => {
            motion::position::run(c, s, course, pace, keeps_enabled).await
        }
        Request::Velocity { velocity, pace, duration_ns, keeps_enabled } => {
            motion::velocity(c, s, velocity, pace, duration_ns, keeps_enabled).await
        }
        Request::Torque { torque, velocity_limit, duration_ns } => {
            motion::torque::run(c, s, torque, velocity_limit, duration_ns).await
        }
        Request::Home { method, within_ns, .. } => homing::home(c, s, method, within_ns).await,
        Request::Zero { is_agreed } => upkeep::zero(c, s, is_agreed).await,
        Request::Save => upkeep::save(c, s).await,
        Request::ClearFault { is_agreed } => fault::clear(c, s, is_agreed).await,
        request => Err(unsupported(&request)),
    }
}

fn unsupported(request: &Request) -> Failure {
    let (what, instead) = match request {
        Request::SetId { .. } => (
            "the node number of an eRob is in no object of its CANopen firmware",
            "set it with the vendor's custom CAN protocol (object 0043: `640+n: 00 43 00 00 00 id`, then save with \
             `640+n: 00 E8` and power-cycle) or with the vendor's tool",
        ),
        Request::SetBitRate { .. } => {
            ("the bit rate of an eRob is fixed at 1 Mbit/s", "set the bus to 1 Mbit/s instead")
        }
        Request::Gains { .. } => (
            "the gains of an eRob are set with the vendor's tool and suit most applications",
            "they can be read and written as the objects 2380, 2381 and 2382",
        ),
        Request::Gear { .. } => (
            "an eRob has no electronic gear",
            "it counts its output; scale with `gear_ratio` in the configuration",
        ),
        Request::AutoHome { .. } => ("an eRob does not move by itself at power-up", "move it with `move`"),
        _ => (
            "an eRob needs no set-up for interpolation",
            "its cyclic modes interpolate between set-points by themselves",
        ),
    };
    Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() }
}
