//! The words of an entry of a journal, one after another. What is taken from a file is checked word by word.

use takt_rt::{AxisPoint, Frame, FrameKind, Id, MAX_GROUPS, PositionPoint, RequestTarget, StopCategory};

/// The words are none of an entry: the file is damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

/// Puts the words of an entry.
#[derive(Clone, Debug, Default)]
pub struct Put(pub Vec<u64>);

impl Put {
    /// A word.
    pub fn word(&mut self, word: u64) -> &mut Self {
        self.0.push(word);
        self
    }

    /// A count or an index.
    pub fn index(&mut self, index: usize) -> &mut Self {
        self.word(index as u64)
    }

    /// A number by its bits.
    pub fn number(&mut self, number: f64) -> &mut Self {
        self.word(number.to_bits())
    }

    /// Numbers behind their count.
    pub fn numbers(&mut self, numbers: &[f64]) -> &mut Self {
        self.index(numbers.len());
        self.0.extend(numbers.iter().map(|number| number.to_bits()));
        self
    }

    /// A frame.
    pub fn frame(&mut self, frame: &Frame) -> &mut Self {
        let kind = match frame.kind() {
            FrameKind::Data => 0,
            FrameKind::Remote => 1,
            FrameKind::Fd => 2,
            FrameKind::FdBitRateSwitch => 3,
        };
        self.word(kind | u64::from(frame.id().is_extended()) << 2 | (frame.length() as u64) << 3);
        self.word(frame.id().value().into());
        for bytes in frame.payload().chunks(size_of::<u64>()) {
            let mut word = [0; size_of::<u64>()];
            word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
            self.word(u64::from_le_bytes(word));
        }
        self
    }

    /// All axes, or a group.
    pub fn target(&mut self, target: RequestTarget) -> &mut Self {
        self.word(match target {
            RequestTarget::All => 0,
            RequestTarget::Group(group) => 1 + u64::from(group),
        })
    }

    /// What a point says of an axis.
    pub fn axis_point(&mut self, point: &AxisPoint) -> &mut Self {
        let (kind, motion, [stiffness, damping, torque]) = match *point {
            AxisPoint::Position { motion, torque } => (0, motion, [0.0, 0.0, torque]),
            AxisPoint::Impedance { motion, stiffness, damping, torque } => {
                (1, motion, [stiffness, damping, torque])
            }
            AxisPoint::Velocity(velocity) => {
                (2, PositionPoint { velocity: Some(velocity), ..PositionPoint::default() }, [0.0; 3])
            }
            AxisPoint::Torque(torque) => (3, PositionPoint::default(), [0.0, 0.0, torque]),
        };
        let given = u64::from(motion.velocity.is_some()) << 8 | u64::from(motion.acceleration.is_some()) << 9;
        self.word(kind | given).number(motion.position);
        self.number(motion.velocity.unwrap_or_default()).number(motion.acceleration.unwrap_or_default());
        self.number(stiffness).number(damping).number(torque)
    }
}

/// Takes the words of an entry.
#[derive(Clone, Copy, Debug)]
pub struct Take<'a>(pub &'a [u64]);

impl Take<'_> {
    /// The next word.
    pub fn word(&mut self) -> Result<u64, Malformed> {
        let (first, rest) = self.0.split_first().ok_or(Malformed)?;
        self.0 = rest;
        Ok(*first)
    }

    /// The next word, as an index or a count, whatever it counts.
    pub fn index(&mut self) -> Result<usize, Malformed> {
        usize::try_from(self.word()?).map_err(|_| Malformed)
    }

    /// A count of things of so many words each, which there are.
    pub fn count_of(&mut self, words_each: usize) -> Result<usize, Malformed> {
        let count = self.index()?;
        let needed = count.checked_mul(words_each).ok_or(Malformed)?;
        if needed <= self.0.len() { Ok(count) } else { Err(Malformed) }
    }

    /// The next number. It may be infinite or none: the controller refuses that with the words for it.
    pub fn number(&mut self) -> Result<f64, Malformed> {
        self.word().map(f64::from_bits)
    }

    /// Numbers behind their count.
    pub fn numbers(&mut self) -> Result<Vec<f64>, Malformed> {
        let count = self.count_of(1)?;
        (0..count).map(|_| self.number()).collect()
    }

    /// A frame.
    pub fn frame(&mut self) -> Result<Frame, Malformed> {
        let (head, number) = (self.word()?, u32::try_from(self.word()?).map_err(|_| Malformed)?);
        let length =
            usize::try_from(head >> 3).ok().filter(|length| *length <= Frame::MAX_BYTES).ok_or(Malformed)?;
        let id =
            if head & 4 == 0 { Id::base(number) } else { Id::extended(number) }.map_err(|_| Malformed)?;
        let kind = head & 3;
        if kind == 1 {
            return Frame::remote(id, length as u8).map_err(|_| Malformed);
        }
        let mut payload = [0; Frame::MAX_BYTES];
        let payload = payload.get_mut(..length).ok_or(Malformed)?;
        for bytes in payload.chunks_mut(size_of::<u64>()) {
            bytes.iter_mut().zip(self.word()?.to_le_bytes()).for_each(|(to, from)| *to = from);
        }
        match kind {
            0 => Frame::data(id, payload),
            fd => Frame::fd(id, payload, fd == 3),
        }
        .map_err(|_| Malformed)
    }

    /// All axes, or a group. Whether there is such a group, the controller knows.
    pub fn target(&mut self) -> Result<RequestTarget, Malformed> {
        match self.word()? {
            0 => Ok(RequestTarget::All),
            group @ 1..=GROUPS => Ok(RequestTarget::Group((group - 1) as u8)),
            _ => Err(Malformed),
        }
    }

    /// The category of a stop.
    pub fn category(&mut self) -> Result<StopCategory, Malformed> {
        match self.word()? {
            0 => Ok(StopCategory::Zero),
            1 => Ok(StopCategory::One),
            2 => Ok(StopCategory::Two),
            _ => Err(Malformed),
        }
    }

    /// What a point says of an axis.
    pub fn axis_point(&mut self) -> Result<AxisPoint, Malformed> {
        let (head, position) = (self.word()?, self.number()?);
        let (velocity, acceleration) = (self.number()?, self.number()?);
        let (stiffness, damping, torque) = (self.number()?, self.number()?, self.number()?);
        let given = |bit: u32, value: f64| (head >> bit & 1 == 1).then_some(value);
        let motion =
            PositionPoint { position, velocity: given(8, velocity), acceleration: given(9, acceleration) };
        match head & !(3 << 8) {
            0 => Ok(AxisPoint::Position { motion, torque }),
            1 => Ok(AxisPoint::Impedance { motion, stiffness, damping, torque }),
            2 => Ok(AxisPoint::Velocity(velocity)),
            3 => Ok(AxisPoint::Torque(torque)),
            _ => Err(Malformed),
        }
    }

    /// There are no more words.
    pub fn end(self) -> Result<(), Malformed> {
        if self.0.is_empty() { Ok(()) } else { Err(Malformed) }
    }
}

const GROUPS: u64 = MAX_GROUPS as u64;
