//! SDO transfers, byte for byte (CiA 301, 7.2.4).

use super::bench::{Bench, MILLISECOND_NS, NODE, parameters};

const NO_OBJECT: u32 = 0x0602_0000;
const NO_SUBINDEX: u32 = 0x0609_0011;
const READ_ONLY: u32 = 0x0601_0002;
const WRITE_ONLY: u32 = 0x0601_0001;
const TOO_LONG: u32 = 0x0607_0012;
const TOO_SHORT: u32 = 0x0607_0013;
const VALUE: u32 = 0x0609_0030;
const DEVICE_STATE: u32 = 0x0800_0022;
const NOT_MAPPABLE: u32 = 0x0604_0041;
const PDO_TOO_LONG: u32 = 0x0604_0042;

#[test]
fn the_identity_equals_that_of_the_real_unit() {
    let mut bench = Bench::new();
    assert_eq!(bench.sdo([0x40, 0x00, 0x10, 0, 0, 0, 0, 0]), [0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x42, 0x00]);
    assert_eq!(bench.sdo([0x40, 0x18, 0x10, 1, 0, 0, 0, 0]), [0x43, 0x18, 0x10, 1, 0x6F, 0x72, 0x65, 0x5A]);
    assert_eq!(bench.read(0x1018, 2), Ok(0x2648_3052));
    assert_eq!(bench.read(0x1018, 3), Ok(0x0002_0111));
    assert_eq!(bench.read(0x6502, 0), Ok(909));
    assert_eq!(bench.read(0x6076, 0), Ok(31_000));
    assert_eq!(bench.read(0x6075, 0), Ok(6_300));
}

#[test]
fn values_of_one_two_and_four_bytes_are_uploaded_expedited_with_their_size() {
    let mut bench = Bench::new();
    assert_eq!(bench.sdo([0x40, 0x18, 0x10, 0, 0, 0, 0, 0]), [0x4F, 0x18, 0x10, 0, 3, 0, 0, 0]);
    assert_eq!(bench.sdo([0x40, 0x5E, 0x60, 0, 0, 0, 0, 0]), [0x4B, 0x5E, 0x60, 0, 2, 0, 0, 0]);
    assert_eq!(bench.sdo([0x40, 0x81, 0x60, 0, 0, 0, 0, 0]), [0x43, 0x81, 0x60, 0, 0x10, 0x27, 0, 0]);
}

#[test]
fn every_refusal_has_its_own_abort_code() {
    let mut bench = Bench::new();
    assert_eq!(bench.sdo([0x40, 0x72, 0x60, 0, 0, 0, 0, 0]), [0x80, 0x72, 0x60, 0, 0x00, 0x00, 0x02, 0x06]);
    assert_eq!(bench.read(0x605A, 0), Err(NO_OBJECT));
    assert_eq!(bench.read(0x1018, 4), Err(NO_SUBINDEX));
    assert_eq!(bench.write(0x1000, 0, 4, 1), Err(READ_ONLY));
    assert_eq!(bench.read(0x2242, 0), Err(WRITE_ONLY));
    assert_eq!(bench.write(0x6060, 0, 4, 8), Err(TOO_LONG));
    assert_eq!(bench.write(0x6081, 0, 2, 8), Err(TOO_SHORT));
    assert_eq!(bench.write(0x1029, 1, 1, 3), Err(VALUE));
    assert_eq!(bench.write(0x60B2, 0, 2, 3001), Err(VALUE));
    assert_eq!(bench.write(0x60B2, 0, 2, -3000), Ok(()));
    assert_eq!(bench.write(0x1005, 0, 4, 0x2000_0080), Err(VALUE));
    assert_eq!(bench.write(0x1010, 1, 4, 1), Err(0x0800_0020));
    // A download without a size is accepted with the size of the object.
    assert_eq!(bench.sdo([0x22, 0x60, 0x60, 0, 3, 0xFF, 0xFF, 0xFF])[0], 0x60);
    assert_eq!(bench.read(0x6060, 0), Ok(3));
}

#[test]
fn a_segmented_download_is_accepted() {
    let mut bench = Bench::new();
    assert_eq!(bench.sdo([0x21, 0x81, 0x60, 0, 4, 0, 0, 0]), [0x60, 0x81, 0x60, 0, 0, 0, 0, 0]);
    // Two bytes with toggle 0, then the last two with toggle 1.
    assert_eq!(bench.sdo([0x0A, 0x11, 0x22, 0, 0, 0, 0, 0]), [0x20, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.sdo([0x1B, 0x33, 0x44, 0, 0, 0, 0, 0]), [0x30, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.read(0x6081, 0), Ok(0x4433_2211));
}

#[test]
fn segments_with_a_wrong_toggle_bit_or_size_are_refused() {
    let mut bench = Bench::new();
    let toggle = [0x80, 0x81, 0x60, 0, 0x00, 0x00, 0x03, 0x05];
    let command = [0x80, 0, 0, 0, 0x01, 0x00, 0x04, 0x05];
    let begin = [0x21, 0x81, 0x60, 0, 4, 0, 0, 0];
    // The first segment must have toggle 0.
    assert_eq!(bench.sdo(begin)[0], 0x60);
    assert_eq!(bench.sdo([0x17, 1, 2, 3, 4, 0, 0, 0]), toggle);
    // The wrong toggle bit has ended the transfer.
    assert_eq!(bench.sdo([0x07, 0, 0, 0, 4, 0, 0, 0]), command);
    assert_eq!(bench.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]), command);
    // Five bytes and three bytes for an object of four.
    assert_eq!(bench.sdo(begin)[0], 0x60);
    assert_eq!(bench.sdo([0x05, 1, 2, 3, 4, 5, 0, 0])[4..], TOO_LONG.to_le_bytes());
    assert_eq!(bench.sdo(begin)[0], 0x60);
    assert_eq!(bench.sdo([0x09, 1, 2, 3, 0, 0, 0, 0])[4..], TOO_SHORT.to_le_bytes());
    // An impossible size is refused at once.
    assert_eq!(bench.sdo([0x21, 0x81, 0x60, 0, 5, 0, 0, 0])[4..], TOO_LONG.to_le_bytes());
    assert_eq!(bench.read(0x6081, 0), Ok(10_000));
}

#[test]
fn a_segmented_upload_announces_its_size_and_sends_it() {
    let mut segmented = parameters(NODE);
    segmented.quirks.simulated.segments_uploads = true;
    let mut bench = Bench::with(vec![segmented]);
    assert_eq!(bench.sdo([0x40, 0x18, 0x10, 2, 0, 0, 0, 0]), [0x41, 0x18, 0x10, 2, 4, 0, 0, 0]);
    assert_eq!(bench.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]), [0x07, 0x52, 0x30, 0x48, 0x26, 0, 0, 0]);
    assert_eq!(bench.sdo([0x40, 0x18, 0x10, 0, 0, 0, 0, 0]), [0x41, 0x18, 0x10, 0, 1, 0, 0, 0]);
    assert_eq!(bench.sdo([0x70, 0, 0, 0, 0, 0, 0, 0])[4..], 0x0503_0000u32.to_le_bytes());
}

#[test]
fn block_transfer_is_refused_and_an_abort_is_not_answered() {
    let mut bench = Bench::new();
    assert_eq!(bench.sdo([0xA4, 0x18, 0x10, 1, 0, 0, 0, 0]), [0x80, 0x18, 0x10, 1, 0x01, 0x00, 0x04, 0x05]);
    assert_eq!(bench.sdo([0xC2, 0x81, 0x60, 0, 4, 0, 0, 0])[4..], 0x0504_0001u32.to_le_bytes());
    bench.send_data(0x605, [0x80, 0x81, 0x60, 0, 0, 0, 0, 0]);
    bench.run_ms(3);
    assert!(bench.heard.is_empty());
}

#[test]
fn a_reply_takes_up_to_a_millisecond_and_an_overlapping_request_is_lost() {
    let mut bench = Bench::new();
    for _ in 0..50 {
        bench.send_data(0x605, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
        let asked_ns = bench.now_ns;
        bench.run_ns(200_000);
        bench.send_data(0x605, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
        bench.run_ms(2);
        let [answer] = &bench.heard[..] else { panic!("{} answers", bench.heard.len()) };
        assert_eq!(answer.frame.payload()[..3], [0x43, 0x00, 0x10]);
        let latency_ns = answer.at_ns - asked_ns;
        assert!((300_000..MILLISECOND_NS + 270_000).contains(&latency_ns), "{latency_ns}");
        bench.heard.clear();
    }
}

#[test]
fn a_request_that_is_not_eight_bytes_long_is_ignored() {
    let mut bench = Bench::new();
    bench.send_data(0x605, [0x40, 0x00, 0x10, 0]);
    bench.run_ms(3);
    assert!(bench.heard.is_empty());
}

#[test]
fn a_mapping_changes_only_while_its_pdo_is_disabled_and_its_count_is_0() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x1A00, 0, 1, 0), Err(DEVICE_STATE));
    assert_eq!(bench.write(0x1800, 1, 4, 0x0000_0186), Err(DEVICE_STATE));
    bench.write(0x1800, 1, 4, 0x8000_0185).unwrap();
    assert_eq!(bench.write(0x1A00, 2, 4, 0x6064_0020), Err(DEVICE_STATE));
    bench.write(0x1A00, 0, 1, 0).unwrap();
    bench.write(0x1A00, 2, 4, 0x6064_0020).unwrap();
    bench.write(0x1A00, 0, 1, 2).unwrap();
    bench.write(0x1800, 1, 4, 0x0000_0185).unwrap();
    assert_eq!(bench.read(0x1A00, 2), Ok(0x6064_0020));
}

#[test]
fn only_mappable_objects_that_fit_a_pdo_can_be_mapped() {
    let mut bench = Bench::new();
    bench.write(0x1401, 0x01, 4, 0x8000_0305).unwrap();
    bench.write(0x1601, 0, 1, 0).unwrap();
    bench.write(0x1A01, 0, 1, 0).unwrap();
    // In turn: not mappable, read-only in an RPDO, missing object, missing sub-index, wrong length, a placeholder.
    assert_eq!(bench.write(0x1A01, 1, 4, 0x22A2_0010), Err(NOT_MAPPABLE));
    assert_eq!(bench.write(0x1601, 1, 4, 0x6064_0020), Err(NOT_MAPPABLE));
    assert_eq!(bench.write(0x1A01, 1, 4, 0x6072_0010), Err(NO_OBJECT));
    assert_eq!(bench.write(0x1A01, 1, 4, 0x607D_0320), Err(NO_SUBINDEX));
    assert_eq!(bench.write(0x1A01, 1, 4, 0x6064_0010), Err(NOT_MAPPABLE));
    assert_eq!(bench.write(0x1601, 1, 4, 0x0005_0008), Err(NO_OBJECT));
    for subindex in 1..=3 {
        bench.write(0x1A01, subindex, 4, 0x6064_0020).unwrap();
    }
    assert_eq!(bench.write(0x1A01, 0, 1, 3), Err(PDO_TOO_LONG));
    assert_eq!(bench.write(0x1A01, 0, 1, 9), Err(PDO_TOO_LONG));
    assert_eq!(bench.write(0x1A01, 0, 1, 4), Err(NO_OBJECT));
    bench.write(0x1A01, 0, 1, 2).unwrap();
}

#[test]
fn identifiers_and_transmission_types_out_of_range_are_refused() {
    let mut bench = Bench::new();
    for id in [0x2000_0285, 0x000, 0x080, 0x123, 0x585, 0x605, 0x705] {
        assert_eq!(bench.write(0x1801, 1, 4, id), Err(VALUE), "{id:X}");
    }
    for transmission_type in [241, 252, 253] {
        assert_eq!(bench.write(0x1801, 2, 1, transmission_type), Err(VALUE));
    }
    for transmission_type in [0, 1, 240, 254, 255] {
        bench.write(0x1801, 2, 1, transmission_type).unwrap();
    }
}

#[test]
fn saved_values_survive_a_power_cycle_three_seconds_later_and_others_do_not() {
    let mut bench = Bench::new();
    bench.write(0x6085, 0, 4, 1234).unwrap();
    bench.write(0x1010, 1, 4, u32::from_le_bytes(*b"save").into()).unwrap();
    bench.run_ms(2_900);
    bench.bus.power_cycle(NODE).unwrap();
    bench.run_ms(10);
    bench.heard.clear();
    assert_eq!(bench.read(0x6085, 0), Ok(200));

    bench.write(0x6085, 0, 4, 1234).unwrap();
    bench.write(0x1017, 0, 2, 0).unwrap();
    bench.write(0x1010, 1, 4, u32::from_le_bytes(*b"save").into()).unwrap();
    bench.run_ms(3_001);
    bench.write(0x6083, 0, 4, 77).unwrap();
    bench.bus.power_cycle(NODE).unwrap();
    bench.run_ms(10);
    bench.heard.clear();
    assert_eq!(bench.read(0x6085, 0), Ok(1234));
    assert_eq!(bench.read(0x6083, 0), Ok(200));
}
