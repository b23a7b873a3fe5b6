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
    let default = reader.value("DefaultValue", data_type);
    let configured = reader.value("ParameterValue", data_type);
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

/// Reads an integer without `$NODEID`; reports a problem otherwise.
pub(super) fn whole(section: &Section<'_>, key: &str, reporter: &mut Reporter) -> Option<i128> {
    let pair = section.get(key)?;
    let number = number::read(pair.value).filter(|parsed| !parsed.number.adds_node);
    let Some(parsed) = number else {
        reporter.report(not_a_number(pair), pair.span.clone());
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
    let key = pair.key.to_owned();
    let kind = match (Value::read(pair.value, data_type), data_type) {
        (Ok((value, anomaly)), _) => {
            report_anomaly(anomaly, pair, reporter);
            let line = reporter.line_of(pair.span.start);
            return Some(LocatedValue { value, line, span: pair.span.clone() });
        }
        (Err(ValueError::OutOfRange { value }), Some(data_type)) => {
            EdsProblemKind::DoesNotFit { key, value, data_type }
        }
        (Err(ValueError::NotBytes), _) => EdsProblemKind::NotBytes { key, given: pair.value.to_owned() },
        (Err(_), _) => not_a_number(pair),
    };
    reporter.report(kind, pair.span.clone());
    None
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
            let kind = EdsProblemKind::UnknownDataType { given: pair.value.to_owned() };
            self.reporter.report(kind, pair.span.clone());
            return None;
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

    fn value(&mut self, key: &str, data_type: Option<DataTypeCode>) -> Option<LocatedValue> {
        value(self.section.get(key)?, data_type, self.reporter)
    }

    fn whole(&mut self, key: &str) -> Option<i128> {
        whole(self.section, key, self.reporter)
    }

    /// Reads the limits. Wrong limits are dropped, because limits only lead to warnings.
    fn limits(&mut self, data_type: Option<DataTypeCode>) -> (Option<Value>, Option<Value>) {
        let low = self.limit("LowLimit", data_type);
        let high = self.limit("HighLimit", data_type);
        let numbers = low.as_ref().zip(high.as_ref()).and_then(|((low, _), (high, span))| {
            Some((low.number(Some(1))?, high.number(Some(1))?, span.clone()))
        });
        if let Some((low, high, span)) = numbers.filter(|(low, high, _)| low > high) {
            let reason = format!("the lower limit {low} is above the upper limit {high}");
            self.reporter.report(EdsProblemKind::BadLimit { reason }, span);
            return (None, None);
        }
        (low.map(|(low, _)| low), high.map(|(high, _)| high))
    }

    fn limit(&mut self, key: &str, data_type: Option<DataTypeCode>) -> Option<(Value, Range<usize>)> {
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
