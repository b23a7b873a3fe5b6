//! The error codes that a drive has its own words for, in the metadata of a recording: one a line, `8611 following error`.

/// The key of the metadata of an axis.
pub const OWN_ERRORS: &str = "own_errors";

/// The text for these codes.
pub fn write(own_errors: &[(u16, String)]) -> String {
    let line = |(code, words): &(u16, String)| format!("{code:04X} {}", words.replace(['\n', '\r'], " "));
    own_errors.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The codes of a text. A line that is none is left out.
pub fn read(text: &str, printable: impl Fn(&str) -> String) -> Vec<(u16, String)> {
    let line = |line: &str| {
        let (code, words) = line.split_once(' ')?;
        Some((u16::from_str_radix(code, 16).ok()?, printable(words)))
    };
    text.lines().filter_map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_error_codes_survive_a_recording_and_foreign_lines_are_left_out() {
        let own =
            vec![(0x8611, "following error of the vendor".to_owned()), (0xFF01, "belt\ntorn".to_owned())];
        let text = write(&own);
        let back = read(&text, str::to_owned);
        assert_eq!(back, [own[0].clone(), (0xFF01, "belt torn".to_owned())]);
        assert_eq!(read("no code\n12345 too long\nFF02", str::to_owned), []);
    }
}
