//! The two numbers that recordings keep of a fault or a rejection.

use crate::cia402::{DriveState, OperationMode};
use crate::frame::Id;
use crate::pdo::MappedObject;

/// The second number of an identifier of 29 bits; 0 where it has 11, as in earlier recordings.
const EXTENDED_ID_BITS: f64 = 29.0;

/// A field as one number.
pub(crate) trait RecordedNumber: Sized {
    fn to_number(self) -> f64;
    /// `None` for a number that no value has.
    fn from_number(number: f64) -> Option<Self>;
}

/// Fields as two numbers: what was seen or asked for, and what is allowed; 0 where there is none.
pub(crate) trait RecordedNumbers: Sized {
    fn to_numbers(self) -> (f64, f64);
    fn from_numbers(seen: f64, allowed: f64) -> Option<Self>;
}

/// A number that is the same in every recording, in place of a field.
pub(crate) struct Fixed<const NUMBER: u8>;

/// The numbers that a row of a table states, or else its fields in their order.
macro_rules! stated_or {
    ($stated:tt $fields:tt) => {
        $stated
    };
    ($fields:tt) => {
        $fields
    };
}
pub(crate) use stated_or;

macro_rules! recorded_numbers {
    ($($type:ty: $value:ident => $to:expr, $number:ident => $from:expr;)*) => {
        $(impl RecordedNumber for $type {
            fn to_number(self) -> f64 {
                let $value = self;
                $to
            }

            fn from_number($number: f64) -> Option<Self> {
                $from
            }
        })*
    };
}

recorded_numbers! {
    f64: value => value, number => Some(number);
    u8: value => value.into(), number => Some(number as Self);
    i8: value => value.into(), number => Some(number as Self);
    u16: value => value.into(), number => Some(number as Self);
    u32: value => value.into(), number => Some(number as Self);
    u64: value => value as f64, number => Some(number as Self);
    OperationMode: mode => (mode as i8).into(), number => Self::from_number(number as i8);
    DriveState: state => f64::from(state as u8),
        number => Self::ALL.into_iter().find(|state| f64::from(*state as u8) == number);
    MappedObject: object => object.parameter().into(), number => Some(Self::from_parameter(number as u32));
}

impl<const NUMBER: u8> RecordedNumber for Fixed<NUMBER> {
    fn to_number(self) -> f64 {
        NUMBER.into()
    }

    fn from_number(_: f64) -> Option<Self> {
        Some(Self)
    }
}

impl RecordedNumbers for () {
    fn to_numbers(self) -> (f64, f64) {
        (0.0, 0.0)
    }

    fn from_numbers(_: f64, _: f64) -> Option<Self> {
        Some(())
    }
}

impl<A: RecordedNumber> RecordedNumbers for (A,) {
    fn to_numbers(self) -> (f64, f64) {
        (self.0.to_number(), 0.0)
    }

    fn from_numbers(seen: f64, _: f64) -> Option<Self> {
        Some((A::from_number(seen)?,))
    }
}

impl<A: RecordedNumber, B: RecordedNumber> RecordedNumbers for (A, B) {
    fn to_numbers(self) -> (f64, f64) {
        (self.0.to_number(), self.1.to_number())
    }

    fn from_numbers(seen: f64, allowed: f64) -> Option<Self> {
        Some((A::from_number(seen)?, B::from_number(allowed)?))
    }
}

impl RecordedNumbers for (Id,) {
    fn to_numbers(self) -> (f64, f64) {
        (self.0.value().into(), if self.0.is_extended() { EXTENDED_ID_BITS } else { 0.0 })
    }

    fn from_numbers(seen: f64, allowed: f64) -> Option<Self> {
        let id = if allowed == EXTENDED_ID_BITS { Id::extended(seen as u32) } else { Id::base(seen as u32) };
        Some((id.ok()?,))
    }
}
