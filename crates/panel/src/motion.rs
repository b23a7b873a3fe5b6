//! One motion that a page has set going: how it goes on, and how a velocity or a torque reaches the drive.

use std::time::Duration;

use takt_rt::{AxisPoint, Nanoseconds, OperationMode, Phase, RequestId, RequestTarget, StopCategory};

use super::command::{CommandRefusal, Quantity, not_refused};
use super::pages::PageNumber;
use takt::command::{AnyHandle, MotionError, MotionId, MoveOptions, StreamError};

/// The real-time thread stops a drive in a profile mode whose value is not renewed for so long.
const VALID_FOR: Duration = Duration::from_millis(300);

/// A motion of a page.
pub struct Motion {
    pub page: PageNumber,
    pub target: RequestTarget,
    /// The newest stop when it began: a later one ends it.
    pub newest_stop: RequestId,
    pub kind: Kind,
}

pub enum Kind {
    /// To a target, once.
    Move(MotionId),
    /// To and fro.
    Reciprocate { axis: usize, ends: [Vec<f64>; 2], options: MoveOptions, next: usize, motion: MotionId },
    /// A velocity or a torque.
    Drive { axis: usize, value: f64, until: Option<Nanoseconds>, by: Route },
}

/// How a velocity or a torque reaches the drive.
pub enum Route {
    /// As the target of a profile mode.
    Profile { quantity: Quantity, newest: MotionId },
    /// As a stream, in which the other axes of the group stay where they are.
    Stream { quantity: Quantity, place: usize, points: Vec<AxisPoint> },
}

/// What has become of a motion.
pub enum Step {
    GoesOn,
    /// It has ended by itself, or somebody else has ended it.
    Over,
    /// It is to be brought to rest.
    Rest,
    /// It cannot go on, for this reason, and is to be brought to rest.
    Failed(CommandRefusal),
}

/// Returns `true` if a group is one of a target.
pub fn is_meant(target: RequestTarget, group: usize) -> bool {
    match target {
        RequestTarget::All => true,
        RequestTarget::Group(meant) => usize::from(meant) == group,
    }
}

impl Motion {
    /// The axis of what goes on until it is released.
    pub const fn repeated_axis(&self) -> Option<usize> {
        match &self.kind {
            Kind::Move(_) => None,
            Kind::Reciprocate { axis, .. } | Kind::Drive { axis, .. } => Some(*axis),
        }
    }

    pub const fn is_profile(&self) -> bool {
        matches!(self.kind, Kind::Drive { by: Route::Profile { .. }, .. })
    }

    /// Lets the value of a profile mode go to zero, where the drive holds or has no torque; `None` for other motions, which are stopped.
    pub fn zero(&self, controller: &AnyHandle) -> Option<Result<MotionId, CommandRefusal>> {
        let Kind::Drive { axis, by: Route::Profile { quantity, .. }, .. } = &self.kind else { return None };
        let zero = match quantity {
            Quantity::Velocity => controller.velocity(*axis, 0.0, VALID_FOR),
            Quantity::Torque => controller.torque(*axis, 0.0, VALID_FOR),
        };
        Some(zero.map_err(CommandRefusal::from))
    }

    /// Goes on with it.
    pub fn step(&mut self, controller: &AnyHandle) -> Step {
        if controller.of(self.target).newest_stop() != self.newest_stop {
            // Of another process' stop one hears late: what was renewed since then must end as well.
            return if self.repeated_axis().is_some() { Step::Rest } else { Step::Over };
        }
        let step = match &mut self.kind {
            Kind::Move(motion) => match controller.result_of(*motion) {
                None => Step::GoesOn,
                Some(_) => Step::Over,
            },
            Kind::Reciprocate { ends, options, next, motion, .. } => match controller.result_of(*motion) {
                None => Step::GoesOn,
                Some(Ok(())) => match controller.of(self.target).move_with(&ends[*next % 2], *options) {
                    Ok(begun) => {
                        (*motion, *next) = (begun, *next + 1);
                        Step::GoesOn
                    }
                    Err(error) => Step::Failed(error.into()),
                },
                Some(Err(_)) => Step::Over,
            },
            Kind::Drive { until: Some(until), .. } if controller.now_ns() >= *until => Step::Rest,
            Kind::Drive { axis, value, by, .. } => by.step(controller, self.target, *axis, *value),
        };
        // A stop that came in between must not be followed by a new value.
        match step {
            Step::GoesOn if controller.of(self.target).newest_stop() != self.newest_stop => Step::Rest,
            step => step,
        }
    }
}

impl Route {
    /// Begins a velocity or torque in the way that the mode of the axis needs.
    ///
    /// # Errors
    /// See [`CommandRefusal`].
    pub fn begin(
        controller: &AnyHandle,
        axis: usize,
        target: RequestTarget,
        quantity: Quantity,
        value: f64,
    ) -> Result<Self, CommandRefusal> {
        let state = controller.state();
        let mode = state.axes().get(axis).and_then(|axis| OperationMode::from_number(axis.mode_set));
        let wrong = || CommandRefusal::WrongMode {
            axis: controller.machine().axis_name(u8::try_from(axis).unwrap_or(u8::MAX)),
            mode: mode.map_or("no mode", OperationMode::name),
            quantity: match quantity {
                Quantity::Velocity => "velocity",
                Quantity::Torque => "torque",
            },
        };
        match (mode, quantity) {
            (Some(OperationMode::ProfileVelocity), Quantity::Velocity) => {
                let newest = not_refused(controller, controller.velocity(axis, value, VALID_FOR)?)?;
                Ok(Self::Profile { quantity, newest })
            }
            (Some(OperationMode::ProfileTorque), Quantity::Torque) => {
                let newest = not_refused(controller, controller.torque(axis, value, VALID_FOR)?)?;
                Ok(Self::Profile { quantity, newest })
            }
            (
                Some(
                    OperationMode::ProfileVelocity
                    | OperationMode::ProfileTorque
                    | OperationMode::ProfilePosition,
                ),
                _,
            )
            | (None, _) => Err(wrong()),
            (Some(mode), Quantity::Torque) if mode != OperationMode::CyclicSynchronousTorque => Err(wrong()),
            (Some(_), _) => {
                let axes = controller.of(target).axis_numbers();
                let rest = |number: &usize| {
                    AxisPoint::position(state.axes().get(*number).map_or(0.0, |axis| axis.position_set))
                };
                let points: Vec<AxisPoint> = axes.iter().map(rest).collect();
                let place = axes.iter().position(|number| *number == axis).ok_or_else(wrong)?;
                controller.of(target).begin_stream()?;
                let mut route = Self::Stream { quantity, place, points };
                // A value that is refused moves nothing, and leaves no stream behind.
                if let Err(error) = route.send(controller, target, axis, value) {
                    controller.of(target).stop(StopCategory::Two)?;
                    return Err(error);
                }
                Ok(route)
            }
        }
    }

    fn step(&mut self, controller: &AnyHandle, target: RequestTarget, axis: usize, value: f64) -> Step {
        match self {
            Self::Profile { newest, .. } => {
                if let Some(Err(error)) = controller.result_of(*newest) {
                    let is_told = matches!(error, MotionError::Refused(_));
                    return if is_told { Step::Failed(error.into()) } else { Step::Over };
                }
            }
            Self::Stream { .. } => {
                let state = controller.state();
                let mut groups =
                    state.groups().iter().enumerate().filter(|(group, _)| is_meant(target, *group));
                if !groups.any(|(_, group)| group.phase == Phase::Streaming) {
                    return Step::Over;
                }
            }
        }
        match self.send(controller, target, axis, value) {
            Ok(()) => Step::GoesOn,
            // A stop has ended the stream.
            Err(CommandRefusal::Stream(StreamError::NotStreaming)) => Step::Over,
            Err(error) => Step::Failed(error),
        }
    }

    fn send(
        &mut self,
        controller: &AnyHandle,
        target: RequestTarget,
        axis: usize,
        value: f64,
    ) -> Result<(), CommandRefusal> {
        match self {
            Self::Profile { quantity: Quantity::Velocity, newest } => {
                *newest = controller.velocity(axis, value, VALID_FOR)?;
            }
            Self::Profile { quantity: Quantity::Torque, newest } => {
                *newest = controller.torque(axis, value, VALID_FOR)?;
            }
            Self::Stream { quantity, place, points } => {
                if let Some(point) = points.get_mut(*place) {
                    *point = match quantity {
                        Quantity::Velocity => AxisPoint::Velocity(value),
                        Quantity::Torque => AxisPoint::Torque(value),
                    };
                }
                controller.of(target).stream().push(controller.now_ns(), points)?;
            }
        }
        Ok(())
    }
}
