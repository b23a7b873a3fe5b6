//! Fuzzes the readers of logs, and the decoder that tells what their frames mean.

use std::io::Cursor;
use std::path::Path;
use std::sync::OnceLock;

use takt::Config;
use takt_rt::Frame;
use takt_tools::monitor::{BusDecoder, BusStatistics};
use takt_wire::bus_log::{self, Direction, LogFormat, LogWriter, LoggedFrame};

use super::input::Input;

/// A frame that was read.
struct Kept {
    at_ns: u64,
    bus: String,
    direction: Option<Direction>,
    frame: Frame,
}

/// What is read from a log is written in every kind and read again as the same frames. Each frame has a meaning, whatever came before.
pub fn run(bytes: &[u8]) {
    let frames = match read(bytes) {
        Ok(frames) => frames,
        Err(words) => return assert!(!words.is_empty()),
    };
    for (word, format) in LogFormat::WORDS {
        if frames.is_empty() {
            break;
        }
        let mut written = vec![];
        let mut writer = LogWriter::begin(&mut written, format).expect("memory takes everything");
        for Kept { at_ns, bus, direction, frame } in &frames {
            let logged = LoggedFrame { at_ns: *at_ns, bus, direction: *direction, frame: *frame };
            writer.add(&logged, "a \"meaning\", of\nsome kind").expect("memory takes everything");
        }
        let again = read(&written).unwrap_or_else(|error| panic!("{word}: {error}"));
        assert!(frames.iter().map(|kept| kept.frame).eq(again.iter().map(|kept| kept.frame)), "{word}");
    }
    let mut statistics = BusStatistics::new(1_000_000, None);
    for decoder in &mut decoders() {
        for Kept { at_ns, frame, .. } in &frames {
            means_something(decoder, frame);
            statistics.add(*at_ns, frame);
        }
    }
    assert!(statistics.load().is_none_or(|load| (0.0..=1.0).contains(&load)));
    assert!(statistics.ids().map(|id| id.frames).sum::<u64>() <= statistics.frames());
}

/// Any frames, one behind the other, have a meaning.
pub fn decode(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let mut decoders = decoders();
    while !input.is_empty() {
        let frame = input.frame();
        decoders.iter_mut().for_each(|decoder| means_something(decoder, &frame));
    }
}

fn means_something(decoder: &mut BusDecoder, frame: &Frame) {
    let decoded = decoder.decode(frame);
    assert!(!decoded.service.name().is_empty() && !decoded.line().is_empty());
    for value in &decoded.values {
        assert!(!value.name.is_empty() && !value.text.is_empty(), "{value:?}");
    }
}

fn read(bytes: &[u8]) -> Result<Vec<Kept>, String> {
    let mut frames = vec![];
    let taken = |LoggedFrame { at_ns, bus, direction, frame }: LoggedFrame<'_>| {
        frames.push(Kept { at_ns, bus: bus.to_owned(), direction, frame });
        frames.len() < 1000
    };
    bus_log::read(Cursor::new(bytes), taken).map_err(|error| error.to_string())?;
    Ok(frames)
}

/// Without a configuration, and of buses with drives of every kind.
fn decoders() -> Vec<BusDecoder> {
    static CONFIGS: OnceLock<Vec<Config>> = OnceLock::new();
    let configs = CONFIGS.get_or_init(|| {
        let names = ["canopen", "hollow", "own_protocol", "two_buses"];
        let load = |name: &str| {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
            let path = format!("crates/cli/tests/monitor/{name}.toml");
            let path =
                [folder.join(&path), folder.join("..").join(&path)].into_iter().find(|path| path.exists());
            Config::load(&path.expect("the configuration is there")).expect("the configuration is right")
        };
        names.map(load).into()
    });
    let of_buses =
        configs.iter().flat_map(|config| (0..config.buses.len()).map(move |bus| BusDecoder::of(config, bus)));
    std::iter::once(BusDecoder::with_drives(&[])).chain(of_buses).collect()
}
