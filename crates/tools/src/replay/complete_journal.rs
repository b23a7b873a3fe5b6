//! Whether there is all that a replay needs.

use takt::journal::Journal;
use takt::telemetry::RecordedJournal;

/// The journal, if all of it is there.
///
/// # Errors
/// What is missing, in words.
pub fn complete_journal(path: &str, found: RecordedJournal) -> Result<Journal, String> {
    if let Some(first) = found.begins_in {
        let is_there = if first.exists() {
            "replay that one, and this one follows it"
        } else {
            "which is not there any more"
        };
        return Err(format!(
            "{path}: the journal of this run begins in an earlier file, {}: {is_there}",
            first.display()
        ));
    }
    if found.is_of_other_version {
        return Err(format!(
            "{path}: its journal is of another version of takt; replay it with that version"
        ));
    }
    if let Some(defect) = found.defect {
        return Err(defect.to_string());
    }
    match (found.journal, found.lost) {
        (None, _) => Err(format!(
            "{path}: this has no journal: recordings and black boxes of `takt run` have one, and those of a replay have none"
        )),
        (_, Some(lost)) if lost > 0 => Err(format!(
            "{path}: {lost} entries of the journal were lost, because the logger was late: it cannot be replayed"
        )),
        (Some(journal), _) => Ok(journal),
    }
}
