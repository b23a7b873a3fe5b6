//! Makes the items of a recording from its records.

use std::collections::{BTreeMap, HashMap};

use takt_rt::CycleRecord;

use super::RecordedEvent;
use super::printable_name::name;
use super::records::{self, Record};
use crate::family;
use crate::link::trace::TracedHealth;
use crate::telemetry::history::OnBus;
use crate::telemetry::machine::{AxisDescription, SetPointMagnitudes, Unit};
use crate::telemetry::messages::{self, MessageType};
use crate::telemetry::{black_box, own_errors, recording};

/// An item of a recording.
pub(super) enum Item<'a> {
    Machine(BTreeMap<String, String>),
    Incident(BTreeMap<String, String>),
    Cycle {
        record: &'a CycleRecord,
        /// Its time of day.
        log_time_ns: u64,
        /// The axes that the recording has, by their numbers.
        axes: &'a BTreeMap<usize, AxisDescription>,
    },
    Event(RecordedEvent),
    Health(OnBus<TracedHealth>),
}

/// The kind of messages of a channel.
#[derive(Clone, Copy)]
enum Carries {
    Cycles,
    Group(usize),
    Axis(usize),
    Events,
    Health(usize),
}

/// Makes items from records.
#[derive(Default)]
pub(super) struct Decoder {
    pub(super) library: String,
    pub(super) is_of_takt: bool,
    pub(super) other_layout: Option<&'static str>,
    schemas: HashMap<u16, &'static MessageType>,
    channels: HashMap<u16, Carries>,
    pub(super) axes: BTreeMap<usize, AxisDescription>,
    /// The cycle whose axes follow, its time of day, and the number of axes seen so far.
    cycle: Option<(Box<CycleRecord>, u64, usize)>,
    pub(super) malformed: u64,
}

impl Decoder {
    /// Passes on what the record completes.
    pub(super) fn record(&mut self, opcode: u8, body: &[u8], give: &mut impl FnMut(Item<'_>)) {
        match records::parse(opcode, body) {
            None => {}
            Some(Ok(Record::Header { library })) => self.library = library,
            Some(Ok(Record::Schema { id, name, definition })) => self.schema(id, &name, definition),
            Some(Ok(Record::Channel { id, schema, metadata })) => self.channel(id, schema, &metadata),
            Some(Ok(Record::Metadata { name, entries })) if name == recording::METADATA => {
                self.is_of_takt = true;
                give(Item::Machine(entries));
            }
            Some(Ok(Record::Metadata { name, entries })) if name == black_box::METADATA => {
                give(Item::Incident(entries));
            }
            Some(Ok(Record::Metadata { .. })) => {}
            Some(Ok(Record::Message { channel, log_time_ns, data })) => {
                if let Some(carries) = self.channels.get(&channel)
                    && self.message(*carries, log_time_ns, data, give).is_none()
                {
                    self.malformed += 1;
                }
            }
            Some(Err(records::Malformed)) => self.malformed += 1,
        }
    }

    fn schema(&mut self, id: u16, name: &str, definition: &[u8]) {
        let known = messages::READ.iter().find(|message| message.name == name);
        let Some(known) = known else { return };
        if known.can_be_read_as(&String::from_utf8_lossy(definition)) {
            self.schemas.insert(id, known);
        } else {
            self.other_layout = Some(known.name);
        }
    }

    fn channel(&mut self, id: u16, schema: u16, metadata: &BTreeMap<String, String>) {
        let Some(schema) = self.schemas.get(&schema) else { return };
        let text = |key: &str| metadata.get(key).map_or("", String::as_str);
        let number = |key: &str| text(key).parse().unwrap_or(f64::INFINITY);
        let index = text("index").parse::<usize>().ok();
        let carries = match (schema.name, index) {
            (message, _) if message == messages::CYCLE.name => Carries::Cycles,
            (message, _) if message == messages::EVENT.name => Carries::Events,
            (message, Some(index)) if message == messages::GROUP.name => Carries::Group(index),
            (message, Some(index)) if message == messages::AXIS.name => {
                let description = AxisDescription {
                    name: name(text("name")),
                    bus: metadata.get("bus").map(|bus| name(bus)),
                    group: text("group").parse().unwrap_or(0),
                    family: family::named(text("drive")).map(|family| family.word().to_owned()),
                    own_errors: own_errors::read(text(own_errors::OWN_ERRORS), name),
                    unit: if text("unit") == Unit::Metre.symbol() { Unit::Metre } else { Unit::Radian },
                    // Recordings of earlier versions do not have it.
                    plans_own_profile: text("plans_own_profile") == "true",
                    counts_per_unit: number("counts_per_unit"),
                    limits: SetPointMagnitudes {
                        velocity: number("velocity_limit"),
                        acceleration: number("acceleration_limit"),
                        jerk: number("jerk_limit"),
                    },
                };
                self.axes.insert(index, description);
                Carries::Axis(index)
            }
            (message, Some(index)) if message == messages::BUS.name => Carries::Health(index),
            _ => return,
        };
        self.channels.insert(id, carries);
    }

    fn message(
        &mut self,
        carries: Carries,
        log_time_ns: u64,
        data: &[u8],
        give: &mut impl FnMut(Item<'_>),
    ) -> Option<()> {
        match carries {
            Carries::Cycles => {
                let mut record = Box::new(messages::decode_cycle(data)?);
                record.axis_count = u8::try_from(self.axes.len()).ok()?;
                self.finish(give);
                self.cycle = Some((record, log_time_ns, 0));
                if self.axes.is_empty() {
                    self.finish(give);
                }
            }
            Carries::Group(index) => {
                let (slot, group) = messages::decode_group(data)?;
                let (record, ..) = self.cycle.as_mut()?;
                if record.timing.slot == slot {
                    *record.groups.get_mut(index)? = group;
                    record.group_count = record.group_count.max(u8::try_from(index + 1).ok()?);
                }
            }
            Carries::Axis(index) => {
                let (slot, axis) = messages::decode_axis(data)?;
                let (record, _, seen) = self.cycle.as_mut()?;
                if record.timing.slot == slot {
                    *record.axes.get_mut(index)? = axis;
                    *seen += 1;
                }
            }
            Carries::Events => {
                give(Item::Event(messages::decode_event(data)?));
            }
            Carries::Health(bus) => give(Item::Health(OnBus { bus, what: messages::decode_bus(data)? })),
        }
        Some(())
    }

    /// Passes on the last cycle, unless some of its axes are missing.
    pub(super) fn finish(&mut self, give: &mut impl FnMut(Item<'_>)) {
        if let Some((record, log_time_ns, seen)) = self.cycle.take()
            && seen == self.axes.len()
        {
            give(Item::Cycle { record: &record, log_time_ns, axes: &self.axes });
        }
    }
}
