//! The SDO client in exchanges that are exact to the byte.

use proptest::prelude::*;
use takt_rt::{Frame, Id};
use takt_wire::canopen::object::{DataType, ObjectAddress};
use takt_wire::canopen::sdo::{
    AbortCode, Completed, MAX_UPLOAD_BYTES, SdoBusy, SdoClient, SdoError, SdoTiming, Transfer, Uploaded,
};

const NODE: u8 = 2;
const TIMING: SdoTiming = SdoTiming { reply_timeout_ns: 500, retries: 2 };
const MODE: ObjectAddress = ObjectAddress::new(0x6060, 0);
const DISPLAY: ObjectAddress = ObjectAddress::new(0x6061, 0);
const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);

/// A client and the replies that the test gives it.
struct Exchange {
    client: SdoClient,
    now_ns: u64,
}

impl Exchange {
    fn new(transfer: Transfer) -> Self {
        let mut client = SdoClient::new(NODE, TIMING);
        client.start(transfer).unwrap();
        Self { client, now_ns: 0 }
    }

    fn upload(object: ObjectAddress) -> Self {
        Self::new(Transfer::Upload { object })
    }

    fn download(object: ObjectAddress, data: &[u8]) -> Self {
        Self::new(Transfer::Download { object, data: data.into() })
    }

    fn sends(&mut self, hex: &str) -> &mut Self {
        let frame = self.client.poll(self.now_ns).unwrap_or_else(|| panic!("{hex} was not sent"));
        assert_eq!(
            (frame.id().value(), frame.payload()),
            (0x602, &bytes(hex)[..]),
            "{frame:?} instead of {hex}"
        );
        self
    }

    fn sends_nothing(&mut self) -> &mut Self {
        assert_eq!(self.client.poll(self.now_ns), None);
        self
    }

    fn receives(&mut self, hex: &str) -> &mut Self {
        self.client.receive(&reply(&bytes(hex)));
        self
    }

    fn passes(&mut self, ns: u64) -> &mut Self {
        self.now_ns += ns;
        self
    }

    fn is_open(&mut self) -> &mut Self {
        assert_eq!(self.client.take_outcome(), None);
        self
    }

    fn ends(&mut self, outcome: Result<Completed, SdoError>) -> &mut Self {
        assert_eq!(self.client.take_outcome(), Some(outcome));
        self
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn reply(bytes: &[u8]) -> Frame {
    Frame::data(Id::canopen(0x580, NODE), bytes).unwrap()
}

fn uploaded(bytes: &[u8]) -> Result<Completed, SdoError> {
    Ok(Completed::Uploaded(Uploaded { bytes: bytes.into(), is_size_known: true }))
}

#[test]
fn an_object_is_written_in_one_frame_each_way() {
    Exchange::download(MODE, &[8])
        .sends("2F 60 60 00 08 00 00 00")
        .sends_nothing()
        .is_open()
        .receives("60 60 60 00 00 00 00 00")
        .ends(Ok(Completed::Downloaded))
        .sends_nothing();
}

#[test]
fn the_command_byte_gives_the_size_of_two_three_and_four_bytes() {
    for (data, frame) in [
        (&[1, 2][..], "2B 60 60 00 01 02 00 00"),
        (&[1, 2, 3][..], "27 60 60 00 01 02 03 00"),
        (&[1, 2, 3, 4][..], "23 60 60 00 01 02 03 04"),
    ] {
        Exchange::download(MODE, data).sends(frame);
    }
}

#[test]
fn an_object_is_read_in_one_frame_each_way() {
    Exchange::upload(DISPLAY)
        .sends("40 61 60 00 00 00 00 00")
        .receives("4F 61 60 00 08 00 00 00")
        .ends(uploaded(&[8]));
}

#[test]
fn a_reply_without_a_size_is_read_by_the_data_type_of_the_object() {
    let mut client = SdoClient::new(NODE, TIMING);
    client.start(Transfer::Upload { object: DISPLAY }).unwrap();
    client.poll(0).unwrap();
    client.receive(&reply(&bytes("42 61 60 00 FE 00 00 00")));
    let Some(Ok(Completed::Uploaded(uploaded))) = client.take_outcome() else { panic!("not read") };
    assert_eq!((uploaded.bytes.len(), uploaded.number(DataType::I8)), (4, Some(-2)));
}

#[test]
fn a_reply_of_another_length_than_the_data_type_is_not_a_number() {
    let two = Uploaded { bytes: vec![1, 0], is_size_known: true };
    assert_eq!((two.number(DataType::I8), two.number(DataType::I32)), (None, None));
    assert_eq!(two.number(DataType::U16), Some(1));
}

#[test]
fn a_text_is_read_in_segments_with_alternating_toggle() {
    let mut conversation = Exchange::upload(NAME);
    conversation
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 10 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("00 65 52 6F 62 20 6A 6F")
        .sends("70 00 00 00 00 00 00 00")
        .receives("10 69 6E 74 20 38 30 48")
        .sends("60 00 00 00 00 00 00 00")
        .receives("0B 49 00 00 00 00 00 00")
        .sends_nothing();
    // The last segment holds two bytes (n = 5): "I" and a zero, which completes the announced sixteen bytes.
    let Some(Ok(Completed::Uploaded(uploaded))) = conversation.client.take_outcome() else {
        panic!("not read")
    };
    assert_eq!((uploaded.bytes.len(), uploaded.text().as_str()), (16, "eRob joint 80HI"));
}

#[test]
fn segments_without_an_announced_size_are_read_to_the_last_one() {
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("40 08 10 00 00 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("0D 41 00 00 00 00 00 00")
        .ends(uploaded(b"A"));
}

#[test]
fn an_empty_text_is_read() {
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 00 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("0F 00 00 00 00 00 00 00")
        .ends(uploaded(b""));
}

#[test]
fn more_than_four_bytes_are_written_in_segments() {
    Exchange::download(NAME, b"gantry axis 1!")
        .sends("21 08 10 00 0E 00 00 00")
        .receives("60 08 10 00 00 00 00 00")
        .sends("00 67 61 6E 74 72 79 20")
        .receives("20 00 00 00 00 00 00 00")
        .sends("11 61 78 69 73 20 31 21")
        .receives("30 00 00 00 00 00 00 00")
        .ends(Ok(Completed::Downloaded));
}

#[test]
fn five_bytes_leave_two_of_the_segment_unused() {
    Exchange::download(NAME, b"joint")
        .sends("21 08 10 00 05 00 00 00")
        .receives("60 08 10 00 00 00 00 00")
        .sends("05 6A 6F 69 6E 74 00 00")
        .receives("20 00 00 00 00 00 00 00")
        .ends(Ok(Completed::Downloaded));
}

#[test]
fn an_empty_value_is_written_in_one_empty_segment() {
    Exchange::download(NAME, b"")
        .sends("21 08 10 00 00 00 00 00")
        .receives("60 08 10 00 00 00 00 00")
        .sends("0F 00 00 00 00 00 00 00")
        .receives("20 00 00 00 00 00 00 00")
        .ends(Ok(Completed::Downloaded));
}

#[test]
fn an_abort_ends_a_transfer_with_its_code() {
    Exchange::upload(DISPLAY)
        .sends("40 61 60 00 00 00 00 00")
        .receives("80 61 60 00 00 00 02 06")
        .ends(Err(SdoError::Aborted(AbortCode::ObjectDoesNotExist)));
    Exchange::download(NAME, b"joint")
        .sends("21 08 10 00 05 00 00 00")
        .receives("60 08 10 00 00 00 00 00")
        .sends("05 6A 6F 69 6E 74 00 00")
        .receives("80 08 10 00 22 00 00 08")
        .ends(Err(SdoError::Aborted(AbortCode::PresentDeviceState)))
        .sends_nothing();
}

#[test]
fn an_abort_for_another_object_is_ignored() {
    Exchange::upload(DISPLAY)
        .sends("40 61 60 00 00 00 00 00")
        .receives("80 60 60 00 00 00 02 06")
        .is_open()
        .receives("4F 61 60 00 08 00 00 00")
        .ends(uploaded(&[8]));
}

#[test]
fn replies_for_other_objects_and_of_other_kinds_are_ignored() {
    Exchange::upload(DISPLAY)
        .sends("40 61 60 00 00 00 00 00")
        .receives("4F 60 60 00 08 00 00 00") // other index
        .receives("4F 61 60 01 08 00 00 00") // other sub-index
        .receives("60 61 60 00 00 00 00 00") // answer to a download
        .receives("00 01 02 03 04 05 06 07") // segment of nothing
        .receives("C0 61 60 00 08 00 00 00") // block transfer
        .is_open()
        .receives("4F 61 60 00 03 00 00 00")
        .ends(uploaded(&[3]));
}

#[test]
fn replies_of_other_nodes_and_with_other_identifiers_are_ignored() {
    let mut conversation = Exchange::upload(DISPLAY);
    conversation.sends("40 61 60 00 00 00 00 00");
    let payload = [0x4F, 0x61, 0x60, 0, 8, 0, 0, 0];
    for id in [Id::canopen(0x580, 3), Id::canopen(0x600, 2), Id::extended(0x582).unwrap()] {
        conversation.client.receive(&Frame::of(id, payload));
    }
    conversation.is_open();
}

#[test]
fn truncated_and_remote_replies_count_as_no_reply() {
    let mut conversation = Exchange::upload(DISPLAY);
    conversation
        .sends("40 61 60 00 00 00 00 00")
        .receives("4F 61 60 00 08")
        .receives("")
        .receives("4F 61 60 00 08 00 00");
    conversation.client.receive(&Frame::remote(Id::canopen(0x580, NODE), 8).unwrap());
    for _ in 0..2 {
        conversation.passes(500).sends("40 61 60 00 00 00 00 00");
    }
    let error = SdoError::NoReply { attempts: 3, reply_timeout_ns: 500, unusable: 4 };
    conversation.passes(500).sends_nothing().ends(Err(error));
}

#[test]
fn a_request_is_repeated_after_the_time_out_and_fails_after_the_last_repetition() {
    Exchange::download(MODE, &[8])
        .sends("2F 60 60 00 08 00 00 00")
        .passes(499)
        .sends_nothing()
        .passes(1)
        .sends("2F 60 60 00 08 00 00 00")
        .passes(500)
        .sends("2F 60 60 00 08 00 00 00")
        .passes(499)
        .sends_nothing()
        .is_open()
        .passes(1)
        .sends_nothing()
        .ends(Err(SdoError::NoReply { attempts: 3, reply_timeout_ns: 500, unusable: 0 }));
}

#[test]
fn a_segmented_transfer_that_times_out_is_aborted_and_restarted() {
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 09 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("00 31 32 33 34 35 36 37")
        .sends("70 00 00 00 00 00 00 00")
        .passes(500)
        .sends("80 08 10 00 00 00 04 05")
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 09 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("00 31 32 33 34 35 36 37")
        .sends("70 00 00 00 00 00 00 00")
        .receives("1B 38 39 00 00 00 00 00")
        .ends(uploaded(b"123456789"));
}

#[test]
fn after_a_repetition_the_client_waits_until_stale_replies_have_arrived() {
    let mut conversation = Exchange::download(MODE, &[8]);
    conversation
        .sends("2F 60 60 00 08 00 00 00")
        .passes(500)
        .sends("2F 60 60 00 08 00 00 00")
        .passes(10)
        .receives("60 60 60 00 00 00 00 00") // late answer to the first request
        .ends(Ok(Completed::Downloaded));
    conversation.client.start(Transfer::Download { object: MODE, data: vec![9] }).unwrap();
    conversation
        .sends_nothing()
        .passes(10)
        .receives("60 60 60 00 00 00 00 00") // answer to the repetition, not to mode 9
        .is_open()
        .passes(480)
        .sends("2F 60 60 00 09 00 00 00")
        .is_open()
        .receives("60 60 60 00 00 00 00 00")
        .ends(Ok(Completed::Downloaded));
}

#[test]
fn a_toggle_bit_that_does_not_alternate_aborts_the_transfer() {
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 10 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("10 65 52 6F 62 20 6A 6F")
        .sends("80 08 10 00 00 00 03 05")
        .ends(Err(SdoError::ToggleNotAlternated));
    Exchange::download(NAME, b"joint")
        .sends("21 08 10 00 05 00 00 00")
        .receives("60 08 10 00 00 00 00 00")
        .sends("05 6A 6F 69 6E 74 00 00")
        .receives("30 00 00 00 00 00 00 00")
        .sends("80 08 10 00 00 00 03 05")
        .ends(Err(SdoError::ToggleNotAlternated));
}

#[test]
fn an_unrelated_reply_between_segments_does_not_disturb_the_transfer() {
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 08 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("00 31 32 33 34 35 36 37")
        .sends("70 00 00 00 00 00 00 00")
        .receives("4F 61 60 00 08 00 00 00")
        .sends_nothing()
        .receives("1D 38 00 00 00 00 00 00")
        .ends(uploaded(b"12345678"));
}

#[test]
fn more_or_less_data_than_announced_aborts_the_transfer() {
    for (segment, received) in [("00 31 32 33 34 35 36 37", 7), ("0B 31 32 00 00 00 00 00", 2)] {
        Exchange::upload(NAME)
            .sends("40 08 10 00 00 00 00 00")
            .receives("41 08 10 00 05 00 00 00")
            .sends("60 00 00 00 00 00 00 00")
            .receives(segment)
            .sends("80 08 10 00 10 00 07 06")
            .ends(Err(SdoError::SizeMismatch { announced: 5, received }));
    }
}

#[test]
fn an_endless_upload_is_aborted() {
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("41 08 10 00 FF FF FF FF")
        .sends("80 08 10 00 05 00 04 05")
        .ends(Err(SdoError::TooLong { limit: MAX_UPLOAD_BYTES as u32 }));
    Exchange::upload(NAME)
        .sends("40 08 10 00 00 00 00 00")
        .receives("40 08 10 00 00 00 00 00")
        .sends("60 00 00 00 00 00 00 00")
        .receives("0E 00 00 00 00 00 00 00")
        .sends("80 08 10 00 00 00 00 08")
        .ends(Err(SdoError::EmptySegment));
    let mut endless = Exchange::upload(NAME);
    endless.sends("40 08 10 00 00 00 00 00").receives("40 08 10 00 00 00 00 00");
    for segment in 0..=MAX_UPLOAD_BYTES / 7 {
        endless.sends(if segment % 2 == 0 { "60 00 00 00 00 00 00 00" } else { "70 00 00 00 00 00 00 00" });
        endless.receives(if segment % 2 == 0 { "00 1 1 1 1 1 1 1" } else { "10 1 1 1 1 1 1 1" });
    }
    endless.sends("80 08 10 00 05 00 04 05").ends(Err(SdoError::TooLong { limit: MAX_UPLOAD_BYTES as u32 }));
}

#[test]
fn one_transfer_runs_at_a_time() {
    let mut client = SdoClient::new(NODE, TIMING);
    let transfer = Transfer::Upload { object: DISPLAY };
    client.start(transfer.clone()).unwrap();
    assert_eq!(client.start(transfer.clone()), Err(SdoBusy));
    client.poll(0).unwrap();
    client.receive(&reply(&[0x4F, 0x61, 0x60, 0, 8, 0, 0, 0]));
    assert_eq!(client.start(transfer.clone()), Err(SdoBusy), "its outcome has not been taken");
    client.take_outcome().unwrap().unwrap();
    client.start(transfer).unwrap();
}

#[test]
fn errors_have_plain_messages() {
    let no_reply = SdoError::NoReply { attempts: 3, reply_timeout_ns: 500_000_000, unusable: 0 };
    assert_eq!(no_reply.to_string(), "no reply within 500 ms in 3 attempts");
    let aborted = SdoError::Aborted(AbortCode::ObjectDoesNotExist);
    assert_eq!(aborted.to_string(), "abort 0x06020000 (object does not exist in the object dictionary)");
}

/// Bytes that often look like replies, so that a transfer progresses.
fn any_reply() -> impl Strategy<Value = Vec<u8>> {
    let first = prop_oneof![
        Just(0x4F),
        Just(0x43),
        Just(0x41),
        Just(0x60),
        Just(0x00),
        Just(0x10),
        Just(0x01),
        Just(0x20),
        Just(0x80),
        any::<u8>()
    ];
    let address = prop_oneof![3 => Just([0x08, 0x10, 0x00]), 1 => any::<[u8; 3]>()];
    let plausible = (first, address, any::<[u8; 4]>())
        .prop_map(|(first, address, tail)| [&[first][..], &address, &tail].concat());
    prop_oneof![4 => plausible, 1 => prop::collection::vec(any::<u8>(), 0..=8)]
}

proptest! {
    /// The test does not decode: a transfer may succeed only with a frame that the standard allows there.
    #[test]
    fn arbitrary_replies_never_panic_and_never_complete_an_upload_wrongly(
        replies in prop::collection::vec((any_reply(), 0..600u64), 0..60),
    ) {
        let mut client = SdoClient::new(NODE, TIMING);
        client.start(Transfer::Upload { object: NAME }).unwrap();
        let (mut now_ns, mut last_request, mut collected) = (0, vec![], vec![]);
        for (bytes, pause_ns) in replies {
            while let Some(frame) = client.poll(now_ns) {
                last_request = frame.payload().to_vec();
                if last_request[0] == 0x40 {
                    collected.clear();
                }
            }
            let is_expected_segment = matches!(last_request[0], 0x60 | 0x70)
                && bytes.len() == 8
                && bytes[0] & 0xF0 == last_request[0] & 0x10;
            client.receive(&reply(&bytes));
            if is_expected_segment {
                collected.extend_from_slice(&bytes[1..8 - usize::from(bytes[0] >> 1 & 7)]);
            }
            match client.take_outcome() {
                None => {}
                Some(Err(_)) => return Ok(()),
                Some(Ok(Completed::Downloaded)) => prop_assert!(false, "an upload cannot end as a download"),
                Some(Ok(Completed::Uploaded(uploaded))) => {
                    if last_request[0] == 0x40 {
                        prop_assert_eq!(&bytes[1..4], &[0x08, 0x10, 0x00]);
                        prop_assert_eq!(bytes[0] & 0xE2, 0x42);
                        prop_assert_eq!(&uploaded.bytes[..], &bytes[4..4 + uploaded.bytes.len()]);
                    } else {
                        prop_assert!(is_expected_segment && bytes[0] & 1 == 1);
                        prop_assert_eq!(&uploaded.bytes, &collected);
                    }
                    return Ok(());
                }
            }
            now_ns += pause_ns;
        }
    }

    #[test]
    fn arbitrary_replies_never_complete_a_download_without_its_acknowledgement(
        replies in prop::collection::vec((any_reply(), 0..600u64), 0..60),
        length in 0..20usize,
    ) {
        let mut client = SdoClient::new(NODE, TIMING);
        client.start(Transfer::Download { object: NAME, data: vec![7; length] }).unwrap();
        let (mut now_ns, mut last_request) = (0, vec![]);
        for (bytes, pause_ns) in replies {
            while let Some(frame) = client.poll(now_ns) {
                last_request = frame.payload().to_vec();
            }
            client.receive(&reply(&bytes));
            match client.take_outcome() {
                None => {}
                Some(Err(_)) => return Ok(()),
                Some(Ok(outcome)) => {
                    prop_assert_eq!(outcome, Completed::Downloaded);
                    prop_assert_eq!(bytes.len(), 8);
                    if (1..=4).contains(&length) {
                        prop_assert_eq!(bytes[0] & 0xE0, 0x60);
                        prop_assert_eq!(&bytes[1..4], &[0x08, 0x10, 0x00]);
                    } else {
                        prop_assert_eq!(bytes[0] & 0xF0, 0x20 | last_request[0] & 0x10);
                        prop_assert_eq!(last_request[0] & 1, 1, "the last segment was acknowledged");
                    }
                    return Ok(());
                }
            }
            now_ns += pause_ns;
        }
    }

    #[test]
    fn every_transfer_ends_within_its_time_outs_without_a_server(step_ns in 1..700u64) {
        let mut client = SdoClient::new(NODE, TIMING);
        client.start(Transfer::Download { object: NAME, data: vec![1; 9] }).unwrap();
        let (mut now_ns, mut requests) = (0, 0);
        let error = loop {
            while let Some(frame) = client.poll(now_ns) {
                requests += usize::from(frame.payload()[0] == 0x21);
            }
            if let Some(outcome) = client.take_outcome() {
                break outcome.unwrap_err();
            }
            now_ns += step_ns;
            prop_assert!(now_ns < 3 * (500 + 700));
        };
        prop_assert_eq!(requests, 3);
        prop_assert_eq!(error, SdoError::NoReply { attempts: 3, reply_timeout_ns: 500, unusable: 0 });
    }
}
