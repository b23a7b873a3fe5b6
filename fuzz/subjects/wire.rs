//! Fuzzes every decoder of frames with arbitrary frames.

use std::sync::OnceLock;

use takt::config::Config;
use takt_rt::{
    BusPort, DriveState, Frame, Id, MAX_OBJECTS, MappedObject, Mapping, ProcessImage, ReceiveBatch,
};
use takt_wire::canopen::emcy::Emergency;
use takt_wire::canopen::lss::{LssRequest, LssResponse};
use takt_wire::canopen::nmt::{ErrorControl, NmtCommand};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::sdo::{SdoClient, SdoRequest, SdoResponse, SdoTiming, Transfer};
use takt_wire::canopen::time::TimeOfDay;
use takt_wire::erob_can::frame::{ReceivedRequest, Reply, Request};

use super::input::Input;
use super::procedures;

const NODE: u8 = 2;

/// A decoded frame can be encoded, and gives the same frame. The SDO client, the layer settings, the bring-up and the
/// shut-down always end. The simulated drive goes on and sends valid frames. Process data are accepted or rejected.
pub fn run(bytes: &[u8]) {
    let Some((kind, rest)) = bytes.split_first() else { return };
    let input = Input::new(rest);
    match kind % 8 {
        0 => decode(input),
        1 => ask(input),
        2 => talk_to_drive(one_drive(), input),
        3 => unpack(input),
        4 => procedures::layer_settings(input),
        5 => talk_to_drive(one_yz_aim(), input),
        _ => procedures::bring_up(input),
    }
}

fn decode(mut input: Input<'_>) {
    while !input.is_empty() {
        let frame = input.frame();
        if let Some(emergency) = Emergency::decode(&frame) {
            assert_eq!(Emergency::decode(&emergency.frame()), Some(emergency));
        }
        if let Some((command, target)) = NmtCommand::decode(&frame) {
            assert_eq!(NmtCommand::decode(&command.frame(target)), Some((command, target)));
        }
        if let Some(control) = ErrorControl::decode(&frame) {
            assert_eq!(ErrorControl::decode(&control.frame()), Some(control));
        }
        if let Some((node, request)) = SdoRequest::decode(&frame) {
            assert_eq!(SdoRequest::decode(&request.frame(node)), Some((node, request)), "{frame:?}");
        }
        if let Some((node, response)) = SdoResponse::decode(&frame) {
            assert_eq!(SdoResponse::decode(&response.frame(node)), Some((node, response)), "{frame:?}");
        }
        if let Some(received) = ReceivedRequest::decode(&frame) {
            let request = match received.value {
                Some(value) => Request::Write(received.address, value),
                None => Request::Read(received.address),
            };
            assert_eq!(ReceivedRequest::decode(&request.frame(received.node)), Some(received), "{frame:?}");
        }
        if let Some(reply) = Reply::decode(frame.payload()) {
            assert_eq!(Reply::decode(reply.frame(NODE).payload()), Some(reply), "{frame:?}");
        }
        if let Some(request) = LssRequest::decode(&frame) {
            assert_eq!(LssRequest::decode(&request.frame()), Some(request), "{frame:?}");
        }
        if let Some(response) = LssResponse::decode(&frame) {
            assert_eq!(LssResponse::decode(&response.frame()), Some(response), "{frame:?}");
        }
        if let Some(time) = TimeOfDay::decode(&frame) {
            assert_eq!(TimeOfDay::decode(&time.frame()), Some(time), "{frame:?}");
        }
        DriveState::decode(frame.first_word() as u16);
    }
}

/// The highest number of polls of a client whose server sends arbitrary replies.
const MAX_POLLS: usize = 10_000;

fn ask(mut input: Input<'_>) {
    let object = ObjectAddress { index: input.short(), subindex: input.byte() };
    let transfer = match input.byte() % 4 {
        0 => Transfer::Upload { object },
        1 => Transfer::BlockUpload { object },
        kind => {
            let data: Vec<u8> = (0..input.byte()).collect();
            if kind == 2 {
                Transfer::Download { object, data }
            } else {
                Transfer::BlockDownload { object, data }
            }
        }
    };
    let mut client = SdoClient::new(NODE, SdoTiming { reply_timeout_ns: 1_000_000, retries: 2 });
    assert!(client.start(transfer).is_ok());
    let mut now_ns = 0;
    for _ in 0..MAX_POLLS {
        while let Some(frame) = client.poll(now_ns) {
            // A segment of a block has no command specifier, so nothing more holds for every frame.
            assert_eq!((frame.id(), frame.payload().len()), (Id::canopen(0x600, NODE), 8), "{frame:?}");
        }
        if client.take_outcome().is_some() {
            return;
        }
        if input.is_empty() {
            now_ns += 1_000_000;
            continue;
        }
        now_ns += u64::from(input.short());
        let answer = Frame::of(Id::canopen(0x580, NODE), input.bytes::<8>());
        client.receive(&answer);
    }
    panic!("the client does not end");
}

fn one_drive() -> &'static Config {
    static CONFIG: OnceLock<Config> = OnceLock::new();
    CONFIG.get_or_init(|| {
        let text = include_str!("../../configs/single-erob.toml");
        let mut config = Config::parse("single-erob.toml", text).expect("the example is valid");
        config.axes.iter_mut().for_each(|axis| {
            axis.node = NODE;
            axis.power_up_ns = 100_000;
        });
        config
    })
}

fn one_yz_aim() -> &'static Config {
    static CONFIG: OnceLock<Config> = OnceLock::new();
    CONFIG.get_or_init(|| {
        let text = include_str!("../../configs/gantry-yz-aim.toml");
        let mut config = Config::parse("gantry-yz-aim.toml", text).expect("the example is valid");
        config.axes.truncate(1);
        config.axes[0].node = NODE;
        config.axes[0].power_up_ns = 100_000;
        config
    })
}

fn talk_to_drive(config: &Config, mut input: Input<'_>) {
    let mut bus = takt::simulated_bus(config, 0);
    let mut now_ns = 0;
    for _ in 0..MAX_FRAMES {
        if input.is_empty() {
            break;
        }
        now_ns += 10 * u64::from(input.short());
        bus.send(now_ns, &[input.frame()]);
        let mut batch = ReceiveBatch::new();
        bus.receive(now_ns, &mut batch);
        for received in &batch {
            let id = received.frame.id();
            if id.value() & 0x780 == 0x580 && !id.is_extended() {
                assert!(SdoResponse::decode(&received.frame).is_some(), "{:?}", received.frame);
            }
        }
    }
    let seen = bus.observe(NODE).expect("the drive is there");
    assert!(seen.position.is_finite() && seen.velocity.is_finite() && seen.torque.is_finite(), "{seen:?}");
}

const MAX_FRAMES: usize = 200;

fn unpack(mut input: Input<'_>) {
    let count = usize::from(input.byte()) % (MAX_OBJECTS + 2);
    let objects: Vec<MappedObject> = (0..count)
        .map(|_| match input.byte() % 6 {
            0 => MappedObject::new(0x6041, 0, 16),
            1 => MappedObject::new(0x6064, 0, 32),
            2 => MappedObject::new(0x6061, 0, 8),
            3 => MappedObject::new(0x6040, 0, 16),
            4 => MappedObject::new(0x607A, 0, 32),
            _ => MappedObject::from_parameter(input.word()),
        })
        .collect();
    let bits: usize = objects.iter().map(|object| usize::from(object.bits)).sum();
    if let Ok(mapping) = Mapping::feedback(&objects) {
        assert_eq!(8 * mapping.length(), bits);
        let mut image = ProcessImage::default();
        let length = usize::from(input.byte()) % 9;
        let word = u64::from_le_bytes(input.bytes());
        let is_taken = mapping.unpack(word, length, &mut image).is_ok();
        assert_eq!(is_taken, length >= mapping.length());
    }
    if let Ok(mapping) = Mapping::commands(&objects) {
        let payload = mapping.pack(&ProcessImage::default());
        assert!(mapping.length() <= payload.len());
    }
}
