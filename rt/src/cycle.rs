//! The paced loop: waits for each slot, releases SYNC, takes the feedback, lets the engine think, sends.
//!
//! ```text
//! slot k                                                                     slot k+1
//! |SYNC|  feedback arrives          |receive → compute → set-points → services| |SYNC|
//! 0                           command phase                             all sent
//! ```
//!
//! A late wake-up never bursts and never loses phase: slots that have passed are skipped and counted, and the
//! trajectory goes on by one nominal period.

use arrayvec::ArrayVec;

use crate::engine::{BusSet, Engine, SendBatch, Transmission};
use crate::frame::Frame;
use crate::host::HostInterface;
use crate::port::{BusHealth, BusPort, Clock, Outgoing, ReceiveBatch};
use crate::record::{CycleTiming, MAX_BUSES};
use crate::time::{Grid, Nanoseconds};

/// When things happen inside a slot, in nanoseconds after its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotPlan {
    /// SYNC that cannot leave by then is not sent: the slot is skipped, since drives would latch late and the
    /// feedback would miss the command phase.
    pub latest_sync_ns: Nanoseconds,
    /// The beginning of the command phase.
    pub command_phase_ns: Nanoseconds,
    /// Set-points that are not ready by then are not sent: they would run into the next SYNC.
    pub latest_set_points_ns: Nanoseconds,
}

impl SlotPlan {
    /// The usual plan for a period: SYNC within a tenth of it, set-points ready no later than a quarter of it
    /// after the command phase begins.
    pub const fn usual(period_ns: Nanoseconds, command_phase_ns: Nanoseconds) -> Self {
        let quarter = command_phase_ns + period_ns / 4;
        let end = period_ns / 20 * 19;
        Self {
            latest_sync_ns: period_ns / 10,
            command_phase_ns,
            latest_set_points_ns: if quarter < end { quarter } else { end },
        }
    }
}

/// Whether the loop is to go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// There is a next cycle.
    Continue,
    /// The loop was asked to end.
    Shutdown,
}

/// The loop's place on the grid.
#[derive(Clone, Copy, Debug)]
pub struct Cycle {
    grid: Grid,
    plan: SlotPlan,
    next_slot: u64,
}

impl Cycle {
    /// A loop that begins with slot 0 of `grid`.
    pub const fn new(grid: Grid, plan: SlotPlan) -> Self {
        Self { grid, plan, next_slot: 0 }
    }

    /// One whole cycle.
    pub fn run<C: Clock, P: BusPort, D: HostInterface>(
        &mut self,
        engine: &mut Engine,
        clock: &mut C,
        ports: &mut [P],
        host: &mut D,
    ) -> Flow {
        let mut timing = self.reach_slot(clock);
        timing.sync_ns = clock.now_ns().saturating_sub(timing.slot_start_ns);
        release_sync(engine, ports, timing.slot, clock.now_ns());

        let wake = clock.wait_until(timing.slot_start_ns + self.plan.command_phase_ns);
        let held_back = take_feedback(engine, ports, wake.now_ns, host);
        engine.hold_back(held_back);
        let health = health_of(ports);
        let began_ns = clock.now_ns();
        let transmission = if held_back.is_every_of(ports.len()) {
            Transmission::Blocked
        } else if began_ns > timing.slot_start_ns + self.plan.latest_set_points_ns {
            Transmission::TooLate
        } else {
            Transmission::Free
        };
        let has_commands = engine.compute(timing.slot, began_ns, &health, transmission, host);
        timing.compute_ns = clock.now_ns().saturating_sub(began_ns);

        // Not made as a constant, whose 80 kB would be written in every cycle.
        let mut batches: [SendBatch; MAX_BUSES] = core::array::from_fn(|_| SendBatch::new());
        for (bus, batch) in batches.iter_mut().enumerate().take(ports.len()) {
            if has_commands {
                engine.set_points(bus, timing.slot, batch);
            }
            engine.services(bus, host, batch);
        }
        let not_taken = send(ports, &batches, clock.now_ns());
        engine.not_taken(not_taken);
        let finished_ns = clock.now_ns();
        timing.sent_ns = finished_ns.saturating_sub(timing.slot_start_ns);
        engine.finish(timing, finished_ns, &health, host);
        if engine.is_leaving() { Flow::Shutdown } else { Flow::Continue }
    }

    /// Waits for the next slot that can be used. The wake-ups that came too late for theirs are among the latency.
    fn reach_slot(&mut self, clock: &mut impl Clock) -> CycleTiming {
        let mut wake_ns = 0;
        loop {
            let now_ns = clock.now_ns();
            let mut slot = self.next_slot;
            if now_ns > self.grid.slot_start_ns(slot) + self.plan.latest_sync_ns {
                slot = slot.max(self.grid.next_slot(now_ns));
            }
            let slot_start_ns = self.grid.slot_start_ns(slot);
            let wake = clock.wait_to_send(slot_start_ns);
            wake_ns = wake.timer_latency_ns.max(wake_ns);
            if wake.now_ns <= slot_start_ns + self.plan.latest_sync_ns {
                self.next_slot = slot + 1;
                return CycleTiming { slot, slot_start_ns, wake_ns, ..CycleTiming::default() };
            }
            self.next_slot = slot + 1;
        }
    }
}

/// SYNC on every bus that has it in this slot.
fn release_sync<P: BusPort>(engine: &mut Engine, ports: &mut [P], slot: u64, now_ns: Nanoseconds) {
    let syncs = (0..ports.len()).map(|bus| engine.sync(bus, slot, now_ns).into_iter().collect());
    let syncs: ArrayVec<ArrayVec<Frame, 1>, MAX_BUSES> = syncs.take(MAX_BUSES).collect();
    send(ports, &syncs, now_ns);
}

/// Sends to each bus its own frames. Returns the buses that did not take all of them.
fn send<P: BusPort, const N: usize>(
    ports: &mut [P],
    batches: &[ArrayVec<Frame, N>],
    now_ns: Nanoseconds,
) -> BusSet {
    let mut taken = [0; MAX_BUSES];
    let entries = ports.iter_mut().zip(batches).zip(&mut taken).filter(|((_, frames), _)| !frames.is_empty());
    let mut outgoing: ArrayVec<Outgoing<'_, P>, MAX_BUSES> =
        entries.map(|((port, frames), taken)| Outgoing { port, frames, taken }).collect();
    P::send_together(now_ns, &mut outgoing);
    drop(outgoing);
    let mut not_taken = BusSet::default();
    let is_short = |(_, (frames, taken)): &(usize, (&ArrayVec<Frame, N>, &usize))| **taken < frames.len();
    let short = batches.iter().zip(&taken).enumerate().filter(is_short);
    short.for_each(|(bus, _)| not_taken.insert(bus));
    not_taken
}

/// Hands everything that has arrived to the engine. Returns the buses on which own frames still wait for the wire.
fn take_feedback<P: BusPort>(
    engine: &mut Engine,
    ports: &mut [P],
    now_ns: Nanoseconds,
    host: &mut impl HostInterface,
) -> BusSet {
    let mut held_back = BusSet::default();
    let mut batch = ReceiveBatch::new();
    for (bus, port) in ports.iter_mut().enumerate() {
        // Bounded: whoever floods the bus with more than a bus can carry in one slot is heard next time.
        for _ in 0..RECEIVES_PER_CYCLE {
            batch.clear();
            port.receive(now_ns, &mut batch);
            for received in &batch {
                engine.receive(bus, received, host);
            }
            if !batch.is_full() {
                break;
            }
        }
        if port.unconfirmed(now_ns) > 0 {
            held_back.insert(bus);
        }
    }
    held_back
}

const RECEIVES_PER_CYCLE: usize = 4;

fn health_of<P: BusPort>(ports: &mut [P]) -> ArrayVec<BusHealth, MAX_BUSES> {
    ports.iter_mut().take(MAX_BUSES).map(BusPort::health).collect()
}
