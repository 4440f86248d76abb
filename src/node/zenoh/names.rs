//! What `rmw_zenoh` calls things: the keys that messages go by, the tokens by which nodes find each other, the bytes beside
//! each message. Pure.

use xxhash_rust::xxh3::xxh3_128;

use crate::msg::topic::{Named, Qos};
use crate::node::heard::PublisherId;
use crate::node::topics::ros_type;
use crate::node::transport::Source;

/// What the keys of tokens begin with.
const TOKENS: &str = "@ros2_lv";

/// Stands for any hash of a type: what is wrong with a message of another definition is found when it is read.
const ANY_HASH: &str = "*";

/// Letters of a token's key that are looked at: more than any name of ROS has.
const MOST_LETTERS: usize = 2048;

/// Hashes of the types that the node speaks, as ROS computes them; `tests/ros/test_zenoh.py` holds them against its own.
const HASHES: &str = include_str!("type_hashes.txt");

/// In place of a hash, where the distribution has none.
const NO_HASH: &str = "TypeHashNotSupported";

/// What a token speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Publisher,
    Subscription,
    Service,
}

impl Kind {
    const fn code(self) -> &'static str {
        match self {
            Self::Publisher => "MP",
            Self::Subscription => "MS",
            Self::Service => "SS",
        }
    }
}

impl Qos {
    /// The part of it that a token tells. Empty is what is ROS's default.
    fn token(self) -> String {
        let reliability = if self.reliable { "" } else { "2" };
        let durability = if self.latched { "1" } else { "" };
        format!("{reliability}:{durability}:,{}:,:,:,,", self.depth)
    }
}

// What a fully qualified name is in keys.
impl Named<'_> {
    /// The key that is sent to.
    pub(super) fn key(self, domain: u16) -> String {
        self.key_of(domain, hash(self.type_name))
    }

    /// The key that is listened to.
    pub(super) fn key_of_any(self, domain: u16) -> String {
        self.key_of(domain, ANY_HASH)
    }

    fn key_of(self, domain: u16, hash: &str) -> String {
        format!("{domain}/{}/{}/{hash}", self.name.trim_start_matches('/'), dds_type(self.type_name))
    }
}

/// The node in its tokens.
#[derive(Clone, Debug)]
pub(super) struct NodeToken {
    pub(super) domain: u16,
    /// The session's.
    pub(super) id: String,
    pub(super) namespace: String,
    pub(super) name: String,
}

impl NodeToken {
    /// The node's own key.
    pub(super) fn key(&self) -> String {
        self.begin(0, "NN")
    }

    /// The key of one of its ends; numbers begin with 1, the node's is 0.
    pub(super) fn key_of(&self, number: u64, kind: Kind, named: Named<'_>, qos: Qos) -> String {
        let (name, hash) = (mangled(named.name), hash(named.type_name));
        let (start, dds_type) = (self.begin(number, kind.code()), dds_type(named.type_name));
        format!("{start}/{name}/{dds_type}/{hash}/{}", qos.token())
    }

    /// Whether a token is of this node, or of one of its ends.
    pub(super) fn is_own(&self, token: &str) -> bool {
        token.split('/').nth(2) == Some(&self.id)
    }

    /// Whether a token is that of another node of this name.
    pub(super) fn has_namesake(&self, token: &str) -> bool {
        let parts: Vec<_> = token.split('/').take(10).collect();
        let [TOKENS, _, id, _, _, "NN", _, namespace, name] = parts[..] else { return false };
        id != self.id && namespace == mangled(&self.namespace) && name == mangled(&self.name)
    }

    fn begin(&self, number: u64, code: &str) -> String {
        let Self { domain, id, namespace, name } = self;
        // The third part is the enclave, for which there are no keys.
        format!("{TOKENS}/{domain}/{id}/0/{number}/{code}/%/{}/{}", mangled(namespace), mangled(name))
    }
}

/// What matches all tokens of a domain.
pub(super) fn tokens(domain: u16) -> String {
    format!("{TOKENS}/{domain}/**")
}

/// What names a publisher in its messages, from its token's key.
pub(super) fn publisher_id(token: &str) -> PublisherId {
    xxh3_128(token.as_bytes()).to_le_bytes()
}

/// The publisher that a token speaks of; nothing where it speaks of something else, or is none.
pub(super) fn source(token: &str) -> Option<Source> {
    if token.len() > MOST_LETTERS {
        return None;
    }
    let parts: Vec<_> = token.split('/').collect();
    let [TOKENS, _, _, _, _, "MP", _, _, _, topic, type_name, ..] = parts[..] else { return None };
    Some(Source { topic: topic.replace('%', "/"), type_name: ros_type(type_name) })
}

/// The hash of a type in a key.
fn hash(type_name: &str) -> &'static str {
    let mut lines = HASHES.lines().filter_map(|line| line.split_once(' '));
    match lines.find(|(name, _)| *name == type_name) {
        Some((_, hash)) if cfg!(feature = "jazzy") => hash,
        _ => NO_HASH,
    }
}

fn mangled(name: &str) -> String {
    if name.is_empty() { "%".to_owned() } else { name.replace('/', "%") }
}

/// `sensor_msgs/msg/PointCloud2` as keys have it.
fn dds_type(type_name: &str) -> String {
    match type_name.rsplit_once('/') {
        Some((path, name)) => format!("{}::dds_::{name}_", path.replace('/', "::")),
        None => type_name.to_owned(),
    }
}

/// What goes beside a message: its number, the time, and who sent it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment {
    pub(super) number: i64,
    /// Since the epoch (ns).
    pub(super) stamp: i64,
    pub(super) publisher: PublisherId,
}

impl Attachment {
    /// Two integers, the lower byte first, and 16 bytes after their count.
    pub(super) fn bytes(self) -> Vec<u8> {
        let count = self.publisher.len() as u8;
        [&self.number.to_le_bytes()[..], &self.stamp.to_le_bytes(), &[count], &self.publisher].concat()
    }

    /// Nothing where the bytes are none.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let (number, rest) = bytes.split_first_chunk()?;
        let (stamp, rest) = rest.split_first_chunk()?;
        let (&count, publisher) = rest.split_first()?;
        let publisher = PublisherId::try_from(publisher).ok().filter(|id| usize::from(count) == id.len())?;
        Some(Self { number: i64::from_le_bytes(*number), stamp: i64::from_le_bytes(*stamp), publisher })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::{Environment, Setup};
    use crate::msg::sent;
    use crate::node::check_names;
    use crate::node::parameters::{self, ParameterService};

    const LATCHED: Qos = Qos::latched(1);

    fn node(namespace: &str) -> NodeToken {
        let (id, name) = ("aac3178e".to_owned(), "cfodi".to_owned());
        NodeToken { domain: 7, id, namespace: namespace.to_owned(), name }
    }

    #[test]
    fn keys_are_those_of_rmw_zenoh() {
        let named = Named { name: "/robot1/chatter", type_name: "std_srvs/srv/Trigger" };
        let hash = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f";
        assert_eq!(named.key(2), format!("2/robot1/chatter/std_srvs::srv::dds_::Trigger_/{hash}"));
        assert_eq!(named.key_of_any(0), "0/robot1/chatter/std_srvs::srv::dds_::Trigger_/*");
        assert_eq!(node("/").key(), "@ros2_lv/7/aac3178e/0/0/NN/%/%/cfodi");
        let key = node("/robot").key_of(3, Kind::Service, named, LATCHED);
        let start = "@ros2_lv/7/aac3178e/0/3/SS/%/%robot/cfodi/%robot1%chatter/std_srvs::srv::dds_::Trigger_";
        assert_eq!(key, format!("{start}/{hash}/:1:,1:,:,:,,"));
        assert_eq!(Qos::best_effort(10).token(), "2::,10:,:,:,,");
    }

    #[test]
    fn a_publisher_is_read_from_its_own_token_and_nothing_from_others() {
        let named = Named { name: "/a/points", type_name: "sensor_msgs/msg/PointCloud2" };
        let found = source(&node("/a").key_of(1, Kind::Publisher, named, LATCHED)).unwrap();
        assert_eq!(
            (found.topic.as_str(), found.type_name.as_str()),
            ("/a/points", "sensor_msgs/msg/PointCloud2")
        );
        assert_eq!(source(&node("/a").key_of(1, Kind::Subscription, named, LATCHED)), None);
        for token in ["", "@ros2_lv/7", "@ros2_lv/7/a/0/1/MP/%/%/n/%t", &node("/").key(), &"/".repeat(9000)] {
            assert_eq!(source(token), None, "{token}");
        }
    }

    #[test]
    fn every_type_that_the_node_sends_or_serves_has_its_hash() {
        let setup = Setup::parse(&[], &Environment::default(), "cfodi").unwrap().0;
        assert!(check_names(&setup).is_ok());
        let services = ParameterService::ALL.map(|service| service.named().type_name);
        let topics = sent::TOPICS.into_iter().chain([parameters::EVENTS]);
        let types = topics.map(|topic| topic.type_name);
        for type_name in services.into_iter().chain(types) {
            assert!(hash(type_name).starts_with("RIHS01_"), "{type_name}");
        }
        assert_eq!(hash("a/msg/B"), NO_HASH);
    }

    #[test]
    fn an_attachment_is_read_as_it_was_written_and_no_other_bytes_are_one() {
        let attachment = Attachment { number: -7, stamp: i64::MAX, publisher: publisher_id("a") };
        let bytes = attachment.bytes();
        assert_eq!((bytes.len(), bytes[16]), (33, 16));
        assert_eq!(Attachment::read(&bytes), Some(attachment));
        assert!((0..33).all(|length| Attachment::read(&bytes[..length]).is_none()));
        assert_eq!(Attachment::read(&[&bytes[..], &[0]].concat()), None);
        let mut other_count = bytes;
        other_count[16] = 255;
        assert_eq!(Attachment::read(&other_count), None);
    }
}
