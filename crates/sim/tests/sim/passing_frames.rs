//! PDOs of other nodes, which a simulated node does not look at.

use takt::sim::cia402::Cia402Drive;
use takt::sim::{Defect, Drive, DriveFault, Gravity, Mailbox, Observation, QueueOrder, Unsupported};
use takt_rt::{Frame, Id};

use super::bench::{Bench, NODE, drive, parameters};

const TARGET_POSITION: u32 = 0x607A_0020;
/// It belongs to no service, and a node looks at it to find that out.
const UNKNOWN: u32 = 0x005;

/// The same drive twice. One gets the PDOs of other nodes as they are, the other one each of them under an identifier that it looks at.
struct Pair {
    passing: Cia402Drive,
    looking: Cia402Drive,
    passed: u32,
}

impl Pair {
    fn new() -> Self {
        let [passing, looking] = [(); 2].map(|()| drive(parameters(NODE)));
        let mut pair = Self { passing, looking, passed: 0 };
        pair.set_gravity(Gravity::Pendulum(7.0));
        pair
    }

    /// Has both do something, and compares what they send and when they act next.
    fn both(&mut self, mailbox: &mut Mailbox, mut act: impl FnMut(&mut Cia402Drive, bool, &mut Mailbox)) {
        let [mut sent, mut expected] = [(); 2].map(|()| Mailbox::new(QueueOrder::FirstInFirstOut, 16));
        act(&mut self.passing, true, &mut sent);
        act(&mut self.looking, false, &mut expected);
        assert_eq!(self.passing.wake_ns(), self.looking.wake_ns());
        while let Some(frame) = expected.pop() {
            assert_eq!(sent.pop(), Some(frame));
            mailbox.put(frame);
        }
        assert!(sent.is_empty());
    }
}

impl Drive for Pair {
    fn node(&self) -> u8 {
        NODE
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame, mailbox: &mut Mailbox) {
        let is_of_others =
            matches!(frame.id().value(), 0x180..=0x57F) && frame.id().value() & 0x7F != u32::from(NODE);
        self.passed += u32::from(is_of_others);
        let unknown = Frame::data(Id::base(UNKNOWN).unwrap(), frame.payload()).unwrap();
        self.both(mailbox, |drive, is_passing, mailbox| {
            let frame = if is_of_others && !is_passing { &unknown } else { frame };
            drive.receive(now_ns, frame, mailbox);
        });
    }

    fn advance(&mut self, now_ns: u64, mailbox: &mut Mailbox) {
        self.both(mailbox, |drive, _, mailbox| drive.advance(now_ns, mailbox));
    }

    fn wake_ns(&self) -> u64 {
        self.passing.wake_ns()
    }

    fn observe(&mut self, now_ns: u64) -> Observation {
        let seen = self.passing.observe(now_ns);
        assert_eq!(seen, self.looking.observe(now_ns));
        assert!(self.passed > 5_000);
        seen
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.passing.inject_fault(fault);
        self.looking.inject_fault(fault);
    }

    fn power_cycle(&mut self, now_ns: u64, mailbox: &mut Mailbox) {
        self.both(mailbox, |drive, _, mailbox| drive.power_cycle(now_ns, mailbox));
    }

    fn set_gravity(&mut self, gravity: Gravity) {
        self.passing.set_gravity(gravity);
        self.looking.set_gravity(gravity);
    }

    fn set_load_torque(&mut self, torque: f64) {
        self.passing.set_load_torque(torque);
        self.looking.set_load_torque(torque);
    }

    fn inject_defect(&mut self, now_ns: u64, defect: Defect, is_present: bool) -> Result<(), Unsupported> {
        self.passing.inject_defect(now_ns, defect, is_present)?;
        self.looking.inject_defect(now_ns, defect, is_present)
    }
}

#[test]
fn a_drive_that_pdos_of_others_pass_by_moves_and_sends_bit_for_bit_as_one_that_looks_at_them() {
    let mut bench = Bench::of(vec![Box::new(Pair::new())]);
    bench.write(0x6060, 0, 1, 8).unwrap();
    bench.start_process_data(TARGET_POSITION);
    let mut target = 0;
    for cycle in 0..3000 {
        let controlword = [0x06, 0x07, 0x0F].get(cycle / 3).copied().unwrap_or(0x0F);
        for other in [1, 2, 3] {
            bench.send_data(0x180 + other, [cycle as u8; 6]);
            bench.send_data(0x200 + other, [0x0F, 0, cycle as u8, 0, 0, 0]);
        }
        match cycle {
            700 => bench.bus.set_load_torque(NODE, -5.0).unwrap(),
            1200 => bench.bus.inject_defect(NODE, Defect::EncoderJump { distance: 1e-4 }, true).unwrap(),
            2500 => bench.bus.inject_fault(NODE, DriveFault::OverCurrent).unwrap(),
            _ => {}
        }
        target += if (100..2600).contains(&cycle) { 90 + (cycle % 7) as i32 } else { 0 };
        bench.cycle(controlword, target);
    }
    assert!(bench.observe().position_counts > 200_000);
}
