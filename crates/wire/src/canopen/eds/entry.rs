//! Reads one value of an object from the keys of its section.

use std::ops::Range;

use super::data_type::DataTypeCode;
use super::dictionary::{AccessType, DictionaryEntry, LocatedValue};
use super::findings::Reporter;
use super::ini::{Pair, Section};
use super::number::{self, Anomaly};
use super::problem::EdsProblemKind;
use super::value::{Value, ValueError};
use crate::canopen::object::ObjectAddress;

/// Keys of objects and sub-objects.
const KEYS: [&str; 20] = [
    "SubNumber",
    "ParameterName",
    "ObjectType",
    "DataType",
    "LowLimit",
    "HighLimit",
    "AccessType",
    "DefaultValue",
    "PDOMapping",
    "ObjFlags",
    "CompactSubObj",
    "ParameterValue",
    "Denotation",
    "UploadFile",
    "DownloadFile",
    "ParamRefd",
    "StorageLocation",
    "CountLabel",
    "SRDOMapping",
    "InvertedSRAD",
];

/// What is known about an entry besides its own section.
#[derive(Clone, Copy, Debug)]
pub(super) struct Context {
    pub address: ObjectAddress,
    /// The type if the file gives none; it follows from the object that the entry belongs to.
    pub usual_type: Option<DataTypeCode>,
}

/// Reads an entry from the section of a variable, a sub-object, or an object with compact sub-objects.
pub(super) fn read(section: &Section<'_>, context: Context, reporter: &mut Reporter) -> DictionaryEntry {
    let mut reader = Reader { section, context, reporter };
    let data_type = reader.data_type();
    let default = reader.default_value(data_type);
    // It is for the device, so it must be right whatever the object.
    let configured = section.get("ParameterValue").and_then(|pair| value(pair, data_type, reader.reporter));
    let (low, high) = reader.limits(data_type);
    for (key, stated) in [("DefaultValue", &default), ("ParameterValue", &configured)] {
        reader.check_limits(key, stated.as_ref(), low.as_ref(), high.as_ref());
    }
    let flags = reader.whole("ObjFlags").unwrap_or(0);
    DictionaryEntry {
        address: context.address,
        name: reader.name(),
        data_type,
        access: reader.access(),
        default,
        configured,
        low,
        high,
        is_mappable: reader.whole("PDOMapping").is_some_and(|value| value != 0),
        is_write_refused: flags & 1 != 0,
        denotation: section.get("Denotation").map(|pair| pair.value.to_owned()),
    }
}

/// Warns of misspelt keys.
pub(super) fn check_keys(section: &Section<'_>, known: &[&'static str], reporter: &mut Reporter) {
    for pair in section.pairs() {
        if known.iter().any(|known| known.eq_ignore_ascii_case(pair.key)) {
            continue;
        }
        if let Some(nearest) = misspelling_of(pair.key, known) {
            reporter.report(
                EdsProblemKind::UnknownKey { key: pair.key.to_owned(), nearest },
                pair.key_span.clone(),
            );
        }
    }
}

/// The known word that a word misspells. Words of a manufacturer's own are not misspellings.
pub(super) fn misspelling_of(word: &str, known: &[&'static str]) -> Option<&'static str> {
    const LETTERS: usize = 2;
    let distance =
        |known: &str| strsim::damerau_levenshtein(&word.to_ascii_lowercase(), &known.to_ascii_lowercase());
    let nearest = known.iter().map(|known| (distance(known), *known)).min()?;
    (nearest.0 <= LETTERS && word.len() > 2 * LETTERS).then_some(nearest.1)
}

/// Returns `true` if takt works by the values that a data sheet has for this object: identity, SYNC, error control, PDOs, modes and units.
/// What cannot be read of any other object does not matter.
fn is_used(index: u16) -> bool {
    // The objects of each further axis stand 0x800 higher (CiA 402-2).
    let of_first_axis =
        if (0x6000..0xA000).contains(&index) { 0x6000 + (index - 0x6000) % 0x800 } else { index };
    matches!(
        of_first_axis,
        0x1000
            | 0x1005
            | 0x100C
            | 0x100D
            | 0x1016..=0x1018
            | 0x1400..=0x1BFF
            | 0x6502
            | 0x607B
            | 0x608F
            | 0x6092
            | 0x6096
            | 0x60A9
    )
}

/// A problem in the description of an object: of no consequence where takt does not use the object.
pub(super) fn of_object(index: u16, kind: EdsProblemKind) -> EdsProblemKind {
    if is_used(index) { kind } else { EdsProblemKind::Unused { problem: Box::new(kind) } }
}

/// Reads an integer without `$NODEID`; reports a problem otherwise. `of` is the object that it describes.
pub(super) fn whole(
    section: &Section<'_>,
    key: &str,
    of: Option<u16>,
    reporter: &mut Reporter,
) -> Option<i128> {
    let pair = section.get(key)?;
    let number = number::read(pair.value).filter(|parsed| !parsed.number.adds_node);
    let Some(parsed) = number else {
        let kind = not_a_number(pair);
        let kind = match of {
            Some(index) => of_object(index, kind),
            None => kind,
        };
        reporter.report(kind, pair.span.clone());
        return None;
    };
    report_anomaly(parsed.anomaly, pair, reporter);
    Some(parsed.number.constant)
}

/// Reads the value of a pair for an entry of this type.
pub(super) fn value(
    pair: &Pair<'_>,
    data_type: Option<DataTypeCode>,
    reporter: &mut Reporter,
) -> Option<LocatedValue> {
    let read = value_or_problem(pair, data_type, reporter);
    read.map_err(|kind| reporter.report(kind, pair.span.clone())).ok()
}

fn value_or_problem(
    pair: &Pair<'_>,
    data_type: Option<DataTypeCode>,
    reporter: &mut Reporter,
) -> Result<LocatedValue, EdsProblemKind> {
    let key = pair.key.to_owned();
    Err(match (Value::read(pair.value, data_type), data_type) {
        (Ok((value, anomaly)), _) => {
            report_anomaly(anomaly, pair, reporter);
            let line = reporter.line_of(pair.span.start);
            return Ok(LocatedValue { value, line, span: pair.span.clone() });
        }
        (Err(ValueError::OutOfRange { value }), Some(data_type)) => {
            EdsProblemKind::DoesNotFit { key, value, data_type }
        }
        (Err(ValueError::NotBytes), _) => EdsProblemKind::NotBytes { key, given: pair.value.to_owned() },
        (Err(_), _) => not_a_number(pair),
    })
}

fn not_a_number(pair: &Pair<'_>) -> EdsProblemKind {
    EdsProblemKind::NotANumber { key: pair.key.to_owned(), given: pair.value.to_owned() }
}

fn report_anomaly(anomaly: Option<Anomaly>, pair: &Pair<'_>, reporter: &mut Reporter) {
    if let Some(anomaly) = anomaly {
        reporter.report(
            EdsProblemKind::NumberAnomaly { given: pair.value.to_owned(), anomaly },
            pair.span.clone(),
        );
    }
}

/// The object; its sub-index 0 is a count.
const CONSUMER_HEARTBEAT: u16 = 0x1016;
/// The lowest value of 1016:01 that has a node ID (CiA 301, 7.5.2.13).
const NODE_IN_HEARTBEAT: i128 = 0x1_0000;

/// A limit, and where it is.
type PlacedLimit = (Value, Range<usize>);

/// The limits as numbers for node 1, and the place of the upper one.
fn numbers_of(low: Option<&PlacedLimit>, high: Option<&PlacedLimit>) -> Option<(i128, i128, Range<usize>)> {
    let ((low, _), (high, span)) = low.zip(high)?;
    Some((low.number(Some(1))?, high.number(Some(1))?, span.clone()))
}

struct Reader<'s, 't, 'r> {
    section: &'s Section<'t>,
    context: Context,
    reporter: &'r mut Reporter,
}

impl Reader<'_, '_, '_> {
    fn name(&mut self) -> String {
        check_keys(self.section, &KEYS, self.reporter);
        match self.section.get("ParameterName") {
            Some(pair) => pair.value.to_owned(),
            None => {
                self.missing("ParameterName", "it has no name".to_owned());
                String::new()
            }
        }
    }

    fn data_type(&mut self) -> Option<DataTypeCode> {
        let Some(pair) = self.section.get("DataType") else {
            let ObjectAddress { index, subindex } = self.context.address;
            let data_type = DataTypeCode::of_standard_object(index, subindex).or(self.context.usual_type);
            let repair = match data_type {
                Some(data_type) => format!("it was read as {data_type}"),
                None => "its type is unknown, so it can be neither written nor mapped".to_owned(),
            };
            self.missing("DataType", repair);
            return data_type;
        };
        if let Some(data_type) = DataTypeCode::from_name(pair.value) {
            self.reporter.report(EdsProblemKind::NamedDataType { data_type }, pair.span.clone());
            return Some(data_type);
        }
        let number = number::read(pair.value).filter(|parsed| !parsed.number.adds_node);
        let code = number.as_ref().and_then(|parsed| u16::try_from(parsed.number.constant).ok());
        let Some(code) = code.filter(|code| *code > 0) else {
            let ObjectAddress { index, subindex } = self.context.address;
            let kind = EdsProblemKind::UnknownDataType { given: pair.value.to_owned() };
            self.reporter.report(of_object(index, kind), pair.span.clone());
            return DataTypeCode::of_standard_object(index, subindex);
        };
        report_anomaly(number.and_then(|parsed| parsed.anomaly), pair, self.reporter);
        Some(DataTypeCode(code))
    }

    fn access(&mut self) -> AccessType {
        let Some(pair) = self.section.get("AccessType") else {
            self.missing("AccessType", "it was read as ro".to_owned());
            return AccessType::ReadOnly;
        };
        AccessType::from_word(pair.value).unwrap_or_else(|| {
            let kind = EdsProblemKind::UnknownWord {
                key: pair.key.to_owned(),
                given: pair.value.to_owned(),
                repair: "it was read as ro; allowed: ro, wo, rw, rwr, rww, const",
            };
            self.reporter.report(kind, pair.span.clone());
            AccessType::ReadOnly
        })
    }

    fn default_value(&mut self, data_type: Option<DataTypeCode>) -> Option<LocatedValue> {
        let pair = self.section.get("DefaultValue")?;
        let read = value_or_problem(pair, data_type, self.reporter);
        read.map_err(|kind| {
            self.reporter.report(of_object(self.context.address.index, kind), pair.span.clone())
        })
        .ok()
    }

    fn whole(&mut self, key: &str) -> Option<i128> {
        whole(self.section, key, Some(self.context.address.index), self.reporter)
    }

    /// Reads the limits. Wrong limits are dropped, because limits only lead to warnings.
    fn limits(&mut self, data_type: Option<DataTypeCode>) -> (Option<Value>, Option<Value>) {
        let low = self.limit("LowLimit", data_type);
        let high = self.limit("HighLimit", data_type);
        let numbers = numbers_of(low.as_ref(), high.as_ref());
        if let Some((low, high, span)) = numbers.filter(|(low, high, _)| low > high) {
            let reason = format!("the lower limit {low} is above the upper limit {high}");
            self.reporter.report(EdsProblemKind::BadLimit { reason }, span);
            return (None, None);
        }
        if let Some((_, high, span)) = numbers_of(low.as_ref(), high.as_ref())
            .filter(|(_, high, _)| self.is_heartbeat_consumer() && (1..NODE_IN_HEARTBEAT).contains(high))
        {
            let reason = format!("the upper limit {high} leaves no room for the node ID in bits 16 to 22");
            self.reporter.report(EdsProblemKind::BadLimit { reason }, span);
            return (low.map(|(low, _)| low), None);
        }
        (low.map(|(low, _)| low), high.map(|(high, _)| high))
    }

    fn is_heartbeat_consumer(&self) -> bool {
        self.context.address.index == CONSUMER_HEARTBEAT && self.context.address.subindex > 0
    }

    fn limit(&mut self, key: &str, data_type: Option<DataTypeCode>) -> Option<PlacedLimit> {
        let pair = self.section.get(key)?;
        let reason = match Value::read(pair.value, data_type) {
            Ok((value, anomaly)) => {
                report_anomaly(anomaly, pair, self.reporter);
                return Some((value, pair.span.clone()));
            }
            Err(ValueError::OutOfRange { value }) => {
                let type_name = data_type.map_or_else(String::new, |data_type| data_type.to_string());
                format!("`{}` is {value}, which {type_name} cannot be", pair.key)
            }
            Err(_) => format!("`{}` is no value of the object's type: {:?}", pair.key, pair.value),
        };
        self.reporter.report(EdsProblemKind::BadLimit { reason }, pair.span.clone());
        None
    }

    fn check_limits(
        &mut self,
        key: &str,
        stated: Option<&LocatedValue>,
        low: Option<&Value>,
        high: Option<&Value>,
    ) {
        let number = |value: Option<&Value>| value.and_then(|value| value.number(None));
        let Some(stated) = stated else { return };
        let (Some(value), Some(low), Some(high)) = (stated.value.number(None), number(low), number(high))
        else {
            return;
        };
        // Tools write 0 and 0 when there are no limits.
        if (low, high) != (0, 0) && !(low..=high).contains(&value) {
            let kind = EdsProblemKind::OutsideLimits { key: key.to_owned(), value, low, high };
            self.reporter.report(kind, stated.span.clone());
        }
    }

    fn missing(&mut self, key: &'static str, repair: String) {
        let object = self.context.address.to_string();
        self.reporter.report(EdsProblemKind::MissingKey { key, object, repair }, self.section.header.clone());
    }
}
