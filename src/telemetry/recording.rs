//! The MCAP recording: `/cycle` with the times, `/group/<name>` for each group, `/axis/<name>` for each axis, and `/events`.
//! Without configured groups the only one is `/group/all`. A black box also has
//! `/bus/<name>` with the health of each bus, and `/frames/<name>`. The time of a message is a time of day: that of its
//! event or frame, or the start of its slot.

use std::collections::BTreeMap;
use std::io::{BufWriter, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, McapResult, WriteOptions};
use takt_rt::{CycleRecord, Event, Phase};

use super::cdr::CdrEncoder;
use super::destination::Opened;
use super::history::OnBus;
use super::machine::Machine;
use super::messages::{self, MessageType};
use super::own_errors;
use super::wall_clock::WallClock;
use crate::config::ConfigSources;
use crate::link::trace::{TracedFrame, TracedHealth};

/// A chunk is written to the file as a whole. It holds a third of a second of six axes at 1 ms. A crash of the computer
/// loses at most that.
const CHUNK_BYTES: u64 = 256 * 1024;

/// The name of the metadata record that describes the machine.
pub const METADATA: &str = "takt";

/// The version of the format of the journal, in the metadata of its channel.
pub const JOURNAL_VERSION: &str = "1";
/// The metadata record at the end of a journal.
pub const JOURNAL_END: &str = "journal end";
/// The metadata record that names the file of the configuration, and the interfaces that replace those of the file.
pub const CONFIGURATION: &str = "configuration";
/// Its key for the file.
pub const MAIN_FILE: &str = "file";
/// What is before the name of a bus in its keys for interfaces.
pub const INTERFACE_OF: &str = "interface of ";
/// The metadata record with the files of the configuration.
pub const CONFIGURATION_FILES: &str = "configuration files";

/// The name of the group of all axes, where no groups are configured.
const ONLY_GROUP: &str = "all";

/// A recording that is being written.
pub struct Recording {
    /// Its name in messages.
    pub label: String,
    writer: mcap::Writer<NoSeek<BufWriter<Box<dyn Write + Send>>>>,
    encoder: CdrEncoder,
    wall_clock: WallClock,
    cycle_channel: u16,
    event_channel: u16,
    group_channels: Vec<u16>,
    axis_channels: Vec<u16>,
    bus_channels: Vec<BusChannels>,
    journal_channel: Option<u16>,
    /// The time of the last message.
    last_time: u64,
    /// Whether a group was stopping in the last cycle.
    was_stopping: bool,
}

/// The channels of one bus.
struct BusChannels {
    health: u16,
    frames: u16,
}

impl Recording {
    /// Writes the beginning: schemas, channels, and the description of the machine.
    pub fn begin(opened: Opened, machine: &Machine, wall_clock: WallClock) -> McapResult<Self> {
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("takt ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::new(opened.writer)))?;
        writer.write_metadata(&Metadata { name: METADATA.to_owned(), metadata: describe(machine) })?;
        let mut schema =
            |message: &MessageType| writer.add_schema(message.name, "ros2msg", message.definition.as_bytes());
        let (cycle, axis, event) =
            (schema(&messages::CYCLE)?, schema(&messages::AXIS)?, schema(&messages::EVENT)?);
        let group = schema(&messages::GROUP)?;
        let mut channel = |schema, topic: &str, metadata: &BTreeMap<_, _>| {
            writer.add_channel(schema, topic, "cdr", metadata)
        };
        let cycle_channel = channel(cycle, "/cycle", &BTreeMap::new())?;
        let event_channel = channel(event, "/events", &BTreeMap::new())?;
        let mut group_channels = Vec::new();
        let only = [ONLY_GROUP.to_owned()];
        let names = if machine.groups.is_empty() { &only[..] } else { &machine.groups };
        for (index, name) in names.iter().enumerate() {
            let metadata = BTreeMap::from([("index".to_owned(), index.to_string())]);
            group_channels.push(channel(group, &format!("/group/{name}"), &metadata)?);
        }
        let mut axis_channels = Vec::new();
        for (index, description) in machine.axes.iter().enumerate() {
            let mut metadata = BTreeMap::from([
                ("index".to_owned(), index.to_string()),
                ("name".to_owned(), description.name.clone()),
                ("group".to_owned(), description.group.to_string()),
                ("unit".to_owned(), description.unit.symbol().to_owned()),
                ("plans_own_profile".to_owned(), description.plans_own_profile.to_string()),
                ("counts_per_unit".to_owned(), description.counts_per_unit.to_string()),
                ("velocity_limit".to_owned(), description.limits.velocity.to_string()),
                ("acceleration_limit".to_owned(), description.limits.acceleration.to_string()),
                ("jerk_limit".to_owned(), description.limits.jerk.to_string()),
            ]);
            metadata.extend(description.family.clone().map(|family| ("drive".to_owned(), family)));
            if !description.own_errors.is_empty() {
                let text = own_errors::write(&description.own_errors);
                metadata.insert(own_errors::OWN_ERRORS.to_owned(), text);
            }
            metadata.extend(description.bus.clone().map(|bus| ("bus".to_owned(), bus)));
            axis_channels.push(channel(axis, &format!("/axis/{}", description.name), &metadata)?);
        }
        // A file that cannot be written fails here already, and the file can be opened while it grows.
        writer.flush()?;
        Ok(Self {
            label: opened.label,
            writer,
            encoder: CdrEncoder::default(),
            wall_clock,
            cycle_channel,
            event_channel,
            group_channels,
            axis_channels,
            bus_channels: Vec::new(),
            journal_channel: None,
            last_time: 0,
            was_stopping: false,
        })
    }

    /// Adds the channel of the journal, and the files that the configuration was made of.
    pub fn begin_journal(&mut self, sources: &ConfigSources) -> McapResult<()> {
        let metadata = BTreeMap::from([("journal".to_owned(), JOURNAL_VERSION.to_owned())]);
        self.journal_channel = Some(self.writer.add_channel(0, "/journal", "takt-journal", &metadata)?);
        if let Some(main) = &sources.main {
            let overrides = sources
                .interfaces
                .iter()
                .map(|(bus, interface)| (format!("{INTERFACE_OF}{bus}"), interface.clone()));
            let main = (MAIN_FILE.to_owned(), main.display().to_string());
            self.metadata(CONFIGURATION, overrides.chain([main]).collect())?;
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            let files = sources.files.iter().map(|(path, bytes)| (path.display().to_string(), text(bytes)));
            self.metadata(CONFIGURATION_FILES, files.collect())?;
        }
        self.writer.flush()
    }

    /// Writes a block of the journal.
    pub fn journal(&mut self, block: &[u8]) -> McapResult<()> {
        let Some(channel_id) = self.journal_channel else { return Ok(()) };
        let time = self.last_time;
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, block)
    }

    /// Adds the channels of the buses.
    pub fn add_buses(&mut self, machine: &Machine) -> McapResult<()> {
        let mut schema = |message: &MessageType| {
            self.writer.add_schema(message.name, "ros2msg", message.definition.as_bytes())
        };
        let (frame, bus) = (schema(&messages::FRAME)?, schema(&messages::BUS)?);
        for (index, description) in machine.buses.iter().enumerate() {
            let metadata = BTreeMap::from([
                ("index".to_owned(), index.to_string()),
                ("name".to_owned(), description.name.clone()),
                ("interface".to_owned(), description.interface.clone()),
            ]);
            let mut channel = |schema, kind: &str| {
                self.writer.add_channel(schema, &format!("/{kind}/{}", description.name), "cdr", &metadata)
            };
            self.bus_channels
                .push(BusChannels { health: channel(bus, "bus")?, frames: channel(frame, "frames")? });
        }
        Ok(())
    }

    /// Writes a metadata record.
    pub fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> McapResult<()> {
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    /// Writes a frame, if its bus is recorded.
    pub fn frame(&mut self, OnBus { bus, what }: &OnBus<TracedFrame>) -> McapResult<()> {
        let Some(channels) = self.bus_channels.get(*bus) else { return Ok(()) };
        messages::encode_frame(what, &mut self.encoder);
        self.write(channels.frames, 0, what.at_ns)
    }

    /// Writes the health of a bus, if the bus is recorded.
    pub fn health(&mut self, OnBus { bus, what }: &OnBus<TracedHealth>) -> McapResult<()> {
        let Some(channels) = self.bus_channels.get(*bus) else { return Ok(()) };
        messages::encode_bus(what, &mut self.encoder);
        self.write(channels.health, 0, what.at_ns)
    }

    /// Writes everything to the file that is still in memory.
    pub fn flush(&mut self) -> McapResult<()> {
        self.writer.flush()
    }

    /// Writes a cycle.
    pub fn cycle(&mut self, record: &CycleRecord) -> McapResult<()> {
        let (slot, start_ns) = (record.timing.slot, record.timing.slot_start_ns);
        messages::encode_cycle(record, &mut self.encoder);
        self.write(self.cycle_channel, slot, start_ns)?;
        for (group, channel) in record.groups().iter().zip(self.group_channels.clone()) {
            messages::encode_group(slot, group, &mut self.encoder);
            self.write(channel, slot, start_ns)?;
        }
        for (index, axis) in record.axes().iter().enumerate() {
            let Some(&channel) = self.axis_channels.get(index) else { break };
            messages::encode_axis(slot, axis, &mut self.encoder);
            self.write(channel, slot, start_ns)?;
        }
        // The cycles before a stop show its cause: they are in the file from now on.
        let is_stopping = record.groups().iter().any(|group| group.phase == Phase::Stopping);
        let was_stopping = std::mem::replace(&mut self.was_stopping, is_stopping);
        let begins_to_stop = is_stopping && !was_stopping;
        if begins_to_stop { self.writer.flush() } else { Ok(()) }
    }

    /// Writes an event and its text.
    pub fn event(&mut self, event: &Event, text: &str) -> McapResult<()> {
        messages::encode_event(event, text, &mut self.encoder);
        self.write(self.event_channel, event.slot, event.at_ns)
    }

    fn write(&mut self, channel_id: u16, slot: u64, at_ns: u64) -> McapResult<()> {
        let time = self.wall_clock.unix_ns(at_ns);
        self.last_time = time;
        let header = MessageHeader { channel_id, sequence: slot as u32, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, self.encoder.bytes())
    }

    /// Writes the end of a recording with a journal, of which so many entries were lost.
    pub fn finish_with(mut self, lost: Option<u64>) -> McapResult<()> {
        if let Some(lost) = lost {
            self.metadata(JOURNAL_END, BTreeMap::from([("lost".to_owned(), lost.to_string())]))?;
        }
        self.finish()
    }

    /// Writes the end: statistics and index.
    pub fn finish(mut self) -> McapResult<()> {
        self.writer.finish()?;
        self.writer.into_inner().into_inner().flush().map_err(McapError::Io)
    }
}

fn describe(machine: &Machine) -> BTreeMap<String, String> {
    let list = |names: &mut dyn Iterator<Item = &String>| names.cloned().collect::<Vec<_>>().join("\n");
    let described = [
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("machine".to_owned(), machine.name.clone()),
        ("cycle_ns".to_owned(), machine.cycle_ns.to_string()),
        ("axes".to_owned(), list(&mut machine.axes.iter().map(|axis| &axis.name))),
        ("buses".to_owned(), list(&mut machine.buses.iter().map(|bus| &bus.name))),
    ];
    let groups = (!machine.groups.is_empty()).then(|| ("groups".to_owned(), machine.groups.join("\n")));
    described.into_iter().chain(groups).collect()
}
