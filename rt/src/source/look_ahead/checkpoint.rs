//! The state of a stream as bytes, and back.

extern crate alloc;

use alloc::vec::Vec;

use super::{LookAhead, POINTS_AT_MOST, Playback};
use crate::checkpoint::CheckpointError;
use crate::source::axis_piece::AxisPiece;
use crate::source::delay::DelayEstimator;
use crate::source::target::{StreamCounts, StreamPoint};
use crate::time::Nanoseconds;

/// What changes while a stream is used, with its points in the order of their stamps.
#[derive(bitcode::Encode, bitcode::Decode)]
struct State<const AXES: usize> {
    points: Vec<StreamPoint<AXES>>,
    delay: DelayEstimator,
    playback: Playback,
    sampled_ns: Option<Nanoseconds>,
    arrived_ns: Nanoseconds,
    judged_ns: Option<Nanoseconds>,
    open_chunk_ns: Option<Nanoseconds>,
    counts: StreamCounts,
    revision: u64,
    pieces: Vec<AxisPiece>,
    pieces_of: Option<(u64, Nanoseconds)>,
}

impl<const AXES: usize, P> LookAhead<AXES, P>
where
    P: AsRef<[StreamPoint<AXES>]> + AsMut<[StreamPoint<AXES>]>,
{
    /// The state between two samples.
    pub fn checkpoint(&self) -> Vec<u8> {
        bitcode::encode(&State {
            points: (0..self.count).filter_map(|index| self.point(index).copied()).collect(),
            delay: self.delay.clone(),
            playback: self.playback,
            sampled_ns: self.sampled_ns,
            arrived_ns: self.arrived_ns,
            judged_ns: self.judged_ns,
            open_chunk_ns: self.open_chunk_ns,
            counts: self.counts,
            revision: self.revision,
            pieces: self.pieces.to_vec(),
            pieces_of: self.pieces_of,
        })
    }

    /// Takes over the state of a stream of the same axes, and goes on from there. The limits and the delay that it was made with
    /// stay.
    ///
    /// # Errors
    /// See [`CheckpointError`]. Nothing has changed then.
    pub fn resume(&mut self, checkpoint: &[u8]) -> Result<(), CheckpointError> {
        let state: State<AXES> = bitcode::decode(checkpoint)?;
        let pieces: [AxisPiece; AXES] = state.pieces.try_into().map_err(|_| CheckpointError::OtherMachine)?;
        if state.points.len() > self.capacity || !state.points.is_sorted_by_key(|point| point.at_ns) {
            return Err(CheckpointError::Unreadable);
        }
        self.count = state.points.len();
        self.stamps_ns = [0; POINTS_AT_MOST];
        self.places = core::array::from_fn(|place| place as u16);
        let storage = self.points.as_mut().iter_mut().zip(&mut self.stamps_ns);
        for ((place, stamp_ns), point) in storage.zip(&state.points) {
            (*place, *stamp_ns) = (*point, point.at_ns);
        }
        self.delay = state.delay.with_parameters_of(&self.delay);
        self.playback = state.playback;
        self.sampled_ns = state.sampled_ns;
        self.arrived_ns = state.arrived_ns;
        self.judged_ns = state.judged_ns;
        self.open_chunk_ns = state.open_chunk_ns;
        self.counts = state.counts;
        self.revision = state.revision;
        (self.pieces, self.pieces_of) = (pieces, state.pieces_of);
        Ok(())
    }
}
