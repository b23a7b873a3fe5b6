//! The SDO transfers of one node, as somebody hears them who takes no part: what a segment belongs to, and which PDO parameters were
//! written or read.

use std::collections::BTreeMap;

use takt_rt::Frame;
use takt_wire::canopen::function_code;
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::{PdoDirection, PdoParameters};
use takt_wire::canopen::pdo_configuration::PdoConfiguration;
use takt_wire::canopen::sdo::{BlockSegment, SdoRequest, SdoResponse};
use takt_wire::printable::printable;

/// Bytes of a transfer that are kept, to show them at its end.
const KEPT_BYTES: usize = 512;
/// Letters of a text that are shown.
const SHOWN_BYTES: usize = 64;

/// What an SDO frame is.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard<M> {
    /// A message that stands for itself.
    Message(M),
    /// A message that ends a transfer of several frames: with what was transferred.
    End {
        /// The message.
        message: M,
        /// The object.
        object: ObjectAddress,
        /// What was transferred.
        content: String,
    },
    /// A segment of a block.
    BlockSegment {
        /// The object.
        object: ObjectAddress,
        /// Its number in its block, counted from 1.
        number: u8,
        /// True if it is the last one of the transfer.
        is_last: bool,
    },
}

/// A transfer under way.
#[derive(Debug)]
struct UnderWay {
    object: ObjectAddress,
    bytes: Vec<u8>,
    /// How many bytes there were, kept or not.
    total: usize,
    block: Option<Block>,
}

/// The block that is being sent.
#[derive(Clone, Copy, Debug)]
struct Block {
    is_upload: bool,
    /// How many segments it has.
    segments: u8,
    /// Where it began.
    begin: usize,
    /// The number of the last segment of the transfer, once it was heard.
    end: Option<u8>,
    is_running: bool,
}

impl UnderWay {
    const fn new(object: ObjectAddress) -> Self {
        Self { object, bytes: vec![], total: 0, block: None }
    }

    fn add(&mut self, bytes: &[u8]) {
        self.total += bytes.len();
        let room = KEPT_BYTES.saturating_sub(self.bytes.len());
        self.bytes.extend(bytes.iter().take(room));
    }

    fn cut(&mut self, total: usize) {
        self.total = self.total.min(total);
        self.bytes.truncate(total);
    }

    /// A text where it is one, or else bytes.
    fn content(&self) -> String {
        let end = self.bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        let kept = self.bytes.get(..end).unwrap_or_default();
        let is_text = !kept.is_empty() && kept.iter().all(|byte| matches!(byte, b' '..=b'~'));
        let shown = self.bytes.get(..SHOWN_BYTES).unwrap_or(&self.bytes);
        let more = if self.total > shown.len() { " …" } else { "" };
        if is_text {
            let text = String::from_utf8_lossy(kept.get(..SHOWN_BYTES).unwrap_or(kept)).into_owned();
            return format!("{:?}{}", printable(&text), if kept.len() > SHOWN_BYTES { " …" } else { "" });
        }
        format!("{} bytes: {shown:02X?}{more}", self.total)
    }
}

/// What is heard of the SDO server of one node.
#[derive(Debug, Default)]
pub struct SdoTraffic {
    under_way: Option<UnderWay>,
    /// What was written and is not yet accepted.
    written: Option<(ObjectAddress, u32)>,
    /// The PDO parameters that were read or written.
    parameters: BTreeMap<ObjectAddress, u32>,
    pdos: Vec<PdoConfiguration>,
}

impl SdoTraffic {
    /// The PDOs whose mapping was heard.
    pub fn pdos(&self) -> &[PdoConfiguration] {
        &self.pdos
    }

    /// Takes a request to the node.
    pub fn request(&mut self, frame: &Frame) -> Option<Heard<SdoRequest>> {
        if let Some(segment) = self.block_segment(frame, false) {
            return Some(segment);
        }
        let (_, request) = SdoRequest::decode(frame)?;
        match request {
            SdoRequest::DownloadExpedited { object, data } => {
                self.under_way = None;
                self.written = number(data.bytes()).map(|number| (object, number));
            }
            SdoRequest::DownloadSegmented { object, .. } | SdoRequest::Upload { object } => {
                self.under_way = Some(UnderWay::new(object));
            }
            SdoRequest::BlockUpload { object, block_size, .. } => {
                let block = Block {
                    is_upload: true,
                    segments: block_size.segments(),
                    begin: 0,
                    end: None,
                    is_running: false,
                };
                self.under_way = Some(UnderWay { block: Some(block), ..UnderWay::new(object) });
            }
            SdoRequest::BlockDownload { object, .. } => {
                let block = Block { is_upload: false, segments: 0, begin: 0, end: None, is_running: false };
                self.under_way = Some(UnderWay { block: Some(block), ..UnderWay::new(object) });
            }
            SdoRequest::BlockUploadStart => self.begin_block(None),
            SdoRequest::BlockAcknowledge { last, block_size } => {
                self.end_block(last, block_size.segments());
            }
            SdoRequest::DownloadSegment { data, is_last, .. } => {
                if let Some(under_way) = &mut self.under_way {
                    under_way.add(data.bytes());
                }
                if is_last {
                    return Some(self.end(request));
                }
            }
            SdoRequest::BlockDownloadEnd { unused, .. } => {
                self.drop_unused(unused);
                return Some(self.end(request));
            }
            SdoRequest::Abort { .. } => self.under_way = None,
            SdoRequest::UploadSegment { .. } | SdoRequest::BlockUploadEnd => {}
        }
        Some(Heard::Message(request))
    }

    /// Takes a response of the node.
    pub fn response(&mut self, frame: &Frame) -> Option<Heard<SdoResponse>> {
        if let Some(segment) = self.block_segment(frame, true) {
            return Some(segment);
        }
        // Some drives leave out the bytes that are not used.
        let whole = Frame::of(frame.id(), frame.first_word().to_le_bytes());
        let (_, response) = SdoResponse::decode(&whole).filter(|_| !frame.payload().is_empty())?;
        match response {
            SdoResponse::UploadExpedited { object, data } => {
                self.under_way = None;
                if let Some(value) = number(data.bytes()) {
                    self.learn(object, value);
                }
            }
            SdoResponse::DownloadAccepted { object } => {
                if let Some((_, value)) = self.written.take_if(|(written, _)| *written == object) {
                    self.learn(object, value);
                }
            }
            SdoResponse::UploadSegment { data, is_last, .. } => {
                if let Some(under_way) = &mut self.under_way {
                    under_way.add(data.bytes());
                }
                if is_last {
                    return Some(self.end(response));
                }
            }
            SdoResponse::BlockDownload { block_size, .. } => self.begin_block(Some(block_size.segments())),
            SdoResponse::BlockAcknowledge { last, block_size } => {
                self.end_block(last, block_size.segments());
            }
            SdoResponse::BlockUploadEnd { unused, .. } => {
                self.drop_unused(unused);
                return Some(self.end(response));
            }
            SdoResponse::Abort { .. } => {
                self.written = None;
                self.under_way = None;
            }
            SdoResponse::UploadSegmented { .. }
            | SdoResponse::DownloadSegmentAccepted { .. }
            | SdoResponse::BlockUpload { .. }
            | SdoResponse::BlockDownloadEnd => {}
        }
        Some(Heard::Message(response))
    }

    fn block_segment<M>(&mut self, frame: &Frame, is_from_server: bool) -> Option<Heard<M>> {
        let under_way = self.under_way.as_mut()?;
        let block = under_way.block.filter(|block| block.is_running && block.is_upload == is_from_server)?;
        let segment = BlockSegment::decode(frame.payload().try_into().ok()?)?;
        under_way.add(&segment.data());
        let is_end = segment.is_last() || segment.number() >= block.segments;
        let end = segment.is_last().then_some(segment.number());
        under_way.block = Some(Block { is_running: !is_end, end, ..block });
        Some(Heard::BlockSegment {
            object: under_way.object,
            number: segment.number(),
            is_last: segment.is_last(),
        })
    }

    fn begin_block(&mut self, segments: Option<u8>) {
        if let Some(under_way) = &mut self.under_way
            && let Some(block) = &mut under_way.block
        {
            block.segments = segments.unwrap_or(block.segments);
            block.begin = under_way.total;
            block.end = None;
            block.is_running = true;
        }
    }

    /// Segments behind the last one that arrived in order are sent again. Another block follows, unless the transfer is complete.
    fn end_block(&mut self, last: u8, next_segments: u8) {
        let Some(under_way) = &mut self.under_way else { return };
        let Some(block) = under_way.block else { return };
        under_way.cut(block.begin + 7 * usize::from(last));
        if block.end != Some(last) {
            self.begin_block(Some(next_segments));
        }
    }

    fn drop_unused(&mut self, unused: u8) {
        if let Some(under_way) = &mut self.under_way {
            under_way.cut(under_way.total.saturating_sub(unused.into()));
        }
    }

    fn end<M>(&mut self, message: M) -> Heard<M> {
        match self.under_way.take() {
            Some(under_way) => Heard::End { message, object: under_way.object, content: under_way.content() },
            None => Heard::Message(message),
        }
    }

    /// Takes the value of an object. Those of PDOs say how they are decoded.
    fn learn(&mut self, object: ObjectAddress, value: u32) {
        let direction = match object.index {
            0x1400..=0x17FF => PdoDirection::Receive,
            0x1800..=0x1BFF => PdoDirection::Transmit,
            _ => return,
        };
        let number = (object.index & 0x1FF) + 1;
        self.parameters.insert(object, value);
        let parameters = PdoParameters::at(direction, number);
        let known = PdoConfiguration::read(direction, number, parameters, |object| {
            self.parameters.get(&object).copied()
        });
        self.pdos.retain(|pdo| (pdo.direction, pdo.number) != (direction, number));
        self.pdos.extend(known);
    }

    /// The mapped objects of the PDO with an identifier of the pre-defined connection set whose own identifier was never heard.
    pub fn predefined(&self, function: u16) -> Option<&PdoConfiguration> {
        let place = |all: [u16; 4]| all.iter().position(|known| *known == function);
        let (direction, place) = match (place(function_code::RPDO), place(function_code::TPDO)) {
            (Some(place), _) => (PdoDirection::Receive, place),
            (_, Some(place)) => (PdoDirection::Transmit, place),
            _ => return None,
        };
        self.pdos.iter().find(|pdo| {
            (pdo.direction, usize::from(pdo.number)) == (direction, place + 1) && pdo.id.is_none()
        })
    }
}

fn number(bytes: &[u8]) -> Option<u32> {
    (bytes.len() <= 4).then(|| bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)))
}
