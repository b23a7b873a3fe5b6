//! A motor that does what a CAN FD command says, without mechanics: it keeps to the velocity that it is given.

use takt_rt::Nanoseconds;
use takt_wire::hollow_lines::motor_data::{
    COUNTS_PER_TURN, MotorCommand, MotorMode, MotorReply, MotorRun, MotorScale,
};

/// Counts per second squared of one ampere in torque mode: a small motor without load.
const COUNTS_PER_S2_AND_A: f64 = 20.0 * COUNTS_PER_TURN;
/// Counts per second: as fast as the voltage allows.
const FASTEST: f64 = 40.0 * COUNTS_PER_TURN;
/// How a free motor comes to rest.
const COASTING: f64 = 10.0 * COUNTS_PER_TURN;
/// The pole pairs of the example in the manual.
const POLE_PAIRS: std::num::NonZeroU16 = std::num::NonZeroU16::new(14).unwrap();
/// °C
const TEMPERATURE: i8 = 30;

/// A simulated motor.
#[derive(Clone, Debug)]
pub struct Motor {
    id: u8,
    command: MotorCommand,
    /// Counts.
    position: f64,
    /// Counts per second.
    velocity: f64,
    now_ns: Nanoseconds,
}

impl Motor {
    /// A motor that is free and stands at zero.
    pub fn new(id: u8) -> Self {
        Self { id, command: MotorCommand::default(), position: 0.0, velocity: 0.0, now_ns: 0 }
    }

    /// Its identifier.
    pub const fn id(&self) -> u8 {
        self.id
    }

    /// Follows a command from now on. As the manual says, it follows the last one for ever.
    pub fn obey(&mut self, now_ns: Nanoseconds, command: MotorCommand) {
        self.advance(now_ns);
        if command.run == MotorRun::FreeAndSetZero && self.command.run != MotorRun::Run {
            self.position = 0.0;
        }
        self.command = command;
    }

    /// Moves up to this time.
    pub fn advance(&mut self, now_ns: Nanoseconds) {
        let step_s = now_ns.saturating_sub(self.now_ns) as f64 / 1e9;
        self.now_ns = self.now_ns.max(now_ns);
        if step_s == 0.0 {
            return;
        }
        let before = self.position;
        if self.command.run == MotorRun::Run {
            self.run(step_s);
        } else {
            let slower = (self.velocity.abs() - COASTING * step_s).max(0.0);
            self.velocity = slower.copysign(self.velocity);
            self.position += self.velocity * step_s;
        }
        if self.command.run == MotorRun::Run && self.command.mode == MotorMode::Position {
            self.velocity = (self.position - before) / step_s;
        }
    }

    fn run(&mut self, step_s: f64) {
        let scale = MotorScale { pole_pairs: POLE_PAIRS };
        let turns_per_s = scale.velocity(self.command.velocity) / std::f64::consts::TAU;
        let commanded = (turns_per_s * COUNTS_PER_TURN).clamp(-FASTEST, FASTEST);
        match self.command.mode {
            MotorMode::Position => {
                let way = self.command.position as f64 - self.position;
                let farthest = commanded.abs() * step_s;
                self.position += way.clamp(-farthest, farthest);
            }
            MotorMode::Velocity => {
                self.velocity = if self.command.current == 0 { 0.0 } else { commanded };
                self.position += self.velocity * step_s;
            }
            MotorMode::Torque => {
                let faster = scale.current(self.command.current) * COUNTS_PER_S2_AND_A * step_s;
                self.velocity = (self.velocity + faster).clamp(-FASTEST, FASTEST);
                self.position += self.velocity * step_s;
            }
        }
    }

    /// What it replies now.
    pub fn reply(&self) -> MotorReply {
        let scale = MotorScale { pole_pairs: POLE_PAIRS };
        let is_running = self.command.run == MotorRun::Run;
        let turns_per_s = self.velocity / COUNTS_PER_TURN;
        MotorReply {
            // The position has 40 bits and goes round.
            position: (self.position.round() as i64) << 24 >> 24,
            velocity: scale.velocity_code(turns_per_s * std::f64::consts::TAU),
            current: if is_running && self.command.mode == MotorMode::Torque {
                self.command.current
            } else {
                0
            },
            mode: self.command.mode,
            is_running,
            error: 0,
            temperature: TEMPERATURE,
            id: self.id,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: Nanoseconds = 1_000_000_000;

    fn slow(mode: MotorMode) -> MotorCommand {
        // 1 turn/s: 14 Hz of electrical frequency.
        let scale = MotorScale { pole_pairs: POLE_PAIRS };
        let velocity = scale.velocity_code(std::f64::consts::TAU);
        MotorCommand { velocity, current: 100, mode, run: MotorRun::Run, ..MotorCommand::default() }
    }

    fn after_1_s(command: MotorCommand) -> MotorReply {
        let mut motor = Motor::new(1);
        motor.obey(0, command);
        for step in 1..=1_000 {
            motor.advance(step * SECOND_NS / 1_000);
        }
        motor.reply()
    }

    #[test]
    fn it_goes_to_a_position_no_faster_than_it_may() {
        let near = after_1_s(MotorCommand { position: 100_000, ..slow(MotorMode::Position) });
        assert_eq!((near.position, near.velocity, near.is_running), (100_000, 0, true));
        let far = after_1_s(MotorCommand { position: -1 << 30, ..slow(MotorMode::Position) });
        assert!((far.position + 1_048_576).abs() < 100, "{far:?}");
    }

    #[test]
    fn it_keeps_a_velocity_and_speeds_up_under_a_current() {
        let even = after_1_s(slow(MotorMode::Velocity));
        assert!((even.position - 1_048_576).abs() < 100, "{even:?}");
        let pushed = after_1_s(slow(MotorMode::Torque));
        assert!(pushed.velocity > 0 && pushed.position > 0, "{pushed:?}");
    }

    #[test]
    fn free_it_comes_to_rest_and_its_zero_is_set_only_then() {
        let mut motor = Motor::new(1);
        motor.obey(0, slow(MotorMode::Velocity));
        motor.advance(SECOND_NS);
        motor.obey(SECOND_NS, MotorCommand { run: MotorRun::FreeAndSetZero, ..slow(MotorMode::Velocity) });
        assert_ne!(motor.reply().position, 0);
        motor.advance(2 * SECOND_NS);
        motor.obey(2 * SECOND_NS, MotorCommand { run: MotorRun::FreeAndSetZero, ..MotorCommand::default() });
        let reply = motor.reply();
        assert_eq!((reply.position, reply.velocity, reply.is_running), (0, 0, false));
    }
}
