//! A program without the standard library and without an allocator that runs cycles of the real-time half. That it
//! links is the proof that nothing in there allocates; that it exits with 0, that it works.
#![no_std]
#![no_main]

use core::f64::consts::TAU;

use takt_rt::{
    AxisLimits, AxisParameters, BitSet, BusHealth, BusParameters, CanopenNetwork, Cia402Codec, CommandPdo,
    Exchange, Pdos,
    ControlLaw, CycleInput, CycleTiming, Deadline, Engine, EngineParameters, FeedForward, FeedbackSince,
    Follow, Frame, HostInterface, Id, MappedObject, Mapping, ModeChanges, Pdo, Phase, PositionCounter, Received, Request,
    RequestEnvelope, RequestId, RequestTarget, Scale, ScaleParameters, SendBatch, StopCategories,
    Supervision, TimingLadder, TorqueLimits,
};

// The C library gives the program its entry; nothing else of it is used.
#[link(name = "c")]
unsafe extern "C" {}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: `_exit` only ends the process.
    unsafe { libc::_exit(101) }
}

/// Unwinding is switched off, but the core library was built with it and names this symbol.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

#[derive(Default)]
struct Silent {
    requests: [Option<Request<1>>; 3],
}

impl HostInterface<1, 1> for Silent {
    fn request(&mut self) -> Option<RequestEnvelope<1>> {
        let numbered = self.requests.iter_mut().zip(1..);
        numbered
            .filter_map(|(place, id)| {
                Some(RequestEnvelope {
                    id: RequestId(id),
                    target: RequestTarget::All,
                    request: place.take()?,
                })
            })
            .next()
    }
}

fn axis() -> Option<AxisParameters> {
    let commands = [MappedObject::new(0x6040, 0, 16), MappedObject::new(0x607A, 0, 32)];
    let feedback = [MappedObject::new(0x6041, 0, 16), MappedObject::new(0x6064, 0, 32)];
    let scale = ScaleParameters {
        counts_per_turn: 524_288.0,
        velocity_units_per_turn: 524_288.0,
        gear_ratio: 1.0,
        travel_per_turn: TAU,
        reversed: false,
        zero_counts: 0.0,
        rated_torque: 31.0,
    };
    let pdo = |function, mapping| Pdo::classic(Id::canopen(function, 1), mapping);
    Some(AxisParameters {
        bus: 0,
        node: 1,
        node_axis: 1,
        exchange: Exchange::Pdos(Pdos {
            commands: [CommandPdo::every_cycle(pdo(0x200, Mapping::commands(&commands).ok()?))]
                .into_iter()
                .collect(),
            feedback: [pdo(0x180, Mapping::feedback(&feedback).ok()?)].into_iter().collect(),
            unused: Default::default(),
        }),
        codec: Cia402Codec::default(),
        controlword_spacing_cycles: 0,
        feedback_since: FeedbackSince::Sync,
        law: ControlLaw::Position,
        mode_changes: ModeChanges::default(),
        scale: Scale::new(scale).ok()?,
        counter: PositionCounter::default(),
        limits: AxisLimits {
            position_min: -3.0,
            position_max: 3.0,
            velocity: 2.0,
            acceleration: 10.0,
            deceleration: 10.0,
            jerk: f64::INFINITY,
            torque: 40.0,
        },
        torque_limits: TorqueLimits::NONE,
        feed_forward: FeedForward::None,
        start_tolerance: 0.02,
        follow: Follow::Smooth,
        supervision: Supervision::Feedback,
        stops_by_itself_cycles: None,
        following_error_limit: 0.1,
        following_error_cycles: 50,
        missed_feedback_cycles: 5,
    })
}

fn cycles() -> Option<Phase> {
    let bus = BusParameters {
        canopen: Some(CanopenNetwork { sync_id: Id::canopen(0x080, 0) }),
        divider: 1,
        service_frames_active: 1,
        service_frames_passive: 6,
    };
    let parameters = EngineParameters {
        period_ns: 1_000_000,
        axes: [axis()?].into_iter().collect(),
        groups: Default::default(),
        buses: [bus].into_iter().collect(),
        heartbeat: None,
        time_cycles: None,
        enable_timeout_cycles: 100,
        not_transmitted_cycles: 5,
        acknowledge_timeout_cycles: 500,
        categories: StopCategories::default(),
        timing: TimingLadder { warning: 10, degraded: 50, unfit: 250, leak_slots: 20 },
    };
    let mut engine: Engine<1, 1> = Engine::new(parameters).ok()?;
    let requests = [Some(Request::Sync(true)), Some(Request::Activate), Some(Request::Enable)];
    let mut host = Silent { requests };
    let health = [BusHealth::default()];
    // Ready to switch on.
    let mut statusword_low = 0x31;
    for slot in 0..100 {
        let at_ns = slot * 1_000_000;
        let frame = Frame::of(Id::canopen(0x180, 1), [statusword_low, 0x12, 1, 0, 0, 0]);
        engine.sync(0, slot, at_ns);
        engine.receive(0, &Received { frame, at_ns });
        engine.compute(
            &CycleInput {
                suspended_ns: 0,
                slot,
                slot_start_ns: at_ns,
                set_points_due_ns: at_ns,
                now_ns: at_ns,
                buses: &health,
                behind: BitSet::default(),
            },
            &mut host,
        );
        let mut batch = SendBatch::new();
        engine.encode(0, Deadline::Met, &mut host, &mut batch);
        // The drive obeys the controlword, the first two bytes of its command.
        statusword_low = match batch.first().map(Frame::payload) {
            Some([0x07, ..]) => 0x33, // switched on
            Some([0x0F, ..]) => 0x37, // operation enabled
            _ => statusword_low,
        };
        engine.finish(CycleTiming { slot, ..CycleTiming::default() }, at_ns, &health, &mut host);
    }
    engine.phase(0)
}

/// Called by the C start-up code.
#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    if cycles() == Some(Phase::Holding) { 0 } else { 1 }
}
