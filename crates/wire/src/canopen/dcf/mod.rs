//! Device configuration: the values that a DCF (CiA 306) or a concise DCF (CiA 302-3, object 1F22) writes to a device.
//!
//! A DCF has values but no order. [`DeviceConfiguration::of`] gives the writes in an order that devices accept: by
//! index, and each PDO is made invalid, mapped, and made valid again (CiA 301, 7.5.2.36). A concise DCF is an ordered
//! list and keeps its order.
//!
//! Commands and set-points are not written: see [`Omission`].

mod concise;
mod download;
mod order;

use std::fmt;
use std::path::{Path, PathBuf};

pub use concise::{ConciseError, decode as decode_concise, encode as encode_concise};
pub use download::Download;

use super::eds::{self, Findings, ObjectDictionary, Severity};
use super::object::ObjectAddress;
use crate::printable::printable_path;

/// The writes that configure a device, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceConfiguration {
    /// The file.
    pub path: PathBuf,
    /// The writes.
    pub downloads: Vec<Download>,
    /// The configured values that are not written, with the reason.
    pub omitted: Vec<(ObjectAddress, Omission)>,
}

/// Why a configured value is not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Omission {
    /// A command: it stores or restores parameters, or loads a program (1010, 1011, 1F50 to 1F57).
    Command,
    /// A controlword, mode or set-point: it could move the drive, or make it jump when it is enabled.
    Motion,
    /// The value cannot be encoded: its type is unknown or DOMAIN, or it has characters that the type does not allow.
    NoBytes,
}

impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Command => "a command, not a parameter",
            Self::Motion => "a set-point, which only the controller may write",
            Self::NoBytes => "a value that cannot be encoded",
        })
    }
}

/// Why a configuration cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DcfError {
    /// The file has errors.
    #[error("{}", findings_words(.0))]
    File(Findings),
    /// The file cannot be read.
    #[error("{path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// The operating system's reason.
        reason: String,
    },
    /// The file was made for another node.
    #[error("{path} was made for node {made_for}, not for node {node}")]
    OtherNode {
        /// The file.
        path: String,
        /// The node of the file.
        made_for: u8,
        /// The node to configure.
        node: u8,
    },
    /// The file has no configured value.
    #[error("{path} configures nothing: no object has a ParameterValue")]
    Nothing {
        /// The file.
        path: String,
    },
}

impl DcfError {
    /// The remedy.
    pub fn help(&self) -> &'static str {
        match self {
            Self::File(_) => "`takt eds FILE` shows all problems of the file",
            Self::Unreadable { .. } => "a relative path begins at the folder of this configuration",
            Self::OtherNode { .. } => {
                "export it for this node; without NodeID in [DeviceComissioning] it is valid for every node"
            }
            Self::Nothing { .. } => "an EDS only describes a device; use a DCF, which configures it",
        }
    }
}

fn findings_words(findings: &Findings) -> String {
    let is_error = |problem: &&eds::EdsProblem| problem.kind.severity() == Severity::Error;
    let first = findings.problems().iter().find(is_error).map(|problem| {
        let position = findings.position(problem);
        format!("; line {}: {problem}", position.line)
    });
    format!("{findings}{}", first.unwrap_or_default())
}

impl DeviceConfiguration {
    /// Loads a DCF or a concise DCF for a node.
    pub fn load(path: &Path, node: u8) -> Result<Self, DcfError> {
        let name = printable_path(path);
        let bytes = crate::text_file::read(path)
            .map_err(|error| DcfError::Unreadable { path: name.clone(), reason: error.to_string() })?;
        // A DCF is not mistaken for a concise DCF: its first bytes, read as a count, exceed any file.
        if let Ok(downloads) = decode_concise(&bytes) {
            return Ok(Self::of_list(path, downloads));
        }
        let dictionary = eds::parse(&name, &bytes).map_err(DcfError::File)?.dictionary;
        if let Some(made_for) = dictionary.commissioned_node().filter(|made_for| *made_for != node) {
            return Err(DcfError::OtherNode { path: name, made_for, node });
        }
        let configuration = Self::of(path, &dictionary, node);
        if configuration.downloads.is_empty() && configuration.omitted.is_empty() {
            return Err(DcfError::Nothing { path: name });
        }
        Ok(configuration)
    }

    /// The writes that a dictionary configures for a node.
    pub fn of(path: &Path, dictionary: &ObjectDictionary, node: u8) -> Self {
        let mut configuration = Self { path: path.to_owned(), downloads: vec![], omitted: vec![] };
        for entry in dictionary.entries() {
            let Some(stated) = &entry.configured else { continue };
            if entry.is_write_refused || !entry.access.is_writable() {
                continue;
            }
            let data = entry.data_type.and_then(|data_type| stated.value.encode(data_type, Some(node)));
            match (omission(entry.address), data) {
                (Some(omission), _) => configuration.omitted.push((entry.address, omission)),
                (None, None) => configuration.omitted.push((entry.address, Omission::NoBytes)),
                (None, Some(data)) => configuration.downloads.push(Download { object: entry.address, data }),
            }
        }
        configuration.downloads = order::ordered(configuration.downloads, dictionary, node);
        configuration
    }

    fn of_list(path: &Path, downloads: Vec<Download>) -> Self {
        let (omitted, written): (Vec<_>, Vec<_>) =
            downloads.into_iter().partition(|download| omission(download.object).is_some());
        let omitted = omitted
            .into_iter()
            .filter_map(|download| Some((download.object, omission(download.object)?)))
            .collect();
        Self { path: path.to_owned(), downloads: written, omitted }
    }
}

fn omission(object: ObjectAddress) -> Option<Omission> {
    match object.index {
        0x1010 | 0x1011 | 0x1F50..=0x1F57 => Some(Omission::Command),
        0x6040 | 0x6042 | 0x6060 | 0x6071 | 0x607A | 0x60B0..=0x60B2 | 0x60C1 | 0x60FF => {
            Some(Omission::Motion)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn writes(file: &str, node: u8) -> (Vec<String>, usize) {
        let dictionary = eds::parse("test.dcf", file.as_bytes()).unwrap().dictionary;
        let configuration = DeviceConfiguration::of(Path::new("test.dcf"), &dictionary, node);
        let shown = |download: &Download| format!("{} {:02X?}", download.object, download.data);
        (configuration.downloads.iter().map(shown).collect(), configuration.omitted.len())
    }

    fn variable(index: &str, data_type: u8, access: &str, value: &str) -> String {
        format!(
            "[{index}]\nParameterName=x\nDataType={data_type}\nAccessType={access}\nParameterValue={value}\n"
        )
    }

    #[test]
    fn configured_values_are_written_by_index_if_they_are_writable() {
        let file = variable("6081", 7, "rw", "1000")
            + &variable("1017", 6, "rw", "100")
            + &variable("1000", 7, "ro", "0x20192")
            + &variable("6040", 6, "rw", "15")
            + &variable("1008", 9, "rw", "left arm")
            + "[2000]\nParameterName=x\nDataType=7\nAccessType=rw\nDefaultValue=5\n";
        let expected =
            ["1008:00 [6C, 65, 66, 74, 20, 61, 72, 6D]", "1017:00 [64, 00]", "6081:00 [E8, 03, 00, 00]"];
        assert_eq!(writes(&file, 2), (expected.map(str::to_owned).to_vec(), 1));
    }

    #[test]
    fn a_pdo_is_made_invalid_mapped_and_made_valid_again() {
        let sub = |index: &str, sub: u8, data_type: u8, value: &str| {
            variable(&format!("{index}sub{sub}"), data_type, "rw", value)
        };
        let file = sub("1A00", 1, 7, "0x60410010")
            + &sub("1A00", 2, 7, "0x60640020")
            + &sub("1A00", 3, 7, "0")
            + &sub("1A00", 0, 5, "2")
            + &sub("1800", 1, 7, "$NODEID+0x180")
            + &sub("1800", 2, 5, "1")
            + &variable("1005", 7, "rw", "0x80")
            + &variable("2000", 5, "rw", "1");
        let expected = [
            "1005:00 [80, 00, 00, 00]",
            "1800:01 [82, 01, 00, 80]",
            "1A00:00 [00]",
            "1A00:01 [10, 00, 41, 60]",
            "1A00:02 [20, 00, 64, 60]",
            "1A00:00 [02]",
            "1800:02 [01]",
            "1800:01 [82, 01, 00, 00]",
            "2000:00 [01]",
        ];
        assert_eq!(writes(&file, 2).0, expected);
    }

    #[test]
    fn a_mapping_without_a_cob_id_uses_the_cob_id_of_the_device() {
        let mapping = variable("1601sub1", 7, "rw", "0x60400010");
        let known =
            "[1401sub1]\nParameterName=x\nDataType=7\nAccessType=rw\nDefaultValue=0x80000300+$NODEID\n";
        let order = |file: &str| writes(file, 2).0;
        let switched =
            ["1401:01 [02, 03, 00, 80]", "1601:00 [00]", "1601:01 [10, 00, 40, 60]", "1601:00 [01]"];
        assert_eq!(order(&(mapping.clone() + known))[..4], switched);
        assert_eq!(order(&(mapping + known)).last().map(String::as_str), Some("1401:01 [02, 03, 00, 80]"));
    }
}
