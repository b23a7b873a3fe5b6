//! The MCAP recording: `/cycle` with the times, `/group/<name>` for each group, `/axis/<name>` for each axis, `/events`, and
//! `/bus/<name>` with the health and the load of each bus. Without configured groups the only one is `/group/all`. A black box
//! also has `/frames/<name>`. For programs of ROS 2 there are `/joint_states` with all axes, a hundred times a second, and
//! `/rosout` with the events in words. The time of a message is a time of day: that of its event or frame, or the start of
//! its slot.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Seek, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, McapResult};
use takt_rt::{CycleRecord, CycleTiming, Event, EventKind, NANOSECONDS_PER_SECOND, Nanoseconds, Phase};

use super::cdr::CdrEncoder;
use super::compression;
use super::destination::Opened;
use super::history::OnBus;
use super::machine::{BusDescription, Machine};
use super::messages::{self, MessageType};
use super::missed_slots::MissedSlotsSoFar;
use super::own_errors;
use super::wall_clock::WallClock;
use super::words;
use crate::config::ConfigSources;
use crate::link::trace::{TracedFrame, TracedHealth};

/// A chunk is written to the file as a whole, and a crash of the program loses at most that. It holds a third of a second of
/// six axes at 1 ms, as counted before compression.
const CHUNK_BYTES: u64 = 256 * 1024;
/// The longest time in a chunk.
const CHUNK_NS: Nanoseconds = NANOSECONDS_PER_SECOND;
/// What a message takes beside its data: the opcode, the length, and the header.
const MESSAGE_BYTES: u64 = 1 + 8 + 22;
/// What the index at the end of the file has of a chunk, and of each channel in it.
const CHUNK_INDEX_BYTES: u64 = 100;
const CHANNEL_INDEX_BYTES: u64 = 10;
/// The period of the joint states: programs that draw a robot want no more.
const JOINT_STATES_NS: Nanoseconds = 10_000_000;

/// The metadata record of one file of several, with the name of the first one and its own number.
pub const PART: &str = "part";
/// Its key for the first file.
pub const FIRST_PART: &str = "first";
/// Its key for the number of this file.
pub const PART_NUMBER: &str = "number";

/// The name of the metadata record that describes the machine.
pub const METADATA: &str = "takt";

/// The version of the format of the journal, in the metadata of its channel.
pub const JOURNAL_VERSION: &str = "4";
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

/// The key of the quality of service in the metadata of a channel (rosbag2_storage_mcap).
const OFFERED_QOS: &str = "offered_qos_profiles";
/// Keep the last 10, reliable, volatile, automatic liveliness, no deadlines: the numbers of `rmw/types.h`, which every version of rosbag2 reads.
const QOS_PROFILES: &str = "- history: 1
  depth: 10
  reliability: 1
  durability: 2
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";

/// The name of the group of all axes, where no groups are configured.
const ONLY_GROUP: &str = "all";

/// A recording that is being written.
pub struct Recording {
    /// Its name in messages.
    pub label: String,
    writer: mcap::Writer<NoSeek<BufWriter<Counted>>>,
    /// The bytes of the file so far.
    written: Arc<AtomicU64>,
    /// The chunks that were written, and what the one that is open holds.
    chunks: u64,
    open_bytes: u64,
    opened_ns: Option<Nanoseconds>,
    /// The bytes before the first cycle; the end of the file repeats a part of them.
    begun_bytes: u64,
    encoder: CdrEncoder,
    wall_clock: WallClock,
    cycle_channel: u16,
    event_channel: u16,
    group_channels: Vec<u16>,
    axis_channels: Vec<u16>,
    joint_channel: u16,
    log_channel: u16,
    /// The machine and its axes, by their names.
    machine_name: String,
    axis_names: Vec<String>,
    group_names: Vec<String>,
    next_joint_states_ns: Nanoseconds,
    health_channels: Vec<u16>,
    frame_channels: Vec<u16>,
    journal_channel: Option<u16>,
    /// The time of the last message.
    last_time: u64,
    /// True if a group was stopping in the last cycle.
    was_stopping: bool,
    missed_slots: MissedSlotsSoFar,
}

/// Counts the bytes that pass.
struct Counted {
    to: Box<dyn Write + Send>,
    written: Arc<AtomicU64>,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.to.write(bytes)?;
        self.written.fetch_add(taken as u64, Ordering::Relaxed);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

impl Recording {
    /// Writes the beginning: schemas, channels, and the description of the machine.
    pub fn begin(
        opened: Opened,
        machine: &Machine,
        wall_clock: WallClock,
        is_compressed: bool,
    ) -> McapResult<Self> {
        let written = Arc::new(AtomicU64::new(0));
        let counted = Counted { to: opened.writer, written: Arc::clone(&written) };
        let mut writer = compression::of_recordings(is_compressed)
            .profile("ros2")
            .library(concat!("takt ", env!("CARGO_PKG_VERSION")))
            // `end_chunk` decides.
            .chunk_size(None)
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::new(counted)))?;
        writer.write_metadata(&Metadata { name: METADATA.to_owned(), metadata: describe(machine) })?;
        let mut schema =
            |message: &MessageType| writer.add_schema(message.name, "ros2msg", message.definition.as_bytes());
        let (cycle, axis, event) =
            (schema(&messages::CYCLE)?, schema(&messages::AXIS)?, schema(&messages::EVENT)?);
        let (group, bus) = (schema(&messages::GROUP)?, schema(&messages::BUS)?);
        let (joint_state, log) = (schema(&messages::JOINT_STATE)?, schema(&messages::LOG)?);
        let mut channel = |schema, topic: &str, metadata: &BTreeMap<_, _>| {
            add_channel(&mut writer, schema, topic, metadata)
        };
        let cycle_channel = channel(cycle, "/cycle", &BTreeMap::new())?;
        let event_channel = channel(event, "/events", &BTreeMap::new())?;
        let joint_channel = channel(joint_state, "/joint_states", &BTreeMap::new())?;
        let log_channel = channel(log, "/rosout", &BTreeMap::new())?;
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
        let mut health_channels = Vec::new();
        for (index, description) in machine.buses.iter().enumerate() {
            let topic = format!("/bus/{}", description.name);
            health_channels.push(channel(bus, &topic, &describe_bus(index, description))?);
        }
        // A file that cannot be written fails here already, and the file can be opened while it grows.
        writer.flush()?;
        Ok(Self {
            label: opened.label,
            writer,
            begun_bytes: written.load(Ordering::Relaxed),
            written,
            chunks: 0,
            open_bytes: 0,
            opened_ns: None,
            encoder: CdrEncoder::default(),
            wall_clock,
            cycle_channel,
            event_channel,
            group_channels,
            axis_channels,
            joint_channel,
            log_channel,
            machine_name: machine.name.clone(),
            axis_names: machine.axes.iter().map(|axis| axis.name.clone()).collect(),
            group_names: machine.groups.clone(),
            next_joint_states_ns: 0,
            health_channels,
            frame_channels: Vec::new(),
            journal_channel: None,
            last_time: 0,
            was_stopping: false,
            missed_slots: MissedSlotsSoFar::default(),
        })
    }

    /// Goes on where another file of the same run has ended.
    pub fn continue_after(&mut self, before: &Self) {
        self.last_time = before.last_time;
        self.was_stopping = before.was_stopping;
        self.missed_slots = before.missed_slots;
        self.next_joint_states_ns = before.next_joint_states_ns;
    }

    /// Adds the channel of the journal, and the files that the configuration was made of.
    pub fn begin_journal(&mut self, sources: &ConfigSources) -> McapResult<()> {
        let metadata = BTreeMap::from([("journal".to_owned(), JOURNAL_VERSION.to_owned())]);
        let MessageType { name, definition, .. } = messages::JOURNAL;
        let schema = self.writer.add_schema(name, "ros2msg", definition.as_bytes())?;
        self.journal_channel = Some(add_channel(&mut self.writer, schema, "/journal", &metadata)?);
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
        self.end_chunk()?;
        self.begun_bytes = self.written.load(Ordering::Relaxed);
        Ok(())
    }

    /// Writes a block of the journal.
    pub fn journal(&mut self, block: &[u8]) -> McapResult<()> {
        let Some(channel_id) = self.journal_channel else { return Ok(()) };
        let time = self.last_time;
        messages::encode_journal(block, &mut self.encoder);
        self.write_encoded(channel_id, 0, time)
    }

    /// Adds the channels of the frames.
    pub fn add_frames(&mut self, machine: &Machine) -> McapResult<()> {
        let MessageType { name, definition, .. } = messages::FRAME;
        let frame = self.writer.add_schema(name, "ros2msg", definition.as_bytes())?;
        for (index, description) in machine.buses.iter().enumerate() {
            let topic = format!("/frames/{}", description.name);
            let metadata = describe_bus(index, description);
            self.frame_channels.push(add_channel(&mut self.writer, frame, &topic, &metadata)?);
        }
        Ok(())
    }

    /// Writes a metadata record.
    pub fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> McapResult<()> {
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    /// Writes a frame, if its bus is recorded.
    pub fn frame(&mut self, OnBus { bus, what }: &OnBus<TracedFrame>) -> McapResult<()> {
        let Some(&channel) = self.frame_channels.get(*bus) else { return Ok(()) };
        messages::encode_frame(what, &mut self.encoder);
        self.write(channel, 0, what.at_ns)
    }

    /// Writes the health of a bus, if the bus is recorded.
    pub fn health(&mut self, OnBus { bus, what }: &OnBus<TracedHealth>) -> McapResult<()> {
        let Some(&channel) = self.health_channels.get(*bus) else { return Ok(()) };
        messages::encode_bus(what, &mut self.encoder);
        self.write(channel, 0, what.at_ns)
    }

    /// Writes everything to the file that is still in memory.
    pub fn end_chunk(&mut self) -> McapResult<()> {
        self.chunks += u64::from(self.open_bytes > 0);
        self.open_bytes = 0;
        self.opened_ns = None;
        self.writer.flush()
    }

    /// Returns `true` if the file could exceed this size by another chunk, with the index at its end. A file has at least one chunk.
    pub fn is_full(&self, size_limit_bytes: u64) -> bool {
        let channels = 4 + self.group_channels.len() + self.axis_channels.len() + self.health_channels.len();
        let index = CHUNK_INDEX_BYTES + CHANNEL_INDEX_BYTES * (channels + 1) as u64;
        // What cannot be compressed, and its index.
        let next_chunk = 2 * CHUNK_BYTES;
        let at_end = (self.chunks + 1) * index + self.begun_bytes + next_chunk;
        self.open_bytes == 0
            && self.chunks > 0
            && self.written.load(Ordering::Relaxed).saturating_add(at_end) > size_limit_bytes
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
        self.joint_states(record)?;
        // The cycles before a stop show its cause: they are in the file from now on.
        let is_stopping = record.groups().iter().any(|group| group.phase == Phase::Stopping);
        let was_stopping = std::mem::replace(&mut self.was_stopping, is_stopping);
        let begins_to_stop = is_stopping && !was_stopping;
        if begins_to_stop || self.is_chunk_full(start_ns) { self.end_chunk() } else { Ok(()) }
    }

    /// A chunk ends between two cycles.
    fn is_chunk_full(&mut self, now_ns: Nanoseconds) -> bool {
        let opened_ns = *self.opened_ns.get_or_insert(now_ns);
        self.open_bytes >= CHUNK_BYTES || now_ns.saturating_sub(opened_ns) >= CHUNK_NS
    }

    /// Writes the axes whose position is known. A drive that has not reported yet has the statusword 0.
    fn joint_states(&mut self, record: &CycleRecord) -> McapResult<()> {
        let CycleTiming { slot, slot_start_ns, .. } = record.timing;
        if slot_start_ns < self.next_joint_states_ns {
            return Ok(());
        }
        let named = self.axis_names.iter().map(String::as_str).zip(record.axes());
        let known: Vec<_> = named.filter(|(_, axis)| axis.statusword != 0).collect();
        if known.is_empty() {
            return Ok(());
        }
        self.next_joint_states_ns = slot_start_ns + JOINT_STATES_NS;
        let time = self.wall_clock.unix_ns(slot_start_ns);
        messages::encode_joint_state(time, &known, &mut self.encoder);
        self.write(self.joint_channel, slot, slot_start_ns)
    }

    /// Writes an event and its text.
    pub fn event(&mut self, event: &Event, text: &str) -> McapResult<()> {
        messages::encode_event(event, text, &mut self.encoder);
        self.write(self.event_channel, event.slot, event.at_ns)?;
        let Some(told) = self.missed_slots.told(*event) else { return Ok(()) };
        let so_far = match told.kind {
            EventKind::MissedSlots { count } => Some(words::missed_slots(count).to_string()),
            _ => None,
        };
        let text = so_far.as_deref().unwrap_or(text);
        let group = event.group.and_then(|group| self.group_names.get(usize::from(group)));
        let name = group.unwrap_or(&self.machine_name);
        let time = self.wall_clock.unix_ns(event.at_ns);
        messages::encode_log(time, &event.kind, name, text, &mut self.encoder);
        self.write(self.log_channel, event.slot, event.at_ns)
    }

    fn write(&mut self, channel_id: u16, slot: u64, at_ns: u64) -> McapResult<()> {
        let time = self.wall_clock.unix_ns(at_ns);
        self.last_time = time;
        self.write_encoded(channel_id, slot as u32, time)
    }

    /// Writes the message of the encoder.
    fn write_encoded(&mut self, channel_id: u16, sequence: u32, time: u64) -> McapResult<()> {
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, self.encoder.bytes())?;
        self.open_bytes += MESSAGE_BYTES + self.encoder.bytes().len() as u64;
        Ok(())
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

/// Adds a channel of CDR messages. rosbag2 expects the quality of service that each topic was offered with.
fn add_channel<W: Write + Seek>(
    writer: &mut mcap::Writer<W>,
    schema: u16,
    topic: &str,
    metadata: &BTreeMap<String, String>,
) -> McapResult<u16> {
    let mut metadata = metadata.clone();
    metadata.insert(OFFERED_QOS.to_owned(), QOS_PROFILES.to_owned());
    writer.add_channel(schema, topic, "cdr", &metadata)
}

fn describe_bus(index: usize, description: &BusDescription) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("index".to_owned(), index.to_string()),
        ("name".to_owned(), description.name.clone()),
        ("interface".to_owned(), description.interface.clone()),
    ])
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
