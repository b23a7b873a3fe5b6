//! The complete drive: it receives frames and time, advances its parts, and sends frames.

mod access;
mod frames;

use takt_rt::Nanoseconds;

use super::axis::{Axis, AxisEvent};
use super::defects::FeedbackDefects;
use super::errors::{Cia402Error, Errors};
use super::network::Network;
use super::places::is_measured;
use super::{Cia402Parameters, NotADrive, dictionary_of};
use crate::config::quirks::Quirks;
use crate::sim::defect::{Defect, Unsupported};
use crate::sim::drive::{Drive, DriveFault, Observation};
use crate::sim::mailbox::Mailbox;
use crate::sim::object_dictionary::SimulatedDictionary;
use crate::sim::pdo_engine::PdoEngine;
use crate::sim::plant::Gravity;
use crate::sim::random::Random;
use crate::sim::sdo_server::{SdoFeatures, SdoServer};

/// Longest time between two advances.
const IDLE_NS: Nanoseconds = 1_000_000;
/// The control loops and the plant run at 8 kHz.
const STEP_NS: Nanoseconds = 125_000;
/// From an SDO request to its reply.
const SHORTEST_REPLY_NS: Nanoseconds = 300_000;
const LONGEST_REPLY_NS: Nanoseconds = 1_000_000;
/// From "save" until it takes effect.
const SAVE_NS: Nanoseconds = 100_000_000;
const NEVER: Nanoseconds = Nanoseconds::MAX;

/// A simulated CiA 402 drive, made from its data sheet.
#[derive(Clone, Debug)]
pub struct Cia402Drive {
    node: u8,
    quirks: Quirks,
    power_up_ns: Nanoseconds,
    feedback_delay_ns: Nanoseconds,
    dictionary: SimulatedDictionary,
    network: Network,
    sdo: SdoServer,
    pdos: PdoEngine,
    errors: Errors,
    axes: Vec<Axis>,
    has_pdo_error: bool,
    /// A fault injected since the last advance.
    injected: Option<DriveFault>,
    defects: FeedbackDefects,
    save_ns: Nanoseconds,
    /// From when on PDOs work after NMT start.
    pdos_ready_ns: Nanoseconds,
    /// The time up to which the loops have run.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
    wake_ns: Nanoseconds,
}

impl Cia402Drive {
    /// A drive whose supply is switched on at time 0.
    ///
    /// # Errors
    /// The data sheet describes no CiA 402 drive with so many axes.
    pub fn new(parameters: Cia402Parameters) -> Result<Self, NotADrive> {
        let mut dictionary = dictionary_of(&parameters)?;
        let Cia402Parameters { node, quirks, axes, power_up_ns, feedback_delay_ns, seed, .. } = parameters;
        let power_up_ns = quirks.delays.boot_up_ns.unwrap_or(power_up_ns);
        let axes = (0u16..).zip(axes).map(|(number, axis)| Axis::new(number, axis, &mut dictionary, &quirks));
        let axes = axes.collect();
        let longest_ns = quirks.delays.sdo_reply_ns.unwrap_or(LONGEST_REPLY_NS);
        let features = SdoFeatures { is_upload_segmented: false, has_blocks: !quirks.refuses_blocks };
        let latency_ns = SHORTEST_REPLY_NS.min(longest_ns)..longest_ns + 1;
        Ok(Self {
            node,
            power_up_ns,
            feedback_delay_ns,
            network: Network::starting(&dictionary, power_up_ns, quirks.power_up),
            sdo: SdoServer::new(Random::new(seed, node), latency_ns, features),
            pdos: PdoEngine::new(&dictionary, is_measured),
            errors: Errors::new(&dictionary),
            axes,
            quirks,
            dictionary,
            has_pdo_error: false,
            injected: None,
            defects: FeedbackDefects::default(),
            save_ns: NEVER,
            pdos_ready_ns: 0,
            stepped_ns: 0,
            now_ns: 0,
            wake_ns: 0,
        })
    }

    /// The number of its axes.
    pub fn axes(&self) -> usize {
        self.axes.len()
    }

    /// From now on gravity loads the joint of one of its axes so, counted from 0. An axis that is not there is left alone.
    pub fn set_axis_gravity(&mut self, axis: usize, gravity: Gravity) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.joint.set_gravity(gravity);
        }
    }

    /// The true state of one of its axes at `now_ns`, counted from 0.
    pub fn observe_axis(&mut self, now_ns: Nanoseconds, axis: usize) -> Option<Observation> {
        self.run_loops(now_ns);
        let nmt = self.network.state();
        let axis = self.axes.get(axis)?;
        Some(Observation {
            position: axis.joint.position(),
            velocity: axis.joint.velocity(),
            torque: axis.joint_torque(),
            position_counts: axis.position().round_ties_even() as i64 as i32,
            state: axis.state(),
            statusword: axis.statusword(),
            error_code: self.dictionary.number_at(axis.places.error_code).unwrap_or(0) as u16,
            operation_mode: axis.mode_number(),
            nmt,
            is_braked: axis.is_braked(),
        })
    }

    /// Runs the loops in steps up to `now_ns`.
    fn run_loops(&mut self, now_ns: Nanoseconds) {
        while self.stepped_ns + STEP_NS <= now_ns {
            self.step(STEP_NS);
        }
    }

    /// Runs the loops exactly up to `now_ns`, so that their steps are locked to SYNC.
    fn lock_loops(&mut self, now_ns: Nanoseconds) {
        self.run_loops(now_ns);
        if now_ns > self.stepped_ns {
            self.step(now_ns - self.stepped_ns);
        }
    }

    fn step(&mut self, duration_ns: Nanoseconds) {
        self.stepped_ns += duration_ns;
        for index in 0..self.axes.len() {
            match self.axes[index].step(self.stepped_ns, duration_ns, &self.dictionary) {
                Some(AxisEvent::Failed(error)) => self.fail(index, error),
                Some(AxisEvent::FaultReset) => self.fault_reset(index),
                None => {}
            }
        }
    }

    /// Has an axis fail: error code, emergency message, fault reaction.
    fn fail(&mut self, index: usize, error: Cia402Error) {
        self.axes[index].fail(error, &mut self.dictionary);
        self.errors.raise(error, &mut self.dictionary);
    }

    fn fault_reset(&mut self, index: usize) {
        self.dictionary.set_at(self.axes[index].places.error_code, 0);
        if self.axes.iter().all(|axis| !axis.state().is_faulted()) {
            self.errors.clear(&mut self.dictionary);
        }
    }

    /// Evaluates the controlwords.
    fn evaluate(&mut self) {
        for index in 0..self.axes.len() {
            if self.axes[index].evaluate(&self.dictionary) {
                self.fault_reset(index);
            }
        }
    }

    fn follow_modes(&mut self, now_ns: Nanoseconds) {
        self.axes.iter_mut().for_each(|axis| axis.follow_mode(&self.dictionary, now_ns));
    }

    fn latch(&mut self) {
        self.axes.iter_mut().for_each(|axis| axis.latch(&self.dictionary));
    }

    /// The master is lost: every axis does what object 6007 says.
    fn lose_master(&mut self) {
        let mut is_fault = false;
        for axis in &mut self.axes {
            if axis.lose_master(&self.dictionary) {
                axis.fail(Cia402Error::MasterLost, &mut self.dictionary);
                is_fault = true;
            }
        }
        // The node reports the error even when its axes go on.
        self.errors.raise(Cia402Error::MasterLost, &mut self.dictionary);
        if !is_fault {
            self.errors.clear(&mut self.dictionary);
        }
        self.stop_services();
    }

    /// Writes the measured values to the dictionary.
    fn measure(&mut self) {
        self.axes.iter().for_each(|axis| axis.measure(&self.quirks, &mut self.dictionary));
    }

    /// Writes the measured values to the dictionary with the effect of the defects, and lets the PDOs take their
    /// objects.
    fn report<T>(&mut self, take: impl FnOnce(&mut PdoEngine, &SimulatedDictionary) -> T) -> T {
        self.measure();
        let places = self.axes[0].places;
        let truth = self.defects.falsify(&places, &mut self.dictionary);
        let taken = take(&mut self.pdos, &self.dictionary);
        truth.restore(&mut self.dictionary);
        taken
    }

    /// Restarts everything except the joints and the saved parameters.
    fn start(&mut self, now_ns: Nanoseconds) {
        self.dictionary.restore(0..=u16::MAX);
        self.network.restart(now_ns + self.power_up_ns);
        self.sdo.reset();
        self.errors.reset();
        self.pdos.compile(&self.dictionary);
        for axis in &mut self.axes {
            axis.restart(&mut self.dictionary, &self.quirks);
        }
        self.has_pdo_error = false;
        self.save_ns = NEVER;
    }

    fn schedule(&mut self, now_ns: Nanoseconds) {
        let has_message = self.errors.is_pending() && self.network.has_services();
        let due_ns = [
            now_ns + IDLE_NS,
            self.network.due_ns(),
            self.sdo.due_ns().unwrap_or(NEVER),
            self.pdos.due_ns(),
            self.save_ns,
            if has_message { now_ns } else { NEVER },
        ];
        self.wake_ns = due_ns.into_iter().min().unwrap_or(NEVER).max(now_ns + 1);
    }
}

impl Drive for Cia402Drive {
    fn node(&self) -> u8 {
        self.node
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &takt_rt::Frame, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        self.receive_frame(now_ns, frame, mailbox);
        self.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            self.fail(0, Cia402Error::Fault(fault));
        }
        if self.network.check_master(now_ns, &self.dictionary) {
            self.lose_master();
        }
        if self.pdos.has_lost_rpdo(now_ns) {
            self.errors.raise(Cia402Error::RpdoTimeout, &mut self.dictionary);
        }
        if now_ns >= self.save_ns {
            self.save_ns = NEVER;
            self.dictionary.save();
        }
        self.send_due(now_ns, mailbox);
        self.schedule(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.wake_ns
    }

    /// The first axis.
    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.observe_axis(now_ns, 0).expect("a drive has at least one axis")
    }

    /// In the first axis.
    fn inject_fault(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.wake_ns = self.now_ns + 1;
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.start(now_ns);
        self.schedule(now_ns);
    }

    /// On the joint of the first axis.
    fn set_gravity(&mut self, gravity: Gravity) {
        self.axes[0].joint.set_gravity(gravity);
    }

    /// On the joint of the first axis.
    fn set_load_torque(&mut self, torque: f64) {
        self.axes[0].joint.set_load_torque(torque);
    }

    /// In the first axis.
    fn inject_defect(
        &mut self,
        now_ns: Nanoseconds,
        defect: Defect,
        is_present: bool,
    ) -> Result<(), Unsupported> {
        if defect == Defect::OtherObjectMapped && self.axes[0].places.torque.is_none() {
            let reason =
                "the data sheet of this drive lacks object 6077, which would take the place of the position";
            return Err(Unsupported { defect, reason });
        }
        self.run_loops(now_ns);
        self.defects.set(defect, is_present);
        let first = &mut self.axes[0];
        match defect {
            Defect::BlockedJoint => first.defects.is_blocked = is_present,
            Defect::StuckBrake => first.defects.is_brake_stuck = is_present,
            Defect::EncoderJump { distance } if is_present => first.jump(distance),
            Defect::TorqueOff if is_present => first.lose_torque(),
            Defect::Alarm { code } if is_present => self.fail(0, Cia402Error::Alarm(code)),
            Defect::Emergency { code } if is_present => {
                self.errors.raise(Cia402Error::Alarm(code), &mut self.dictionary);
            }
            _ => {}
        }
        self.wake_ns = self.now_ns + 1;
        Ok(())
    }
}
