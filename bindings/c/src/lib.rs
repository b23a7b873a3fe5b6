//! takt for programs in C and C++. `include/takt.h` is made of this crate, and is its documentation for them; `docs/c.md` is the guide.
//!
//! Every function of the header is a few lines here: it checks its pointers and handles, calls the one function of [`takt`] that does the
//! work, and turns an error into a code, a text and numbers. No panic leaves a function ([`border`]).
#![allow(non_camel_case_types, reason = "the types have the names that the header gives them")]

pub mod border;
pub mod callback;
pub mod connect;
pub mod description;
pub mod errors;
pub mod events;
pub mod handles;
pub mod last_error;
pub mod life;
pub mod motion;
pub mod open;
mod posix;
mod scope;
pub mod state;
pub mod stream;
pub mod trajectory;
