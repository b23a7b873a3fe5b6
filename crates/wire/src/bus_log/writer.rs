//! Writes a log of one of the kinds.

use std::io::{self, Write};
use std::path::Path;
use std::str::FromStr;

use super::{LoggedFrame, candump, candump_text, csv, pcapng};

/// A kind of log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// `candump -l`
    Candump,
    /// What candump prints.
    CandumpText,
    /// Wireshark.
    Pcapng,
    /// A table.
    Csv,
}

impl LogFormat {
    /// The kinds with their words, which are the usual ends of file names as well.
    pub const WORDS: [(&'static str, Self); 4] =
        [("log", Self::Candump), ("txt", Self::CandumpText), ("pcapng", Self::Pcapng), ("csv", Self::Csv)];

    /// The kind by the end of a file name.
    pub fn of(path: &Path) -> Option<Self> {
        path.extension()?.to_str()?.to_lowercase().parse().ok()
    }
}

impl FromStr for LogFormat {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let known = Self::WORDS.iter().find(|(word, _)| *word == text);
        known
            .map(|(_, format)| *format)
            .ok_or("the kinds of logs are log (candump -l), txt (candump), pcapng, csv")
    }
}

/// A log that is being written.
#[derive(Debug)]
pub struct LogWriter<W> {
    writer: W,
    format: LogFormat,
    buses: Vec<String>,
    frames: u64,
    text: String,
    bytes: Vec<u8>,
}

impl<W: Write> LogWriter<W> {
    /// Writes the beginning of a log.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn begin(mut writer: W, format: LogFormat) -> io::Result<Self> {
        let mut bytes = vec![];
        match format {
            LogFormat::Candump | LogFormat::CandumpText => {}
            LogFormat::Csv => bytes.extend(csv::HEADER.as_bytes()),
            LogFormat::Pcapng => pcapng::begin(&mut bytes),
        }
        writer.write_all(&bytes)?;
        Ok(Self { writer, format, buses: vec![], frames: 0, text: String::new(), bytes })
    }

    /// Adds a frame. Only a table has room for its meaning.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn add(&mut self, logged: &LoggedFrame<'_>, meaning: &str) -> io::Result<()> {
        self.frames += 1;
        self.text.clear();
        self.bytes.clear();
        let bus = named(logged.bus);
        let named = LoggedFrame { bus: &bus, ..*logged };
        match self.format {
            LogFormat::Candump => {
                let line = candump::CandumpLine { unix_ns: named.at_ns, bus: &bus, frame: named.frame };
                self.text = format!("{line}\n");
            }
            LogFormat::CandumpText => candump_text::line(&named, &mut self.text),
            LogFormat::Csv => csv::line(self.frames, logged, meaning, &mut self.text),
            LogFormat::Pcapng => {
                let known = self.buses.iter().position(|known| *known == bus);
                let interface = known.unwrap_or_else(|| {
                    pcapng::interface(&bus, &mut self.bytes);
                    self.buses.push(bus.clone());
                    self.buses.len() - 1
                });
                pcapng::frame(interface as u32, &named, &mut self.bytes);
            }
        }
        self.writer.write_all(self.text.as_bytes())?;
        self.writer.write_all(&self.bytes)
    }

    /// Writes what is still in memory.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// The name of a bus without white space, by which readers split lines.
fn named(bus: &str) -> String {
    let name = bus.split_whitespace().collect::<Vec<_>>().join("_");
    if name.is_empty() { "can".to_owned() } else { name }
}
