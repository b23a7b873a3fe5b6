//! The menu of the parameters of a console, as a motor types it. The manual prints its items and not their text.

use takt_wire::hollow_lines::console::{PARAMETERS, Parameter};

/// What the menu of the parameters shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Menu {
    /// The values of the parameters, in the order of the manual.
    values: [Option<f64>; PARAMETERS.len()],
    /// Degrees.
    pub zero_point: Option<f64>,
    pub step_config: Option<f64>,
    /// Lines that are none of these.
    pub others: Vec<String>,
}

impl Menu {
    /// The menu in these lines.
    pub fn of(lines: &[String]) -> Self {
        let mut menu = Self::default();
        for line in lines {
            let lower = line.to_lowercase();
            let is_item = lower.get(1..).is_some_and(|rest| rest.starts_with([')', '.', ':']));
            let item = lower.chars().next().filter(|_| is_item);
            let place = PARAMETERS.iter().position(|parameter| Some(parameter.item) == item);
            let number = last_number(line);
            if lower.contains("step_config") {
                menu.step_config = number;
            } else if lower.contains("setzero") && number.is_some() {
                menu.zero_point = number;
            } else if let (Some(slot), Some(_)) = (place.and_then(|place| menu.values.get_mut(place)), number)
            {
                *slot = number;
            } else {
                menu.others.push(line.clone());
            }
        }
        menu
    }

    /// Returns `true` if it is the menu of the parameters.
    pub fn is_complete(&self) -> bool {
        self.values.iter().all(Option::is_some) && self.zero_point.is_some()
    }

    /// The value of a parameter.
    pub fn value(&self, parameter: &Parameter) -> Option<f64> {
        let place = PARAMETERS.iter().position(|known| known.item == parameter.item)?;
        self.values.get(place).copied().flatten()
    }
}

/// The last number of a line.
fn last_number(line: &str) -> Option<f64> {
    line.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-')))
        .rev()
        .find_map(|word| word.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_menu_is_read_whatever_stands_around_its_numbers() {
        let lines = [
            "A): current loop bandwidth = 500",
            "b. x 7",
            "hello",
            "SetZeroPoint: 12.50 deg",
            "STEP_CONFIG 90",
        ];
        let menu = Menu::of(&lines.map(str::to_owned));
        assert_eq!((menu.values[0], menu.values[1], menu.values[2]), (Some(500.0), Some(7.0), None));
        assert_eq!((menu.zero_point, menu.step_config), (Some(12.5), Some(90.0)));
        assert_eq!(menu.others, ["hello"]);
        assert!(!menu.is_complete());
    }

    proptest! {
        #[test]
        fn any_lines_are_read_and_none_is_lost(lines in prop::collection::vec(any::<String>(), 0..20)) {
            let menu = Menu::of(&lines);
            prop_assert!(menu.others.iter().all(|line| lines.contains(line)));
            let (values, others) = (menu.values.iter().flatten().count(), menu.others.len());
            let named = usize::from(menu.zero_point.is_some()) + usize::from(menu.step_config.is_some());
            prop_assert!(values + named + others <= lines.len());
        }
    }
}
