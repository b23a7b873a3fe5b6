//! The frame lengths of the simulation against the worst case of the bus load calculation.
//! The two calculations are independent.

use proptest::prelude::*;
use takt_rt::{Frame, Id};
use takt_wire::frame_time::{FrameShape, worst_case_bits};
use takt_wire::wire_length::WireLength;

fn identifiers() -> impl Strategy<Value = Id> {
    prop_oneof![
        (0u32..0x800).prop_map(|id| Id::base(id).unwrap()),
        (0u32..1 << 29).prop_map(|id| Id::extended(id).unwrap()),
    ]
}

proptest! {
    #[test]
    fn no_frame_is_longer_than_its_worst_case(
        id in identifiers(), kind in 0u8..4, length in 0usize..16, bytes: [u8; 64], is_plain: bool, plain: u8,
    ) {
        let bytes = if is_plain { [plain; 64] } else { bytes };
        let frame = match kind {
            0 => Frame::data(id, &bytes[..length.min(8)]),
            1 => Frame::remote(id, length.min(8) as u8),
            _ => {
                let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
                Frame::fd(id, &bytes[..lengths[length]], kind == 3)
            }
        };
        let frame = frame.unwrap();
        let shape =
            FrameShape { kind: frame.kind(), is_extended: id.is_extended(), length: frame.length() };
        let (worst, actual) = (worst_case_bits(shape), WireLength::of(&frame));
        prop_assert!(actual.nominal_bits <= worst.nominal, "{actual:?} {worst:?}");
        prop_assert!(actual.data_bits <= worst.data, "{actual:?} {worst:?}");
    }
}
