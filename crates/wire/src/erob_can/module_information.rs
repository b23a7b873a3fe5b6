//! What a module tells of itself (eRunner manual 7.5.3): serial number, model, hardware and module version.

use std::fmt;

/// The numbers of which the texts are made, as they are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModuleNumbers {
    /// 0x0001:3, hardware version.
    pub hardware_version: u32,
    /// 0x0232:1, serial counter.
    pub serial_counter: u32,
    /// 0x0232:2, model information A.
    pub model_a: u32,
    /// 0x0232:5, model information B.
    pub model_b: u32,
    /// 0x0232:6, hardware change identifier.
    pub hardware_change: u32,
    /// 0x0232:7, IO identifier.
    pub io_identifier: u32,
    /// 0x0232:8, module version.
    pub module_version: u32,
}

/// A field of a number that stands in no table of the manual. Nothing is guessed for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownField {
    /// Its name.
    pub field: &'static str,
    /// Its value.
    pub value: u8,
}

impl std::error::Error for UnknownField {}

impl fmt::Display for UnknownField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the manual knows no {} {}", self.field, self.value)
    }
}

impl ModuleNumbers {
    /// The serial number: the outer diameter in three digits, and the serial counter in eight.
    ///
    /// # Errors
    /// The outer diameter is not in the manual's table.
    pub fn serial_number(&self) -> Result<String, UnknownField> {
        Ok(format!("{:0>3}{:08}", self.outer_diameter()?, self.serial_counter))
    }

    /// The model number, as it is ordered: `eRob70H100I-BM-18EN`.
    ///
    /// # Errors
    /// A field is not in the manual's tables.
    pub fn model_number(&self) -> Result<String, UnknownField> {
        Ok(format!(
            "eRob{}{}{}{}-{}{}-18{}{}",
            self.outer_diameter()?,
            pick("reducer type", self.model_b, 20, &["F", "H"])?,
            pick("gear ratio", self.model_a, 12, &["50", "80", "100", "120", "160"])?,
            pick("mounting type", self.model_b, 24, &["I", "T", "BI", "BT"])?,
            pick("brake", self.model_b, 16, &["F", "B"])?,
            pick("output encoder", self.model_b, 0, &["S", "M", "HS", "HM"])?,
            pick("communication", self.model_b, 8, &["E", "C"])?,
            pick("torque sensor", self.model_b, 4, &["N", "T"])?,
        ))
    }

    /// The hardware version: `1005_1_1`.
    pub fn hardware_version(&self) -> String {
        format!("{}_{}_{}", self.hardware_version, self.hardware_change, self.io_identifier)
    }

    /// The module version: `MC2A.BC.DE`.
    ///
    /// # Errors
    /// A field is not in the manual's tables.
    pub fn module_version(&self) -> Result<String, UnknownField> {
        let field = |name, shift, names| pick(name, self.module_version, shift, names);
        Ok(format!(
            "MC{}{}.{}{}.{}{}",
            field("motor version", 0, &["1", "2"])?,
            field("motor housing version", 4, &["A", "B", "C", "D", "E"])?,
            field("visible mechanical version", 8, &HEXADECIMAL)?,
            field("reducer version", 12, &["A", "B", "C", "c", "D", "d", "E", "e"])?,
            field("driver version", 16, &HEXADECIMAL)?,
            field("hidden mechanical version", 20, &["A", "B", "C", "D", "E"])?,
        ))
    }

    fn outer_diameter(&self) -> Result<&'static str, UnknownField> {
        pick("outer diameter", self.model_a, 16, &["70", "80", "90", "110", "142", "170", "70", "70"])
    }
}

const HEXADECIMAL: [&str; 14] = ["1", "2", "3", "4", "5", "6", "7", "8", "9", "A", "B", "C", "D", "E"];

/// The text of the four bits from `shift` on: 1 is the first.
fn pick(
    field: &'static str,
    number: u32,
    shift: u32,
    names: &[&'static str],
) -> Result<&'static str, UnknownField> {
    let value = (number >> shift & 0xF) as u8;
    let name = usize::from(value).checked_sub(1).and_then(|place| names.get(place));
    name.copied().ok_or(UnknownField { field, value })
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: ModuleNumbers = ModuleNumbers {
        hardware_version: 1005,
        serial_counter: 0x457,
        model_a: 0x0001_3000,
        model_b: 0x0122_0112,
        hardware_change: 1,
        io_identifier: 1,
        module_version: 0x005D_3B12,
    };

    #[test]
    fn the_examples_of_the_manual_are_decoded() {
        assert_eq!(EXAMPLE.serial_number().as_deref(), Ok("07000001111"));
        assert_eq!(EXAMPLE.model_number().as_deref(), Ok("eRob70H100I-BM-18EN"));
        assert_eq!(EXAMPLE.hardware_version(), "1005_1_1");
        assert_eq!(EXAMPLE.module_version().as_deref(), Ok("MC2A.BC.DE"));
    }

    #[test]
    fn a_value_beyond_the_tables_is_named_and_not_guessed() {
        let of = |model_a| ModuleNumbers { model_a, ..EXAMPLE };
        let unknown = |field, value| Err(UnknownField { field, value });
        assert_eq!(of(0x0009_3000).serial_number(), unknown("outer diameter", 9));
        assert_eq!(of(0x0001_0000).model_number(), unknown("gear ratio", 0));
        assert_eq!(of(0x0004_3000).serial_number().as_deref(), Ok("11000001111"));
    }
}
