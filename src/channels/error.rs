//! The error of a channel.

/// Why a request or frame was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelError {
    /// The channel is full: the real-time thread does not run, or gets too much.
    #[error("the channel to the real-time thread is full")]
    Full,
    /// No stream takes points.
    #[error("no stream is running")]
    NotStreaming,
    /// No bus has this number.
    #[error("there is no bus {bus}: the controller has {buses} buses")]
    NoSuchBus {
        /// The number of the bus.
        bus: usize,
        /// The number of buses.
        buses: usize,
    },
}
