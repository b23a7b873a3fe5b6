//! Commissioning one drive: what the vendors' host tools do with it, as procedures without input and output.
//!
//! ```text
//! request ── procedure ── the present and frames in, frames, events and an outcome out
//!               │
//!          conversation ── transfers, pauses, conditions to await
//!               │
//!      erob_canopen, yz_aim ── what each family does: objects, alarms, the way to every motion
//!               │
//!       subject, pace ── the joint's units and limits
//! ```
//!
//! [`bus_session::run`] carries a procedure out on a bus, [`meaning`] tells what its frames mean. Devices that have no
//! node number yet are set up by [`layer_settings`].

pub mod amount;
pub mod bus_session;
mod contact;
mod conversation;
pub mod dictionary;
pub mod erob_canopen;
mod event;
mod failure;
mod family;
mod guarded;
pub mod layer_settings;
mod line;
mod looking;
pub mod meaning;
mod objects;
mod pace;
mod procedure;
mod report;
mod request;
mod scan;
mod subject;
pub mod yz_aim;

pub use conversation::Conversation;
pub use event::{Event, Reading};
pub use failure::Failure;
pub use family::Family;
pub use line::Manners;
pub use pace::{GENTLE, Pace, Profile};
pub use procedure::{Failed, Procedure};
pub use report::{Finding, Report};
pub use request::{Course, ReadObject, Request};
pub use subject::{Amount, Subject};

/// The procedure that does what is asked for with this drive.
pub fn procedure(subject: Subject, request: Request) -> Procedure {
    let (node, manners) = (subject.node, subject.family.manners());
    Procedure::new(node, manners, move |conversation| async move {
        match request {
            Request::Read { objects } => objects::read(&conversation, &subject, &objects).await,
            Request::Write { object, value, entry } => {
                objects::write(&conversation, &subject, object, value, entry).await
            }
            request => match subject.family {
                Family::ErobCanopen => erob_canopen::carry_out(&conversation, &subject, request).await,
                Family::YzAim => yz_aim::carry_out(&conversation, &subject, request).await,
            },
        }
    })
}
