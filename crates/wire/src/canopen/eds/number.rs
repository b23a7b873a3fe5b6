//! Integers in files, with the node ID as a possible summand.

/// An integer, with the device's node ID as an optional summand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The number without the node ID.
    pub constant: i128,
    /// True if `$NODEID` is added.
    pub adds_node: bool,
}

impl Number {
    /// A number that does not depend on the node ID.
    pub const fn constant(constant: i128) -> Self {
        Self { constant, adds_node: false }
    }

    /// The number for a node ID; `None` when it needs a node ID and none is given.
    pub fn at(self, node: Option<u8>) -> Option<i128> {
        match (self.adds_node, node) {
            (false, _) => Some(self.constant),
            (true, Some(node)) => Some(self.constant + i128::from(node)),
            (true, None) => None,
        }
    }
}

/// A parsed number, and the anomaly in its spelling.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ParsedNumber {
    pub number: Number,
    pub anomaly: Option<Anomaly>,
    /// True if it is hexadecimal, so that it may be a bit pattern.
    pub is_pattern: bool,
}

/// An anomaly in the spelling of a number, which is repaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Anomaly {
    /// A leading zero makes it octal, which differs from its decimal parsed.
    Octal,
    /// A leading zero before digits that are not octal: it is read as decimal.
    NotOctal,
    /// `200h` for 0x200.
    Suffix,
    /// `NODEID` without the dollar sign.
    NoDollar,
    /// Text behind a semicolon.
    Comment,
    /// `true` or `false`, `yes` or `no`.
    Word,
    /// A suffix of a C literal: `0x10UL`.
    CSuffix,
    /// A whole number with a decimal point: `100.0`.
    Point,
}

/// Parses a sum of numbers and at most one `$NODEID`; `None` for any other text.
pub(super) fn read(text: &str) -> Option<ParsedNumber> {
    let (sum, mut anomaly) = match text.split_once(';') {
        Some((sum, _)) => (sum, Some(Anomaly::Comment)),
        None => (text, None),
    };
    let mut number = Number::constant(0);
    let mut is_pattern = false;
    let mut rest = sum.trim();
    let mut is_negative = false;
    if let Some(tail) = rest.strip_prefix(['+', '-']) {
        is_negative = rest.starts_with('-');
        rest = tail.trim_start();
    }
    loop {
        let end = rest.find(['+', '-']).unwrap_or(rest.len());
        let (term, tail) = rest.split_at(end);
        let term = read_term(term.trim())?;
        anomaly = anomaly.or(term.anomaly);
        is_pattern |= term.is_pattern && !is_negative;
        match (term.number.adds_node, is_negative) {
            (true, true) => return None,
            (true, false) if number.adds_node => return None,
            (true, false) => number.adds_node = true,
            (false, true) => number.constant -= term.number.constant,
            (false, false) => number.constant += term.number.constant,
        }
        if tail.is_empty() {
            return Some(ParsedNumber { number, anomaly, is_pattern });
        }
        is_negative = tail.starts_with('-');
        rest = tail.get(1..)?.trim_start();
    }
}

fn read_term(term: &str) -> Option<ParsedNumber> {
    let of = |constant: u64, anomaly, is_pattern| {
        Some(ParsedNumber { number: Number::constant(constant.into()), anomaly, is_pattern })
    };
    let lower = term.to_ascii_lowercase();
    if let Some(literal) = without_c_suffix(&lower) {
        return Some(ParsedNumber { anomaly: Some(Anomaly::CSuffix), ..read_term(literal)? });
    }
    let node = |anomaly| {
        let number = Number { constant: 0, adds_node: true };
        Some(ParsedNumber { number, anomaly, is_pattern: false })
    };
    match lower.as_str() {
        "$nodeid" => return node(None),
        "nodeid" => return node(Some(Anomaly::NoDollar)),
        "true" | "yes" => return of(1, Some(Anomaly::Word), false),
        "false" | "no" => return of(0, Some(Anomaly::Word), false),
        _ => {}
    }
    if let Some(digits) = lower.strip_prefix("0x") {
        return of(digits_in(digits, 16)?, None, true);
    }
    if let Some(digits) = lower.strip_suffix('h') {
        return of(digits_in(digits, 16)?, Some(Anomaly::Suffix), true);
    }
    if let Some(whole) = without_zero_fraction(&lower) {
        return of(digits_in(whole, 10)?, Some(Anomaly::Point), false);
    }
    let decimal = digits_in(&lower, 10)?;
    if lower.len() == 1 || !lower.starts_with('0') {
        return of(decimal, None, false);
    }
    match digits_in(&lower, 8) {
        None => of(decimal, Some(Anomaly::NotOctal), false),
        Some(octal) => of(octal, (octal != decimal).then_some(Anomaly::Octal), false),
    }
}

/// The literal without the suffix of an integer in C (ISO/IEC 9899, 6.4.4.1); `None` if it has none.
fn without_c_suffix(literal: &str) -> Option<&str> {
    let digits = literal.trim_end_matches(['u', 'l']);
    let is_number = digits.starts_with(|first: char| first.is_ascii_digit());
    (is_number && (1..=3).contains(&(literal.len() - digits.len()))).then_some(digits)
}

/// The whole part of a decimal number whose fraction is zero.
fn without_zero_fraction(text: &str) -> Option<&str> {
    let (whole, fraction) = text.split_once('.')?;
    (!whole.is_empty() && fraction.bytes().all(|digit| digit == b'0')).then_some(whole)
}

fn digits_in(digits: &str, radix: u32) -> Option<u64> {
    // The standard library would accept another sign here.
    digits.chars().all(|c| c.is_digit(radix)).then(|| u64::from_str_radix(digits, radix).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Option<(i128, Option<Anomaly>)> {
        read(text).map(|parsed| (parsed.number.at(Some(5)).unwrap(), parsed.anomaly))
    }

    #[test]
    fn the_node_id_is_parsed_in_any_spelling_and_order() {
        for text in [
            "$NODEID+0x200",
            "0x200+$NODEID",
            "$nodeid + 0x200",
            "512 + $NodeID",
            " $NodeId+01000 ",
            "0x100+$NODEID+0x100",
        ] {
            assert_eq!(value(text).map(|(number, _)| number), Some(0x205), "{text}");
        }
        assert_eq!(value("$NODEID"), Some((5, None)));
        assert_eq!(value("$NODEID-1"), Some((4, None)));
        assert_eq!(value("NODEID+0x80"), Some((0x85, Some(Anomaly::NoDollar))));
    }

    #[test]
    fn numbers_are_decimal_hexadecimal_or_octal() {
        assert_eq!(value("42"), Some((42, None)));
        assert_eq!(value("0X2a"), Some((42, None)));
        assert_eq!(value("052"), Some((42, Some(Anomaly::Octal))));
        assert_eq!(value("07"), Some((7, None)));
        assert_eq!(value("00"), Some((0, None)));
        assert_eq!(value("089"), Some((89, Some(Anomaly::NotOctal))));
        assert_eq!(value("2Ah"), Some((42, Some(Anomaly::Suffix))));
        assert_eq!(value("-0x2A"), Some((-42, None)));
        assert_eq!(value("0x2AuL"), Some((42, Some(Anomaly::CSuffix))));
        assert_eq!(value("42l"), Some((42, Some(Anomaly::CSuffix))));
        assert_eq!(value("42.00"), Some((42, Some(Anomaly::Point))));
        assert_eq!(value("42 ; forty-two"), Some((42, Some(Anomaly::Comment))));
        assert_eq!(value("0xFFFFFFFFFFFFFFFF"), Some((u64::MAX.into(), None)));
    }

    #[test]
    fn other_texts_are_not_numbers() {
        for text in [
            "",
            "abc",
            "0x",
            "0xG",
            "1.5",
            ".0",
            "ul",
            "1ulul",
            "0x1.0",
            "$NODE+1",
            "-$NODEID",
            "$NODEID+$NODEID",
            "1 2",
            "+",
            "1+",
            "--1",
            "0x1FFFFFFFFFFFFFFFF",
            "12€",
        ] {
            assert_eq!(value(text), None, "{text}");
        }
    }
}
