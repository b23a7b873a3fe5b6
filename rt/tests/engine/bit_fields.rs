//! Frames of bit fields: the frames of the hollow-shaft motors' manual in both directions, what every layout keeps, and what no layout
//! can be.

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;
use takt_rt::{
    BitField, BitRange, ByteOrder, CodeRange, CommandValue, CommandValues, FieldBits, FieldFrame, FieldValue,
    Frame, FrameFormat, FrameLayout, Id, LayoutError, LinearScale, Number, ReplyError, ReplyValue,
    ReplyValues, StateCodes,
};

/// The frames of the manual. Misprints have a corrected row of their own.
const VECTORS: &str = include_str!("../vectors/hollow-motor.csv");

struct Row {
    id: String,
    bytes: Vec<u8>,
    /// The named numbers of the column `value`.
    values: Vec<(String, f64)>,
}

/// The rows whose data are bytes, but for the misprints.
fn rows() -> Vec<Row> {
    VECTORS.lines().skip(1).filter_map(row).collect()
}

fn row(line: &str) -> Option<Row> {
    let mut columns: Vec<String> = vec![String::new()];
    let mut is_quoted = false;
    for character in line.chars() {
        match character {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => columns.push(String::new()),
            _ => columns.last_mut().unwrap().push(character),
        }
    }
    let [id, _, _, _, _, data, _, values, note] = columns.try_into().unwrap();
    if note.starts_with("MISPRINT") {
        return None;
    }
    let bytes = data.split(' ').map(|byte| u8::from_str_radix(byte, 16).ok()).collect::<Option<Vec<u8>>>()?;
    let values = values.split(' ').filter_map(|word| {
        let (name, number) = word.split_once('=')?;
        let number = match number.strip_prefix("0x") {
            Some(digits) => i64::from_str_radix(digits, 16).unwrap() as f64,
            None => number.parse().ok()?,
        };
        Some((name.to_owned(), number))
    });
    Some(Row { id, bytes, values: values.collect() })
}

fn row_named(id: &str) -> Row {
    rows().into_iter().find(|row| row.id == id).unwrap_or_else(|| panic!("there is no row {id}"))
}

const MOTOR: Id = Id::canopen(0, 1);
const MASTER: Id = Id::canopen(0, 0x64);

/// A field whose code is its value.
fn raw<V>(value: V, at: u16, width: u8, number: Number) -> BitField<V> {
    BitField { value, bits: FieldBits::of(at, width), number, scale: LinearScale::ONE, codes: None }
}

fn with_scale<V>(field: BitField<V>, scale: LinearScale) -> BitField<V> {
    BitField { scale, ..field }
}

/// The command of CAN normal mode, packed 16/12/12/12/12 bits, in codes.
fn packed_command() -> [BitField<CommandValue>; 5] {
    [
        raw(CommandValue::Position, 0, 16, Number::Unsigned),
        raw(CommandValue::Velocity, 16, 12, Number::Unsigned),
        raw(CommandValue::Stiffness, 28, 12, Number::Unsigned),
        raw(CommandValue::Damping, 40, 12, Number::Unsigned),
        raw(CommandValue::Torque, 52, 12, Number::Unsigned),
    ]
}

fn packed_reply() -> [BitField<ReplyValue>; 4] {
    [
        raw(ReplyValue::Sender, 0, 8, Number::Unsigned),
        raw(ReplyValue::Position, 8, 16, Number::Unsigned),
        raw(ReplyValue::Velocity, 24, 12, Number::Unsigned),
        raw(ReplyValue::Torque, 36, 12, Number::Unsigned),
    ]
}

/// The reply of extended mode: the higher half of the position lies behind everything else.
fn extended_reply() -> [BitField<ReplyValue>; 4] {
    let halves = FieldBits::split(BitRange { at: 48, width: 16 }, BitRange { at: 8, width: 16 });
    let [sender, position, velocity, torque] = packed_reply();
    [sender, BitField { bits: halves, number: Number::Signed, ..position }, velocity, torque]
}

fn flexible_command() -> [BitField<CommandValue>; 8] {
    [
        raw(CommandValue::Position, 0, 40, Number::Signed),
        raw(CommandValue::Velocity, 40, 32, Number::Signed),
        raw(CommandValue::Torque, 72, 16, Number::Signed),
        raw(CommandValue::Mode, 88, 8, Number::Unsigned),
        raw(CommandValue::Run, 96, 8, Number::Unsigned),
        raw(CommandValue::Stiffness, 104, 8, Number::Unsigned),
        raw(CommandValue::Damping, 112, 8, Number::Unsigned),
        raw(CommandValue::Zero, 120, 8, Number::Unsigned),
    ]
}

fn flexible_reply() -> [BitField<ReplyValue>; 7] {
    [
        raw(ReplyValue::Position, 0, 40, Number::Signed),
        raw(ReplyValue::Velocity, 40, 32, Number::Signed),
        raw(ReplyValue::Torque, 72, 16, Number::Signed),
        raw(ReplyValue::Mode, 88, 8, Number::Unsigned),
        raw(ReplyValue::Run, 96, 8, Number::Unsigned),
        raw(ReplyValue::Temperature, 112, 8, Number::Signed),
        raw(ReplyValue::Sender, 120, 8, Number::Unsigned),
    ]
}

fn compiled<V: FieldValue>(format: FrameFormat, bytes: usize, fields: &[BitField<V>]) -> FieldFrame<V> {
    FieldFrame::compile(MOTOR, format, bytes, ByteOrder::BigEndian, fields).unwrap()
}

/// What a field is called in the column `value`.
fn command_value(name: &str) -> CommandValue {
    match name {
        "pos" => CommandValue::Position,
        "vel" => CommandValue::Velocity,
        "cur" => CommandValue::Torque,
        "kp" => CommandValue::Stiffness,
        "kd" => CommandValue::Damping,
        "mode" => CommandValue::Mode,
        "run" => CommandValue::Run,
        "zero" => CommandValue::Zero,
        other => panic!("{other}"),
    }
}

fn reply_value(name: &str) -> ReplyValue {
    match name {
        "pos" => ReplyValue::Position,
        "vel" => ReplyValue::Velocity,
        "cur" => ReplyValue::Torque,
        "mode" => ReplyValue::Mode,
        "run" => ReplyValue::Run,
        "temp" => ReplyValue::Temperature,
        "id" => ReplyValue::Sender,
        other => panic!("{other}"),
    }
}

fn assert_packs(frame: &FieldFrame<CommandValue>, row: &Row, payload: &[u8]) {
    let mut values = CommandValues::default();
    row.values.iter().for_each(|(name, number)| values.set(command_value(name), *number));
    assert!(!row.values.is_empty() || payload.iter().all(|byte| *byte == 0), "{}", row.id);
    assert_eq!(frame.frame(&values).payload(), payload, "{}", row.id);
}

fn assert_unpacks(reply: &FieldFrame<ReplyValue>, row: &Row, frame: &Frame) {
    let mut values = ReplyValues::default();
    reply.receive(frame, &mut values).unwrap();
    assert!(!row.values.is_empty());
    for (name, number) in &row.values {
        assert_eq!(values.get(reply_value(name)), *number, "{}: {name}", row.id);
    }
}

#[test]
fn the_packed_commands_of_the_manual_come_out_byte_for_byte() {
    let command = compiled(FrameFormat::Classic, 8, &packed_command());
    for id in ["can-cmd-example", "can-cmd-c-program"] {
        let row = row_named(id);
        assert_packs(&command, &row, &row.bytes);
    }
}

#[test]
fn the_replies_of_normal_and_extended_mode_are_told_apart_by_their_length_and_read_as_printed() {
    let normal = compiled(FrameFormat::Classic, 6, &packed_reply());
    let extended = compiled(FrameFormat::Classic, 8, &extended_reply());
    let (row_normal, row_extended) = (row_named("can-reply-normal"), row_named("can-reply-extended"));
    let short = Frame::data(MASTER, &row_normal.bytes).unwrap();
    let long = Frame::data(MASTER, &row_extended.bytes).unwrap();
    assert_unpacks(&normal, &row_normal, &short);
    assert_unpacks(&extended, &row_extended, &long);
    let mut values = ReplyValues::default();
    let error = normal.receive(&long, &mut values);
    assert_eq!(error, Err(ReplyError::Length { expected: 6, received: 8 }));
    assert!(extended.receive(&short, &mut values).is_err());
    assert_eq!(values, ReplyValues::default());
}

#[test]
fn the_flexible_data_rate_frames_of_the_manual_come_out_and_are_read_however_they_were_carried() {
    let command = compiled(FrameFormat::Fd, 16, &flexible_command());
    let reply = compiled(FrameFormat::Fd, 16, &flexible_reply());
    // Over the RS-485 bridge: identifier, the 16 bytes, CRC.
    let carried =
        |row: &Row| if row.bytes.len() == 21 { row.bytes[1..17].to_vec() } else { row.bytes.clone() };
    for id in ["canfd-poll", "rs485-req-fixed", "encoder-req-fixed"] {
        let mut row = row_named(id);
        let payload = carried(&row);
        row.values.retain(|(name, _)| name != "id");
        assert_packs(&command, &row, &payload);
    }
    for id in ["canfd-reply-30c", "canfd-reply-negative", "rs485-rsp-fixed", "encoder-rsp-fixed"] {
        let row = row_named(id);
        for has_bit_rate_switch in [false, true] {
            let frame = Frame::fd(MASTER, &carried(&row), has_bit_rate_switch).unwrap();
            assert_unpacks(&reply, &row, &frame);
        }
    }
    // Over the Modbus bridge: a register for each byte.
    let row = row_named("modbus-read-rsp-fixed");
    let low_bytes: Vec<u8> = row.bytes[3..35].chunks(2).map(|register| register[1]).collect();
    assert_unpacks(&reply, &row, &Frame::fd(MASTER, &low_bytes, false).unwrap());
}

/// A gain frame: which gain, and a multiplier.
#[test]
fn gain_frames_carry_an_ieee_754_number_with_its_highest_byte_first() {
    let fields = [
        raw(CommandValue::Mode, 8, 8, Number::Unsigned),
        raw(CommandValue::Stiffness, 16, 32, Number::Float),
    ];
    let frame = compiled(FrameFormat::Classic, 8, &fields);
    for (index, gain) in (1..).zip(["speed-kp", "speed-ki", "current-kp", "current-ki"]) {
        let mut values = CommandValues::default();
        values.set(CommandValue::Mode, f64::from(index));
        values.set(CommandValue::Stiffness, 1.0);
        assert_eq!(frame.frame(&values).payload(), row_named(&format!("can-gain-{gain}")).bytes, "{gain}");
    }
}

/// A pole pair number, for which the manual gives an example.
const POLE_PAIRS: f64 = 14.0;

#[test]
fn the_scales_of_the_manual_turn_si_units_into_its_codes() {
    let [position, velocity, _, _, torque] = packed_command();
    let fields = [
        with_scale(position, LinearScale::centred(16, TAU)),
        with_scale(velocity, LinearScale::centred(12, 200.0)),
        with_scale(torque, LinearScale::centred(12, 4.0)),
    ];
    let frame = compiled(FrameFormat::Classic, 8, &fields);
    let code = |value: CommandValue, to: f64, first_bit: usize, width: usize| {
        let mut values = CommandValues::default();
        values.set(value, to);
        let word =
            frame.frame(&values).payload().iter().fold(0u64, |word, byte| word << 8 | u64::from(*byte));
        word >> (64 - first_bit - width) & ((1 << width) - 1)
    };
    for (id, value, to, first_bit, width) in [
        ("scale-pos-180", CommandValue::Position, PI, 0, 16),
        ("scale-vel-pos", CommandValue::Velocity, 100.0, 16, 12),
        ("scale-vel-neg", CommandValue::Velocity, -100.0, 16, 12),
        ("scale-cur", CommandValue::Torque, 2.0, 52, 12),
    ] {
        let expected = row_named(id).bytes.iter().fold(0, |word, byte| word << 8 | u64::from(*byte));
        assert_eq!(code(value, to, first_bit, width), expected, "{id}");
    }
    // Exactly one turn would be a code beyond the field.
    assert_eq!(code(CommandValue::Position, TAU, 0, 16), 0xFFFF);
    assert_eq!(code(CommandValue::Position, -f64::INFINITY, 0, 16), 0);
    assert_eq!(code(CommandValue::Position, f64::NAN, 0, 16), 0x8000, "what is no number moves nothing");

    // The velocity of CAN FD is an electrical frequency: 2^23 is 1 kHz.
    let per_radian = 8_388_608.0 / 1000.0 * POLE_PAIRS / TAU;
    let scale = LinearScale { codes_per_unit: per_radian, zero_code: 0.0 };
    let reply = compiled(FrameFormat::Fd, 16, &[with_scale(flexible_reply()[1], scale)]);
    let mut payload = [0; 16];
    payload[5..9].copy_from_slice(&(-8_388_608i32).to_be_bytes());
    let mut values = ReplyValues::default();
    reply.receive(&Frame::fd(MASTER, &payload, false).unwrap(), &mut values).unwrap();
    let rpm = values.get(ReplyValue::Velocity) / TAU * 60.0;
    assert!((rpm + 1000.0 * 60.0 / POLE_PAIRS).abs() < 1e-6, "{rpm}");
}

#[test]
fn a_command_whose_damping_leaves_out_its_last_code_is_none_of_the_frames_with_a_meaning_of_their_own() {
    let [position, velocity, stiffness, damping, torque] = packed_command();
    let damping = BitField { codes: Some(CodeRange { lowest: 0, highest: 0xFFE }), ..damping };
    let frame = compiled(FrameFormat::Classic, 8, &[position, velocity, stiffness, damping, torque]);
    let mut values = CommandValues::default();
    for value in [
        CommandValue::Position,
        CommandValue::Velocity,
        CommandValue::Stiffness,
        CommandValue::Damping,
        CommandValue::Torque,
    ] {
        values.set(value, 1e9);
    }
    assert_eq!(frame.frame(&values).payload(), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xEF, 0xFF]);
}

#[test]
fn a_reply_with_a_field_that_holds_no_number_changes_nothing() {
    let fields =
        [raw(ReplyValue::Velocity, 32, 32, Number::Float), raw(ReplyValue::Position, 0, 32, Number::Float)];
    let reply =
        FieldFrame::compile(MASTER, FrameFormat::Classic, 8, ByteOrder::LittleEndian, &fields).unwrap();
    let payload = |position: f32, velocity: f32| {
        let [a, b, c, d] = position.to_le_bytes();
        let [e, f, g, h] = velocity.to_le_bytes();
        Frame::of(MASTER, [a, b, c, d, e, f, g, h])
    };
    let mut values = ReplyValues::default();
    reply.receive(&payload(1.5, -0.25), &mut values).unwrap();
    let read = |values: &ReplyValues| (values.get(ReplyValue::Position), values.get(ReplyValue::Velocity));
    assert_eq!(read(&values), (1.5, -0.25));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let error = reply.receive(&payload(bad, 3.0), &mut values);
        assert_eq!(error, Err(ReplyError::NoNumber { field: 1 }));
    }
    assert_eq!(read(&values), (1.5, -0.25));
}

#[test]
fn a_code_for_the_state_shows_torque_and_errors() {
    let fields =
        [raw(ReplyValue::State, 0, 4, Number::Unsigned), raw(ReplyValue::Position, 8, 16, Number::Unsigned)];
    let reply = compiled(FrameFormat::Classic, 3, &fields);
    assert!(!reply.carries(ReplyValue::Run) && !reply.carries(ReplyValue::Error));
    let reply = reply.with_states(StateCodes { stopped: 0, running: 1 });
    assert!(reply.carries(ReplyValue::Run) && reply.carries(ReplyValue::Error));
    assert!(!reply.carries(ReplyValue::Velocity));
    let mut values = ReplyValues::default();
    for (code, run, error) in [(0, 0.0, 0.0), (1, 1.0, 0.0), (9, 0.0, 9.0), (0, 0.0, 0.0)] {
        reply.receive(&Frame::of(MASTER, [code << 4 | 5, 0, 0]), &mut values).unwrap();
        assert_eq!((values.get(ReplyValue::Run), values.get(ReplyValue::Error)), (run, error), "{code}");
    }
}

fn error_of(bytes: usize, fields: &[BitField<CommandValue>]) -> LayoutError {
    FrameLayout::compile(bytes, ByteOrder::BigEndian, fields).unwrap_err()
}

#[test]
fn what_no_layout_can_be_is_refused_and_named() {
    let [position, velocity, ..] = packed_command();
    assert_eq!(error_of(0, &[position]), LayoutError::Length { bytes: 0 });
    assert_eq!(error_of(17, &[position]), LayoutError::Length { bytes: 17 });
    let outside = LayoutError::Outside { field: 1, end: 28, bits: 24 };
    assert_eq!(error_of(3, &[position, velocity]), outside);
    let overlapping = raw(CommandValue::Velocity, 15, 12, Number::Unsigned);
    assert_eq!(error_of(8, &[position, overlapping]), LayoutError::Overlap { field: 1, with: 0 });
    let bits = FieldBits::split(BitRange { at: 0, width: 8 }, BitRange { at: 7, width: 8 });
    assert_eq!(error_of(8, &[BitField { bits, ..position }]), LayoutError::Overlap { field: 0, with: 0 });
    assert_eq!(
        error_of(8, &[position, BitField { bits: velocity.bits, ..position }]),
        LayoutError::Repeated { field: 1 }
    );
    for (width, number) in [(0, Number::Unsigned), (54, Number::Signed), (31, Number::Float)] {
        let field = raw(CommandValue::Torque, 0, width, number);
        assert_eq!(error_of(16, &[field]), LayoutError::Width { field: 0, bits: width.into() });
    }
    let halves = FieldBits::split(BitRange { at: 0, width: 30 }, BitRange { at: 30, width: 30 });
    assert_eq!(
        error_of(16, &[BitField { bits: halves, ..position }]),
        LayoutError::Width { field: 0, bits: 60 }
    );
    for (codes_per_unit, zero_code) in [(0.0, 0.0), (f64::NAN, 0.0), (f64::INFINITY, 0.0), (1.0, f64::NAN)] {
        let scale = LinearScale { codes_per_unit, zero_code };
        assert_eq!(error_of(8, &[with_scale(position, scale)]), LayoutError::Scale { field: 0 });
    }
    for (lowest, highest) in [(0, 0x1_0000), (-1, 5), (7, 6)] {
        let codes = CodeRange { lowest, highest };
        assert_eq!(
            error_of(8, &[BitField { codes: Some(codes), ..position }]),
            LayoutError::Codes { field: 0, codes }
        );
    }
    let bits: Vec<_> = (0..13).map(|at| raw(CommandValue::Nothing, at, 1, Number::Unsigned)).collect();
    assert_eq!(error_of(8, &bits), LayoutError::TooManyFields { given: 13 });
    assert!(FrameLayout::compile(8, ByteOrder::BigEndian, &bits[..12]).is_ok());
    for (format, bytes) in
        [(FrameFormat::Classic, 9), (FrameFormat::Fd, 13), (FrameFormat::FdBitRateSwitch, 10)]
    {
        let refused = FieldFrame::compile(MOTOR, format, bytes, ByteOrder::BigEndian, &[position]);
        assert_eq!(refused, Err(LayoutError::Length { bytes }));
    }
}

/// A layout of a command and of a reply with the same bits, and the two that they carry.
fn any_pair() -> impl Strategy<Value = (ByteOrder, [BitRange; 2], [Number; 2], [LinearScale; 2])> {
    let order = prop::sample::select(vec![ByteOrder::BigEndian, ByteOrder::LittleEndian]);
    let number = |width: u8| match width {
        32 => prop::sample::select(vec![Number::Unsigned, Number::Signed, Number::Float]),
        _ => prop::sample::select(vec![Number::Unsigned, Number::Signed]),
    };
    let widths = (1..=53u8, 1..=53u8).prop_flat_map(|(first, second)| {
        (Just(first), Just(second), 0..=(64 - u16::from(first)), 64..=(128 - u16::from(second)))
    });
    let scale = (prop::num::f64::NORMAL, -1e6..1e6f64).prop_map(|(unit, zero_code)| {
        let codes_per_unit = unit.signum() * (1.0 + unit.abs().log10().rem_euclid(6.0)).exp();
        LinearScale { codes_per_unit, zero_code: zero_code.round() }
    });
    (order, widths, scale.clone(), scale).prop_flat_map(
        move |(order, (first, second, at, behind), one, other)| {
            let ranges = [BitRange { at, width: first }, BitRange { at: behind, width: second }];
            (
                Just(order),
                Just(ranges),
                (number(first), number(second)).prop_map(<[Number; 2]>::from),
                Just([one, other]),
            )
        },
    )
}

/// The lowest and the highest value of a field, and the value of one code.
fn range(width: u8, number: Number, scale: LinearScale) -> (f64, f64, f64) {
    let codes = (1u64 << width) as f64;
    let (lowest, highest) = match number {
        Number::Unsigned => (0.0, codes - 1.0),
        Number::Signed => (-codes / 2.0, codes / 2.0 - 1.0),
        Number::Float => (-1e9, 1e9),
    };
    let ends = [lowest, highest].map(|code| (code - scale.zero_code) / scale.codes_per_unit);
    (ends[0].min(ends[1]), ends[0].max(ends[1]), 1.0 / scale.codes_per_unit.abs())
}

proptest! {
    #[test]
    fn what_is_packed_is_unpacked_within_half_a_quantum_and_beyond_full_scale_it_is_full_scale(
        (order, [first, second], numbers, scales) in any_pair(),
        shares in [-0.5..1.5f64, -0.5..1.5f64],
    ) {
        let field = |range: BitRange, which: usize| {
            (FieldBits { high: range, low: None }, numbers[which], scales[which])
        };
        let fields = [field(first, 0), field(second, 1)];
        let command = [CommandValue::Position, CommandValue::Torque];
        let reply = [ReplyValue::Position, ReplyValue::Torque];
        let make = |which: usize| fields[which];
        let sent = [0, 1].map(|which| {
            let (bits, number, scale) = make(which);
            BitField { value: command[which], bits, number, scale, codes: None }
        });
        let heard = [0, 1].map(|which| {
            let (bits, number, scale) = make(which);
            BitField { value: reply[which], bits, number, scale, codes: None }
        });
        let sent = FieldFrame::compile(MOTOR, FrameFormat::Fd, 16, order, &sent).unwrap();
        let heard = FieldFrame::compile(MOTOR, FrameFormat::Fd, 16, order, &heard).unwrap();
        let mut values = CommandValues::default();
        let mut expected = [(0.0, 0.0); 2];
        for which in [0, 1] {
            let (_, number, scale) = fields[which];
            let width = [first, second][which].width;
            let (lowest, highest, quantum) = range(width, number, scale);
            let value = lowest + shares[which] * (highest - lowest);
            values.set(command[which], value);
            let rounding = 4.0 * f64::EPSILON * (value.abs() + scale.zero_code.abs() * quantum);
            expected[which] = match number {
                // 24 bits of the code
                Number::Float => (value, (value * scale.codes_per_unit + scale.zero_code).abs() * 6e-8 * quantum + rounding + 1e-30),
                _ => (value.max(lowest).min(highest), 0.5 * quantum * (1.0 + 1e-9) + rounding),
            };
        }
        let mut read = ReplyValues::default();
        heard.receive(&sent.frame(&values), &mut read).unwrap();
        for which in [0, 1] {
            let (value, tolerance) = expected[which];
            let seen = read.get(reply[which]);
            prop_assert!((seen - value).abs() <= tolerance, "{which}: {seen} for {value}, {tolerance}");
        }
    }

    #[test]
    fn the_parts_of_a_split_field_are_one_number(position in any::<i32>(), velocity in 0..0x1000u32) {
        let extended = compiled(FrameFormat::Classic, 8, &extended_reply());
        let [high_1, high_2, low_1, low_2] = position.to_be_bytes();
        let payload = [7, low_1, low_2, (velocity >> 4) as u8, (velocity << 4) as u8, 0, high_1, high_2];
        let mut values = ReplyValues::default();
        extended.receive(&Frame::of(MASTER, payload), &mut values).unwrap();
        prop_assert_eq!(values.get(ReplyValue::Position), f64::from(position));
        prop_assert_eq!(values.get(ReplyValue::Velocity), f64::from(velocity));
        prop_assert_eq!((values.get(ReplyValue::Sender), values.get(ReplyValue::Torque)), (7.0, 0.0));
    }

    #[test]
    fn any_payload_is_read_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..=8)) {
        let mut values = ReplyValues::default();
        let reply = compiled(FrameFormat::Classic, 6, &packed_reply());
        let result = reply.receive(&Frame::data(MASTER, &bytes).unwrap(), &mut values);
        prop_assert_eq!(result.is_ok(), bytes.len() == 6);
    }
}
