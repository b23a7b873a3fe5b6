//! The unit in which the positions of an axis are shown to people.

use super::model::Travel;

/// The unit in which the positions of an axis are shown: that in which the file has its position limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PositionUnit {
    /// rad
    Radian,
    /// Degrees.
    Degree,
    /// m
    Metre,
    /// mm
    Millimetre,
}

impl PositionUnit {
    /// The SI unit of a travel.
    pub const fn of(travel: Travel) -> Self {
        match travel {
            Travel::Rotary => Self::Radian,
            Travel::Linear { .. } => Self::Metre,
        }
    }

    /// The unit of a text with a number and a unit, among those that suit the travel; else the SI unit.
    pub(crate) fn written(text: &str, travel: Travel) -> Self {
        let unit = text.trim_start_matches(|letter: char| !letter.is_alphabetic() && letter != '°');
        match (travel, unit.trim_end()) {
            (Travel::Rotary, "deg" | "°") => Self::Degree,
            (Travel::Linear { .. }, "mm") => Self::Millimetre,
            _ => Self::of(travel),
        }
    }

    /// Its symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Degree => "deg",
            Self::Metre => "m",
            Self::Millimetre => "mm",
        }
    }

    /// A position in rad (m) in this unit. Velocities, accelerations and jerks are converted alike.
    pub fn from_si(self, position: f64) -> f64 {
        match self {
            Self::Radian | Self::Metre => position,
            Self::Degree => position.to_degrees(),
            Self::Millimetre => position * 1e3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINEAR: Travel = Travel::Linear { lead_m: 0.005 };

    #[test]
    fn a_unit_is_that_of_the_text_where_it_suits_the_travel() {
        assert_eq!(PositionUnit::written("-170 deg", Travel::Rotary), PositionUnit::Degree);
        assert_eq!(PositionUnit::written("90°", Travel::Rotary), PositionUnit::Degree);
        assert_eq!(PositionUnit::written("0.25 turn", Travel::Rotary), PositionUnit::Radian);
        assert_eq!(PositionUnit::written("2.5", Travel::Rotary), PositionUnit::Radian);
        assert_eq!(PositionUnit::written("500 mm", LINEAR), PositionUnit::Millimetre);
        assert_eq!(PositionUnit::written("90 deg", LINEAR), PositionUnit::Metre);
    }

    #[test]
    fn a_position_is_converted_from_si() {
        assert_eq!(PositionUnit::Degree.from_si(std::f64::consts::PI), 180.0);
        assert_eq!(PositionUnit::Millimetre.from_si(0.25), 250.0);
    }
}
