//! One anomaly per row: the text, the warnings or errors with their lines, and the resulting dictionary.

use takt_wire::canopen::eds::{
    self, AccessType, DataTypeCode, DictionaryEntry, Findings, ObjectDictionary, ObjectType, Severity, Value,
};
use takt_wire::canopen::object::ObjectAddress;

/// The end of every file. It lists object 2000.
const LIST: &str = "[ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n";

/// An expected problem: severity, line, and a part of the message or of the help text.
type Found = (Severity, usize, &'static str);

const fn warning(line: usize, part: &'static str) -> Found {
    (Severity::Warning, line, part)
}

const fn error(line: usize, part: &'static str) -> Found {
    (Severity::Error, line, part)
}

fn entry(dictionary: &ObjectDictionary, subindex: u8) -> &DictionaryEntry {
    dictionary.entry(ObjectAddress::new(0x2000, subindex)).unwrap()
}

/// The default of 2000:subindex in a device with node ID 5.
fn number(dictionary: &ObjectDictionary, subindex: u8) -> Option<i128> {
    dictionary.number(ObjectAddress::new(0x2000, subindex), Some(5))
}

fn show(findings: &Findings) -> String {
    format!("{:?}", miette::Report::new(findings.clone()))
}

fn check(what: &str, file: &[u8], expected: &[Found], is_right: impl Fn(&ObjectDictionary) -> bool) {
    let result = eds::parse("odd.eds", file);
    let findings = match &result {
        Ok(loaded) => loaded.warnings.clone(),
        Err(findings) => findings.clone(),
    };
    let found: Vec<(Severity, usize, String)> = findings
        .problems()
        .iter()
        .map(|problem| {
            let text = format!("{problem}; {}", problem.kind.help());
            (problem.kind.severity(), findings.position(problem).line, text)
        })
        .collect();
    assert_eq!(found.len(), expected.len(), "{what}: {}", show(&findings));
    for (severity, line, part) in expected {
        let is_there =
            |(s, l, text): &(Severity, usize, String)| s == severity && l == line && text.contains(part);
        assert!(
            found.iter().any(is_there),
            "{what}: no {severity:?} in line {line} with {part:?}: {found:#?}"
        );
    }
    let has_error = expected.iter().any(|(severity, ..)| *severity == Severity::Error);
    match result {
        Ok(loaded) => {
            assert!(!has_error, "{what}");
            assert!(is_right(&loaded.dictionary), "{what}: {:#?}", loaded.dictionary.objects);
        }
        Err(_) => assert!(has_error, "{what}"),
    }
}

/// A variable 2000 of UNSIGNED32 with additional lines, which begin in line 6.
fn variable(lines: &str) -> String {
    format!("[2000]\nParameterName=x\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\n{lines}\n{LIST}")
}

#[test]
fn odd_numbers() {
    type Row = (&'static str, &'static str, &'static [Found], Option<i128>);
    const ROWS: [Row; 29] = [
        ("the usual node ID", "DefaultValue=$NODEID+0x200", &[], Some(0x205)),
        ("reversed, lower case", "DefaultValue=0x200 + $nodeid", &[], Some(0x205)),
        ("mixed case", "DefaultValue=$NodeID+512", &[], Some(0x205)),
        ("node ID alone", "DefaultValue=$NODEID", &[], Some(5)),
        ("no dollar sign", "DefaultValue=NODEID+0x200", &[warning(6, "read as $NODEID")], Some(0x205)),
        ("another name", "DefaultValue=$NODE+0x200", &[warning(6, "as $NODEID")], None),
        ("node ID subtracted", "DefaultValue=0x200-$NODEID", &[warning(6, "not a number")], None),
        ("octal", "DefaultValue=010", &[warning(6, "octal")], Some(8)),
        ("octal that decimal agrees with", "DefaultValue=007", &[], Some(7)),
        ("octal-looking", "DefaultValue=019", &[warning(6, "read as decimal")], Some(19)),
        ("capital X", "DefaultValue=0X1F", &[], Some(31)),
        ("assembler's hexadecimal", "DefaultValue=1Fh", &[warning(6, "write 0x")], Some(31)),
        ("a comment after it", "DefaultValue=31 ; counts", &[warning(6, "comment")], Some(31)),
        ("a word", "DefaultValue=true", &[warning(6, "read as 1")], Some(1)),
        ("a suffix of C", "DefaultValue=0x10UL", &[warning(6, "suffix of a C literal")], Some(16)),
        ("a decimal suffix of C", "DefaultValue=100l", &[warning(6, "suffix of a C literal")], Some(100)),
        ("a decimal point", "DefaultValue=0.0", &[warning(6, "decimal point")], Some(0)),
        ("a decimal point without decimals", "DefaultValue=100.", &[warning(6, "decimal point")], Some(100)),
        (
            "an attribute that is no number",
            "PDOMapping=maybe\nDefaultValue=1",
            &[warning(6, "not a number")],
            Some(1),
        ),
        ("nothing", "DefaultValue=", &[], None),
        ("no number", "DefaultValue=fast", &[warning(6, "not a number")], None),
        ("a fraction", "DefaultValue=1.5", &[warning(6, "not a number")], None),
        ("too large", "DefaultValue=0x100000000", &[warning(6, "UNSIGNED32 is 0 to 4294967295")], None),
        ("negative", "DefaultValue=-1", &[warning(6, "UNSIGNED32")], None),
        ("too large for any type", "DefaultValue=0x10000000000000000", &[warning(6, "not a number")], None),
        (
            "limits in the wrong order",
            "LowLimit=9\nHighLimit=1\nDefaultValue=3",
            &[warning(7, "above")],
            Some(3),
        ),
        (
            "a limit outside the type",
            "LowLimit=-5\nDefaultValue=3",
            &[warning(6, "limit was ignored")],
            Some(3),
        ),
        (
            "outside the limits",
            "LowLimit=1\nHighLimit=9\nDefaultValue=10",
            &[warning(8, "outside")],
            Some(10),
        ),
        ("limits that are both 0", "LowLimit=0\nHighLimit=0\nDefaultValue=10", &[], Some(10)),
    ];
    for (what, lines, expected, value) in ROWS {
        check(what, variable(lines).as_bytes(), expected, |dictionary| number(dictionary, 0) == value);
    }
}

#[test]
fn odd_texts() {
    let plain = variable("DefaultValue=7");
    let seven = |dictionary: &ObjectDictionary| number(dictionary, 0) == Some(7);
    check("plain", plain.as_bytes(), &[], seven);
    check("byte order mark", &[b"\xEF\xBB\xBF", plain.as_bytes()].concat(), &[], seven);
    check("carriage return and line feed", plain.replace('\n', "\r\n").as_bytes(), &[], seven);
    check("carriage return alone", plain.replace('\n', "\r").as_bytes(), &[], seven);
    check("upper case", plain.to_uppercase().replace("0X", "0x").as_bytes(), &[], seven);
    check("lower case", plain.to_lowercase().as_bytes(), &[], seven);
    check("blanks everywhere", plain.replace('=', " = ").replace('[', " [ ").as_bytes(), &[], seven);
    check("Ctrl-Z at the end", &[plain.as_bytes(), b"\x1A"].concat(), &[], seven);
    let utf16: Vec<u8> = "\u{FEFF}"
        .chars()
        .chain(plain.chars())
        .collect::<String>()
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    check("UTF-16", &utf16, &[], seven);
    let latin1 = plain.replace("=x", "=Temperatur ").into_bytes();
    let place = latin1.windows(11).position(|window| window == b"Temperatur ").unwrap() + 11;
    let latin1 = [&latin1[..place], b"\xB0C", &latin1[place..]].concat();
    check("Latin-1", &latin1, &[], |dictionary| entry(dictionary, 0).name == "Temperatur °C");
    let comments = plain.replace("ObjectType", "; a comment\n# another\nObjectType");
    check("comments", comments.as_bytes(), &[], seven);
    check("a stray line", variable("DefaultValue=7\nand so on").as_bytes(), &[warning(7, "ignored")], seven);
    check("before any section", format!("x=1\n{plain}").as_bytes(), &[warning(1, "before the first")], seven);
    check(
        "an open bracket",
        plain.replacen("[2000]", "[2000", 1).as_bytes(),
        &[warning(1, "bracket")],
        seven,
    );
    check("0x in a section", plain.replacen("[2000]", "[0x2000]", 1).as_bytes(), &[], seven);
    check("an empty file", b"", &[error(1, "no section")], |_| false);
    check("no objects", b"[FileInfo]\nFileName=x\n", &[error(1, "no section")], |_| false);
    check("another format", br#"{"device": "x"}"#, &[warning(1, "ignored"), error(1, "no section")], |_| {
        false
    });
}

#[test]
fn odd_keys_and_sections() {
    let seven = |dictionary: &ObjectDictionary| number(dictionary, 0) == Some(7);
    check(
        "the same twice",
        variable("DefaultValue=7\nDefaultValue=7").as_bytes(),
        &[warning(7, "the same")],
        seven,
    );
    check(
        "twice, differing",
        variable("DefaultValue=7\nDefaultValue=8").as_bytes(),
        &[warning(7, "first one is used")],
        seven,
    );
    check(
        "configured twice",
        variable("ParameterValue=7\nParameterValue=8").as_bytes(),
        &[error(7, "appears twice")],
        |_| false,
    );
    check("first empty", variable("DefaultValue=\nDefaultValue=7").as_bytes(), &[], seven);
    let twice = format!("{}[2000]\nDefaultValue=7\nPDOMapping=1\n", variable(""));
    check("a section twice", twice.as_bytes(), &[warning(10, "appears twice")], |dictionary| {
        seven(dictionary) && entry(dictionary, 0).is_mappable
    });
    check(
        "a misspelt key",
        variable("DefautValue=7").as_bytes(),
        &[warning(6, "`DefaultValue`")],
        |dictionary| number(dictionary, 0).is_none(),
    );
    check(
        "a misspelt section",
        format!("{}[DeviceInfos]\n", variable("")).as_bytes(),
        &[warning(10, "[DeviceInfo]")],
        |_| true,
    );
    check(
        "no hexadecimal",
        format!("{}[20G0]\n", variable("")).as_bytes(),
        &[warning(10, "hexadecimal digits")],
        |_| true,
    );
    check("a manufacturer's own key", variable("Description=x").as_bytes(), &[], |_| true);
    check("a vendor's own section", format!("{}[AcmeStuff]\nx=1\n", variable("")).as_bytes(), &[], |_| true);
}

#[test]
fn odd_objects() {
    let of = |lines: &str| format!("[2000]\n{lines}\n{LIST}");
    let named = |text: &str| text.replace("type", "DataType").replace("access", "AccessType");
    check(
        "no data type",
        of("ParameterName=x\nAccessType=ro\nDefaultValue=7").as_bytes(),
        &[warning(1, "its type is unknown")],
        |dictionary| entry(dictionary, 0).data_type.is_none() && number(dictionary, 0) == Some(7),
    );
    check(
        "data type by name",
        of(&named("ParameterName=x\ntype=unsigned16\naccess=ro")).as_bytes(),
        &[warning(3, "write its code, 0x0006")],
        |dictionary| entry(dictionary, 0).data_type == Some(DataTypeCode::UNSIGNED16),
    );
    check(
        "unknown data type",
        of(&named("ParameterName=x\ntype=word\naccess=ro")).as_bytes(),
        &[warning(3, "not a data type")],
        |dictionary| entry(dictionary, 0).data_type.is_none(),
    );
    check(
        "the device's own data type",
        of(&named("ParameterName=x\ntype=0x0040\naccess=ro\nDefaultValue=a b")).as_bytes(),
        &[],
        |dictionary| entry(dictionary, 0).value() == Some(&Value::Text("a b".to_owned())),
    );
    check(
        "no access type",
        of(&named("ParameterName=x\ntype=7")).as_bytes(),
        &[warning(1, "read as ro")],
        |dictionary| entry(dictionary, 0).access == AccessType::ReadOnly,
    );
    check(
        "access in capitals",
        of(&named("ParameterName=x\ntype=7\naccess=RWW")).as_bytes(),
        &[],
        |dictionary| entry(dictionary, 0).access == AccessType::ReadWriteWrite,
    );
    check(
        "unknown access",
        of(&named("ParameterName=x\ntype=7\naccess=r/w")).as_bytes(),
        &[warning(4, "ro, wo, rw")],
        |_| true,
    );
    check("no name", of(&named("type=7\naccess=rw")).as_bytes(), &[warning(1, "`ParameterName`")], |_| true);
    check(
        "a variable declared as a record",
        of(&named("ParameterName=x\nObjectType=9\ntype=7\naccess=rw")).as_bytes(),
        &[warning(3, "is VAR")],
        |dictionary| {
            dictionary.objects[0].object_type == ObjectType::Variable
                && dictionary.objects[0].entries.len() == 1
        },
    );
    check(
        "unknown object type",
        of(&named("ParameterName=x\nObjectType=0x11\ntype=7\naccess=rw")).as_bytes(),
        &[warning(3, "from the sections")],
        |_| true,
    );
    check(
        "object type in words",
        of(&named("ParameterName=x\nObjectType=VAR\ntype=7\naccess=rw")).as_bytes(),
        &[],
        |_| true,
    );
    check(
        "hexadecimal for a signed type",
        of(&named("ParameterName=x\ntype=4\naccess=rw\nDefaultValue=0xFFFFFFFF")).as_bytes(),
        &[],
        |dictionary| number(dictionary, 0) == Some(-1),
    );
    check(
        "bytes",
        of(&named("ParameterName=x\ntype=0xA\naccess=rw\nDefaultValue=0x0102 ff")).as_bytes(),
        &[],
        |dictionary| entry(dictionary, 0).value() == Some(&Value::Bytes(vec![1, 2, 255])),
    );
    check(
        "half a byte",
        of(&named("ParameterName=x\ntype=0xA\naccess=rw\nDefaultValue=012")).as_bytes(),
        &[warning(5, "not a list of bytes")],
        |dictionary| entry(dictionary, 0).default.is_none(),
    );
    check(
        "a real",
        of(&named("ParameterName=x\ntype=8\naccess=rw\nDefaultValue=-1e-3")).as_bytes(),
        &[],
        |dictionary| entry(dictionary, 0).value() == Some(&Value::Real(-1e-3)),
    );
}

/// An object 2000 with two sub-objects of UNSIGNED32. The second has the value 7.
fn record(header: &str) -> String {
    let sub = |number: &str, data_type: &str, value: &str| {
        format!(
            "[2000{number}]\nParameterName=x\nDataType={data_type}\nAccessType=rw\nDefaultValue={value}\n"
        )
    };
    format!("{header}{}{}{LIST}", sub("Sub0", "5", "1"), sub("SUB1", "7", "7"))
}

#[test]
fn odd_sub_objects() {
    let seven = |dictionary: &ObjectDictionary| {
        number(dictionary, 1) == Some(7) && dictionary.objects[0].object_type.has_sub_objects()
    };
    let header = "[2000]\nParameterName=x\nObjectType=9\nSubNumber=2\n";
    check("valid", record(header).as_bytes(), &[], seven);
    check(
        "declared as a variable",
        record(&header.replace('9', "7")).as_bytes(),
        &[warning(3, "is RECORD")],
        seven,
    );
    check(
        "without an object type",
        record("[2000]\nParameterName=x\n").as_bytes(),
        &[warning(1, "`ObjectType`")],
        seven,
    );
    check(
        "a wrong count",
        record(&header.replace("=2", "=5")).as_bytes(),
        &[warning(4, "there are 2")],
        seven,
    );
    check("no object", record("").as_bytes(), &[warning(1, "no section [2000]")], seven);
    check(
        "a wrong number of entries",
        record(header).replace("DefaultValue=1\n", "DefaultValue=4\n").as_bytes(),
        &[warning(9, "is 4")],
        seven,
    );
    check(
        "a missing data type",
        record(header).replace("DataType=5\n", "").as_bytes(),
        &[warning(5, "read as UNSIGNED8")],
        seven,
    );
    check(
        "sub-index of three digits",
        record(&header.replace("[2000]", "[2000sub100]\n[2000]")).as_bytes(),
        &[warning(1, "is unknown")],
        seven,
    );
}

#[test]
fn compact_sub_objects() {
    let compact = "[2000]\nParameterName=Gain\nObjectType=8\nDataType=6\nAccessType=rw\nDefaultValue=3\nCompactSubObj=3\n";
    let file = |more: &str| format!("{compact}{more}{LIST}");
    check("compact", file("").as_bytes(), &[], |dictionary| {
        let names: Vec<&str> =
            dictionary.objects[0].entries.iter().map(|entry| entry.name.as_str()).collect();
        names == ["NrOfObjects", "Gain1", "Gain2", "Gain3"]
            && number(dictionary, 0) == Some(3)
            && number(dictionary, 3) == Some(3)
            && entry(dictionary, 2).data_type == Some(DataTypeCode::UNSIGNED16)
    });
    let lists = "[2000Name]\nNrOfEntries=1\n2=Integral\n[2000VALUE]\nNrOfEntries=2\n1=0x10\n2=$NODEID\n[2000Denotation]\n3=spare\n";
    check("separate names and values", file(lists).as_bytes(), &[], |dictionary| {
        entry(dictionary, 2).name == "Integral"
            && (number(dictionary, 1), number(dictionary, 2), number(dictionary, 3))
                == (Some(16), Some(5), Some(3))
            && entry(dictionary, 3).denotation.as_deref() == Some("spare")
    });
    check(
        "a wrong count",
        file("[2000Name]\nNrOfEntries=4\n2=Integral\n").as_bytes(),
        &[warning(9, "there are 1")],
        |_| true,
    );
    check(
        "a value that does not fit",
        file("[2000Value]\n1=65536\n").as_bytes(),
        &[error(9, "UNSIGNED16")],
        |_| false,
    );
    let full = "[2000sub2]\nParameterName=x\nDataType=6\nAccessType=ro\nDefaultValue=9\n";
    check("compact and in full", file(full).as_bytes(), &[warning(8, "described twice")], |dictionary| {
        number(dictionary, 2) == Some(9) && number(dictionary, 3) == Some(3)
    });
    check("too many", file("").replace("=3\n[", "=999\n[").as_bytes(), &[warning(7, "0 to 254")], |_| true);
}

#[test]
fn odd_lists() {
    let with = |list: &str| variable("").replace(LIST, list);
    let exists = |dictionary: &ObjectDictionary| dictionary.object(0x2000).is_some();
    check("not listed", with("").as_bytes(), &[warning(1, "none of the lists")], exists);
    check(
        "a wrong count",
        with("[ManufacturerObjects]\nSupportedObjects=9\n1=0x2000\n").as_bytes(),
        &[warning(8, "there are 1")],
        exists,
    );
    check(
        "hexadecimal without 0x",
        with("[ManufacturerObjects]\nSupportedObjects=1\n1=2000\n").as_bytes(),
        &[warning(9, "write 0x2000")],
        exists,
    );
    check(
        "listed only",
        with("[ManufacturerObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2001\n").as_bytes(),
        &[warning(10, "no section describes")],
        exists,
    );
    check(
        "listed twice",
        with("[OptionalObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2000\n").as_bytes(),
        &[warning(10, "listed twice")],
        exists,
    );
    check(
        "no index",
        with("[ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n2=x\n").as_bytes(),
        &[warning(10, "ignored")],
        exists,
    );
}

#[test]
fn pdos_that_are_only_counted_have_the_predefined_identifiers() {
    let file =
        "[DeviceInfo]\nCompactPDO=0x13\nGranularity=8\nNrOfRXPDO=5\nNrOfTXPDO=1\n".to_owned() + &variable("");
    check("compact PDOs", file.as_bytes(), &[], |dictionary| {
        let pdos = dictionary.pdos(Some(5));
        let ids: Vec<Option<u32>> =
            pdos.iter().map(|pdo| pdo.id.filter(|_| pdo.is_valid).map(|id| id.value())).collect();
        let subindices: Vec<u8> =
            dictionary.object(0x1404).unwrap().entries.iter().map(|entry| entry.address.subindex).collect();
        ids == [Some(0x205), Some(0x305), Some(0x405), Some(0x505), None, Some(0x185)]
            && subindices == [0, 1, 2, 5]
            && dictionary.number(ObjectAddress::new(0x1404, 0), None) == Some(5)
            && dictionary.object(0x1A00).unwrap().entries.len() == 9
    });
}

#[test]
fn impossible_mappings_are_reported() {
    let mapping = |value: &str, dummy: &str| {
        format!(
            "[1600]\nParameterName=m\nObjectType=9\nSubNumber=2\n[1600sub0]\nParameterName=n\nDataType=5\nAccessType=rw\n\
             DefaultValue=1\n[1600sub1]\nParameterName=o\nDataType=7\nAccessType=rw\nDefaultValue={value}\n\
             [OptionalObjects]\nSupportedObjects=1\n1=0x1600\n[DummyUsage]\nDummy0005={dummy}\n{}",
            variable("PDOMapping=1")
        )
    };
    for (what, value, dummy, expected) in [
        ("valid", "0x20000020", "0", &[][..]),
        (
            "another length",
            "0x20000010",
            "0",
            &[warning(14, "the mapping has 16 bits, but UNSIGNED32 has 32")],
        ),
        ("no such object", "0x20010020", "0", &[warning(14, "does not exist")]),
        ("not mappable", "0x16000108", "0", &[warning(14, "PDOMapping is 0")]),
        ("a dummy entry", "0x00050008", "1", &[]),
        ("a dummy entry that is not allowed", "0x00050008", "0", &[warning(14, "[DummyUsage]")]),
    ] {
        check(what, mapping(value, dummy).as_bytes(), expected, |_| true);
    }
}

#[test]
fn both_spellings_of_commissioning_are_read() {
    for spelling in ["DeviceComissioning", "DeviceCommissioning", "DEVICECOMISSIONING"] {
        let file = format!(
            "{}[{spelling}]\nNodeID=0x05\nNodeName=left\nBaudrate=1000\n",
            variable("ParameterValue=$NODEID")
        );
        check(spelling, file.as_bytes(), &[], |dictionary| {
            let commissioning = dictionary.commissioning.as_ref().unwrap();
            commissioning.node == Some(5)
                && commissioning.bit_rate == Some(1_000_000)
                && commissioning.node_name.as_deref() == Some("left")
                && dictionary.number(ObjectAddress::new(0x2000, 0), dictionary.commissioned_node()) == Some(5)
        });
    }
    let file = format!("{}[DeviceComissioning]\nNodeID=128\n", variable(""));
    check("an impossible node ID", file.as_bytes(), &[error(11, "1 to 127")], |_| false);
}

#[test]
fn all_problems_are_reported_together_with_line_and_column() {
    let file = variable("DefaultValue = fast\nLowLimit=slow\nHighLimit=-1\nPDOMapping=maybe");
    let findings = eds::parse("odd.eds", file.as_bytes()).unwrap().warnings;
    let places: Vec<(usize, usize)> = findings
        .problems()
        .iter()
        .map(|problem| findings.position(problem))
        .map(|place| (place.line, place.column))
        .collect();
    assert_eq!(places, [(6, 16), (7, 10), (8, 11), (9, 12)]);
    let shown = show(&findings);
    for part in ["odd.eds:6:16", "DefaultValue = fast", "4 warnings", "write 42, 0x2A"] {
        assert!(shown.contains(part), "{part} in {shown}");
    }
}

#[test]
fn a_number_that_cannot_be_read_matters_where_takt_works_by_it_or_writes_it() {
    let object = |index: &str, line: &str| {
        format!(
            "[{index}]\nParameterName=x\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\n{line}\n[OptionalObjects]\n\
             SupportedObjects=1\n1=0x{index}\n"
        )
    };
    check(
        "supported modes",
        object("6502", "DefaultValue=all").as_bytes(),
        &[error(6, "not a number")],
        |_| false,
    );
    check(
        "of a second axis",
        object("6D02", "DefaultValue=all").as_bytes(),
        &[error(6, "not a number")],
        |_| false,
    );
    check(
        "digital inputs",
        object("60FD", "DefaultValue=all").as_bytes(),
        &[warning(6, "does not use")],
        |_| true,
    );
    let configured = variable("ParameterValue=fast");
    check("a value for the device", configured.as_bytes(), &[error(6, "not a number")], |_| false);
}

#[test]
fn two_vendors_or_products_are_named() {
    let identity = |number: &str| {
        format!(
            "[DeviceInfo]\nVendorNumber=0x21\nProductNumber={number}\n[1018]\nParameterName=x\nObjectType=9\nSubNumber=3\n\
             [1018sub0]\nParameterName=x\nDataType=5\nAccessType=ro\nDefaultValue=2\n\
             [1018sub1]\nParameterName=x\nDataType=7\nAccessType=ro\nDefaultValue=0x22\n\
             [1018sub2]\nParameterName=x\nDataType=7\nAccessType=ro\nDefaultValue=7\n\
             [MandatoryObjects]\nSupportedObjects=1\n1=0x1018\n"
        )
    };
    let vendor = warning(2, "0x00000021, but 1018:01 is 0x00000022; the drive is expected");
    check("the vendor", identity("0").as_bytes(), &[vendor], |_| true);
    check("both", identity("8").as_bytes(), &[vendor, warning(3, "1018:02")], |_| true);
}

#[test]
fn a_limit_of_the_consumer_heartbeat_without_room_for_a_node_is_ignored() {
    let sub = |number: u8, lines: &str| {
        format!("[1016sub{number}]\nParameterName=x\nDataType=0x0007\nAccessType=rw\nLowLimit=0\n{lines}\n")
    };
    let file = format!(
        "[1016]\nParameterName=x\nObjectType=8\nSubNumber=3\n{}{}{}[OptionalObjects]\nSupportedObjects=1\n1=0x1016\n",
        sub(0, "HighLimit=2"),
        sub(1, "HighLimit=65535"),
        sub(2, "HighLimit=0x7FFFFF"),
    );
    let limits = |dictionary: &ObjectDictionary| {
        dictionary.objects[0].entries.iter().map(|entry| entry.high.is_some()).collect::<Vec<_>>()
    };
    check("1016", file.as_bytes(), &[warning(16, "no room for the node ID")], |dictionary| {
        limits(dictionary) == [true, false, true]
    });
}
