//! Motion that not every drive has: homing, halt, quick stop, units, several axes.
