//! Fuzzes the reader of EDS, DCF and concise DCF with arbitrary bytes.

use std::path::Path;

use takt_wire::canopen::dcf::{DeviceConfiguration, decode_concise, encode_concise};
use takt_wire::canopen::eds::{self, Findings, Severity};

/// Reads bytes as a device description. An error says what is wrong and where. A description without errors has values that
/// can be written, and only warnings.
pub fn run(bytes: &[u8]) {
    if let Ok(downloads) = decode_concise(bytes) {
        assert_eq!(encode_concise(&downloads), bytes);
    }
    match eds::parse("fuzz", bytes) {
        Err(findings) => {
            assert!(findings.has_errors(), "refused without a reason");
            assert_explained(&findings);
        }
        Ok(loaded) => {
            assert!(!loaded.warnings.has_errors());
            assert_explained(&loaded.warnings);
            let dictionary = &loaded.dictionary;
            assert!(dictionary.objects.is_sorted_by_key(|object| object.index));
            for node in [None, Some(5)] {
                dictionary.pdos(node);
            }
            let configuration = DeviceConfiguration::of(Path::new("fuzz"), dictionary, 5);
            for download in &configuration.downloads {
                // A PDO is disabled before its mapping is written and enabled afterwards, whether the file does so or not.
                let is_of_pdo = (0x1400..0x1C00).contains(&download.object.index);
                let is_writable =
                    dictionary.entry(download.object).is_some_and(|entry| entry.access.is_writable());
                assert!(is_writable || is_of_pdo, "{download:?}");
            }
            assert_eq!(
                decode_concise(&encode_concise(&configuration.downloads)),
                Ok(configuration.downloads)
            );
        }
    }
}

fn assert_explained(findings: &Findings) {
    assert!(!findings.to_string().is_empty());
    for problem in findings.problems() {
        let place = findings.position(problem);
        assert!(place.line > 0 && place.column > 0, "{place:?}");
        findings.source_line(problem);
        assert!(!problem.to_string().is_empty() && !problem.kind.help().is_empty());
        assert!(matches!(problem.kind.severity(), Severity::Warning | Severity::Error));
    }
}
