//! What a frame means.

use std::str::FromStr;

use takt_wire::canopen::object::ObjectAddress;

/// What a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Service {
    /// A command of the NMT master.
    Nmt,
    /// SYNC.
    Sync,
    /// The time of day.
    Time,
    /// An emergency message.
    Emergency,
    /// Heartbeat or boot-up.
    Heartbeat,
    /// The heartbeat of the controller.
    ControllerHeartbeat,
    /// A request of node guarding.
    NodeGuarding,
    /// From an SDO client to a server.
    SdoRequest,
    /// From an SDO server to its client.
    SdoResponse,
    /// An RPDO of a node, by its number where that is known.
    Rpdo(Option<u16>),
    /// A TPDO of a node, by its number where that is known.
    Tpdo(Option<u16>),
    /// From the LSS master.
    LssRequest,
    /// From an LSS slave.
    LssResponse,
    /// A command to a drive that is no CANopen node.
    Command,
    /// A reply of a drive that is no CANopen node.
    Reply,
    /// A remote frame.
    Remote,
    /// Nobody knows.
    Unknown,
}

impl Service {
    /// Its name.
    pub fn name(self) -> String {
        match self {
            Self::Nmt => "NMT".to_owned(),
            Self::Sync => "SYNC".to_owned(),
            Self::Time => "TIME".to_owned(),
            Self::Emergency => "EMCY".to_owned(),
            Self::Heartbeat | Self::ControllerHeartbeat => "heartbeat".to_owned(),
            Self::NodeGuarding => "node guarding".to_owned(),
            Self::SdoRequest => "SDO request".to_owned(),
            Self::SdoResponse => "SDO response".to_owned(),
            Self::Rpdo(number) => pdo("RPDO", number),
            Self::Tpdo(number) => pdo("TPDO", number),
            Self::LssRequest => "LSS request".to_owned(),
            Self::LssResponse => "LSS response".to_owned(),
            Self::Command => "command".to_owned(),
            Self::Reply => "reply".to_owned(),
            Self::Remote => "remote frame".to_owned(),
            Self::Unknown => "unknown".to_owned(),
        }
    }

    /// Its kind.
    pub const fn kind(self) -> ServiceKind {
        match self {
            Self::Nmt => ServiceKind::Nmt,
            Self::Sync => ServiceKind::Sync,
            Self::Time => ServiceKind::Time,
            Self::Emergency => ServiceKind::Emergency,
            Self::Heartbeat | Self::ControllerHeartbeat | Self::NodeGuarding => ServiceKind::Heartbeat,
            Self::SdoRequest | Self::SdoResponse => ServiceKind::Sdo,
            Self::Rpdo(_) | Self::Tpdo(_) => ServiceKind::Pdo,
            Self::LssRequest | Self::LssResponse => ServiceKind::Lss,
            Self::Command | Self::Reply => ServiceKind::Drive,
            Self::Remote | Self::Unknown => ServiceKind::Other,
        }
    }

    /// Returns `true` if the frame goes to the drives, as far as its protocol tells.
    pub const fn is_to_drives(self) -> Option<bool> {
        match self {
            Self::Nmt
            | Self::Sync
            | Self::Time
            | Self::ControllerHeartbeat
            | Self::NodeGuarding
            | Self::SdoRequest
            | Self::Rpdo(_)
            | Self::LssRequest
            | Self::Command => Some(true),
            Self::Emergency
            | Self::Heartbeat
            | Self::SdoResponse
            | Self::Tpdo(_)
            | Self::LssResponse
            | Self::Reply => Some(false),
            Self::Remote | Self::Unknown => None,
        }
    }
}

fn pdo(word: &str, number: Option<u16>) -> String {
    number.map_or_else(|| word.to_owned(), |number| format!("{word}{number}"))
}

/// A kind of service.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ServiceKind {
    /// Commands of the NMT master.
    Nmt,
    /// SYNC.
    Sync,
    /// The time of day.
    Time,
    /// Emergency messages.
    Emergency,
    /// Heartbeat, boot-up, node guarding.
    Heartbeat,
    /// Service data.
    Sdo,
    /// Process data.
    Pdo,
    /// Layer settings.
    Lss,
    /// Commands and replies of drives that are no CANopen nodes.
    Drive,
    /// Everything else.
    Other,
}

impl ServiceKind {
    /// The kinds with their words.
    pub const WORDS: [(&'static str, Self); 10] = [
        ("nmt", Self::Nmt),
        ("sync", Self::Sync),
        ("time", Self::Time),
        ("emcy", Self::Emergency),
        ("heartbeat", Self::Heartbeat),
        ("sdo", Self::Sdo),
        ("pdo", Self::Pdo),
        ("lss", Self::Lss),
        ("drive", Self::Drive),
        ("other", Self::Other),
    ];

    /// Its word.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, kind)| *kind == self).map_or("other", |(word, _)| word)
    }
}

impl FromStr for ServiceKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::WORDS.iter().find(|(word, _)| *word == text);
        known.map(|(_, kind)| *kind).ok_or_else(|| {
            let words: Vec<&str> = Self::WORDS.iter().map(|(word, _)| *word).collect();
            format!("the kinds are {}", words.join(", "))
        })
    }
}

/// A value in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedValue {
    /// Its name.
    pub name: String,
    /// The object, in a frame of CANopen.
    pub object: Option<ObjectAddress>,
    /// The number on the wire, where it is a whole one.
    pub raw: Option<i64>,
    /// In SI units at the joint, where it has a unit.
    pub value: Option<f64>,
    /// In words.
    pub text: String,
}

/// What a frame means.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// What it is for.
    pub service: Service,
    /// The node (motor) that sends or receives it, where one does.
    pub node: Option<u8>,
    /// The axes that it concerns, by their numbers in the configuration.
    pub axes: Vec<usize>,
    /// Who is concerned: the name of an axis, `node 3`; empty where nobody in particular is.
    pub who: String,
    /// In words, without the service and those who are concerned.
    pub words: String,
    /// The values of process data.
    pub values: Vec<DecodedValue>,
    /// True if the frame shows a drive with torque, or one without; `None` where it shows neither.
    pub shows_torque: Option<bool>,
}

impl Decoded {
    /// A frame of a service that concerns nobody in particular.
    pub fn of(service: Service, words: impl Into<String>) -> Self {
        Self {
            service,
            node: None,
            axes: vec![],
            who: String::new(),
            words: words.into(),
            values: vec![],
            shows_torque: None,
        }
    }

    /// Service, who is concerned, and words, in one line.
    pub fn line(&self) -> String {
        let parts = [self.service.name(), self.who.clone()];
        let head = parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
        if self.words.is_empty() { head } else { format!("{head}: {}", self.words) }
    }
}
