//! Layer setting services (CiA 305): giving a device its node number and bit rate over the bus, by its identity.
//!
//! [`LssRequest`] and [`LssResponse`] are what is on the wire; both sides can be written with them. [`LssMaster`] carries
//! out one [`LssTask`] at a time, without input and output; finding a device whose identity nobody knows
//! ([`LssTask::FastScan`]) is in `fast_scan`.
//!
//! A device without a node number is silent: it sends no boot-up and no heartbeat until it has one. That there are such
//! devices is asked with [`LssTask::IdentifyUnconfigured`]. A device boots as soon as it is given a node number and
//! switched to waiting; a device that had another one before keeps it until it is reset.

mod fast_scan;
mod master;
mod wire;

pub use fast_scan::Known;
pub use master::{LssBusy, LssError, LssMaster, LssOutcome, LssTask, LssTiming};
pub use wire::{BitTiming, Inquiry, LssMode, LssRequest, LssResponse, LssResult};

/// What LSS knows a device by: the four values of object 1018, together unique in the world.
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
    /// The four values in their order.
    pub const fn values(self) -> [u32; 4] {
        [self.vendor, self.product, self.revision, self.serial]
    }

    /// From the four values in their order.
    pub const fn from_values([vendor, product, revision, serial]: [u32; 4]) -> Self {
        Self { vendor, product, revision, serial }
    }
}
