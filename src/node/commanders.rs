//! Who may command: an allow-list of nodes, by their names in the graph of ROS, or of ids.
//!
//! DDS without DDS Security knows a sender by the id that is in its packets, and ROS 2 tells on `ros_discovery_info` which node has which ids. Both are
//! what the sender says of itself: a list keeps out a node that was started by mistake or forgotten, not one that lies. Exclusive ownership
//! (OWNERSHIP of DDS) would not do: ROS 2 has no such policy, so its publishers offer none, and RustDDS announces it and does not act on it.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use ros2_client::Gid;
use serde::Deserialize;

use super::health::Health;
use super::realtime::monotonic_ns;
use super::tap::Tap;
use super::transport::{Participant, participant_of};
use govtwin_bag::cdr;

/// Shortest beginning of an id: with Fast DDS it is vendor and host.
const SHORTEST_ID: usize = 4;

/// Most participants and senders that are remembered; beyond them the list is made anew.
const MOST_REMEMBERED: usize = 1024;

/// Most changes of the graph that are taken in at a time.
const MOST_CHANGES: usize = 1024;

/// Whom a list names.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Named {
    /// A node by its full name.
    Node(String),
    /// Nodes by the beginning of their full names: `/bench/*`.
    Nodes(String),
    /// Endpoints by the beginning of their ids.
    Id(Vec<u8>),
}

/// Those who may command; nobody else may. Without names there is no list, and everybody may.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct AllowList(Vec<Named>);

impl AllowList {
    /// Reads names and ids between commas.
    ///
    /// # Errors
    /// In words, on an entry that is neither.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let entries = text.split(',').map(str::trim).filter(|entry| !entry.is_empty());
        entries.map(Named::parse).collect::<Result<_, _>>().map(Self)
    }

    /// Whether there is no list.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn has_node(&self, name: &str) -> bool {
        self.0.iter().any(|named| match named {
            Named::Node(node) => node == name,
            Named::Nodes(beginning) => name.starts_with(beginning.as_str()),
            Named::Id(_) => false,
        })
    }

    fn has_id(&self, id: &[u8; 16]) -> bool {
        self.0.iter().any(|named| matches!(named, Named::Id(beginning) if id.starts_with(beginning)))
    }
}

impl Named {
    fn parse(entry: &str) -> Result<Self, String> {
        let (name, is_beginning) = entry.strip_suffix('*').map_or((entry, false), |name| (name, true));
        let is_name = |name: &str| name.bytes().all(|letter| letter.is_ascii_alphanumeric() || b"_/".contains(&letter));
        if name.starts_with('/') && is_name(name) && (is_beginning || name.len() > 1) {
            return Ok(if is_beginning { Self::Nodes(name.to_owned()) } else { Self::Node(name.to_owned()) });
        }
        let bytes: Option<Vec<u8>> = entry.split('.').map(|byte| u8::from_str_radix(byte, 16).ok()).collect();
        bytes.filter(|id| (SHORTEST_ID..=16).contains(&id.len())).map(Self::Id).ok_or_else(|| {
            format!(
                "`commanders`: `{entry}` is neither the full name of a node (`/governor`, or `/bench/*` for several) nor an id, or the first \
                 {SHORTEST_ID} bytes of one and more, as `ros2 topic info -v` shows it (`01.0f.…`)"
            )
        })
    }
}

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`: the nodes of a participant.
#[derive(Deserialize)]
struct Participation {
    id: Gid,
    nodes: Vec<ListedNode>,
}

/// `rmw_dds_common/msg/NodeEntitiesInfo`: a node with its endpoints.
#[derive(Deserialize)]
struct ListedNode {
    namespace: String,
    name: String,
    _readers: Vec<Gid>,
    writers: Vec<Gid>,
}

impl ListedNode {
    fn full_name(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }
}

/// The list, and what the graph of ROS tells of senders.
pub(crate) struct Commanders<'a> {
    list: AllowList,
    graph: Option<&'a Tap>,
    health: &'a Health,
    nodes: RefCell<BTreeMap<Participant, Vec<ListedNode>>>,
    decided: RefCell<BTreeMap<Gid, bool>>,
    told: RefCell<BTreeSet<Gid>>,
}

impl<'a> Commanders<'a> {
    /// The list, with the topic on which nodes say what they have.
    pub(super) fn new(list: AllowList, graph: Option<&'a Tap>, health: &'a Health) -> Self {
        let (nodes, decided, told) = Default::default();
        Self { list, graph, health, nodes, decided, told }
    }

    /// Whether this sender may command; one that tries and may not is noted in the node's health.
    pub(crate) fn may(&self, sender: Gid) -> bool {
        if self.list.is_empty() {
            return true;
        }
        self.take_in();
        let mut decided = self.decided.borrow_mut();
        if decided.len() >= MOST_REMEMBERED {
            decided.clear();
        }
        let may = *decided.entry(sender).or_insert_with(|| self.decide(sender));
        if !may {
            self.health.note_ignored(monotonic_ns());
        }
        may
    }

    /// Who a sender is, in words, the first time that it is asked for.
    pub(super) fn introduce(&self, sender: Gid) -> Option<String> {
        let mut told = self.told.borrow_mut();
        (told.len() < MOST_REMEMBERED && told.insert(sender)).then(|| {
            let (nodes, id) = (self.nodes_of(sender), hexadecimal(sender));
            if nodes.is_empty() {
                format!("a program outside the graph of ROS ({id})")
            } else {
                format!("{} ({id})", nodes.join(", "))
            }
        })
    }

    /// Takes in what changed in the graph.
    fn take_in(&self) {
        let changes = std::iter::from_fn(|| self.graph?.take()).take(MOST_CHANGES);
        for change in changes.filter_map(Result::ok) {
            if let Ok(Participation { id, nodes }) = cdr::decode(&change.data) {
                self.enter(participant_of(id), nodes);
            }
        }
    }

    fn enter(&self, participant: Participant, listed: Vec<ListedNode>) {
        let mut nodes = self.nodes.borrow_mut();
        if nodes.len() >= MOST_REMEMBERED && !nodes.contains_key(&participant) {
            nodes.clear();
        }
        nodes.insert(participant, listed);
        self.decided.borrow_mut().clear();
    }

    fn decide(&self, sender: Gid) -> bool {
        let nodes = self.nodes_of(sender);
        self.list.has_id(&sender.to_bytes16())
            || (!nodes.is_empty() && nodes.iter().all(|node| self.list.has_node(node)))
    }

    /// The node that lists a sender, or else all nodes of its participant.
    fn nodes_of(&self, sender: Gid) -> Vec<String> {
        let nodes = self.nodes.borrow();
        let Some(all) = nodes.get(&participant_of(sender)) else { return Vec::new() };
        let own = all.iter().find(|node| node.writers.contains(&sender));
        own.map_or_else(|| all.iter().map(ListedNode::full_name).collect(), |own| vec![own.full_name()])
    }
}

/// An id as ROS 2 shows it.
pub(super) fn hexadecimal(id: Gid) -> String {
    id.to_bytes16().map(|byte| format!("{byte:02x}")).join(".")
}

#[cfg(test)]
mod tests {
    use ros2_client::Gid;

    use super::{AllowList, Commanders, ListedNode, participant_of};
    use crate::health::Health;

    fn id(participant: u8, entity: u8) -> Gid {
        let mut bytes = [participant; 16];
        bytes[12..].copy_from_slice(&[0, 0, entity, 3]);
        Gid::from(bytes)
    }

    fn node(namespace: &str, name: &str, writers: &[Gid]) -> ListedNode {
        ListedNode {
            namespace: namespace.to_owned(),
            name: name.to_owned(),
            _readers: Vec::new(),
            writers: writers.to_vec(),
        }
    }

    #[test]
    fn those_on_the_list_may_command_and_nobody_else() {
        let health = Health::default();
        let everybody = Commanders::new(AllowList::parse(" , ").unwrap(), None, &health);
        assert!(everybody.may(id(9, 1)));
        let list = AllowList::parse("/governor, /bench/*, 07.07.07.07.07").unwrap();
        let commanders = Commanders::new(list, None, &health);
        assert_eq!(health.flags().node, 0);
        assert!(!commanders.may(id(1, 1)), "not in the graph yet");
        assert_eq!(health.flags().node, Health::IGNORED);
        let enter = |participant, nodes| commanders.enter(participant_of(id(participant, 0)), nodes);
        enter(1, vec![node("/", "governor", &[id(1, 1)]), node("/", "other", &[id(1, 2)])]);
        enter(2, vec![node("/bench", "valve", &[])]);
        let may = [id(1, 1), id(1, 2), id(1, 3), id(2, 5), id(3, 1), id(7, 1)].map(|sender| commanders.may(sender));
        assert_eq!(may, [true, false, false, true, false, true]);
        // The same process without the other node: what it does not list is the governor's too.
        enter(1, vec![node("/", "governor", &[id(1, 1)])]);
        assert!(commanders.may(id(1, 3)));
        assert!(commanders.introduce(id(2, 5)).unwrap().starts_with("/bench/valve (02.02."));
        assert_eq!(commanders.introduce(id(2, 5)), None, "once");
        assert!(commanders.introduce(id(3, 1)).unwrap().contains("outside the graph"));
    }

    #[test]
    fn an_entry_that_names_nobody_is_refused_with_what_is_expected() {
        for entry in ["governor", "/", "/a-b", "01.0f", "01.0f.00.zz", "/gov*ernor"] {
            let reason = AllowList::parse(entry).unwrap_err();
            assert!(reason.contains(&format!("`{entry}`")) && reason.contains("/governor"), "{reason}");
        }
        assert!(AllowList::parse("/*").is_ok_and(|list| list.has_node("/any/one")));
    }

    #[test]
    fn strangers_take_bounded_room() {
        let health = Health::default();
        let commanders = Commanders::new(AllowList::parse("/governor").unwrap(), None, &health);
        for number in 0..5000_u32 {
            let mut bytes = [0; 16];
            bytes[..4].copy_from_slice(&number.to_le_bytes());
            commanders.enter(participant_of(Gid::from(bytes)), Vec::new());
            assert!(!commanders.may(Gid::from(bytes)));
            let _ = commanders.introduce(Gid::from(bytes));
        }
        assert!(commanders.nodes.borrow().len() <= super::MOST_REMEMBERED);
        assert!(commanders.told.borrow().len() <= super::MOST_REMEMBERED);
    }
}
