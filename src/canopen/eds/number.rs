//! Whole numbers as files write them, with the node number as a possible summand.

/// A whole number, to which the device's node number may have to be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// What the file says without the node number.
    pub constant: i128,
    /// Whether `$NODEID` is a summand.
    pub adds_node: bool,
}

impl Number {
    /// A number that does not depend on the node.
    pub const fn constant(constant: i128) -> Self {
        Self { constant, adds_node: false }
    }

    /// The number for a node; `None` when it depends on the node and none is given.
    pub fn at(self, node: Option<u8>) -> Option<i128> {
        match (self.adds_node, node) {
            (false, _) => Some(self.constant),
            (true, Some(node)) => Some(self.constant + i128::from(node)),
            (true, None) => None,
        }
    }
}

/// A number that was read, and what is odd about the way it is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    pub number: Number,
    pub oddity: Option<Oddity>,
    /// Whether it is written in hexadecimal, and so may be meant as a pattern of bits.
    pub is_pattern: bool,
}

/// A spelling that is repaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oddity {
    /// A leading zero makes it octal, which is another number than its digits in decimal.
    Octal,
    /// A leading zero before digits that octal does not have: it is taken as decimal.
    NotOctal,
    /// `200h` for 0x200.
    Suffix,
    /// `NODEID` without its dollar sign.
    NoDollar,
    /// Something behind a semicolon.
    Comment,
    /// `true` or `false`, `yes` or `no`.
    Word,
}

/// Reads a sum of numbers and at most one `$NODEID`; `None` when the text is something else.
pub(super) fn read(text: &str) -> Option<Reading> {
    let (sum, mut oddity) = match text.split_once(';') {
        Some((sum, _)) => (sum, Some(Oddity::Comment)),
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
        oddity = oddity.or(term.oddity);
        is_pattern |= term.is_pattern && !is_negative;
        match (term.number.adds_node, is_negative) {
            (true, true) => return None,
            (true, false) if number.adds_node => return None,
            (true, false) => number.adds_node = true,
            (false, true) => number.constant -= term.number.constant,
            (false, false) => number.constant += term.number.constant,
        }
        if tail.is_empty() {
            return Some(Reading { number, oddity, is_pattern });
        }
        is_negative = tail.starts_with('-');
        rest = tail.get(1..)?.trim_start();
    }
}

fn read_term(term: &str) -> Option<Reading> {
    let of = |constant: u64, oddity, is_pattern| {
        Some(Reading { number: Number::constant(constant.into()), oddity, is_pattern })
    };
    let lower = term.to_ascii_lowercase();
    let node = |oddity| {
        let number = Number { constant: 0, adds_node: true };
        Some(Reading { number, oddity, is_pattern: false })
    };
    match lower.as_str() {
        "$nodeid" => return node(None),
        "nodeid" => return node(Some(Oddity::NoDollar)),
        "true" | "yes" => return of(1, Some(Oddity::Word), false),
        "false" | "no" => return of(0, Some(Oddity::Word), false),
        _ => {}
    }
    if let Some(digits) = lower.strip_prefix("0x") {
        return of(digits_in(digits, 16)?, None, true);
    }
    if let Some(digits) = lower.strip_suffix('h') {
        return of(digits_in(digits, 16)?, Some(Oddity::Suffix), true);
    }
    let decimal = digits_in(&lower, 10)?;
    if lower.len() == 1 || !lower.starts_with('0') {
        return of(decimal, None, false);
    }
    match digits_in(&lower, 8) {
        None => of(decimal, Some(Oddity::NotOctal), false),
        Some(octal) => of(octal, (octal != decimal).then_some(Oddity::Octal), false),
    }
}

fn digits_in(digits: &str, radix: u32) -> Option<u64> {
    // The standard library takes a sign too, of which there has been one already.
    digits.chars().all(|c| c.is_digit(radix)).then(|| u64::from_str_radix(digits, radix).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Option<(i128, Option<Oddity>)> {
        read(text).map(|reading| (reading.number.at(Some(5)).unwrap(), reading.oddity))
    }

    #[test]
    fn the_node_number_is_read_in_any_spelling_and_order() {
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
        assert_eq!(value("NODEID+0x80"), Some((0x85, Some(Oddity::NoDollar))));
    }

    #[test]
    fn numbers_are_decimal_hexadecimal_or_octal() {
        assert_eq!(value("42"), Some((42, None)));
        assert_eq!(value("0X2a"), Some((42, None)));
        assert_eq!(value("052"), Some((42, Some(Oddity::Octal))));
        assert_eq!(value("07"), Some((7, None)));
        assert_eq!(value("00"), Some((0, None)));
        assert_eq!(value("089"), Some((89, Some(Oddity::NotOctal))));
        assert_eq!(value("2Ah"), Some((42, Some(Oddity::Suffix))));
        assert_eq!(value("-0x2A"), Some((-42, None)));
        assert_eq!(value("42 ; forty-two"), Some((42, Some(Oddity::Comment))));
        assert_eq!(value("0xFFFFFFFFFFFFFFFF"), Some((u64::MAX.into(), None)));
    }

    #[test]
    fn what_is_no_number_is_none() {
        for text in [
            "",
            "abc",
            "0x",
            "0xG",
            "1.5",
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
