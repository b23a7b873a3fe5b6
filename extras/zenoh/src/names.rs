//! The names of ROS 2 in zenoh: key expressions of topics, liveliness tokens of nodes, publishers and subscriptions.

use xxhash_rust::xxh3::xxh3_128;

/// The identifier of a publisher or a subscription in the graph.
pub type Gid = [u8; 16];

/// A type of messages, with its hash by REP 2016.
pub struct MessageType {
    /// Its name in DDS.
    name: &'static str,
    hash: &'static str,
}

/// `sensor_msgs/msg/JointState`
pub const JOINT_STATE: MessageType = MessageType {
    name: "sensor_msgs::msg::dds_::JointState_",
    hash: "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
};
/// `trajectory_msgs/msg/JointTrajectory`
pub const JOINT_TRAJECTORY: MessageType = MessageType {
    name: "trajectory_msgs::msg::dds_::JointTrajectory_",
    hash: "RIHS01_179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
};
/// What stands for the hash of each type in Humble, which has no hashes.
const NO_HASH: &str = "TypeHashNotSupported";

/// Reliable (1), volatile (2), the last (1) 10 messages are kept; deadline, lifespan and lease are without end.
const QUALITY_OF_SERVICE: &str = "1:2:1,10:,:,:,,";

/// The kinds of what is in the graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A publisher.
    Publisher,
    /// A subscription.
    Subscription,
}

/// A node of ROS 2.
pub struct Node {
    /// `ROS_DOMAIN_ID`
    pub domain: u32,
    /// The identifier of the zenoh session, in hexadecimal digits.
    pub session: String,
    /// Its namespace, which begins with a slash.
    pub namespace: String,
    /// Its name.
    pub name: String,
    /// True if its peers are of Humble.
    pub is_humble: bool,
}

impl Node {
    /// Under which its messages are published.
    pub fn topic(&self, topic: &str, of: &MessageType) -> String {
        format!("{}/{}/{}/{}", self.domain, topic.trim_matches('/'), of.name, self.hash(of))
    }

    /// The liveliness token of the node. Its number among those of the session is 0.
    pub fn token(&self) -> String {
        self.token_of(0, "NN")
    }

    /// The liveliness token of a publisher or a subscription, with its number among what the session has in the graph.
    pub fn endpoint(&self, number: u32, kind: Kind, topic: &str, of: &MessageType) -> String {
        let word = match kind {
            Kind::Publisher => "MP",
            Kind::Subscription => "MS",
        };
        let (topic, hash) = (mangled(topic), self.hash(of));
        format!("{}/{topic}/{}/{hash}/{QUALITY_OF_SERVICE}", self.token_of(number, word), of.name)
    }

    fn token_of(&self, number: u32, kind: &str) -> String {
        let Self { domain, session, namespace, name, .. } = self;
        // The enclave is that of no security: "/".
        format!("@ros2_lv/{domain}/{session}/0/{number}/{kind}/%/{}/{}", mangled(namespace), mangled(name))
    }

    fn hash(&self, of: &MessageType) -> &'static str {
        if self.is_humble { NO_HASH } else { of.hash }
    }
}

/// A name as one part of a key expression, which slashes separate.
fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

/// The identifier of what has this liveliness token: its hash, lower half first.
pub fn gid(token: &str) -> Gid {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

/// Returns `true` if this is a name of a topic from the root: `/arm/joint_states`.
pub fn is_topic(name: &str) -> bool {
    let is_part = |part: &str| {
        part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && part.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
    };
    name.strip_prefix('/').is_some_and(|name| name.split('/').all(is_part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node() -> Node {
        let (session, namespace) = ("aac3178e146ba6f1fc6e6a4085e77f21".to_owned(), "/".to_owned());
        Node { domain: 0, session, namespace, name: "talker".to_owned(), is_humble: false }
    }

    /// The examples in `docs/design.md` of `rmw_zenoh`, with a type and a quality of service that are used here.
    #[test]
    fn tokens_and_topics_are_those_of_the_design_document() {
        let session = "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21";
        assert_eq!(node().token(), format!("{session}/0/0/NN/%/%/talker"));
        let made = node().endpoint(10, Kind::Publisher, "/chatter", &JOINT_STATE);
        let (name, hash) = (JOINT_STATE.name, JOINT_STATE.hash);
        assert_eq!(made, format!("{session}/0/10/MP/%/%/talker/%chatter/{name}/{hash}/1:2:1,10:,:,:,,"));
        assert_eq!(
            node().topic("/arm/joint_states", &JOINT_STATE),
            format!("0/arm/joint_states/{name}/{hash}")
        );
        let humble = Node { is_humble: true, namespace: "/arm".to_owned(), ..node() };
        assert_eq!(humble.token(), format!("{session}/0/0/NN/%/%arm/talker"));
        assert!(humble.topic("/chatter", &JOINT_STATE).ends_with("/TypeHashNotSupported"));
    }

    /// The digest of xxHash 0.8.3: `xxh128sum`, which prints it from its highest byte on.
    #[test]
    fn an_identifier_is_the_hash_of_the_token() {
        let digest = "99aa06d3014798d86001c324468d497f";
        let bytes: Vec<u8> = gid("").into_iter().rev().collect();
        assert_eq!(bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>(), digest);
    }

    #[test]
    fn a_topic_is_named_from_the_root() {
        for right in ["/joint_states", "/arm/joint_states", "/_a/b1"] {
            assert!(is_topic(right), "{right}");
        }
        for wrong in ["joint_states", "/", "", "/a//b", "/a/", "/1a", "/a b", "/a*", "/ä"] {
            assert!(!is_topic(wrong), "{wrong}");
        }
    }
}
