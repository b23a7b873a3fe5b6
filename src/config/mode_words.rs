//! The words for the modes that an axis may have.

use takt_rt::OperationMode;

/// The modes, by their words in a configuration.
pub const MODES: [(&str, OperationMode); 7] = [
    ("csp", OperationMode::CyclicSynchronousPosition),
    ("csv", OperationMode::CyclicSynchronousVelocity),
    ("cst", OperationMode::CyclicSynchronousTorque),
    ("ip", OperationMode::InterpolatedPosition),
    ("pp", OperationMode::ProfilePosition),
    ("pv", OperationMode::ProfileVelocity),
    ("pt", OperationMode::ProfileTorque),
];

/// The word for a mode that an axis may have; the name of the standard for another one.
pub fn mode_word(mode: OperationMode) -> &'static str {
    MODES.iter().find(|(_, own)| *own == mode).map_or(mode.name(), |(word, _)| word)
}
