//! Every CANopen exchange that the manual prints, byte for byte.

use super::bench::{Bench, parameters};
use super::rows::columns;

struct Row {
    id: String,
    is_request: bool,
    can_id: u32,
    data: Vec<u8>,
}

/// The rows with CANopen identifiers without misprints, in order.
fn rows() -> Vec<Row> {
    let text = include_str!("../../../../tests/vectors/erob-can.csv");
    let rows = text.lines().skip(1).filter_map(|line| {
        let mut columns = columns(line).into_iter();
        let (id, _, direction, can_id, data) =
            (columns.next()?, columns.next()?, columns.next()?, columns.next()?, columns.next()?);
        let note = columns.nth(3).unwrap_or_default();
        let can_id = u32::from_str_radix(&can_id, 16).ok()?;
        let is_custom = matches!(can_id & 0x7C0, 0x5C0 | 0x640);
        if is_custom || note.starts_with("MISPRINT:") {
            return None;
        }
        let data = data.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
        Some(Row { id, is_request: direction == "host->drive", can_id, data })
    });
    rows.collect()
}

#[test]
fn the_drive_answers_every_printed_canopen_exchange_as_printed() {
    // One capture shows that mode 7 is accepted, although object 6502 of other units excludes it.
    let mut module = parameters(2);
    module.quirks.undeclared_modes = vec![takt_rt::OperationMode::InterpolatedPosition];
    let mut bench = Bench::with(vec![module]);
    let rows = rows();
    assert_eq!(rows.len(), 100);
    let mut answers = 0;
    let mut rows = rows.into_iter().peekable();
    while let Some(row) = rows.next() {
        assert!(row.is_request, "{}: an answer without a request", row.id);
        let frame = takt_rt::Frame::data(takt_rt::Id::base(row.can_id).unwrap(), &row.data).unwrap();
        bench.send(frame);
        bench.run_ms(2);
        let heard: Vec<_> = std::mem::take(&mut bench.heard);
        if let Some(answer) = rows.next_if(|next| !next.is_request) {
            assert_eq!(heard.len(), 1, "{} after {}", answer.id, row.id);
            let frame = heard[0].frame;
            assert_eq!(
                (frame.id().value(), frame.payload()),
                (answer.can_id, &answer.data[..]),
                "{}",
                answer.id
            );
            answers += 1;
        } else if row.can_id != 0x602 {
            assert!(heard.is_empty(), "{}: {:?}", row.id, heard[0].frame);
        }
    }
    assert_eq!(answers, 41);
}
