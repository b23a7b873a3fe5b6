//! The commands to an adapter.

use arrayvec::ArrayVec;

use super::frame_line::LineError;

/// A bit rate that has an `S` command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRate(u8);

/// The bit rates of `S0` to `S8`, in bit/s. `S7` is the one of LAWICEL and of Linux; the CANable runs at 750 kbit/s then.
const BIT_RATES: [u32; 9] = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

impl BitRate {
    /// The command for this bit rate in bit/s; `None` where there is none.
    pub fn of(bits_per_s: u32) -> Option<Self> {
        let code = BIT_RATES.iter().position(|rate| *rate == bits_per_s)?;
        u8::try_from(code).ok().map(Self)
    }

    /// The bit rate in bit/s.
    pub fn bits_per_s(self) -> u32 {
        BIT_RATES.get(usize::from(self.0)).copied().unwrap_or_default()
    }

    /// All of them in bit/s, the slowest one first.
    pub const fn all() -> [u32; 9] {
        BIT_RATES
    }
}

/// A bit rate of the data phase of CAN FD frames that has a `Y` command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DataBitRate(u8);

/// The digits of `Y` are Mbit/s. Most adapters know only some of them: the first firmware of the CANable 2.0 knows 2 and 5.
const DATA_RATES_MBIT: [u8; 6] = [1, 2, 3, 4, 5, 8];
const MEGA: u32 = 1_000_000;

impl DataBitRate {
    /// The command for this bit rate in bit/s; `None` where there is none.
    pub fn of(bits_per_s: u32) -> Option<Self> {
        DATA_RATES_MBIT.into_iter().find(|rate| u32::from(*rate) * MEGA == bits_per_s).map(Self)
    }

    /// The bit rate in bit/s.
    pub fn bits_per_s(self) -> u32 {
        u32::from(self.0) * MEGA
    }

    /// All of them in bit/s, the slowest one first.
    pub fn all() -> [u32; 6] {
        DATA_RATES_MBIT.map(|rate| u32::from(rate) * MEGA)
    }
}

/// A command to an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// `S0` to `S8`: the bit rate of classic frames and of the arbitration phase. Only while the channel is closed.
    SetBitRate(BitRate),
    /// `Y1` to `Y8`: the bit rate of the data phase of CAN FD frames. Only while the channel is closed.
    SetDataBitRate(DataBitRate),
    /// `O`: open the channel.
    Open,
    /// `L`: open the channel for listening alone.
    Listen,
    /// `C`: close the channel.
    Close,
    /// `V`: ask for the version.
    Version,
    /// `N`: ask for the serial number.
    SerialNumber,
    /// `F`: ask for the status flags.
    Status,
    /// `Z0` and `Z1`: time stamps of received frames off and on.
    TimeStamps(bool),
}

impl Command {
    /// The command as it is sent, with its CR.
    pub fn text(self) -> ArrayVec<u8, 3> {
        let (letter, digit) = match self {
            Self::SetBitRate(BitRate(code)) => (b'S', Some(code)),
            Self::SetDataBitRate(DataBitRate(code)) => (b'Y', Some(code)),
            Self::Open => (b'O', None),
            Self::Listen => (b'L', None),
            Self::Close => (b'C', None),
            Self::Version => (b'V', None),
            Self::SerialNumber => (b'N', None),
            Self::Status => (b'F', None),
            Self::TimeStamps(is_on) => (b'Z', Some(u8::from(is_on))),
        };
        let digit = digit.map(|digit| b'0' + digit);
        [Some(letter), digit, Some(b'\r')].into_iter().flatten().collect()
    }

    /// Reads a command without its CR.
    ///
    /// # Errors
    /// [`LineError::UnknownKind`] for another first letter, [`LineError::Parameter`] for a parameter that the command does not
    /// have.
    pub fn decode(line: &[u8]) -> Result<Self, LineError> {
        let (letter, parameter) = line.split_first().ok_or(LineError::Empty)?;
        let plain = |command| if parameter.is_empty() { Ok(command) } else { Err(LineError::Parameter) };
        match (letter, parameter) {
            (b'S', [digit @ b'0'..=b'8']) => Ok(Self::SetBitRate(BitRate(digit - b'0'))),
            (b'Y', [digit]) => {
                let rate = digit.checked_sub(b'0').filter(|rate| DATA_RATES_MBIT.contains(rate));
                rate.map(|rate| Self::SetDataBitRate(DataBitRate(rate))).ok_or(LineError::Parameter)
            }
            (b'Z', [digit @ b'0'..=b'1']) => Ok(Self::TimeStamps(*digit == b'1')),
            (b'S' | b'Y' | b'Z', _) => Err(LineError::Parameter),
            (b'O', _) => plain(Self::Open),
            (b'L', _) => plain(Self::Listen),
            (b'C', _) => plain(Self::Close),
            (b'V', _) => plain(Self::Version),
            (b'N', _) => plain(Self::SerialNumber),
            (b'F', _) => plain(Self::Status),
            (letter, _) => Err(LineError::UnknownKind { letter: *letter }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_bit_rates_have_a_command_and_no_other_one_has() {
        let text = |rate| Command::SetBitRate(BitRate::of(rate).unwrap()).text();
        assert_eq!(text(10_000).as_slice(), b"S0\r");
        assert_eq!(text(125_000).as_slice(), b"S4\r");
        assert_eq!(text(1_000_000).as_slice(), b"S8\r");
        for rate in BitRate::all() {
            assert_eq!(BitRate::of(rate).unwrap().bits_per_s(), rate);
        }
        assert_eq!(BitRate::of(83_333), None);
        assert_eq!(DataBitRate::of(2_500_000), None);
        assert_eq!(DataBitRate::of(6_000_000), None);
        assert_eq!(DataBitRate::of(5_000_000).unwrap().bits_per_s(), 5_000_000);
    }

    #[test]
    fn every_command_is_read_as_it_was_written() {
        let rates = BitRate::all().map(|rate| Command::SetBitRate(BitRate::of(rate).unwrap()));
        let data_rates =
            DataBitRate::all().map(|rate| Command::SetDataBitRate(DataBitRate::of(rate).unwrap()));
        let others = [
            Command::Open,
            Command::Listen,
            Command::Close,
            Command::Version,
            Command::SerialNumber,
            Command::Status,
            Command::TimeStamps(false),
            Command::TimeStamps(true),
        ];
        for command in rates.into_iter().chain(data_rates).chain(others) {
            let text = command.text();
            let (end, line) = text.split_last().unwrap();
            assert_eq!((*end, Command::decode(line)), (b'\r', Ok(command)));
        }
    }

    #[test]
    fn a_parameter_that_is_missing_surplus_or_out_of_range_is_refused() {
        for line in
            [&b"S"[..], b"S9", b"S88", b"Y", b"Y0", b"Y6", b"Y\x00", b"O1", b"C0", b"Z", b"Z2", b"V12"]
        {
            assert_eq!(Command::decode(line), Err(LineError::Parameter), "{line:?}");
        }
        assert_eq!(Command::decode(b"x"), Err(LineError::UnknownKind { letter: b'x' }));
        assert_eq!(Command::decode(b""), Err(LineError::Empty));
    }
}
