//! Decodes a file to text: the encodings and line ends that occur in practice.

use crate::printable::printable;

/// Decodes a file. The standard requires ASCII. UTF-8 (with or without byte order mark), UTF-16 (with byte order mark)
/// and Latin-1 also occur. Characters that are unsafe on a terminal are replaced. Every line of the result ends with a
/// line feed, with or without a carriage return before it.
pub(super) fn decode(bytes: &[u8]) -> String {
    let text = match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8_or_latin1(rest),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => utf8_or_latin1(bytes),
    };
    // Old editors end files with a zero or Ctrl-Z.
    let text = text.trim_end_matches(['\0', '\x1A']);
    printable(&if text.contains('\n') { text.to_owned() } else { text.replace('\r', "\n") })
}

fn utf8_or_latin1(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).filter_map(|pair| Some(unit(pair.try_into().ok()?)));
    char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn every_supported_encoding_gives_the_same_text() {
        let wanted = "[1000]\nDescription=90 °C";
        let utf16: Vec<u8> = wanted.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(decode(wanted.as_bytes()), wanted);
        assert_eq!(decode(&[b"\xEF\xBB\xBF", wanted.as_bytes()].concat()), wanted);
        assert_eq!(decode(b"[1000]\nDescription=90 \xB0C"), wanted);
        assert_eq!(decode(&[&[0xFF, 0xFE][..], &utf16].concat()), wanted);
        assert_eq!(decode(b"[1000]\rDescription=90 \xB0C\0\x1A"), wanted);
    }
}
