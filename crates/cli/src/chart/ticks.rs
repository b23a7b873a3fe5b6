//! Values beside an axis, in steps of 1, 2 or 5.

/// A value with its label.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    pub value: f64,
    pub label: String,
}

/// The ticks of a range, so many at most, in the smallest step of 1, 2 or 5 times a power of ten that gives no more.
pub fn ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0 && most > 1) {
        return vec![];
    }
    let coarse = span / (most - 1) as f64;
    let power = 10_f64.powf(coarse.log10().floor());
    // Not below the resolution of the numbers themselves.
    let finest = low.abs().max(high.abs()) * 1e-12;
    // What is above the coarse step by rounding alone is not above it.
    let fits = |step: &f64| *step >= coarse * (1.0 - 1e-9) && *step > finest;
    let Some(step) = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(fits) else {
        return vec![];
    };
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    let count = (last - first).max(-1.0) as usize + 1;
    (0..count.min(most + 1))
        .map(|number| (first + number as f64) * step)
        .map(|value| Tick { value, label: label(value, step) })
        .collect()
}

/// With as many digits as the step needs.
fn label(value: f64, step: f64) -> String {
    let exponent = (step * (1.0 + 1e-9)).log10().floor();
    // Not "-0".
    let value = if value.abs() < step / 2.0 { 0.0 } else { value };
    match exponent as i32 {
        _ if value == 0.0 => "0".to_owned(),
        -5..0 => format!("{value:.*}", exponent.abs() as usize),
        0..6 => format!("{value:.0}"),
        _ => {
            // As many digits as there are from the first of the value to the first of the step.
            let digits = (value.abs().log10().floor() - exponent).max(0.0) as usize;
            format!("{value:.digits$e}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, most: usize) -> Vec<String> {
        ticks(low, high, most).into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_in_steps_of_1_2_or_5_with_the_digits_that_they_need() {
        assert_eq!(labels(0.0, 10.0, 6), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(labels(-0.27, 0.31, 5), ["-0.2", "0", "0.2"]);
        assert_eq!(labels(0.0, 0.7, 6), ["0", "0.2", "0.4", "0.6"]);
        assert_eq!(labels(101.3, 102.6, 6), ["101.5", "102.0", "102.5"]);
        assert_eq!(labels(-0.0004, 0.0004, 5), ["-0.0004", "-0.0002", "0", "0.0002", "0.0004"]);
        assert_eq!(labels(0.0, 2e-7, 3), ["0", "1e-7", "2e-7"]);
        assert_eq!(labels(0.0, 3e7, 4), ["0", "1e7", "2e7", "3e7"]);
    }

    #[test]
    fn there_are_never_more_than_asked_for_and_none_for_a_range_that_is_none() {
        for (low, high) in [(0.0, 1.0), (-3.3, 77.0), (1e-9, 2e-9), (-1e300, 1e300), (5.0, 5.0 + 1e-15)] {
            for most in [2, 3, 5, 9] {
                let found = ticks(low, high, most);
                assert!(found.len() <= most, "{low} to {high}: {} of {most}", found.len());
                assert!(found.iter().all(|tick| tick.value.is_finite()));
            }
        }
        for (low, high) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert_eq!(ticks(low, high, 5), []);
        }
    }
}
