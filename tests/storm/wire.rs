//! What the controller has sent to each drive in a cycle, read from its PDOs.

use takt::config::Config;
use takt::family::bring_up::ProcessData;
use takt_rt::{Frame, MappedObject};

const CONTROLWORD: u16 = 0x6040;
const TARGET_POSITION: u16 = 0x607A;
const TARGET_VELOCITY: u16 = 0x60FF;
const TARGET_TORQUE: u16 = 0x6071;

/// What was sent to a drive in a cycle, in its own units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SentValues {
    pub controlword: Option<u16>,
    pub position: Option<i32>,
    pub velocity: Option<i32>,
    pub torque: Option<i32>,
}

/// A command PDO: whose it is, and where its objects lie.
struct Command {
    bus: usize,
    axis: usize,
    id: u32,
    objects: Vec<(MappedObject, u32)>,
}

/// Reads the process data of every axis.
pub struct Wire {
    commands: Vec<Command>,
    pub values: Vec<SentValues>,
}

impl Wire {
    pub fn new(config: &Config) -> Self {
        let of_axis = |(number, axis): (usize, &takt::config::Axis)| {
            let bus = axis.bus;
            ProcessData::of(axis, config).commands.into_iter().map(move |pdo| {
                let mut shift = 0;
                let objects = pdo.objects.into_iter().map(|object| {
                    let begins = shift;
                    shift += u32::from(object.bits);
                    (object, begins)
                });
                Command { bus, axis: number, id: pdo.id.value(), objects: objects.collect() }
            })
        };
        Self {
            commands: config.axes.iter().enumerate().flat_map(of_axis).collect(),
            values: vec![SentValues::default(); config.axes.len()],
        }
    }

    /// Reads what was sent in a cycle, an entry a bus.
    pub fn read(&mut self, sent: &[Vec<Frame>]) {
        self.values.fill(SentValues::default());
        for (bus, frames) in sent.iter().enumerate() {
            for frame in frames {
                let id = frame.id().value();
                let own = self.commands.iter().find(|command| command.bus == bus && command.id == id);
                if let Some(command) = own.filter(|_| !frame.id().is_extended()) {
                    take(&mut self.values[command.axis], &command.objects, frame.first_word());
                }
            }
        }
    }
}

fn take(values: &mut SentValues, objects: &[(MappedObject, u32)], payload: u64) {
    for (object, shift) in objects {
        let word = payload >> shift;
        match object.index {
            CONTROLWORD => values.controlword = Some(word as u16),
            TARGET_POSITION => values.position = Some(word as i32),
            TARGET_VELOCITY => values.velocity = Some(word as i32),
            TARGET_TORQUE => values.torque = Some((word as i16).into()),
            _ => {}
        }
    }
}
