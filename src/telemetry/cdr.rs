//! The encoding of ROS 2 messages: OMG CDR, little-endian, in the encapsulation of DDSI-RTPS 10.2 (a header of four
//! bytes, then every number aligned to its size, counted from behind the header).

/// Encodes one message after the other into the same memory.
#[derive(Default)]
pub struct CdrEncoder {
    bytes: Vec<u8>,
}

/// CDR_LE, no options.
const HEADER: [u8; 4] = [0x00, 0x01, 0x00, 0x00];

impl CdrEncoder {
    /// Forgets the last message and begins the next.
    pub fn begin(&mut self) -> &mut Self {
        self.bytes.clear();
        self.bytes.extend_from_slice(&HEADER);
        self
    }

    /// The message so far.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn put<const N: usize>(&mut self, little_endian: [u8; N]) -> &mut Self {
        let behind_header = self.bytes.len() - HEADER.len();
        self.bytes.resize(HEADER.len() + behind_header.next_multiple_of(N), 0);
        self.bytes.extend_from_slice(&little_endian);
        self
    }

    /// `uint8`
    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.put([value])
    }

    /// `uint16`
    pub fn u16(&mut self, value: u16) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `int16`
    pub fn i16(&mut self, value: i16) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `uint32`
    pub fn u32(&mut self, value: u32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `int32`
    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `uint64`
    pub fn u64(&mut self, value: u64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `float32`
    pub fn f32(&mut self, value: f32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `float64`
    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    /// `uint8[N]`: an array of fixed length has no length in front.
    pub fn octets<const N: usize>(&mut self, values: [u8; N]) -> &mut Self {
        self.bytes.extend_from_slice(&values);
        self
    }

    /// `uint8[]`: its length, then its bytes.
    pub fn octet_sequence(&mut self, bytes: &[u8]) -> &mut Self {
        self.u32(bytes.len() as u32);
        self.bytes.extend_from_slice(bytes);
        self
    }

    /// `string`: its length with the closing zero, then its bytes.
    pub fn string(&mut self, text: &str) -> &mut Self {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
        self
    }
}

/// Decodes a message field by field; `None` where it ends too early.
pub struct CdrDecoder<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> CdrDecoder<'a> {
    /// Begins with the first field, if this is little-endian CDR.
    pub fn begin(message: &'a [u8]) -> Option<Self> {
        Some(Self { body: message.strip_prefix(&HEADER)?, at: 0 })
    }

    /// Returns `true` if the message has nothing more.
    pub fn is_over(&self) -> bool {
        self.at >= self.body.len()
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        let bytes = self.body.get(from..)?.first_chunk::<N>()?;
        self.at = from + N;
        Some(*bytes)
    }

    /// `uint8[]`
    pub fn octet_sequence(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.u32()?).ok()?;
        let bytes = self.body.get(self.at..)?.get(..length)?;
        self.at += length;
        Some(bytes)
    }

    /// `uint8`
    pub fn u8(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    /// `uint16`
    pub fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    /// `int16`
    pub fn i16(&mut self) -> Option<i16> {
        self.take().map(i16::from_le_bytes)
    }

    /// `uint32`
    pub fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// `int32`
    pub fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    /// `uint64`
    pub fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    /// `float32`
    pub fn f32(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    /// `float64`
    pub fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    /// `uint8[N]`
    pub fn octets<const N: usize>(&mut self) -> Option<[u8; N]> {
        let bytes = self.body.get(self.at..)?.first_chunk::<N>()?;
        self.at += N;
        Some(*bytes)
    }

    /// `string`
    pub fn string(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.body.get(self.at..)?.get(..length)?;
        self.at += length;
        Some(String::from_utf8_lossy(bytes.strip_suffix(&[0])?).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_aligned_to_its_size_behind_the_header() {
        let mut encoder = CdrEncoder::default();
        encoder.begin().u8(1).u16(0x0302).u8(4).u64(5).u8(6).i32(-2);
        let expected: &[&[u8]] = &[
            &[0, 1, 0, 0],
            &[1, 0, 2, 3, 4, 0, 0, 0],
            &[5, 0, 0, 0, 0, 0, 0, 0],
            &[6, 0, 0, 0, 0xFE, 0xFF, 0xFF, 0xFF],
        ];
        assert_eq!(encoder.bytes(), expected.concat());
    }

    #[test]
    fn a_string_has_its_length_with_the_closing_zero_and_an_array_has_none() {
        let mut encoder = CdrEncoder::default();
        encoder.begin().u64(9).begin().string("ab").octets([7, 8]);
        assert_eq!(encoder.bytes(), [0, 1, 0, 0, 3, 0, 0, 0, b'a', b'b', 0, 7, 8]);
    }
}
