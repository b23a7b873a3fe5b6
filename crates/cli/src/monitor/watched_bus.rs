//! A bus that is watched.

use std::collections::BTreeMap;

use takt_tools::monitor::{BusDecoder, BusStatistics, Decoded};

/// Name, decoder and statistics of a watched bus.
pub struct WatchedBus {
    /// Its name in a configuration, or that of its interface, or that in the log.
    pub name: String,
    pub decoder: BusDecoder,
    pub statistics: BusStatistics,
    /// The frames that were of interest, by identifier: what the last one of each was.
    pub shown: BTreeMap<u64, Decoded>,
}
