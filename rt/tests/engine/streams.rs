//! Streams: points of any rate, early, late, lost and in disorder are followed within the limits; what is to be followed
//! exactly is followed exactly, or refused.

mod exact;
mod points;
mod smooth;
