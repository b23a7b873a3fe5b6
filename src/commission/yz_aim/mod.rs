//! YZ-AIM integrated servos, CANopen edition (manual 1.62), by SDO alone. One request at a time; every one may stay
//! without an answer, since unknown objects get neither reply nor abort.

mod alarm;
mod clearing;
mod enabling;
mod homing;
mod info;
mod motion;
mod objects;
mod process_data;
mod reading;
mod settings;
mod storing;
mod words;

pub use objects::{OBJECTS, meaning};
pub use process_data::words as process_data_words;

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
            motion::position(c, s, course, pace, keeps_enabled).await
        }
        Request::Velocity { velocity, pace, duration_ns, keeps_enabled } => {
            motion::velocity(c, s, velocity, pace, duration_ns, keeps_enabled).await
        }
        Request::Torque { .. } => Err(Failure::Unsupported {
            what: "a YZ-AIM has no torque mode".to_owned(),
            instead: "its current is limited by 261D (maximum allowed current)".to_owned(),
        }),
        Request::Home { method, within_ns, is_forced } => {
            homing::home(c, s, method, within_ns, is_forced).await
        }
        Request::Zero { is_agreed } => storing::zero(c, s, is_agreed).await,
        Request::Save => storing::save(c, s).await,
        Request::SetId { node } => storing::set_id(c, s, node).await,
        Request::SetBitRate { bit_rate } => storing::set_bit_rate(c, s, bit_rate).await,
        Request::ClearFault { is_agreed } => clearing::clear(c, s, is_agreed).await,
        Request::Gains { position_proportional, velocity_proportional, velocity_integration } => {
            settings::gains(c, s, position_proportional, velocity_proportional, velocity_integration).await
        }
        Request::Gear { ratio } => settings::gear(c, s, ratio).await,
        Request::AutoHome { is_on, is_agreed } => settings::auto_home(c, s, is_on, is_agreed).await,
        Request::Interpolation => settings::interpolation(c, s).await,
        Request::Read { .. } | Request::Write { .. } => {
            Err(Failure::Unsuitable("objects are read and written without their family".to_owned()))
        }
    }
}
