//! What the tables of the eRob's manuals say of a parameter, in whichever protocol it is read and written: what may be done with it, its
//! unit, and the numbers that it takes.

use std::fmt;

/// What may be done with a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It is read.
    Read,
    /// It is read and written.
    ReadWrite,
    /// It is written; whether it can be read is not known.
    Write,
    /// It is a command without an argument.
    Command,
    /// It is a command with an argument.
    CommandWithArgument,
}

impl Access {
    /// Returns `true` if the parameter can be read.
    pub const fn can_read(self) -> bool {
        matches!(self, Self::Read | Self::ReadWrite)
    }

    /// Returns `true` if a value can be sent to the parameter.
    pub const fn can_write(self) -> bool {
        matches!(self, Self::ReadWrite | Self::Write | Self::CommandWithArgument)
    }

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::ReadWrite => "read, write",
            Self::Write => "write",
            Self::Command | Self::CommandWithArgument => "command",
        }
    }
}

/// The unit of a number on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// None: a plain number.
    None,
    /// A position in counts at the output: 524288 are a turn.
    Counts,
    /// A distance in counts at the output.
    DistanceCounts,
    /// Counts of the encoders.
    EncoderCounts,
    /// Counts per second.
    CountsPerSecond,
    /// Counts per second squared.
    CountsPerSecondSquared,
    /// Milliamperes.
    Milliamperes,
    /// Millivolts.
    Millivolts,
    /// Milliseconds. The manual of the own CAN protocol prints it where that of Modbus has 0.05 ms: try it on hardware.
    Milliseconds,
    /// Times of 0.05 ms.
    FiftyMicroseconds,
    /// Degrees Celsius.
    Celsius,
    /// Bits per second.
    BitsPerSecond,
    /// Thousandths of the continuous current.
    PerMille,
    /// Millinewton-metres.
    MillinewtonMetres,
}

impl Unit {
    /// The unit as it is written behind a number; empty for a plain number.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Counts | Self::DistanceCounts | Self::EncoderCounts => "count",
            Self::CountsPerSecond => "count/s",
            Self::CountsPerSecondSquared => "count/s²",
            Self::Milliamperes => "mA",
            Self::Millivolts => "mV",
            Self::Milliseconds => "ms",
            Self::FiftyMicroseconds => "× 0.05 ms",
            Self::Celsius => "°C",
            Self::BitsPerSecond => "bit/s",
            Self::PerMille => "‰",
            Self::MillinewtonMetres => "mN·m",
        }
    }
}

/// The numbers that a parameter takes or shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Any that the wire carries.
    Any,
    /// Those from 0 on.
    NotNegative,
    /// Those from here to there.
    Range(i64, i64),
    /// These, with their meanings.
    Named(&'static [(i64, &'static str)]),
}

impl Values {
    /// Returns `true` if a number is one of them.
    pub fn contain(&self, value: i64) -> bool {
        match self {
            Self::Any => true,
            Self::NotNegative => value >= 0,
            Self::Range(lowest, highest) => (*lowest..=*highest).contains(&value),
            Self::Named(names) => names.iter().any(|(known, _)| *known == value),
        }
    }

    /// What a number means, where the manual has words for it.
    pub fn meaning(&self, value: i64) -> Option<&'static str> {
        let Self::Named(names) = self else { return None };
        names.iter().find(|(known, _)| *known == value).map(|(_, meaning)| *meaning)
    }
}

impl fmt::Display for Values {
    /// Nothing for any.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => Ok(()),
            Self::NotNegative => write!(f, "0 and more"),
            Self::Range(lowest, highest) if lowest == highest => write!(f, "{lowest}"),
            Self::Range(lowest, highest) => write!(f, "{lowest} to {highest}"),
            Self::Named(names) => {
                for (place, (value, name)) in names.iter().enumerate() {
                    write!(f, "{}{value} ({name})", if place > 0 { ", " } else { "" })?;
                }
                Ok(())
            }
        }
    }
}

/// A parameter, a variable or a command in the table of a manual. Its text is its name with its address.
pub trait Parameter: Copy + PartialEq + fmt::Debug + fmt::Display + 'static {
    /// What such a thing is called: an entry, a register.
    const KIND: &'static str;
    /// An address as it is written.
    const EXAMPLE: &'static str;

    /// The table.
    fn all() -> &'static [Self];

    /// The one at an address as it is written; `None` if the text is no address.
    fn at(address: &str) -> Option<Self>;

    /// Its address as it is written.
    fn address(&self) -> String;

    /// Its name.
    fn name(&self) -> &'static str;

    /// What may be done with it.
    fn access(&self) -> Access;

    /// The unit of its number on the wire.
    fn unit(&self) -> Unit;

    /// Which numbers it takes, or shows.
    fn values(&self) -> Values;

    /// The least and the greatest number that the wire carries.
    fn range(&self) -> (i64, i64);

    /// What else must be known of it; empty if nothing.
    fn note(&self) -> &'static str;

    /// Checks that it takes a value.
    ///
    /// # Errors
    /// It does not.
    fn check(&self, value: i64) -> Result<(), ValueError<Self>> {
        let (lowest, highest) = self.range();
        let is_taken = (lowest..=highest).contains(&value) && self.values().contain(value);
        if is_taken { Ok(()) } else { Err(ValueError { parameter: *self, value }) }
    }

    /// A value in words: with its unit, or its meaning.
    fn show(&self, value: i64) -> String {
        match (self.values().meaning(value), self.unit().symbol()) {
            (Some(meaning), _) => format!("{value} ({meaning})"),
            (None, "") => value.to_string(),
            (None, unit) => format!("{value} {unit}"),
        }
    }
}

/// A value that a parameter does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValueError<P> {
    /// The parameter.
    pub parameter: P,
    /// The value.
    pub value: i64,
}

impl<P: Parameter> std::error::Error for ValueError<P> {}

impl<P: Parameter> fmt::Display for ValueError<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} cannot be {}: it takes ", self.parameter, self.value)?;
        match self.parameter.values() {
            Values::Any => {
                let (lowest, highest) = self.parameter.range();
                write!(f, "{lowest} to {highest}")
            }
            values => values.fmt(f),
        }
    }
}
