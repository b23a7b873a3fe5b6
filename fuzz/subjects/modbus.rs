//! Fuzzes both sides of a Modbus line with arbitrary bytes.

use takt::sim::commanded_module::ModuleParameters;
use takt::sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use takt::sim::plant::{Encoder, JointParameters};
use takt::sim::serial_line::DevicesOnLine;
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{
    Received, ReceivedRequest, RegisterRange, RegisterValues, Request, SlaveAddress, evaluate, reply_frame,
};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::{Master, MasterTiming, Repeat};

use super::input::Input;

const LINE: LineTiming = LineTiming::new(115_200);
const SLAVE: u8 = 2;

/// A request that is decoded is the one that was encoded; a reply that is taken has the length that was asked for. Every request of the
/// master ends. The simulated drive replies with what its master takes, and stays sound.
pub fn run(bytes: &[u8]) {
    let Some((kind, rest)) = bytes.split_first() else { return };
    match kind % 4 {
        0 => decode(rest),
        1 => ask(Input::new(rest)),
        _ => talk_to_drive(Input::new(rest)),
    }
}

fn slave() -> SlaveAddress {
    SlaveAddress::new(SLAVE).expect("an address of a slave")
}

/// Any request: most of them to registers that the drive has.
fn request(input: &mut Input<'_>) -> Request {
    let kind = input.byte();
    let start = if kind & 0x80 == 0 { u16::from(input.byte()) } else { input.short() };
    let count = 1 + u16::from(input.byte()) % 123;
    let count = if kind & 0x40 == 0 { 1 + count % 2 } else { count };
    match kind & 3 {
        0 | 1 => match RegisterRange::new(start, count) {
            Some(range) => Request::Read(range),
            None => Request::WriteOne { register: start, value: count },
        },
        2 => Request::WriteOne { register: start, value: input.short() % 8 },
        _ => {
            let values: Vec<u16> = (0..count).map(|_| input.short()).collect();
            match RegisterValues::new(start, &values) {
                Some(values) => Request::WriteSeveral(values),
                None => Request::WriteOne { register: start, value: count },
            }
        }
    }
}

fn decode(bytes: &[u8]) {
    if let Some(received) = ReceivedRequest::decode(bytes) {
        let to = SlaveAddress::new(received.address);
        if let (Ok(request), Some(to)) = (&received.request, to) {
            assert_eq!(request.frame(to), bytes);
        }
        let refusal = reply_frame(bytes, Err(ExceptionCode::BUSY));
        assert_eq!(refusal.is_some(), received.address != 0);
        reply_frame(bytes, Ok(&[1, 2, 3]));
    } else {
        assert_eq!(reply_frame(bytes, Ok(&[])), None);
    }
    let mut input = Input::new(bytes);
    let request = request(&mut input);
    for to in [slave(), SlaveAddress::new(bytes.first().copied().unwrap_or(1)).unwrap_or(slave())] {
        if let Received::Whole(Ok(_)) = evaluate(&request, to, bytes) {
            assert!(bytes.len() == request.reply_length() || bytes.len() == 5, "{request:?}: {bytes:02X?}");
        }
    }
}

/// The highest number of polls of a master whose slaves send anything.
const MAX_POLLS: usize = 20_000;

fn ask(mut input: Input<'_>) {
    let mut master = Master::new(MasterTiming::new(LINE));
    let repeat = if input.byte() & 1 == 0 { Repeat::Allowed } else { Repeat::Never };
    assert!(master.start(slave(), request(&mut input), repeat).is_ok());
    let mut now_ns = 0;
    for _ in 0..MAX_POLLS {
        if let Some(frame) = master.poll(now_ns) {
            assert!(ReceivedRequest::decode(&frame).is_some_and(|sent| sent.request.is_ok()), "{frame:02X?}");
        }
        if master.take_outcome().is_some() {
            return;
        }
        if input.is_empty() {
            now_ns += 1_000_000;
            continue;
        }
        now_ns += 100 * u64::from(input.short());
        let length = usize::from(input.byte()) % 32;
        master.receive(&input.bytes::<32>()[..length]);
    }
    panic!("the request does not end");
}

fn drive() -> ErobModbusDrive {
    ErobModbusDrive::new(ErobModbusParameters {
        address: SLAVE,
        bit_rate_code: 4,
        module: ModuleParameters {
            joint: JointParameters {
                inertia: 0.3,
                viscous_friction: 2.0,
                coulomb_friction: 4.0,
                friction_shape: takt::config::FrictionShape::Constant,
                brake_torque: 60.0,
            },
            encoder: Encoder { counts_per_unit: 524_288.0 / std::f64::consts::TAU, zero_counts: 0.0 },
            counts_per_turn: 524_288.0,
            initial_position: 0.0,
            peak_torque: 60.0,
            torque_per_ampere: 5.0,
            highest_velocity: 3.0,
            ready_ns: 0,
            has_battery: true,
        },
        reply_ns: 1_000_000,
        has_torque_sensor: false,
    })
}

const MAX_REQUESTS: usize = 100;

fn talk_to_drive(mut input: Input<'_>) {
    let mut line = SimulatedLine::new(LINE, vec![drive()]);
    let mut now_ns = 10_000_000;
    for _ in 0..MAX_REQUESTS {
        if input.is_empty() {
            break;
        }
        now_ns += 20_000_000 + 10_000 * u64::from(input.short());
        // Bytes that are no request come in between; a silence follows them.
        let length = usize::from(input.byte() & 7);
        line.send(now_ns, &input.bytes::<8>()[..length]);
        now_ns += 5_000_000;
        let request = request(&mut input);
        line.send(now_ns, &request.frame(slave()));
        now_ns += 60_000_000;
        let reply = line.receive(now_ns);
        let taken = evaluate(&request, slave(), &reply);
        assert!(matches!(taken, Received::Whole(Ok(_))), "{request:?}: {reply:02X?}");
    }
    let velocity = line.drive(SLAVE).expect("the drive is there").observe(now_ns).velocity;
    assert!(velocity.is_finite());
}
