//! YZ-AIM
use super::conversation::Conversation;
use super::dictionary::Entry;
use super::failure::Failure;
use super::report::Report;
use super::request::Request;
use super::subject::Subject;
use crate::canopen::object::Object;
/// x
pub const OBJECTS: &[Entry] = &[];
pub(super) async fn carry_out(_c: &Conversation, _s: &Subject, _request: Request) -> Result<Report, Failure> {
    Err(Failure::Interrupted)
}
/// x
pub fn meaning(_o: &Object, _v: i64) -> Option<String> {
    None
}
/// x
pub fn process_data_words(_s: &Subject, _f: &takt_rt::frame::Frame) -> Option<String> {
    None
}
