//! Frames that are as long as their content can make them.

use takt_rt::{Frame, FrameKind, Id};
use takt_wire::frame_time::{BitRates, FrameShape, worst_case_bits};
use takt_wire::wire_length::WireLength;

/// Runs of four equal bits, shifted, and runs of five: what needs the most stuff bits depends on the bits before.
const PATTERNS: [u8; 12] = [0x0F, 0x1E, 0x3C, 0x78, 0xF0, 0xE1, 0xC3, 0x87, 0x00, 0xFF, 0x07, 0xF8];

fn frame(id: Id, kind: FrameKind, bytes: &[u8]) -> Frame {
    match kind {
        FrameKind::Data => Frame::data(id, bytes),
        FrameKind::Remote => Frame::remote(id, bytes.len() as u8),
        FrameKind::Fd => Frame::fd(id, bytes, false),
        FrameKind::FdBitRateSwitch => Frame::fd(id, bytes, true),
    }
    .unwrap()
}

fn bits(frame: &Frame) -> u32 {
    let length = WireLength::of(frame);
    length.nominal_bits + length.data_bits
}

/// A frame of nearly the greatest length that this identifier, kind and number of bytes can have: the best of the
/// patterns, with the byte that suits best at the end and so in the CRC.
pub fn longest(id: Id, kind: FrameKind, length: usize) -> Frame {
    let with_last = |pattern: u8, last: u8| {
        let mut bytes = [pattern; Frame::MAX_BYTES];
        if let Some(byte) = length.checked_sub(1).and_then(|at| bytes.get_mut(at)) {
            *byte = last;
        }
        frame(id, kind, &bytes[..length])
    };
    let all = PATTERNS.into_iter().flat_map(|pattern| (0..=255).map(move |last| with_last(pattern, last)));
    all.max_by_key(bits).unwrap()
}

/// The longest that the arithmetic allows for a frame.
pub fn bound_ns(frame: &Frame, rates: BitRates) -> u64 {
    let (kind, is_extended) = (frame.kind(), frame.id().is_extended());
    rates.duration_ns(worst_case_bits(FrameShape { kind, is_extended, length: frame.length() }))
}

#[test]
fn payloads_exist_that_bring_a_frame_close_to_its_worst_case() {
    let mut shapes: Vec<(FrameKind, usize)> = (1..=8).map(|length| (FrameKind::Data, length)).collect();
    for length in [1, 8, 16, 32, 64] {
        shapes.extend([(FrameKind::Fd, length), (FrameKind::FdBitRateSwitch, length)]);
    }
    for (kind, length) in shapes {
        for id in [Id::canopen(0x180, 1), Id::canopen(0x200, 127), Id::extended(0x1E1E_1E1E).unwrap()] {
            let frame = longest(id, kind, length);
            let worst = worst_case_bits(FrameShape { kind, is_extended: id.is_extended(), length });
            let (actual, worst) = (bits(&frame), worst.nominal + worst.data);
            assert!(
                actual <= worst && actual * 100 >= worst * 90,
                "{id:?} {kind:?} {length}: {actual} of {worst}"
            );
        }
    }
}
