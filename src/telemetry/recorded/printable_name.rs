//! Names that a recording gives.

use takt_wire::printable::printable;

/// Names are repeated in every row of a report, so that a longer one would cost much more than its place in the file.
const LONGEST_NAME: usize = 200;

/// A name that can be shown.
pub fn name(text: &str) -> String {
    printable(&text.chars().take(LONGEST_NAME).collect::<String>())
}
