//! Fuzzes the reader of descriptions of bit fields with arbitrary text, and what is compiled of them with arbitrary replies.

use std::sync::OnceLock;

use takt::config::bit_fields::{compile, parse};
use takt::config::{Axis, Config};
use takt_rt::{
    FieldDrive, FieldDriveParameters, FieldMode, FieldTargets, Frame, FrameFormat, LifeWish, ReplyValue,
};
use takt_wire::bit_fields::{FieldDevice, Setting, Settings};

use super::configuration::assert_explained;
use super::input::Input;

const AXIS: &str = "name = \"fuzz\"\n[[bus]]\nname = \"can\"\n[[axis]]\nname = \"joint\"\nbus = \"can\"\nnode = 1\n\
    drive = \"bit-fields\"\ndescription = \"damiao-dm-mit\"\nmaster_id = 0x11\nmode = \"csp\"\n\
    position_full_scale = \"12.5 rad\"\nvelocity_full_scale = \"30 rad/s\"\ntorque_full_scale = \"10 Nm\"\n\
    kp = 60\nkd = 1.5\n[axis.limits]\nposition = [-1, 1]\nvelocity = 2\nacceleration = 8\ntorque = 5\n";
/// Settings with this value are right for every description that comes with takt.
const NUMBER: f64 = 10.0;
const MASTER_ID: u16 = 0x11;
const CYCLES: usize = 100;

/// Reads a text as a description. An error says what is wrong, and where. What is described can be compiled or is refused; a drive that
/// is led by it sends frames of its own layout, and what any frames make of it is finite.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let description = match parse("fuzz", text) {
        Ok(description) => description,
        Err(error) => return assert_explained(text, &error),
    };
    let mut settings = Settings::default();
    settings.master_id = Some(MASTER_ID);
    for setting in FieldDevice::needed(&description) {
        settings.set(setting, NUMBER);
    }
    settings.set(Setting::PositionGain, NUMBER);
    settings.set(Setting::PositionDamping, NUMBER);
    let device = FieldDevice { description, settings };
    if let Ok(by) = compile(&device, axis()) {
        lead(&by, Input::new(bytes));
    }
}

fn axis() -> &'static Axis {
    static CONFIG: OnceLock<Config> = OnceLock::new();
    let config = CONFIG.get_or_init(|| Config::parse("fuzz", AXIS).expect("a valid configuration"));
    config.axes.first().expect("the configuration has an axis")
}

fn wish(byte: u8) -> LifeWish {
    match byte % 8 {
        0 => LifeWish::Stop,
        1 => LifeWish::Zero,
        2 => LifeWish::Clear,
        3 => LifeWish::Run(FieldMode::Velocity),
        4 => LifeWish::Run(FieldMode::Torque),
        _ => LifeWish::Run(FieldMode::Position),
    }
}

fn lead(by: &FieldDriveParameters, mut input: Input<'_>) {
    let mut drive = FieldDrive::default();
    for _ in 0..CYCLES {
        let wish = wish(input.byte());
        let targets =
            FieldTargets { position: input.number(), velocity: input.number(), ..FieldTargets::default() };
        let frame = drive.step(by, wish, &targets);
        let is_own =
            frame.id() == by.command.id() && frame.is_fd() == (by.command.format() != FrameFormat::Classic);
        assert!(is_own || frame.payload().len() <= 8, "{frame:?}");
        let reply = match input.byte() & 1 {
            0 => input.frame(),
            _ => own_reply(by, &mut input),
        };
        if drive.receive(by, &reply).is_ok() {
            let position = drive.position(by).expect("it has replied");
            assert!(position.is_finite(), "{reply:?}: {position}");
            let velocity = drive.reported(by, ReplyValue::Velocity);
            assert!(velocity.is_none_or(f64::is_finite), "{reply:?}: {velocity:?}");
        }
        drive.drive_state(by);
    }
}

/// A reply of the right length with any contents.
fn own_reply(by: &FieldDriveParameters, input: &mut Input<'_>) -> Frame {
    let payload = input.bytes::<16>();
    let lengths = (0..=16).map(|length| payload.get(..length).unwrap_or_default());
    let frames = lengths.filter_map(|payload| match by.reply.format() {
        FrameFormat::Classic => Frame::data(by.reply.id(), payload).ok(),
        format => Frame::fd(by.reply.id(), payload, format == FrameFormat::FdBitRateSwitch).ok(),
    });
    let is_reply = |frame: &Frame| FieldDrive::default().receive(by, frame).is_ok();
    let all: Vec<Frame> = frames.collect();
    all.iter().copied().find(is_reply).or(all.first().copied()).unwrap_or_else(|| input.frame())
}
