//! The complete drive: it receives frames and time, advances its parts, and sends frames.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::canopen::object::ObjectAddress;

use super::axis::{Axis, AxisEvent};
use super::node::{CanopenDevice, CanopenNode};
use super::places::AXIS_OFFSET;
use super::services::NodeServices;
use super::{Cia402Parameters, NotADrive, dictionary_of};
use crate::defect::{Defect, Unsupported};
use crate::drive::{Drive, DriveFault, Observation};
use crate::errors::DeviceError;
use crate::feedback_defects::ShownObjects;
use crate::loops::ControlLoops;
use crate::mailbox::Mailbox;
use crate::plant::Gravity;
use crate::random::Random;
use crate::sdo_reply::AbortCode;

/// A simulated CiA 402 drive, made from its data sheet.
#[derive(Clone, Debug)]
pub struct Cia402Drive {
    canopen: CanopenNode,
    axes: Vec<Axis>,
    /// A fault injected since the last advance.
    injected: Option<DriveFault>,
    /// The time up to which the loops have run.
    stepped_ns: Nanoseconds,
    now_ns: Nanoseconds,
}

impl Cia402Drive {
    /// A drive whose supply is switched on at time 0.
    ///
    /// # Errors
    /// The data sheet describes no CiA 402 drive with so many axes.
    pub fn new(parameters: Cia402Parameters) -> Result<Self, NotADrive> {
        let mut dictionary = dictionary_of(&parameters)?;
        let Cia402Parameters { node, mut quirks, axes, power_up_ns, feedback_delay_ns, seed, .. } =
            parameters;
        let mut random = Random::new(seed, node);
        if quirks.statusword_set_in_some != 0 && random.next_u64() & 1 == 1 {
            quirks.statusword_set |= quirks.statusword_set_in_some;
        }
        let axes = (0u16..).zip(axes).map(|(number, axis)| Axis::new(number, axis, &mut dictionary, &quirks));
        let axes = axes.collect();
        let mut drive = Self {
            canopen: CanopenNode::new(node, dictionary, quirks, random, power_up_ns, feedback_delay_ns),
            axes,
            injected: None,
            stepped_ns: 0,
            now_ns: 0,
        };
        drive.power_up();
        Ok(drive)
    }

    /// Without a battery the turn count is lost.
    fn power_up(&mut self) {
        if self.canopen.quirks.simulated.lacks_battery {
            self.axes.iter_mut().for_each(Axis::zero_turns);
        }
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
        let nmt = self.canopen.network.state();
        let axis = self.axes.get(axis)?;
        Some(Observation {
            position: axis.joint.position(),
            velocity: axis.joint.velocity(),
            torque: axis.joint_torque(),
            position_counts: axis.position().round_ties_even() as i64 as i32,
            state: axis.state(),
            statusword: axis.statusword(),
            error_code: self.canopen.dictionary.number_at(axis.places.error_code).unwrap_or(0) as u16,
            operation_mode: axis.mode_number(),
            nmt,
            is_braked: axis.is_braked(),
        })
    }

    /// Has an axis fail: error code, emergency message, fault reaction.
    fn fail(&mut self, index: usize, error: DeviceError) {
        self.axes[index].fail(error, &mut self.canopen.dictionary);
        self.canopen.errors.raise(error, &mut self.canopen.dictionary);
    }

    fn fault_reset(&mut self, index: usize) {
        self.canopen.dictionary.set_at(self.axes[index].places.error_code, 0);
        if self.axes.iter().all(|axis| !axis.state().is_faulted()) {
            self.canopen.errors.clear(&mut self.canopen.dictionary);
        }
    }

    /// Evaluates the controlwords.
    fn evaluate(&mut self, now_ns: Nanoseconds) {
        for index in 0..self.axes.len() {
            if self.axes[index].evaluate(now_ns, &self.canopen.dictionary) {
                self.fault_reset(index);
            }
        }
    }

    fn follow_modes(&mut self, now_ns: Nanoseconds) {
        self.axes.iter_mut().for_each(|axis| axis.follow_mode(&self.canopen.dictionary, now_ns));
    }

    fn latch(&mut self) {
        self.axes.iter_mut().for_each(|axis| axis.latch(&self.canopen.dictionary));
    }
}

impl ControlLoops for Cia402Drive {
    fn stepped_ns(&self) -> Nanoseconds {
        self.stepped_ns
    }

    fn step(&mut self, duration_ns: Nanoseconds) {
        self.stepped_ns += duration_ns;
        for index in 0..self.axes.len() {
            match self.axes[index].step(self.stepped_ns, duration_ns, &self.canopen.dictionary) {
                Some(AxisEvent::Failed(error)) => self.fail(index, error),
                Some(AxisEvent::FaultReset) => self.fault_reset(index),
                None => {}
            }
        }
    }
}

impl Cia402Drive {
    /// Acts on the modes, controlwords and set-points in the dictionary.
    fn take_values(&mut self, now_ns: Nanoseconds) {
        self.follow_modes(now_ns);
        self.evaluate(now_ns);
        self.latch();
    }
}

impl CanopenDevice for Cia402Drive {
    fn canopen(&mut self) -> &mut CanopenNode {
        &mut self.canopen
    }

    fn rpdo_applied(&mut self, now_ns: Nanoseconds, _number: usize, is_by_sync: bool) {
        if !is_by_sync {
            self.take_values(now_ns);
        }
    }

    fn synced(&mut self, now_ns: Nanoseconds) {
        self.take_values(now_ns);
    }

    fn is_faulted(&self) -> bool {
        self.axes.iter().any(|axis| axis.state().is_faulted())
    }

    fn measure(&mut self) {
        self.axes.iter().for_each(|axis| axis.measure(&mut self.canopen.dictionary));
    }

    /// The objects that a defect can change in the feedback: the torque takes the place of the position.
    fn shown(&self) -> ShownObjects {
        let places = &self.axes[0].places;
        ShownObjects {
            statusword: places.statusword,
            mode_display: places.mode_display,
            position: places.position,
            instead_of_position: places.torque,
        }
    }

    fn started(&mut self, now_ns: Nanoseconds) {
        for index in 0..self.axes.len() {
            self.axes[index].started(&self.canopen.dictionary, now_ns);
            if self.axes[index].has_lost_turns() {
                self.fail(index, DeviceError::Fault(DriveFault::MultiTurnBattery));
            }
        }
    }

    fn restart(&mut self, now_ns: Nanoseconds) {
        self.canopen.restart(now_ns);
        let CanopenNode { dictionary, quirks, .. } = &mut self.canopen;
        self.axes.iter_mut().for_each(|axis| axis.restart(dictionary, quirks));
        self.power_up();
    }

    /// The master is lost: every axis does what object 6007 says.
    fn lose_master(&mut self) {
        let CanopenNode { dictionary, errors, network, .. } = &mut self.canopen;
        network.follow_error_behaviour(dictionary);
        let mut is_fault = false;
        for axis in &mut self.axes {
            if axis.lose_master(dictionary) {
                axis.fail(DeviceError::MasterLost, dictionary);
                is_fault = true;
            }
        }
        // The node reports the error even when its axes go on.
        errors.raise(DeviceError::MasterLost, dictionary);
        if !is_fault {
            errors.clear(dictionary);
        }
    }

    fn check_write(&self, place: usize) -> Result<(), AbortCode> {
        let is_kept = self.axes.iter().any(|axis| axis.places.mode == Some(place) && axis.keeps_mode());
        if is_kept { Err(AbortCode::DeviceState) } else { Ok(()) }
    }

    fn check_value(&self, address: ObjectAddress, value: i64) -> Result<(), AbortCode> {
        let is_remote = matches!(address.index, 0x1800..=0x19FF) && address.subindex == 2;
        let is_refused =
            self.canopen.quirks.simulated.refuses_remote_pdos && is_remote && matches!(value, 252 | 253);
        if is_refused { Err(AbortCode::Value) } else { Ok(()) }
    }

    fn written(&mut self, address: ObjectAddress, now_ns: Nanoseconds) {
        if self.canopen.quirks.turn_count.is_some_and(|turns| turns.clear == address) {
            let place = self.canopen.dictionary.place(address.index, address.subindex);
            if self.canopen.dictionary.number_at(place) == Some(1) {
                self.axes[0].clear_turns();
            }
        }
        let object = match address.index {
            0x6000..=0x9FFF => 0x6000 + (address.index - 0x6000) % AXIS_OFFSET,
            _ => return,
        };
        match object {
            0x6040 => self.evaluate(now_ns),
            0x6060 => self.follow_modes(now_ns),
            0x607A | 0x60C1 => self.latch(),
            0x607E | 0x608F | 0x6091 | 0x6092 | 0x6096 | 0x60A9 => {
                for axis in &mut self.axes {
                    axis.set_units(&self.canopen.dictionary, &self.canopen.quirks);
                }
            }
            _ => {}
        }
    }
}

impl Drive for Cia402Drive {
    fn node(&self) -> u8 {
        self.canopen.id
    }

    fn receive(&mut self, now_ns: Nanoseconds, frame: &Frame, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        if self.canopen.passes_by(now_ns, frame) {
            return;
        }
        self.run_loops(now_ns);
        self.receive_frame(now_ns, frame, mailbox);
        self.canopen.schedule(now_ns);
    }

    fn advance(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.now_ns = now_ns;
        self.run_loops(now_ns);
        if let Some(fault) = self.injected.take() {
            if fault == DriveFault::MultiTurnBattery && self.canopen.quirks.turn_count.is_some() {
                self.axes[0].lose_turns();
            }
            self.fail(0, DeviceError::Fault(fault));
        }
        self.advance_node(now_ns, mailbox);
        self.canopen.schedule(now_ns);
    }

    fn wake_ns(&self) -> Nanoseconds {
        self.canopen.wake_ns()
    }

    /// The first axis.
    fn observe(&mut self, now_ns: Nanoseconds) -> Observation {
        self.observe_axis(now_ns, 0).expect("a drive has at least one axis")
    }

    /// In the first axis.
    fn inject_fault(&mut self, fault: DriveFault) {
        self.injected = Some(fault);
        self.canopen.wake_after(self.now_ns);
    }

    fn power_cycle(&mut self, now_ns: Nanoseconds, mailbox: &mut Mailbox) {
        self.run_loops(now_ns);
        mailbox.clear();
        self.restart(now_ns);
        self.canopen.is_boot_silent = self.canopen.quirks.simulated.is_power_up_silent;
        self.canopen.schedule(now_ns);
    }

    /// On the joint of the first axis.
    fn set_gravity(&mut self, gravity: Gravity) {
        self.run_loops(self.now_ns);
        self.axes[0].joint.set_gravity(gravity);
    }

    /// On the joint of the first axis.
    fn set_load_torque(&mut self, torque: f64) {
        self.run_loops(self.now_ns);
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
        self.canopen.defects.set(defect, is_present);
        let first = &mut self.axes[0];
        first.defects.set(defect, is_present);
        match defect {
            Defect::EncoderJump { distance } if is_present => first.jump(distance),
            Defect::TorqueOff if is_present => first.lose_torque(),
            Defect::Disobedience(how) => first.disobey(is_present.then_some(how)),
            Defect::Alarm { code } if is_present => self.fail(0, DeviceError::Alarm(code)),
            Defect::Emergency { code } if is_present => {
                self.canopen.errors.raise(DeviceError::Alarm(code), &mut self.canopen.dictionary);
            }
            _ => {}
        }
        self.canopen.wake_after(self.now_ns);
        Ok(())
    }
}
