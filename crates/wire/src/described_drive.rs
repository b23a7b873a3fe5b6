//! The drive that a quirk file or a description of bit fields is about, and how well it is known.

/// The drive that a file is about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DescribedDrive {
    /// The vendor, for people.
    pub vendor: String,
    /// The product, for people.
    pub product: String,
    /// Whether it was tried.
    pub confirmation: Confirmation,
    /// The documents that it was taken from.
    pub sources: Vec<String>,
}

/// Whether anybody has tried what a file says of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Confirmation {
    /// It comes from documents alone.
    #[default]
    DataSheetOnly,
    /// A real drive has shown it.
    TriedOnHardware,
}

impl Confirmation {
    /// For people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DataSheetOnly => "from its data sheet, not tried on hardware",
            Self::TriedOnHardware => "tried on hardware",
        }
    }
}
