//! The stop categories of IEC 60204-1.

/// How a stop is made (IEC 60204-1, 9.2.2). takt's stops are not safety-rated: STO is hardware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub enum StopCategory {
    /// Category 0: power is removed from the drives at once.
    Zero = 0,
    /// Category 1: decelerate at the limits, then remove power and apply the brakes.
    One = 1,
    /// Category 2: decelerate at the limits and hold position under power.
    Two = 2,
}
