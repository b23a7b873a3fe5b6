//! A replay of a recording in memory.

use std::path::Path;
use std::sync::Arc;

use takt::telemetry::{Machine, Recorded, recorded_journal_in_memory};
use takt_tools::replay::{ComparisonReport, Setting, apply, compare, complete_journal};

/// Replays a recording, with changed values of its configuration (`KEY=VALUE`), as `takt replay --json` does.
///
/// # Errors
/// Why there is nothing to be replayed, in words.
pub fn replay(name: &str, recording: Vec<u8>, settings: &[String]) -> Result<String, String> {
    let (path, bytes) = (Path::new(name), Arc::<[u8]>::from(recording));
    let found = recorded_journal_in_memory(path, &bytes).map_err(|error| error.to_string())?;
    let mut sources = found.sources.clone();
    let journal = complete_journal(name, found)?;
    let settings: Vec<Setting> = settings
        .iter()
        .map(|text| text.parse())
        .collect::<Result<_, _>>()
        .map_err(|error| format!("{error}"))?;
    apply(&settings, &mut sources).map_err(|error| error.to_string())?;
    let config = sources.config().map_err(|error| error.to_string())?;
    config.validate().map_err(|error| error.to_string())?;
    let recorded = std::iter::once_with(|| Recorded::in_memory(path, Arc::clone(&bytes)));
    let comparison = compare(recorded, &config, journal, |_, _| {}).map_err(|error| error.to_string())?;
    let report = ComparisonReport::new(&comparison, &config, &Machine::of(&config));
    serde_json::to_string(&report).map_err(|error| error.to_string())
}
