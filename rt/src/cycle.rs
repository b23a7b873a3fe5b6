//! The paced loop: waits for each slot, releases SYNC, takes the feedback, lets the engine think, sends.
//!
//! ```text
//! slot k                                                                     slot k+1
//! |SYNC|  feedback arrives          |receive → compute → set-points → services| |SYNC|
//! 0                           command phase                             all sent
//! ```
//!
//! Drives without SYNC carry out a set-point when it arrives. With such drives the frames wait for the send phase, as SYNC waits
//! for its slot, so that they leave at one moment of every slot, however long computing took:
//!
//! ```text
//! |SYNC|  feedback arrives          |receive → compute| |set-points → services| |SYNC|
//! 0                           command phase        send phase           all sent
//! ```
//!
//! A late wake-up never bursts and never loses phase: slots that have passed are skipped and counted, and the
//! trajectory goes on by one nominal period. Whether the deadline was met is decided after computing, by the clock, when
//! the frames are about to leave. A thread that is always late goes on without SYNC and set-points: the engine then stops the
//! drives by SDO.

use arrayvec::ArrayVec;

use crate::bit_set::BitSet;
use crate::engine::{CycleInput, Deadline, Engine, Receiver, SendBatch};
use crate::frame::Frame;
use crate::host::HostInterface;
use crate::port::{BusHealth, BusPort, Clock, Outgoing, ReceiveBatch};
use crate::record::CycleTiming;
use crate::time::{Grid, Nanoseconds};

/// When things happen inside a slot, in nanoseconds after its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotPlan {
    /// SYNC that cannot leave by then is not sent: the slot is skipped, because drives would latch late and the
    /// feedback would miss the command phase.
    pub latest_sync_ns: Nanoseconds,
    /// The beginning of the command phase.
    pub command_phase_ns: Nanoseconds,
    /// The beginning of the send phase: frames that are ready earlier leave then, and others as soon as they are ready. `None`: each
    /// as soon as it is ready. It lies between the command phase and [`SlotPlan::latest_set_points_ns`].
    pub send_phase_ns: Option<Nanoseconds>,
    /// Set-points that are not ready by then are not sent: they would run into the next SYNC.
    pub latest_set_points_ns: Nanoseconds,
}

impl SlotPlan {
    /// The usual plan for a period: SYNC within a tenth of it, set-points ready no later than a quarter of it
    /// after the command phase begins, and no send phase.
    pub const fn usual(period_ns: Nanoseconds, command_phase_ns: Nanoseconds) -> Self {
        let quarter = command_phase_ns.saturating_add(period_ns / 4);
        let end = period_ns / 20 * 19;
        Self {
            latest_sync_ns: period_ns / 10,
            command_phase_ns,
            send_phase_ns: None,
            latest_set_points_ns: if quarter < end { quarter } else { end },
        }
    }
}

/// What follows a cycle.
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

/// Slots that are tried in one cycle. When the wake-up was too late for each of them, the cycle goes on without SYNC.
const SLOT_ATTEMPTS: usize = 3;

impl Cycle {
    /// A loop that begins with slot 0 of `grid`.
    pub const fn new(grid: Grid, plan: SlotPlan) -> Self {
        Self { grid, plan, next_slot: 0 }
    }

    /// A loop that goes on with a slot of `grid`.
    #[cfg(feature = "checkpoint")]
    pub const fn resumed(grid: Grid, plan: SlotPlan, next_slot: u64) -> Self {
        Self { grid, plan, next_slot }
    }

    /// The slot that comes next.
    #[cfg(feature = "checkpoint")]
    pub const fn next_slot(&self) -> u64 {
        self.next_slot
    }

    /// One whole cycle.
    pub fn run<const AXES: usize, const BUSES: usize, C, P, H>(
        &mut self,
        engine: &mut Engine<AXES, BUSES>,
        clock: &mut C,
        ports: &mut [P],
        host: &mut H,
    ) -> Flow
    where
        C: Clock,
        P: BusPort,
        H: HostInterface<AXES, BUSES>,
    {
        let (mut timing, sync_deadline, suspended_ns) = self.reach_slot(clock);
        timing.sync_ns = clock.now_ns().saturating_sub(timing.slot_start_ns);
        if sync_deadline == Deadline::Met {
            look_again(engine, ports, clock.now_ns(), host);
            release_sync(engine, ports, timing.slot, clock.now_ns());
        }

        let wake = clock.wait_until(timing.slot_start_ns + self.plan.command_phase_ns);
        let behind = take_feedback(engine, ports, wake.now_ns, host);
        let health = health_of::<P, BUSES>(ports);
        let began_ns = clock.now_ns();
        engine.compute(
            &CycleInput {
                slot: timing.slot,
                slot_start_ns: timing.slot_start_ns,
                set_points_due_ns: timing.slot_start_ns + self.plan.latest_set_points_ns,
                now_ns: began_ns,
                suspended_ns,
                buses: &health,
                behind,
            },
            host,
        );
        let ready_ns = clock.now_ns();
        timing.compute_ns = ready_ns.saturating_sub(began_ns);
        let leaving_ns = self.reach_send_phase(clock, timing.slot_start_ns, ready_ns);
        let deadline = match sync_deadline {
            Deadline::Met if leaving_ns <= timing.slot_start_ns + self.plan.latest_set_points_ns => {
                Deadline::Met
            }
            _ => Deadline::Missed,
        };

        // Not made as a constant, all of whose bytes would be written in every cycle.
        let mut batches: [SendBatch; BUSES] = core::array::from_fn(|_| SendBatch::new());
        for (bus, batch) in batches.iter_mut().enumerate().take(ports.len()) {
            engine.encode(bus, deadline, host, batch);
        }
        let not_taken = send(ports, &batches, clock.now_ns());
        engine.not_taken(not_taken);
        let finished_ns = clock.now_ns();
        timing.sent_ns = finished_ns.saturating_sub(timing.slot_start_ns);
        engine.finish(timing, finished_ns, &health, host);
        if engine.is_shutting_down() { Flow::Shutdown } else { Flow::Continue }
    }

    /// Waits for the next slot that can be used; after some that cannot, for the last of them, with a missed deadline. The
    /// wake-ups that came too late for their slots are among the latency. Returns also how long the computer was suspended meanwhile.
    fn reach_slot(&mut self, clock: &mut impl Clock) -> (CycleTiming, Deadline, Nanoseconds) {
        let (mut wake_ns, mut suspended_ns) = (0, 0);
        for attempt in 1..=SLOT_ATTEMPTS {
            let now_ns = clock.now_ns();
            let mut slot = self.next_slot;
            if now_ns > self.latest_sync_ns(slot) {
                slot = slot.max(self.grid.next_slot(now_ns));
            }
            let slot_start_ns = self.grid.slot_start_ns(slot);
            let wake = clock.wait_to_send(slot_start_ns);
            wake_ns = wake.timer_latency_ns.max(wake_ns);
            suspended_ns += wake.suspended_ns;
            self.next_slot = slot.saturating_add(1);
            let timing = CycleTiming { slot, slot_start_ns, wake_ns, ..CycleTiming::default() };
            if wake.now_ns <= self.latest_sync_ns(slot) {
                return (timing, Deadline::Met, suspended_ns);
            }
            if attempt == SLOT_ATTEMPTS {
                return (timing, Deadline::Missed, suspended_ns);
            }
        }
        (CycleTiming::default(), Deadline::Missed, suspended_ns)
    }

    /// Waits for the send phase of a slot, unless it has begun when the frames are ready. Returns the present.
    fn reach_send_phase(
        &self,
        clock: &mut impl Clock,
        slot_start_ns: Nanoseconds,
        ready_ns: Nanoseconds,
    ) -> Nanoseconds {
        match self.plan.send_phase_ns {
            Some(send_phase_ns) if ready_ns < slot_start_ns + send_phase_ns => {
                clock.wait_to_send(slot_start_ns + send_phase_ns).now_ns
            }
            _ => ready_ns,
        }
    }

    const fn latest_sync_ns(&self, slot: u64) -> Nanoseconds {
        self.grid.slot_start_ns(slot).saturating_add(self.plan.latest_sync_ns)
    }
}

/// SYNC on every bus that has it in this slot.
fn release_sync<const AXES: usize, const BUSES: usize, P: BusPort>(
    engine: &mut Engine<AXES, BUSES>,
    ports: &mut [P],
    slot: u64,
    now_ns: Nanoseconds,
) {
    let mut syncs: [ArrayVec<Frame, 1>; BUSES] = core::array::from_fn(|_| ArrayVec::new());
    for (bus, sync) in syncs.iter_mut().enumerate().take(ports.len()) {
        sync.extend(engine.sync(bus, slot, now_ns));
    }
    send(ports, &syncs, now_ns);
}

/// Sends to each bus its own frames. Returns the buses that did not take all of them.
fn send<P: BusPort, const N: usize, const BUSES: usize>(
    ports: &mut [P],
    batches: &[ArrayVec<Frame, N>; BUSES],
    now_ns: Nanoseconds,
) -> BitSet {
    let mut taken = [0; BUSES];
    let entries = ports.iter_mut().zip(batches).zip(&mut taken).filter(|((_, frames), _)| !frames.is_empty());
    let mut outgoing: ArrayVec<Outgoing<'_, P>, BUSES> =
        entries.map(|((port, frames), taken)| Outgoing { port, frames, taken }).collect();
    P::send_together(now_ns, &mut outgoing);
    drop(outgoing);
    let mut not_taken = BitSet::default();
    for (bus, (frames, taken)) in batches.iter().zip(&taken).enumerate() {
        if *taken < frames.len() {
            not_taken.insert(bus);
        }
    }
    not_taken
}

/// Looks again at the buses that were behind in the last cycle: a bus that has caught up since gets its SYNC.
fn look_again<const AXES: usize, const BUSES: usize, P: BusPort>(
    engine: &mut Engine<AXES, BUSES>,
    ports: &mut [P],
    now_ns: Nanoseconds,
    host: &mut impl HostInterface<AXES, BUSES>,
) {
    let was_behind = engine.behind();
    let mut caught_up = BitSet::default();
    for (bus, port) in ports.iter_mut().enumerate().filter(|(bus, _)| was_behind.contains(*bus)) {
        receive(engine, bus, port, now_ns, host);
        if port.unconfirmed(now_ns) == 0 {
            caught_up.insert(bus);
        }
    }
    engine.note_caught_up(caught_up);
}

/// Hands everything that has arrived to the engine. Returns the buses on which own frames still wait for the wire.
fn take_feedback<const AXES: usize, const BUSES: usize, P: BusPort>(
    engine: &mut Engine<AXES, BUSES>,
    ports: &mut [P],
    now_ns: Nanoseconds,
    host: &mut impl HostInterface<AXES, BUSES>,
) -> BitSet {
    let mut behind = BitSet::default();
    for (bus, port) in ports.iter_mut().enumerate() {
        receive(engine, bus, port, now_ns, host);
        if port.unconfirmed(now_ns) > 0 {
            behind.insert(bus);
        }
    }
    behind
}

/// Batches that are received from a bus at a time. A flood of more than a bus can carry in one slot waits for the next time.
const RECEIVES_PER_CYCLE: usize = 4;

fn receive<const AXES: usize, const BUSES: usize, P: BusPort>(
    engine: &mut Engine<AXES, BUSES>,
    bus: usize,
    port: &mut P,
    now_ns: Nanoseconds,
    host: &mut impl HostInterface<AXES, BUSES>,
) {
    let mut batch = ReceiveBatch::new();
    for _ in 0..RECEIVES_PER_CYCLE {
        batch.clear();
        port.receive(now_ns, &mut batch);
        for received in &batch {
            if engine.receive(bus, received) == Receiver::Host && !host.received(bus, received) {
                engine.count_dropped();
            }
        }
        if !batch.is_full() {
            break;
        }
    }
}

fn health_of<P: BusPort, const BUSES: usize>(ports: &mut [P]) -> ArrayVec<BusHealth, BUSES> {
    ports.iter_mut().take(BUSES).map(BusPort::health).collect()
}
