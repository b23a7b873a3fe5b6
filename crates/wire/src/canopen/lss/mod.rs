//! Layer setting services (CiA 305): configure the node ID and bit rate of a device over the bus, by its identity.
//!
//! [`LssRequest`] and [`LssResponse`] are the messages; both sides can be written with them. [`LssMaster`] runs one
//! [`LssTask`] at a time, without input and output. [`LssTask::FastScan`] finds a device with an unknown identity.
//!
//! A device without a node ID sends neither boot-up nor heartbeat. [`LssTask::IdentifyUnconfigured`] asks for such
//! devices. A device boots when it has got a node ID and is switched to waiting state. A device that had another node
//! ID keeps it until it is reset.

mod fast_scan;
mod master;
mod wire;
mod words;

pub use fast_scan::KnownIdentity;
pub use master::{LssBusy, LssError, LssMaster, LssOutcome, LssTask, LssTiming};
pub use wire::{BitTiming, Inquiry, LssMode, LssRequest, LssResponse, LssResult};

/// The LSS address of a device: the four values of object 1018, which are unique together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LssAddress {
    /// 1018:1
    pub vendor: u32,
    /// 1018:2
    pub product: u32,
    /// 1018:3
    pub revision: u32,
    /// 1018:4
    pub serial: u32,
}

impl LssAddress {
    /// The four values in order.
    pub const fn values(self) -> [u32; 4] {
        [self.vendor, self.product, self.revision, self.serial]
    }

    /// The address from the four values in order.
    pub const fn from_values([vendor, product, revision, serial]: [u32; 4]) -> Self {
        Self { vendor, product, revision, serial }
    }
}
