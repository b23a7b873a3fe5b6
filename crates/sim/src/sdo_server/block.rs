//! Block transfers (CiA 301, 7.2.4.3.9 to 7.2.4.3.16).

use takt_wire::canopen::object::ObjectAddress;

use crate::sdo_reply::{AbortCode, addressed};

use super::transfer::{BlockDownload, BlockUpload, DownloadPhase, Transfer, UploadPhase};
use super::{ObjectAccess, SdoServer, check_length};

/// Segments that the server takes in one block.
const BLOCK_SIZE: u8 = 127;

impl SdoServer {
    /// Returns `true` if segments of a block arrive, whose first byte is no command.
    pub(super) fn receives_block(&self) -> bool {
        matches!(
            self.transfer,
            Transfer::BlockDownload(BlockDownload { phase: DownloadPhase::Segments { .. }, .. })
        )
    }

    pub(super) fn block_download(
        &mut self,
        request: [u8; 8],
        address: ObjectAddress,
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        if request[0] & 1 != 0 {
            return self.end_block_download(request, access);
        }
        self.transfer = Transfer::None;
        let length = access.check_write(address)?;
        let announced = (request[0] & 0b10 != 0)
            .then(|| u32::from_le_bytes([request[4], request[5], request[6], request[7]]) as usize);
        check_length(announced, length)?;
        self.value.clear();
        self.transfer = Transfer::BlockDownload(BlockDownload {
            address,
            length,
            has_crc: request[0] & 0b100 != 0,
            phase: DownloadPhase::Segments { sequence: 0 },
        });
        self.replies.push_back(addressed(0xA4, address.index, address.subindex, [BLOCK_SIZE, 0, 0, 0]));
        Ok(())
    }

    /// Takes a segment. One that is out of sequence is ignored; the confirmation says from where to repeat.
    pub(super) fn receive_block_segment(&mut self, request: [u8; 8]) -> Result<(), AbortCode> {
        let Transfer::BlockDownload(BlockDownload { phase: DownloadPhase::Segments { sequence }, .. }) =
            self.transfer
        else {
            return Err(AbortCode::Command);
        };
        let is_last = request[0] & 0x80 != 0;
        let number = request[0] & 0x7F;
        let is_next = number == sequence + 1;
        if is_next {
            // The end says how many bytes of the last segment are data, so the length is checked there.
            self.append(&request[1..], None)?;
        }
        let sequence = if is_next { number } else { sequence };
        let is_block_over = is_last || number >= BLOCK_SIZE;
        if let Transfer::BlockDownload(transfer) = &mut self.transfer {
            transfer.phase = match (is_block_over, is_last && is_next) {
                (_, true) => DownloadPhase::End,
                (true, false) => DownloadPhase::Segments { sequence: 0 },
                (false, false) => DownloadPhase::Segments { sequence },
            };
        }
        if is_block_over {
            self.replies.push_back([0xA2, sequence, BLOCK_SIZE, 0, 0, 0, 0, 0]);
        }
        Ok(())
    }

    fn end_block_download(
        &mut self,
        request: [u8; 8],
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        let Transfer::BlockDownload(BlockDownload { address, length, has_crc, phase: DownloadPhase::End }) =
            self.transfer
        else {
            return Err(AbortCode::Command);
        };
        let unused = usize::from(request[0] >> 2 & 0b111);
        self.value.truncate(self.value.len().saturating_sub(unused));
        check_length(Some(self.value.len()), length)?;
        if has_crc && u16::from_le_bytes([request[1], request[2]]) != checksum(&self.value) {
            return Err(AbortCode::Checksum);
        }
        access.write(address, &self.value)?;
        self.transfer = Transfer::None;
        self.replies.push_back([0xA1, 0, 0, 0, 0, 0, 0, 0]);
        Ok(())
    }

    pub(super) fn block_upload(
        &mut self,
        request: [u8; 8],
        address: ObjectAddress,
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        match (request[0] & 0b11, self.transfer) {
            (0, _) => self.begin_block_upload(request, address, access),
            (3, Transfer::BlockUpload(upload)) if upload.phase == UploadPhase::Announced => {
                self.send_block(BlockUpload { phase: UploadPhase::Segments, ..upload });
                Ok(())
            }
            (2, Transfer::BlockUpload(upload)) if upload.phase == UploadPhase::Segments => {
                self.confirm_block(upload, request[1], request[2])
            }
            (1, Transfer::BlockUpload(upload)) if upload.phase == UploadPhase::End => {
                self.transfer = Transfer::None;
                Ok(())
            }
            _ => Err(AbortCode::Command),
        }
    }

    fn begin_block_upload(
        &mut self,
        request: [u8; 8],
        address: ObjectAddress,
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        self.transfer = Transfer::None;
        let size = request[4];
        if !(1..=127).contains(&size) {
            return Err(AbortCode::BlockSize);
        }
        self.value.clear();
        access.read(address, &mut self.value)?;
        let length = (self.value.len() as u32).to_le_bytes();
        let has_crc = request[0] & 0b100 != 0;
        self.transfer = Transfer::BlockUpload(BlockUpload {
            address,
            has_crc,
            size,
            confirmed: 0,
            phase: UploadPhase::Announced,
        });
        self.replies.push_back(addressed(0xC6, address.index, address.subindex, length));
        Ok(())
    }

    /// Queues the segments of one block.
    fn send_block(&mut self, upload: BlockUpload) {
        let left = &self.value[upload.confirmed..];
        let segments = left.len().div_ceil(7).max(1);
        for number in 0..segments.min(upload.size.into()) {
            let data = left.chunks(7).nth(number).unwrap_or(&[]);
            let is_last = number + 1 == segments;
            let mut frame = [0; 8];
            frame[0] = u8::from(is_last) << 7 | (number as u8 + 1);
            frame[1..=data.len()].copy_from_slice(data);
            self.replies.push_back(frame);
        }
        self.transfer = Transfer::BlockUpload(upload);
    }

    fn confirm_block(&mut self, upload: BlockUpload, sequence: u8, size: u8) -> Result<(), AbortCode> {
        if !(1..=127).contains(&size) {
            return Err(AbortCode::BlockSize);
        }
        let confirmed = (upload.confirmed + 7 * usize::from(sequence)).min(self.value.len());
        let upload = BlockUpload { confirmed, size, ..upload };
        if confirmed < self.value.len() {
            self.send_block(upload);
            return Ok(());
        }
        let length = self.value.len();
        let unused = if length == 0 { 7 } else { (7 - length % 7) % 7 } as u8;
        let [low, high] = if upload.has_crc { checksum(&self.value).to_le_bytes() } else { [0, 0] };
        self.replies.push_back([0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0]);
        self.transfer = Transfer::BlockUpload(BlockUpload { phase: UploadPhase::End, ..upload });
        Ok(())
    }
}

/// The CRC of all data of a transfer: polynomial x¹⁶ + x¹² + x⁵ + 1, start value 0.
fn checksum(data: &[u8]) -> u16 {
    let shift = |crc: u16, _| if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 };
    data.iter().fold(0, |crc, byte| (0..8).fold(crc ^ u16::from(*byte) << 8, shift))
}

#[cfg(test)]
mod tests {
    use super::checksum;

    #[test]
    fn the_crc_of_the_standards_check_string_is_right() {
        assert_eq!(checksum(b"123456789"), 0x31C3);
    }
}
