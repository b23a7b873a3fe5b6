//! What is written down.

use std::path::Path;

use super::Fields;
use crate::config::keys;
use crate::config::model::Telemetry;
use crate::config::spot::Spot;

pub fn validate(telemetry: &Telemetry, fields: &Fields<'_>) {
    directory(&fields.at("directory"), &telemetry.directory);
    if let Some(black_box_ns) = telemetry.black_box_ns {
        fields.duration(&keys::telemetry::BLACK_BOX, black_box_ns);
    }
    fields.integer(&keys::telemetry::RING_RECORDS, telemetry.ring_records);
}

pub fn directory(spot: &Spot<'_>, directory: &Path) {
    if directory.as_os_str().is_empty() {
        spot.report_range("an empty text".to_owned(), "the path of a folder".to_owned());
    }
}
