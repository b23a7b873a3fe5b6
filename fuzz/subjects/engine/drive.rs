//! A drive of the simplest kind: it obeys what it is commanded, in any mode of either family.

use takt::config::{Axis, Config, Control};
use takt::family::bring_up::{PdoPlan, ProcessData};
use takt_rt::{Command, DriveState, Frame, Id, MappedObject, Scale, ShownStates, controlword, statusword};

/// Below this speed friction fades out, so that a joint at rest stays there: rad/s (m/s).
const COULOMB_FADE: f64 = 1e-3;
/// Transmission types up to this one answer SYNC (CiA 301, 7.5.2.36).
const LAST_SYNCHRONOUS: u8 = 240;
/// The state in a heartbeat.
const OPERATIONAL: u8 = 5;

pub struct ObedientDrive {
    axis: &'static Axis,
    scale: Scale,
    /// What it is sent and what it sends.
    pub data: ProcessData,
    pub state: DriveState,
    pub is_silent: bool,
    /// True if it tells in each cycle what it had to tell in the one before.
    pub is_late: bool,
    /// Where the joint is and how fast: rad (m), rad/s (m/s).
    position: f64,
    velocity: f64,
    /// The last values of objects 6040, 607A, 60FF and 6071.
    controlword: u16,
    target_position: i32,
    target_velocity: i32,
    target_torque: i32,
    /// The target of profile position that it has taken.
    taken: i32,
    sent_before: Vec<Frame>,
    /// When its last heartbeat was due.
    heartbeat_ns: u64,
}

impl ObedientDrive {
    pub fn new(axis: &'static Axis, config: &Config) -> Self {
        Self {
            axis,
            scale: axis.scale().expect("the example is sound"),
            data: ProcessData::of(axis, config),
            state: DriveState::SwitchOnDisabled,
            is_silent: false,
            is_late: false,
            position: axis.limits.position_min.max(0.0).min(axis.limits.position_max),
            velocity: 0.0,
            controlword: 0,
            target_position: 0,
            target_velocity: 0,
            target_torque: 0,
            taken: 0,
            sent_before: vec![],
            heartbeat_ns: 0,
        }
    }

    pub fn counts(&self) -> i32 {
        self.scale.position_to_counts(self.position)
    }

    /// Turns the joint by hand.
    pub fn turn(&mut self, counts: i32) {
        self.position = self.scale.position_from_counts(self.counts().wrapping_add(counts));
    }

    /// What it says in a cycle of its bus, in answer to SYNC or by itself.
    pub fn tell(&mut self, now_ns: u64, has_sync: bool) -> Vec<Frame> {
        let says = |pdo: &&PdoPlan| has_sync || pdo.transmission_type > LAST_SYNCHRONOUS;
        let mut frames: Vec<Frame> =
            self.data.feedback.iter().filter(says).map(|pdo| self.frame(pdo)).collect();
        if let Some(period_ns) =
            self.axis.heartbeat_ns.filter(|period_ns| now_ns >= self.heartbeat_ns + period_ns)
        {
            self.heartbeat_ns += period_ns;
            frames.push(Frame::of(Id::canopen(0x700, self.axis.node), [OPERATIONAL]));
        }
        if self.is_silent {
            return vec![];
        }
        let before = std::mem::replace(&mut self.sent_before, frames.clone());
        if self.is_late { before } else { frames }
    }

    fn frame(&self, pdo: &PdoPlan) -> Frame {
        let value = |object: &MappedObject| match object.index {
            0x6041 => u64::from(self.statusword()),
            0x6064 => u64::from(self.counts() as u32),
            0x606C => u64::from(self.scale.velocity_to_drive(self.velocity) as u32),
            0x6077 => u64::from(self.target_torque as i16 as u16),
            0x6061 => u64::from(self.axis.control.operation_mode() as i8 as u8),
            _ => 0,
        };
        let fields = pdo.objects.iter().map(|object| (object.bits, value(object)));
        let (word, bits) = fields.fold((0u64, 0u32), |(word, shift), (bits, value)| {
            (word | value << shift, shift + u32::from(bits))
        });
        Frame::data(pdo.id, &word.to_le_bytes()[..bits as usize / 8]).expect("a PDO has at most eight bytes")
    }

    fn statusword(&self) -> u16 {
        let is_enabled = self.state == DriveState::OperationEnabled;
        match self.axis.drive.codec.states {
            ShownStates::EnabledAndFault { enabled, fault } => match self.state {
                DriveState::Fault | DriveState::FaultReactionActive => fault,
                _ if is_enabled => enabled | self.target_reached(),
                _ => 0x0404,
            },
            ShownStates::All => {
                let has_handshake = self.axis.control == Control::ProfilePosition;
                let is_offered = is_enabled && self.controlword & controlword::BIT_4 != 0;
                let acknowledged = if has_handshake && is_offered { statusword::BIT_12 } else { 0 };
                self.state.statusword_bits() | acknowledged | self.target_reached()
            }
        }
    }

    fn target_reached(&self) -> u16 {
        let is_reached = match self.axis.control {
            Control::ProfilePosition => self.counts() == self.taken,
            Control::ProfileVelocity => self.scale.velocity_to_drive(self.velocity) == self.target_velocity,
            _ => true,
        };
        if is_reached { statusword::TARGET_REACHED } else { 0 }
    }

    pub fn is_commanded_by(&self, id: Id) -> bool {
        self.data.commands.iter().any(|pdo| pdo.id == id)
    }

    /// Takes a frame, if it is one of its commands. Returns the controlword in it.
    pub fn take(&mut self, frame: &Frame) -> Option<u16> {
        let pdo = self.data.commands.iter().find(|pdo| pdo.id == frame.id())?;
        let (mut rest, mut command) = (frame.first_word(), None);
        for object in &pdo.objects {
            match object.index {
                0x6040 => command = Some(rest as u16),
                0x607A => self.target_position = rest as u32 as i32,
                0x60FF => self.target_velocity = rest as u32 as i32,
                0x6071 => self.target_torque = (rest as u16 as i16).into(),
                _ => {}
            }
            rest = rest.checked_shr(object.bits.into()).unwrap_or(0);
        }
        if let Some(word) = command {
            let is_edge =
                word & controlword::FAULT_RESET != 0 && self.controlword & controlword::FAULT_RESET == 0;
            self.state = self.state.after(Command::decode(word), is_edge);
            let is_offered =
                word & controlword::BIT_4 != 0 || !self.axis.drive.codec.acknowledges_set_points();
            if is_offered {
                self.taken = self.target_position;
            }
            self.controlword = word;
        }
        command
    }

    /// The target of an axis that follows set-points of the position, as it came over the wire.
    pub fn position_target(&self) -> Option<i32> {
        let is_position = matches!(self.axis.control, Control::Position | Control::Interpolated);
        is_position.then_some(self.target_position)
    }

    /// Lets time pass.
    pub fn pass(&mut self, period_s: f64) {
        match self.state {
            DriveState::OperationEnabled => self.go(period_s),
            // Its ramp is steep, and it has no torque at the end of it.
            DriveState::QuickStopActive => {
                self.velocity = 0.0;
                self.state = DriveState::SwitchOnDisabled;
            }
            _ => self.velocity = 0.0,
        }
    }

    fn go(&mut self, period_s: f64) {
        let before = self.position;
        let limits = &self.axis.limits;
        match self.axis.control {
            Control::Position | Control::Interpolated => {
                self.position = self.scale.position_from_counts(self.target_position);
            }
            Control::ProfilePosition => {
                let target = self.scale.position_from_counts(self.taken);
                let most = limits.velocity * period_s / 2.0;
                self.position += (target - self.position).clamp(-most, most);
            }
            Control::Velocity { .. } => {
                self.position += self.scale.velocity_from_drive(self.target_velocity) * period_s;
            }
            Control::ProfileVelocity => {
                let most = limits.acceleration * period_s;
                let target = self.scale.velocity_from_drive(self.target_velocity);
                self.velocity += (target - self.velocity).clamp(-most, most);
                self.position += self.velocity * period_s;
                return;
            }
            Control::Torque { .. } | Control::ProfileTorque => {
                let joint = &self.axis.joint;
                let direction = (self.velocity / COULOMB_FADE).clamp(-1.0, 1.0);
                let friction =
                    joint.viscous_friction() * self.velocity + joint.coulomb_friction() * direction;
                let torque = self.scale.torque_from_per_mille(self.target_torque);
                self.velocity += (torque - friction) / joint.inertia() * period_s;
                self.position += self.velocity * period_s;
                return;
            }
        }
        self.velocity = (self.position - before) / period_s;
    }
}

/// The drives of a configuration.
pub fn drives(config: &'static Config) -> Vec<ObedientDrive> {
    config.axes.iter().map(|axis| ObedientDrive::new(axis, config)).collect()
}
