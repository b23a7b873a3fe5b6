//! One axis of the drive: its objects, its state machine, its set-points, its loops and its joint.

use takt_rt::{DriveState, NANOSECONDS_PER_SECOND, Nanoseconds, OperationMode};
use takt_wire::quirks::{MeasuredObject, MeasuredQuantity, Quirks};

use crate::defect::Disobedience;
use crate::errors::DeviceError;
use crate::feedback_defects::JointDefects;
use crate::motion::{Actual, Measured};
use crate::object_dictionary::SimulatedDictionary;
use crate::plant::Joint;
use crate::servo::Servo;

use super::Cia402AxisParameters;
use super::device::{Change, Device, FaultReaction};
use super::homing::HomingStep;
use super::motion::Motion;
use super::places::{self, Places};
use super::profile::Profile;
use super::units::{CommissionedScale, Units, units_per_turn};

/// Object 607E, bit 7: the position counts the other way.
const POSITION_REVERSED: i64 = 1 << 7;

/// A mode that the axis is about to be in.
#[derive(Clone, Copy, Debug)]
struct ComingMode {
    mode: OperationMode,
    due_ns: Nanoseconds,
}

/// What an axis asks of the drive after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisEvent {
    /// A fault was reset: the error is over.
    FaultReset,
    /// The axis is to fail.
    Failed(DeviceError),
}

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Where its objects stand.
    pub places: Places,
    parameters: Cia402AxisParameters,
    scale: CommissionedScale,
    units: Units,
    modes: u32,
    mode_change_ns: Nanoseconds,
    keeps_mode_with_torque: bool,
    interpolates_over_sync: bool,
    moves_in_interpolation: bool,
    /// Objects of the vendor that show measured values, by their places.
    measured: Vec<(Option<usize>, MeasuredObject)>,
    /// True after a fault that has cost it its turn count, until that is cleared.
    has_lost_turns: bool,
    /// Bits of the statusword that are always 1, always 0, and 1 unless it is enabled.
    status_bits: [u16; 3],
    device: Device,
    motion: Motion,
    servo: Servo,
    /// The joint.
    pub joint: Joint,
    /// Its defects.
    pub defects: JointDefects,
    /// Torque of the motor in the direction of the position units: N·m (N).
    torque: f64,
    /// Added to the position, by homing and by defects: counts.
    offset: f64,
    mode: Option<OperationMode>,
    coming_mode: Option<ComingMode>,
    mode_bits: u16,
}

impl Axis {
    /// An axis whose supply is switched on. Ratings that the data sheet leaves open become those of the joint.
    pub fn new(
        number: u16,
        parameters: Cia402AxisParameters,
        dictionary: &mut SimulatedDictionary,
        quirks: &Quirks,
    ) -> Self {
        let mut places = Places::of(dictionary, number);
        if let Some(target) = quirks.interpolation_target {
            places.interpolation_data =
                dictionary.place(target.index + number * places::AXIS_OFFSET, target.subindex);
        }
        let Cia402AxisParameters { rated_torque, peak_torque, .. } = parameters;
        commission(dictionary, places.rated_torque, (1000.0 * rated_torque).round());
        if let Some(torque_per_ampere) = quirks.simulated.torque_per_ampere {
            let milliamperes = (1000.0 * rated_torque / torque_per_ampere).round();
            commission(dictionary, places.rated_current, milliamperes);
        }
        for limit in [places.max_torque, places.positive_torque_limit, places.negative_torque_limit] {
            commission_open(dictionary, limit, (1000.0 * peak_torque / rated_torque).round());
        }
        // All ones: no window.
        commission_open(dictionary, places.following_error_window, -1.0);
        let scale = CommissionedScale {
            counts_per_unit: parameters.encoder.counts_per_unit,
            counts_per_turn: parameters.counts_per_turn,
            by_objects: units_per_turn(dictionary, &places),
        };
        let servo = Servo::new(parameters.joint.inertia, peak_torque, parameters.highest_velocity);
        let joint = Joint::new(parameters.joint, parameters.initial_position).between(parameters.end_stops);
        Self {
            places,
            units: Units::of(dictionary, &places, quirks, scale),
            scale,
            // The velocity mode of frequency converters is not simulated.
            modes: modes_of(dictionary, &places, quirks) & !OperationMode::Velocity.supported_bit(),
            mode_change_ns: quirks.delays.mode_change_ns.unwrap_or(super::MODE_CHANGE_NS),
            keeps_mode_with_torque: quirks.keeps_mode_with_torque,
            interpolates_over_sync: quirks.simulated.interpolates_over_sync,
            moves_in_interpolation: quirks.simulated.moves_in_interpolation,
            measured: measured_objects(dictionary, number, quirks),
            has_lost_turns: false,
            status_bits: [quirks.statusword_set, quirks.statusword_clear, quirks.statusword_set_disabled],
            device: Device::starting(quirks.delays.fault_reset_ns.unwrap_or(0)),
            motion: Motion::new(quirks.simulated.moves_in_interpolation),
            servo,
            joint,
            defects: JointDefects::default(),
            torque: 0.0,
            offset: 0.0,
            mode: None,
            coming_mode: None,
            mode_bits: 0,
            parameters,
        }
    }

    /// Restarts everything except the joint.
    pub fn restart(&mut self, dictionary: &mut SimulatedDictionary, quirks: &Quirks) {
        self.device = self.device.restarted();
        self.motion = Motion::new(self.moves_in_interpolation);
        self.servo.reset();
        (self.torque, self.mode, self.coming_mode, self.mode_bits) = (0.0, None, None, 0);
        self.set_units(dictionary, quirks);
    }

    /// Ends the initialisation.
    pub fn started(&mut self, dictionary: &SimulatedDictionary, now_ns: Nanoseconds) {
        self.device.started();
        self.follow_mode(dictionary, now_ns);
    }

    /// Takes new values of the unit objects.
    pub fn set_units(&mut self, dictionary: &SimulatedDictionary, quirks: &Quirks) {
        self.units = Units::of(dictionary, &self.places, quirks, self.scale);
        if dictionary.number_at(self.places.polarity).unwrap_or(0) & POSITION_REVERSED != 0 {
            self.units.position = -self.units.position;
        }
    }

    /// Its state.
    pub fn state(&self) -> DriveState {
        self.device.state()
    }

    /// Its statusword.
    pub fn statusword(&self) -> u16 {
        let [set, clear, set_disabled] = self.status_bits;
        let bits = if self.state() == DriveState::OperationEnabled { self.mode_bits } else { set_disabled };
        self.device.statusword(bits) & !clear | set
    }

    /// Returns `true` if it now refuses to take another mode.
    pub fn keeps_mode(&self) -> bool {
        self.keeps_mode_with_torque && self.device.state().has_torque()
    }

    /// From now on its turn count is lost.
    pub fn lose_turns(&mut self) {
        self.has_lost_turns = true;
    }

    /// Returns `true` if its turn count is lost.
    pub fn has_lost_turns(&self) -> bool {
        self.has_lost_turns
    }

    /// Clears its turn count, and ends the loss of it.
    pub fn clear_turns(&mut self) {
        self.has_lost_turns = false;
        self.zero_turns();
    }

    /// Sets its turn count to 0. The position within a turn stays.
    pub fn zero_turns(&mut self) {
        let position = self.position();
        let within_turn = position.rem_euclid(self.parameters.counts_per_turn.abs().max(1.0));
        self.offset += within_turn - position;
        self.motion.shift(within_turn - position);
    }

    /// Its mode of operation, as in 6061; 0 for none.
    pub fn mode_number(&self) -> i8 {
        self.mode.map_or(0, |mode| mode as i8)
    }

    /// Torque of the motor at the joint: N·m (N).
    pub fn joint_torque(&self) -> f64 {
        self.torque * self.direction()
    }

    /// Returns `true` if the brake is engaged.
    pub fn is_braked(&self) -> bool {
        !self.device.state().has_torque() || self.defects.is_brake_stuck
    }

    /// Its position in position units, wrapped to 32 bits as in the objects.
    pub fn position(&self) -> f64 {
        let unwrapped =
            self.joint.position() * self.units.position + self.parameters.encoder.zero_counts + self.offset;
        let turn = 2f64.powi(32);
        unwrapped - turn * (unwrapped / turn).round_ties_even()
    }

    fn direction(&self) -> f64 {
        1f64.copysign(self.units.position)
    }

    fn actual(&self) -> Actual {
        Actual { position: self.position(), velocity: self.joint.velocity() * self.units.position }
    }

    fn profile<'a>(&'a self, dictionary: &'a SimulatedDictionary) -> Profile<'a> {
        Profile {
            places: &self.places,
            units: &self.units,
            dictionary,
            highest_velocity: self.parameters.highest_velocity * self.units.position.abs(),
            interpolates_over_sync: self.interpolates_over_sync,
        }
    }

    /// Adds a jump of the measured position: rad (m).
    pub fn jump(&mut self, distance: f64) {
        self.offset += distance * self.units.position;
    }

    /// From now on it does not obey its controlword in this way, or obeys it again.
    pub fn disobey(&mut self, disobedience: Option<Disobedience>) {
        self.device.disobey(disobedience);
    }

    /// Removes the torque without a fault, like safe torque off.
    pub fn lose_torque(&mut self) {
        self.device.lose_torque();
        self.torque = 0.0;
    }

    /// Latches the target of the cyclic modes.
    pub fn latch(&mut self, dictionary: &SimulatedDictionary) {
        let mut motion = self.motion;
        motion.latch(&self.profile(dictionary));
        self.motion = motion;
    }

    /// 6061 follows 6060 after a moment, if the axis has the mode.
    pub fn follow_mode(&mut self, dictionary: &SimulatedDictionary, now_ns: Nanoseconds) {
        if self.keeps_mode() {
            return self.coming_mode = None;
        }
        let number = dictionary.number_at(self.places.mode).unwrap_or(0) as i8;
        let wanted = OperationMode::from_number(number).filter(|mode| self.modes & mode.supported_bit() != 0);
        self.coming_mode = match (wanted, self.coming_mode) {
            (Some(mode), _) if Some(mode) == self.mode => None,
            (Some(mode), Some(coming)) if coming.mode == mode => Some(coming),
            (Some(mode), _) => Some(ComingMode { mode, due_ns: now_ns + self.mode_change_ns }),
            (None, _) => None,
        };
    }

    fn take_coming_mode(&mut self, dictionary: &SimulatedDictionary, now_ns: Nanoseconds) {
        let Some(coming) = self.coming_mode.filter(|coming| coming.due_ns <= now_ns) else { return };
        self.coming_mode = None;
        if self.keeps_mode() {
            return;
        }
        self.mode = Some(coming.mode);
        if self.device.state().has_torque() && self.device.stop().is_none() {
            self.engage(dictionary);
        }
    }

    fn engage(&mut self, dictionary: &SimulatedDictionary) {
        let mut motion = self.motion;
        motion.engage(self.mode, self.actual(), &self.profile(dictionary));
        self.motion = motion;
    }

    /// Evaluates the controlword in the state machine and in the mode. Returns whether a fault was reset.
    pub fn evaluate(&mut self, now_ns: Nanoseconds, dictionary: &SimulatedDictionary) -> bool {
        let word = dictionary.number_at(self.places.controlword).unwrap_or(0) as u16;
        let previous = self.device.controlword();
        let had_stop = self.device.stop().is_some();
        let change = self.device.evaluate(now_ns, word, &self.places, dictionary, !self.has_lost_turns);
        if change == Change::Enabled {
            self.servo.reset();
            self.engage(dictionary);
        }
        if !had_stop && self.device.stop().is_some() {
            self.motion.begin_stop(self.actual());
        }
        if self.device.state() == DriveState::OperationEnabled {
            let mut motion = self.motion;
            let switches = self.parameters.switches;
            let is_home = motion.evaluate(word, previous, &switches, &self.profile(dictionary));
            self.motion = motion;
            if is_home {
                self.set_home(self.joint.position(), dictionary);
            }
        }
        change == Change::FaultReset
    }

    /// Reacts to the loss of the master by object 6007; without it the axis faults. Returns whether it is to fail.
    pub fn lose_master(&mut self, dictionary: &SimulatedDictionary) -> bool {
        match dictionary.number_at(self.places.abort_connection_option) {
            Some(0) => false,
            Some(2) => {
                self.lose_torque();
                false
            }
            Some(3) => {
                if self.device.state() == DriveState::OperationEnabled {
                    self.device.quick_stop(dictionary.number_at(self.places.quick_stop_option).unwrap_or(2));
                    self.motion.begin_stop(self.actual());
                }
                false
            }
            _ => true,
        }
    }

    /// Enters a fault: error code and fault reaction.
    pub fn fail(&mut self, error: DeviceError, dictionary: &mut SimulatedDictionary) {
        dictionary.set_at(self.places.error_code, error.code().into());
        let reaction = if error.cuts_power() { FaultReaction::CutPower } else { FaultReaction::ByOption };
        self.device.fault(reaction, &self.places, dictionary);
        if self.device.stop().is_some() {
            self.motion.begin_stop(self.actual());
        } else {
            self.torque = 0.0;
        }
    }

    /// Gives the joint the position of object 607C at the home position (rad, m).
    fn set_home(&mut self, home: f64, dictionary: &SimulatedDictionary) {
        let wanted = dictionary.real_at(self.places.home_offset).unwrap_or(0.0);
        let before = self.position();
        self.offset = wanted - home * self.units.position - self.parameters.encoder.zero_counts;
        self.motion.shift(self.position() - before);
    }

    /// One step of state machine, set-points, loops and joint.
    pub fn step(
        &mut self,
        now_ns: Nanoseconds,
        duration_ns: Nanoseconds,
        dictionary: &SimulatedDictionary,
    ) -> Option<AxisEvent> {
        let duration_s = duration_ns as f64 / NANOSECONDS_PER_SECOND as f64;
        self.take_coming_mode(dictionary, now_ns);
        let mut event = self.evaluate(now_ns, dictionary).then_some(AxisEvent::FaultReset);
        let is_driven = self.device.state().has_torque();
        if is_driven {
            self.drive(dictionary, duration_s);
        } else {
            self.torque = 0.0;
        }
        let from = self.joint.position();
        if self.defects.is_blocked {
            self.joint.halt();
        } else {
            self.joint.step(duration_s, self.joint_torque(), self.is_braked());
        }
        if is_driven {
            self.search_home(from, dictionary);
            let mut motion = self.motion;
            let is_beyond = motion.exceeds_window(self.actual(), &self.profile(dictionary), duration_s);
            self.motion = motion;
            if is_beyond && self.device.stop().is_none() {
                event = Some(AxisEvent::Failed(DeviceError::FollowingError));
            }
        } else {
            self.motion.follow(self.actual());
        }
        let mut motion = self.motion;
        let word = self.device.controlword();
        self.mode_bits = motion.status_bits(self.actual(), word, &self.profile(dictionary), duration_s);
        self.motion = motion;
        event
    }

    fn search_home(&mut self, from: f64, dictionary: &SimulatedDictionary) {
        let switches = self.parameters.switches;
        let home = self.motion.step_homing(HomingStep {
            switches: &switches,
            from,
            to: self.joint.position(),
            direction: self.direction(),
            is_at_rest: self.motion.is_at_rest(),
        });
        if let Some(home) = home {
            self.set_home(home, dictionary);
        }
    }

    /// One step of set-point, loops and torque.
    fn drive(&mut self, dictionary: &SimulatedDictionary, duration_s: f64) {
        let actual = self.actual();
        let mut motion = self.motion;
        let profile = self.profile(dictionary);
        let (demand, is_stopped) = match self.device.stop() {
            Some(stop) => motion.step_stop(profile.deceleration_of(stop.ramp), duration_s),
            None => (motion.step(self.device.controlword(), actual, &profile, duration_s), false),
        };
        self.motion = motion;
        if is_stopped {
            self.device.stopped();
        }
        let measured = Measured {
            count: 1.0 / self.units.position.abs(),
            per_mille: self.parameters.rated_torque / 1000.0,
            position: actual.position,
            velocity: self.joint.velocity() * self.direction(),
        };
        self.servo.set_torque_limit(self.torque_limit(dictionary));
        self.torque = demand.torque(&mut self.servo, measured, duration_s);
        if !self.device.state().has_torque() {
            self.torque = 0.0;
        }
    }

    /// The peak torque within objects 6072, 60E0 and 60E1: N·m (N).
    fn torque_limit(&self, dictionary: &SimulatedDictionary) -> f64 {
        let places =
            [self.places.max_torque, self.places.positive_torque_limit, self.places.negative_torque_limit];
        let limits = places.into_iter().filter_map(|place| dictionary.real_at(place));
        let limits = limits.map(|limit| limit * self.parameters.rated_torque / 1000.0);
        limits.fold(self.parameters.peak_torque, f64::min)
    }

    /// Writes the measured values to the dictionary.
    pub fn measure(&self, dictionary: &mut SimulatedDictionary) {
        let Self { places, units, parameters, .. } = self;
        let position = self.position();
        let per_mille = 1000.0 * self.torque / parameters.rated_torque;
        let velocity = self.joint.velocity() * units.position;
        dictionary.set_at(places.statusword, self.statusword().into());
        dictionary.set_at(places.mode_display, self.mode_number().into());
        dictionary.set_at(places.position, position.round_ties_even() as i64);
        dictionary.set_at(places.position_increments, position.round_ties_even() as i64);
        dictionary.set_at(places.position_demand, self.motion.position().round_ties_even() as i64);
        dictionary.set_real_at(places.velocity, velocity / units.velocity);
        dictionary.set_real_at(places.velocity_demand, self.motion.velocity() / units.velocity);
        dictionary.set_real_at(places.torque, per_mille);
        dictionary.set_real_at(places.current, per_mille);
        dictionary.set_real_at(places.torque_demand, per_mille);
        dictionary.set_real_at(places.following_error, self.motion.position() - position);
        dictionary.set_at(places.digital_inputs, self.inputs());
        for (place, MeasuredObject { factor, quantity, .. }) in &self.measured {
            match quantity {
                MeasuredQuantity::Position => {
                    let counts = self.joint.position() * units.position * factor;
                    dictionary.set_at(*place, counts.round_ties_even() as i64);
                }
                MeasuredQuantity::Torque => dictionary.set_real_at(*place, factor * self.torque),
            }
        }
    }

    /// Object 60FD: negative limit, positive limit, home switch.
    fn inputs(&self) -> i64 {
        let at = self.joint.position();
        let switches = &self.parameters.switches;
        let all = [switches.negative_limit, switches.positive_limit, switches.home];
        let is_closed = all.map(|switch| switch.is_some_and(|switch| switch.is_closed(at)));
        is_closed.into_iter().enumerate().map(|(bit, is_closed)| i64::from(is_closed) << bit).sum()
    }
}

/// The objects of the vendor that show measured values of an axis.
fn measured_objects(
    dictionary: &SimulatedDictionary,
    number: u16,
    quirks: &Quirks,
) -> Vec<(Option<usize>, MeasuredObject)> {
    let of_first = quirks.simulated.measured.iter().filter(|_| number == 0);
    of_first.map(|shown| (dictionary.place(shown.address.index, shown.address.subindex), *shown)).collect()
}

/// Sets a rating of the motor.
fn commission(dictionary: &mut SimulatedDictionary, place: Option<usize>, value: f64) {
    if let Some(place) = place {
        dictionary.set_factory(place, value as i64);
    }
}

/// Sets a rating of the motor that the data sheet leaves open.
fn commission_open(dictionary: &mut SimulatedDictionary, place: Option<usize>, value: f64) {
    if let Some(place) = place.filter(|place| dictionary.number(*place) == 0) {
        dictionary.set_factory(place, value as i64);
    }
}

/// The modes of an axis, as bits of object 6502: by the quirks, by that object, or by the objects that only one mode has, and those
/// that the quirks add. No object tells of a cyclic mode.
fn modes_of(dictionary: &SimulatedDictionary, places: &Places, quirks: &Quirks) -> u32 {
    let bits = |modes: &[OperationMode]| modes.iter().fold(0, |bits, mode| bits | mode.supported_bit());
    let stated = dictionary.number_at(places.supported_modes).filter(|modes| *modes != 0);
    let own = match (&quirks.modes, stated) {
        (Some(modes), _) => bits(modes),
        (None, Some(stated)) => stated as u32,
        (None, None) => modes_by_objects(places),
    };
    own | bits(&quirks.undeclared_modes)
}

fn modes_by_objects(places: &Places) -> u32 {
    let of = |mode: OperationMode, demanded: &[Option<usize>]| {
        if demanded.iter().all(Option::is_some) { mode.supported_bit() } else { 0 }
    };
    of(OperationMode::ProfilePosition, &[places.target_position, places.profile_velocity])
        | of(OperationMode::ProfileVelocity, &[places.target_velocity, places.profile_acceleration])
        | of(OperationMode::ProfileTorque, &[places.target_torque, places.torque_slope])
        | of(OperationMode::Homing, &[places.homing_method])
        | of(OperationMode::InterpolatedPosition, &[places.interpolation_data])
}
