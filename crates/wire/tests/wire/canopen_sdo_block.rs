//! SDO block transfer: exchanges exact to the byte, and a server that loses frames.

use proptest::prelude::*;
use takt_rt::{Frame, Id};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::sdo::{
    AbortCode, BlockSegment, BlockSize, Completed, Expedited, SdoClient, SdoError, SdoRequest, SdoResponse,
    SdoTiming, Transfer, Uploaded,
};

const NODE: u8 = 2;
const TIMING: SdoTiming = SdoTiming { reply_timeout_ns: 500, retries: 2 };
const DOMAIN: ObjectAddress = ObjectAddress::new(0x1F50, 1);

fn bytes(hex: &str) -> [u8; 8] {
    let bytes: Vec<u8> = hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
    bytes.try_into().unwrap()
}

fn client(transfer: Transfer) -> SdoClient {
    let mut client = SdoClient::new(NODE, TIMING);
    client.start(transfer).unwrap();
    client
}

/// Plays an exchange: `>` is sent by the client, `<` by the server.
fn play(client: &mut SdoClient, conversation: &[&str]) {
    for line in conversation {
        match line.split_at(2) {
            ("> ", hex) => {
                let frame = client.poll(0).unwrap_or_else(|| panic!("{hex} was not sent"));
                assert_eq!(
                    (frame.id().value(), frame.payload()),
                    (0x602, &bytes(hex)[..]),
                    "{frame:?}, not {hex}"
                );
            }
            (_, hex) => {
                assert_eq!(client.poll(0), None, "before {hex}");
                client.receive(&Frame::of(Id::canopen(0x580, NODE), bytes(hex)));
            }
        }
    }
    assert_eq!(client.poll(0), None);
}

fn uploaded(bytes: &[u8]) -> Option<Result<Completed, SdoError>> {
    Some(Ok(Completed::Uploaded(Uploaded { bytes: bytes.into(), is_size_known: true })))
}

#[test]
fn an_object_is_read_in_blocks() {
    let mut client = client(Transfer::BlockUpload { object: DOMAIN });
    play(
        &mut client,
        &[
            "> A4 50 1F 01 20 00 00 00",
            "< C6 50 1F 01 09 00 00 00",
            "> A3 00 00 00 00 00 00 00",
            "< 01 31 32 33 34 35 36 37",
            "< 82 38 39 00 00 00 00 00",
            "> A2 02 20 00 00 00 00 00",
            "< D5 C3 31 00 00 00 00 00",
            "> A1 00 00 00 00 00 00 00",
        ],
    );
    assert_eq!(client.take_outcome(), uploaded(b"123456789"));
}

#[test]
fn an_object_is_written_in_blocks_of_the_size_that_the_server_sets() {
    let mut client = client(Transfer::BlockDownload { object: DOMAIN, data: b"123456789".into() });
    play(
        &mut client,
        &[
            "> C6 50 1F 01 09 00 00 00",
            "< A4 50 1F 01 01 00 00 00",
            "> 01 31 32 33 34 35 36 37",
            "< A2 01 7F 00 00 00 00 00",
            "> 81 38 39 00 00 00 00 00",
            "< A2 01 7F 00 00 00 00 00",
            "> D5 C3 31 00 00 00 00 00",
            "< A1 00 00 00 00 00 00 00",
        ],
    );
    assert_eq!(client.take_outcome(), Some(Ok(Completed::Downloaded)));
}

#[test]
fn unacknowledged_segments_are_sent_again() {
    let data: Vec<u8> = (1..=21).collect();
    let mut client = client(Transfer::BlockDownload { object: DOMAIN, data });
    play(
        &mut client,
        &[
            "> C6 50 1F 01 15 00 00 00",
            "< A0 50 1F 01 7F 00 00 00",
            "> 01 01 02 03 04 05 06 07",
            "> 02 08 09 0A 0B 0C 0D 0E",
            "> 83 0F 10 11 12 13 14 15",
            "< A2 01 7F 00 00 00 00 00",
            "> 01 08 09 0A 0B 0C 0D 0E",
            "> 82 0F 10 11 12 13 14 15",
            "< A2 02 7F 00 00 00 00 00",
            "> C1 00 00 00 00 00 00 00", // the server makes no checksum
            "< A1 00 00 00 00 00 00 00",
        ],
    );
    assert_eq!(client.take_outcome(), Some(Ok(Completed::Downloaded)));
}

#[test]
fn a_server_without_block_transfer_gets_a_segmented_transfer() {
    let mut reading = client(Transfer::BlockUpload { object: DOMAIN });
    play(
        &mut reading,
        &[
            "> A4 50 1F 01 20 00 00 00",
            "< 80 50 1F 01 01 00 04 05",
            "> 40 50 1F 01 00 00 00 00",
            "< 4B 50 1F 01 07 08 00 00",
        ],
    );
    assert_eq!(reading.take_outcome(), uploaded(&[7, 8]));
    let mut writing = client(Transfer::BlockDownload { object: DOMAIN, data: vec![1, 2, 3, 4, 5] });
    play(
        &mut writing,
        &[
            "> C6 50 1F 01 05 00 00 00",
            "< 80 50 1F 01 01 00 04 05",
            "> 21 50 1F 01 05 00 00 00",
            "< 60 50 1F 01 00 00 00 00",
            "> 05 01 02 03 04 05 00 00",
            "< 20 00 00 00 00 00 00 00",
        ],
    );
    assert_eq!(writing.take_outcome(), Some(Ok(Completed::Downloaded)));
}

#[test]
fn four_bytes_are_transferred_expedited() {
    let mut client = client(Transfer::BlockDownload { object: DOMAIN, data: vec![1, 2, 3, 4] });
    play(&mut client, &["> 23 50 1F 01 01 02 03 04", "< 60 50 1F 01 00 00 00 00"]);
    assert_eq!(client.take_outcome(), Some(Ok(Completed::Downloaded)));
}

#[test]
fn other_aborts_end_a_block_transfer() {
    let mut client = client(Transfer::BlockUpload { object: DOMAIN });
    play(&mut client, &["> A4 50 1F 01 20 00 00 00", "< 80 50 1F 01 00 00 02 06"]);
    assert_eq!(client.take_outcome(), Some(Err(SdoError::Aborted(AbortCode::ObjectDoesNotExist))));
}

#[test]
fn an_abort_between_segments_is_not_read_as_a_segment() {
    let mut client = client(Transfer::BlockUpload { object: DOMAIN });
    play(
        &mut client,
        &[
            "> A4 50 1F 01 20 00 00 00",
            "< C6 50 1F 01 09 00 00 00",
            "> A3 00 00 00 00 00 00 00",
            "< 01 31 32 33 34 35 36 37",
            "< 80 50 1F 01 00 00 00 08",
        ],
    );
    assert_eq!(client.take_outcome(), Some(Err(SdoError::Aborted(AbortCode::General))));
}

#[test]
fn a_wrong_checksum_aborts_the_transfer() {
    let mut client = client(Transfer::BlockUpload { object: DOMAIN });
    play(
        &mut client,
        &[
            "> A4 50 1F 01 20 00 00 00",
            "< C6 50 1F 01 09 00 00 00",
            "> A3 00 00 00 00 00 00 00",
            "< 01 31 32 33 34 35 36 37",
            "< 82 38 38 00 00 00 00 00",
            "> A2 02 20 00 00 00 00 00",
            "< D5 C3 31 00 00 00 00 00",
            "> 80 50 1F 01 04 00 04 05",
        ],
    );
    assert!(matches!(client.take_outcome(), Some(Err(SdoError::Checksum { received: 0x31C3, .. }))));
}

#[test]
fn the_transfer_ends_when_no_block_arrives() {
    let mut writing = client(Transfer::BlockDownload { object: DOMAIN, data: vec![9; 7] });
    let (segment, nothing) = ("> 81 09 09 09 09 09 09 09", "< A2 00 7F 00 00 00 00 00");
    play(
        &mut writing,
        &["> C6 50 1F 01 07 00 00 00", "< A4 50 1F 01 7F 00 00 00"]
            .into_iter()
            .chain([segment, nothing, segment, nothing, segment, nothing, "> 80 50 1F 01 03 00 04 05"])
            .collect::<Vec<_>>(),
    );
    assert_eq!(writing.take_outcome(), Some(Err(SdoError::BlockSequence)));
    let mut confirmed = client(Transfer::BlockDownload { object: DOMAIN, data: vec![9; 7] });
    play(
        &mut confirmed,
        &[
            "> C6 50 1F 01 07 00 00 00",
            "< A4 50 1F 01 7F 00 00 00",
            segment,
            "< A2 02 7F 00 00 00 00 00", // segment 2 was never sent
            "> 80 50 1F 01 03 00 04 05",
        ],
    );
    assert_eq!(confirmed.take_outcome(), Some(Err(SdoError::BlockSequence)));
}

/// A server that holds one object and loses segments.
struct Server {
    data: Vec<u8>,
    losses: Vec<bool>,
    sent: usize,
    received: Vec<u8>,
    last: u8,
    has_ended: bool,
    /// True if the client has begun a block download that has not ended.
    is_receiving: bool,
}

const SERVER_BLOCK: BlockSize = BlockSize::new(5).unwrap();

impl Server {
    fn new(data: &[u8], losses: &[bool]) -> Self {
        Self {
            data: data.into(),
            losses: losses.into(),
            sent: 0,
            received: vec![],
            last: 0,
            has_ended: false,
            is_receiving: false,
        }
    }

    /// Returns `true` if the next segment is lost. After the end of the list, no segment is lost.
    fn loses(&mut self) -> bool {
        self.losses.pop().unwrap_or(false)
    }

    fn receive(&mut self, frame: &Frame) -> Vec<[u8; 8]> {
        let raw: [u8; 8] = frame.payload().try_into().unwrap();
        let payload = |response: SdoResponse| response.frame(NODE).payload().try_into().unwrap();
        if self.is_receiving && raw[0] & 0x7F <= SERVER_BLOCK.segments() && raw[0] != 0x80 {
            return self.take(BlockSegment::decode(raw).unwrap()).map(payload).into_iter().collect();
        }
        match SdoRequest::decode(frame).unwrap().1 {
            SdoRequest::BlockUpload { object, .. } => {
                self.sent = 0;
                let size = Some(self.data.len() as u32);
                vec![payload(SdoResponse::BlockUpload { object, size, has_crc: true })]
            }
            SdoRequest::BlockUploadStart => self.block(32),
            SdoRequest::BlockAcknowledge { last, block_size } => {
                self.sent += 7 * usize::from(last);
                if self.sent < self.data.len() {
                    return self.block(block_size.segments());
                }
                let unused = (self.sent - self.data.len()) as u8;
                vec![payload(SdoResponse::BlockUploadEnd { unused, crc: crc(&self.data) })]
            }
            SdoRequest::BlockUploadEnd => {
                self.has_ended = true;
                vec![]
            }
            SdoRequest::BlockDownload { object, .. } => {
                (self.received, self.last, self.is_receiving) = (vec![], 0, true);
                vec![payload(SdoResponse::BlockDownload { object, block_size: SERVER_BLOCK, has_crc: true })]
            }
            SdoRequest::BlockDownloadEnd { unused, crc: told } => {
                self.received.truncate(self.received.len() - usize::from(unused));
                assert_eq!(told, crc(&self.received));
                (self.has_ended, self.is_receiving) = (true, false);
                vec![payload(SdoResponse::BlockDownloadEnd)]
            }
            SdoRequest::Abort { .. } => {
                self.is_receiving = false;
                vec![]
            }
            other => panic!("{other:?}"),
        }
    }

    fn block(&mut self, segments: u8) -> Vec<[u8; 8]> {
        let rest = self.data[self.sent..].to_vec();
        let count = rest.len().div_ceil(7);
        let numbered = (1..=segments).zip(rest.chunks(7)).collect::<Vec<_>>();
        let all = numbered.into_iter().map(|(number, chunk)| {
            BlockSegment::new(number, chunk, usize::from(number) == count).unwrap().encode()
        });
        all.collect::<Vec<_>>().into_iter().filter(|_| !self.loses()).collect()
    }

    fn take(&mut self, segment: BlockSegment) -> Option<SdoResponse> {
        let is_lost = self.loses();
        if !is_lost && segment.number() == self.last + 1 {
            self.received.extend(segment.data());
            self.last = segment.number();
        }
        // A server acknowledges a full block or the last segment. It waits without end for a lost last segment.
        if is_lost || (segment.number() < SERVER_BLOCK.segments() && !segment.is_last()) {
            return None;
        }
        let last = std::mem::take(&mut self.last);
        Some(SdoResponse::BlockAcknowledge { last, block_size: SERVER_BLOCK })
    }
}

fn crc(data: &[u8]) -> u16 {
    let table =
        |crc: u16| (0..8).fold(crc, |crc, _| if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 });
    data.iter().fold(0, |crc: u16, byte| crc << 8 ^ table(crc & 0xFF00 ^ u16::from(*byte) << 8))
}

/// Runs until the transfer has ended. Time passes while neither side has a frame to send.
fn run(client: &mut SdoClient, server: &mut Server) -> Result<Completed, SdoError> {
    let mut now_ns = 0;
    for _ in 0..100_000 {
        let mut replies = vec![];
        while let Some(frame) = client.poll(now_ns) {
            replies.extend(server.receive(&frame));
        }
        if let Some(outcome) = client.take_outcome() {
            while let Some(frame) = client.poll(now_ns) {
                server.receive(&frame);
            }
            return outcome;
        }
        replies.iter().for_each(|reply| client.receive(&Frame::of(Id::canopen(0x580, NODE), *reply)));
        now_ns += 100;
    }
    panic!("no end");
}

proptest! {
    #[test]
    fn an_upload_with_lost_segments_returns_the_servers_data_or_fails(
        data in prop::collection::vec(any::<u8>(), 1..600),
        losses in prop::collection::vec(prop::bool::weighted(0.1), 0..200),
    ) {
        let has_losses = losses.contains(&true);
        let mut server = Server::new(&data, &losses);
        match run(&mut client(Transfer::BlockUpload { object: DOMAIN }), &mut server) {
            Ok(outcome) => {
                prop_assert_eq!(outcome, Completed::Uploaded(Uploaded { bytes: data, is_size_known: true }));
                prop_assert!(server.has_ended);
            }
            Err(error) => prop_assert!(has_losses, "{error}"),
        }
    }

    #[test]
    fn a_download_with_lost_segments_writes_the_clients_data_or_fails(
        data in prop::collection::vec(any::<u8>(), 5..600),
        losses in prop::collection::vec(prop::bool::weighted(0.05), 0..200),
    ) {
        let has_losses = losses.contains(&true);
        let mut server = Server::new(&[], &losses);
        let transfer = Transfer::BlockDownload { object: DOMAIN, data: data.clone() };
        match run(&mut client(transfer), &mut server) {
            Ok(outcome) => {
                prop_assert_eq!(outcome, Completed::Downloaded);
                prop_assert!(server.has_ended);
                prop_assert_eq!(server.received, data);
            }
            Err(error) => prop_assert!(has_losses, "{error}"),
        }
    }

    /// Zeros have the checksum 0, so some of these uploads succeed.
    #[test]
    fn arbitrary_frames_never_panic_and_never_complete_an_upload_with_a_wrong_checksum(
        frames in prop::collection::vec(
            (
                prop_oneof![0xC0..0xE0u8, 1..5u8, 0x81..0x85u8, any::<u8>()],
                prop_oneof![4 => Just([0; 7]), 1 => any::<[u8; 7]>()],
            ),
            0..80,
        ),
    ) {
        let mut client = client(Transfer::BlockUpload { object: DOMAIN });
        play(&mut client, &["> A4 50 1F 01 20 00 00 00", "< C4 50 1F 01 00 00 00 00", "> A3 00 00 00 00 00 00 00"]);
        for (first, rest) in frames {
            while client.poll(0).is_some() {}
            let [a, b, c, d, e, f, g] = rest;
            client.receive(&Frame::of(Id::canopen(0x580, NODE), [first, a, b, c, d, e, f, g]));
            if let Some(Ok(Completed::Uploaded(uploaded))) = client.take_outcome() {
                prop_assert_eq!(first & 0xE1, 0xC1);
                prop_assert_eq!(u16::from_le_bytes([a, b]), crc(&uploaded.bytes));
                return Ok(());
            }
        }
    }
}

#[test]
fn an_expedited_answer_does_not_end_a_block_transfer() {
    let mut client = client(Transfer::BlockUpload { object: DOMAIN });
    client.poll(0).unwrap();
    let data = Expedited::of(&[1]).unwrap();
    client.receive(&SdoResponse::UploadExpedited { object: DOMAIN, data }.frame(NODE));
    assert_eq!(client.take_outcome(), None);
}
