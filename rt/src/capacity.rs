//! The most that one controller has room for.

/// The most axes one controller moves.
pub const MAX_AXES: usize = 32;
/// The most buses one controller owns.
pub const MAX_BUSES: usize = 16;
/// The most groups that the axes of one controller are in.
pub const MAX_GROUPS: usize = 8;
