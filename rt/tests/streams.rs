//! Streams: points of any rate, early, late, lost and in disorder are followed within the limits; what is to be followed
//! exactly is followed exactly, or refused.

mod fixture;
mod streams {
    pub mod exact;
    pub mod points;
    pub mod smooth;
}
