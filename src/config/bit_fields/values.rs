//! Reads values that several sections of a description have.

use takt_wire::bit_fields::IdExpression;

use crate::config::data_file::each;
use crate::config::read::entry::Entry;

/// Two whole numbers, the lower one first.
pub(super) fn two(entry: &Entry<'_>, allowed: std::ops::Range<i64>) -> Option<(i64, i64)> {
    let numbers = each(entry, |entry| entry.integer(allowed.clone()))?;
    match numbers.as_slice() {
        [low, high] if low <= high => Some((*low, *high)),
        _ => {
            entry.report_range(
                "a list of something else".to_owned(),
                "two numbers, the lower one first".to_owned(),
            );
            None
        }
    }
}

/// The expression of an identifier.
pub(super) fn expression(entry: &Entry<'_>, is_extended: bool) -> Option<IdExpression> {
    let text = entry.text()?;
    let read = IdExpression::parse(text, is_extended);
    if read.is_none() {
        let allowed = "a sum of \"motor\", \"master\" and numbers: \"motor\", \"master\", \"motor + 0x100\", \"32 * motor + 7\"";
        entry.report_range(format!("{text:?}"), allowed.to_owned());
    }
    read
}
