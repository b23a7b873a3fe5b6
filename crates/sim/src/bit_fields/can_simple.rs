//! The messages of ODrive's protocol CAN Simple beside the command and the report of a cycle (docs.odriverobotics.com, CAN Protocol; firmware
//! 0.6, and 0.5: Firmware/communication/can/can_simple.cpp).
//!
//! An identifier is the node ID and, in its lowest five bits, the message. A message with data sets, one without (a remote frame, or no
//! bytes) asks. Bytes that are missing are zero.

use takt_rt::{FieldMode, Frame, FrameKind, Id};

/// The bits of an identifier for the message.
const MESSAGE_BITS: u32 = 5;
/// The node ID of drives that have none yet, by which all are asked for their addresses.
const UNADDRESSED: u8 = 0x3F;
/// Protocol version 2; hardware 4.4.58 (ODrive Pro); firmware 0.6.10, released.
const VERSION: [u8; 8] = [2, 4, 4, 58, 0, 6, 10, 0];
/// Bytes of the serial number that are the same in every simulated drive; the last one is its first node ID.
const SERIAL_NUMBER: [u8; 5] = [0x54, 0x41, 0x4B, 0x54, 0x00];
/// Endpoints that a drive remembers at most.
const MAX_ENDPOINTS: usize = 32;
/// The error of a drive that was asked for an emergency stop: the bit `ESTOP_REQUESTED`.
pub const ESTOP_REQUESTED: u16 = 25;
/// Supply: V.
const BUS_VOLTAGE: f64 = 24.0;

/// States of an axis.
const IDLE: u8 = 1;
const CLOSED_LOOP_CONTROL: u8 = 8;
/// Results of procedures.
const SUCCESS: u8 = 0;
const BUSY: u8 = 1;
const DISARMED: u8 = 3;

/// What a message does to a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deed {
    /// Closed-loop control begins.
    Start,
    /// It becomes idle.
    Stop,
    /// It becomes idle with an error.
    Fail(u16),
    /// Errors are cleared.
    Clear,
    /// It follows this from now on.
    Mode(FieldMode),
    /// A position with what is fed forward: turns, turns/s, N·m.
    Position(f64, f64, f64),
    /// A velocity with what is fed forward: turns/s, N·m.
    Velocity(f64, f64),
    /// A torque: N·m.
    Torque(f64),
    /// The present position becomes this one: turns.
    Place(f64),
    /// It starts anew.
    Reboot,
    /// It has another node ID from now on.
    Node(u8),
    /// It sends this.
    Send(Frame),
    /// It takes the message, which changes no motion here.
    Nothing,
}

/// What the drive is like now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Its node ID.
    pub node: u8,
    /// True in closed-loop control.
    pub runs: bool,
    /// The number of the bit of its error.
    pub error: Option<u16>,
    /// turns
    pub position: f64,
    /// turns/s
    pub velocity: f64,
    /// N·m
    pub torque: f64,
    /// A
    pub current: f64,
    /// °C
    pub temperature: f64,
}

impl Condition {
    fn error_bits(&self) -> u32 {
        self.error.map_or(0, |bit| 1u32.checked_shl(bit.into()).unwrap_or(0))
    }

    fn heartbeat(&self) -> [u8; 8] {
        let [a, b, c, d] = self.error_bits().to_le_bytes();
        let (state, result) = match (self.runs, self.error) {
            (true, _) => (CLOSED_LOOP_CONTROL, BUSY),
            (false, None) => (IDLE, SUCCESS),
            (false, Some(_)) => (IDLE, DISARMED),
        };
        [a, b, c, d, state, result, 0, 0]
    }
}

/// What a drive remembers of its messages.
#[derive(Clone, Debug)]
pub struct CanSimple {
    /// Numbers that were written to endpoints.
    endpoints: Vec<(u16, u32)>,
    serial_number: [u8; 6],
}

fn two(one: f64, other: f64) -> [u8; 8] {
    let mut bytes = [0; 8];
    let (low, high) = bytes.split_at_mut(4);
    low.copy_from_slice(&(one as f32).to_le_bytes());
    high.copy_from_slice(&(other as f32).to_le_bytes());
    bytes
}

fn frame(node: u8, message: u8, payload: &[u8]) -> Option<Frame> {
    let id = Id::base(u32::from(node) << MESSAGE_BITS | u32::from(message)).ok()?;
    Frame::data(id, payload).ok()
}

impl CanSimple {
    /// Of a drive that has this node ID at first.
    pub fn new(node: u8) -> Self {
        let [a, b, c, d, e] = SERIAL_NUMBER;
        Self { endpoints: Vec::with_capacity(MAX_ENDPOINTS), serial_number: [a, b, c, d, e, node] }
    }

    /// The heartbeat.
    pub fn heartbeat(now: &Condition) -> Option<Frame> {
        frame(now.node, 0x01, &now.heartbeat())
    }

    /// What a frame does to the drive. `None`: it is for another one.
    pub fn take(&mut self, now: &Condition, received: &Frame) -> Option<Deed> {
        let id = received.id();
        if id.is_extended() || received.is_fd() {
            return None;
        }
        let (node, message) = (id.value() >> MESSAGE_BITS, (id.value() & 0x1F) as u8);
        let is_own = node == u32::from(now.node);
        let asks = received.kind() == FrameKind::Remote || received.payload().is_empty();
        if !is_own && (message != 0x06 || node != u32::from(UNADDRESSED)) {
            return None;
        }
        let mut data = [0; 8];
        for (to, from) in data.iter_mut().zip(received.payload()) {
            *to = *from;
        }
        Some(match asks {
            true => self.asked(now, message),
            false => self.set(now, message, data),
        })
    }

    fn asked(&self, now: &Condition, message: u8) -> Deed {
        let mechanical = now.torque * now.velocity * std::f64::consts::TAU;
        let payload = match message {
            0x00 => VERSION,
            0x01 => now.heartbeat(),
            0x02 => return Deed::Fail(ESTOP_REQUESTED),
            0x03 => {
                let bits = u64::from(now.error_bits());
                (bits | bits << 32).to_le_bytes()
            }
            0x06 => {
                let [a, b, c, d, e, f] = self.serial_number;
                [now.node, a, b, c, d, e, f, 0]
            }
            0x09 => two(now.position, now.velocity),
            0x14 => two(now.current, now.current),
            0x15 => two(now.temperature, now.temperature),
            0x16 => return Deed::Reboot,
            0x17 => two(BUS_VOLTAGE, mechanical / BUS_VOLTAGE),
            0x18 => return Deed::Clear,
            0x1C => two(now.torque, now.torque),
            0x1D => two(mechanical, mechanical),
            _ => return Deed::Nothing,
        };
        frame(now.node, message, &payload).map_or(Deed::Nothing, Deed::Send)
    }

    fn set(&mut self, now: &Condition, message: u8, data: [u8; 8]) -> Deed {
        let [a, b, c, d, e, f, g, h] = data;
        let (low, high) = ([a, b, c, d], [e, f, g, h]);
        let (one, other) = (f64::from(f32::from_le_bytes(low)), f64::from(f32::from_le_bytes(high)));
        // Vel_FF and Torque_FF of a position: thousandths.
        let thousandths = |low, high| f64::from(i16::from_le_bytes([low, high])) * 1e-3;
        let is_finite = |deed, numbers: &[f64]| match numbers.iter().all(|number| number.is_finite()) {
            true => deed,
            false => Deed::Nothing,
        };
        match message {
            0x02 => Deed::Fail(ESTOP_REQUESTED),
            0x04 => self.sdo(now, data),
            0x06 if [b, c, d, e, f, g] == self.serial_number && (1..UNADDRESSED).contains(&a) => {
                Deed::Node(a)
            }
            0x07 => match u32::from_le_bytes(low) {
                state if state == u32::from(CLOSED_LOOP_CONTROL) => Deed::Start,
                // A calibration or the like is done at once.
                _ => Deed::Stop,
            },
            0x0B => match u32::from_le_bytes(low) {
                0 | 1 => Deed::Mode(FieldMode::Torque),
                2 => Deed::Mode(FieldMode::Velocity),
                3 => Deed::Mode(FieldMode::Position),
                _ => Deed::Nothing,
            },
            0x0C => is_finite(Deed::Position(one, thousandths(e, f), thousandths(g, h)), &[one]),
            0x0D => is_finite(Deed::Velocity(one, other), &[one, other]),
            0x0E => is_finite(Deed::Torque(one), &[one]),
            0x16 => Deed::Reboot,
            0x18 => Deed::Clear,
            0x19 => is_finite(Deed::Place(one), &[one]),
            _ => Deed::Nothing,
        }
    }

    /// An endpoint: opcode 0 reads it, 1 writes it. Which endpoint is what differs from firmware to firmware: here, each is a memory.
    fn sdo(&mut self, now: &Condition, [opcode, low, high, _, a, b, c, d]: [u8; 8]) -> Deed {
        let (endpoint, value) = (u16::from_le_bytes([low, high]), u32::from_le_bytes([a, b, c, d]));
        let has_room = self.endpoints.len() < MAX_ENDPOINTS;
        let known = self.endpoints.iter_mut().find(|(own, _)| *own == endpoint);
        match (opcode, known) {
            (0, known) => {
                let [a, b, c, d] = known.map_or(0, |(_, value)| *value).to_le_bytes();
                frame(now.node, 0x05, &[0, low, high, 0, a, b, c, d]).map_or(Deed::Nothing, Deed::Send)
            }
            (1, Some((_, own))) => {
                *own = value;
                Deed::Nothing
            }
            (1, None) if has_room => {
                self.endpoints.push((endpoint, value));
                Deed::Nothing
            }
            _ => Deed::Nothing,
        }
    }

    /// Forgets what does not outlive the power.
    pub fn boot(&mut self) {
        self.endpoints.clear();
    }
}
