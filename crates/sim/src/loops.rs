//! When the control loops and the plant of a simulated CANopen drive run: at 4 kHz, and exactly up to SYNC. They are nearly a third of what a
//! simulated cycle costs. So what they call in each step is marked `#[inline]`, which lets it be compiled into them from another module.

use takt_rt::Nanoseconds;

/// One step.
const STEP_NS: Nanoseconds = 250_000;

/// The loops of a drive.
pub trait ControlLoops {
    /// The time up to which they have run.
    fn stepped_ns(&self) -> Nanoseconds;

    /// Advances them, and that time, by one step of this length.
    fn step(&mut self, duration_ns: Nanoseconds);

    /// Runs the loops in steps up to `now_ns`.
    fn run_loops(&mut self, now_ns: Nanoseconds) {
        while self.stepped_ns() + STEP_NS <= now_ns {
            self.step(STEP_NS);
        }
    }

    /// Runs the loops exactly up to `now_ns`, so that their steps are locked to SYNC.
    fn lock_loops(&mut self, now_ns: Nanoseconds) {
        self.run_loops(now_ns);
        if now_ns > self.stepped_ns() {
            self.step(now_ns - self.stepped_ns());
        }
    }
}
