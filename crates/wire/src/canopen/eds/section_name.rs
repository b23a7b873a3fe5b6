//! The meaning of a section by its name.

/// The meaning of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SectionName {
    /// `[1018]`
    Object(u16),
    /// `[1018sub1]`
    SubObject(u16, u8),
    /// `[1018Name]`: names of compact sub-objects.
    Names(u16),
    /// `[1018Value]`: configured values of compact sub-objects.
    Values(u16),
    /// `[1018Denotation]`: the configuration tool's names of compact sub-objects.
    Denotations(u16),
    /// `[1018ObjectLinks]`: not used here.
    ObjectLinks,
    /// A name that begins like an object but is not valid.
    Malformed,
    /// Any other section.
    Other,
}

impl SectionName {
    /// Reads a name, without case and blanks.
    pub fn read(name: &str) -> Self {
        let lower: String =
            name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect();
        let lower = lower.strip_prefix("0x").unwrap_or(&lower);
        let is_index = |text: &str| text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let unknown =
            if lower.starts_with(|c: char| c.is_ascii_digit()) { Self::Malformed } else { Self::Other };
        let (Some(index), Some(suffix)) = (lower.get(..4).filter(|text| is_index(text)), lower.get(4..))
        else {
            return unknown;
        };
        let Ok(index) = u16::from_str_radix(index, 16) else { return unknown };
        match suffix {
            "" => Self::Object(index),
            "name" => Self::Names(index),
            "value" => Self::Values(index),
            "denotation" => Self::Denotations(index),
            "objectlinks" => Self::ObjectLinks,
            _ => match suffix.strip_prefix("sub").filter(|digits| is_index(digits)) {
                Some(digits) => u8::from_str_radix(digits, 16)
                    .map_or(unknown, |subindex| Self::SubObject(index, subindex)),
                None => unknown,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::SectionName::{self, *};

    #[test]
    fn sections_are_recognised_by_index_and_suffix_in_any_case() {
        for (name, expected) in [
            ("1018", Object(0x1018)),
            ("1a00", Object(0x1A00)),
            ("0x1A00", Object(0x1A00)),
            ("1018Sub1", SubObject(0x1018, 1)),
            ("1018sub1F", SubObject(0x1018, 0x1F)),
            ("1018 SUB 0x", Malformed),
            ("1003Name", Names(0x1003)),
            ("1003VALUE", Values(0x1003)),
            ("1003Denotation", Denotations(0x1003)),
            ("1003ObjectLinks", ObjectLinks),
            ("1018sub", Malformed),
            ("1018sub100", Malformed),
            ("10G8", Malformed),
            ("DeadBand", Other),
            ("DeviceInfo", Other),
            ("Überschrift", Other),
        ] {
            assert_eq!(SectionName::read(name), expected, "{name}");
        }
    }
}
