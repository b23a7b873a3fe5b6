//! The reader accepts or refuses any bytes, and every problem can be displayed.

use proptest::prelude::*;
use takt_wire::canopen::eds::{self, Findings};

fn show(findings: &Findings) {
    for problem in findings.problems() {
        let place = findings.position(problem);
        assert!(place.line >= 1 && place.column >= 1);
        let _ = (problem.to_string(), problem.kind.help(), findings.source_line(problem));
    }
    let _ = format!("{:?}", miette::Report::new(findings.clone()));
}

fn read(bytes: &[u8]) {
    match eds::parse("fuzz.eds", bytes) {
        Ok(loaded) => {
            let pdos = loaded.dictionary.pdos(Some(1));
            assert!(pdos.iter().all(|pdo| pdo.length() <= 254 * 32));
            show(&loaded.warnings);
        }
        Err(findings) => {
            assert!(findings.has_errors());
            show(&findings);
        }
    }
}

/// Parts of almost valid lines, so that the reader gets past the first check.
const HEADERS: [&str; 20] = [
    "[1018]",
    "[1018sub0]",
    "[1018Sub1]",
    "[1a00]",
    "[1A00sub1]",
    "[1A00Value]",
    "[1A00Name]",
    "[1400",
    "[1600]",
    "[1600sub0]",
    "[DeviceInfo]",
    "[DeviceComissioning]",
    "[DummyUsage]",
    "[Comments]",
    "[OptionalObjects]",
    "[]",
    "[é]",
    "=",
    "; x",
    "x",
];
const KEYS: [&str; 21] = [
    "ParameterName",
    "ObjectType",
    "DataType",
    "AccessType",
    "DefaultValue",
    "LowLimit",
    "HighLimit",
    "PDOMapping",
    "SubNumber",
    "CompactSubObj",
    "ParameterValue",
    "NodeID",
    "CompactPDO",
    "NrOfRXPDO",
    "Granularity",
    "SupportedObjects",
    "NrOfEntries",
    "1",
    "Dummy0005",
    "Line1",
    "ObjFlags",
];
const VALUES: [&str; 19] = [
    "$NODEID+0x200",
    "7",
    "8",
    "9",
    "0x7",
    "rw",
    "0x60400010",
    "254",
    "255",
    "-1",
    "0xFFFFFFFF",
    "1e9",
    "0x1A00",
    "é",
    "",
    "18446744073709551615",
    "2",
    "3F",
    "08",
];

fn line() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(HEADERS.to_vec()).prop_map(str::to_owned),
        (prop::sample::select(KEYS.to_vec()), prop::sample::select(VALUES.to_vec()))
            .prop_map(|(key, value)| format!("{key}={value}")),
    ]
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read(&bytes);
    }

    #[test]
    fn no_lines_make_the_reader_panic(lines in prop::collection::vec(line(), 0..60), end in "\r?\n|\r") {
        read(lines.join(&end).as_bytes());
    }

    #[test]
    fn a_damaged_file_is_read_or_refused(at in 0..17_000_usize, bytes in prop::collection::vec(any::<u8>(), 0..6)) {
        let mut file = include_bytes!("../../../../../tests/eds/yz-aim.eds").to_vec();
        let at = at.min(file.len());
        let end = (at + bytes.len()).min(file.len());
        file.splice(at..end, bytes);
        read(&file);
    }
}
