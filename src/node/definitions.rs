//! Definitions of the types that others publish: those of this program, of files, or asked of whoever publishes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use ros2_client::{Client, ServiceMapping};

use super::bus::Bus;
use super::offer::{Describer, Offer};
use super::realtime::Until;
use super::services::CYCLONE;
use super::transport::Participant;
use govtwin_bag::TopicInfo;
use govtwin_bag::msg::definition::{DefinitionError, closure_with, schema_with, text_of};
use govtwin_bag::msg::type_hash::{hash_of, texts_of};
use govtwin_bag::msg::upkeep::{GetTypeDescription, TypeRequest, TypeResponse};
use govtwin_files::read_text;

/// A longer file is no definition of a message, bytes.
const LARGEST_FILE_BYTES: u64 = 1 << 20;

/// An answer is waited for so long; a request that finds nobody is sent again meanwhile.
const PATIENCE: Duration = Duration::from_secs(4);

/// Requests are sent so far apart.
const AGAIN: Duration = Duration::from_millis(700);

/// Services that are asked for one type at most.
const MOST_ASKED: usize = 8;

/// A type and the hash that its publisher announces, empty where it does not.
type Wanted = (String, String);

/// The definition of a type.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct KnownDefinition {
    /// The `ros2msg` schema; empty where nobody knows one.
    pub(super) schema: String,
    /// The hash of the type as it is published; empty where neither publisher nor schema says.
    pub(super) hash: String,
}

impl KnownDefinition {
    /// A topic of this type, as bags tell of it.
    pub(super) fn topic(self, name: &str, type_name: &str, offered_qos_profiles: String) -> TopicInfo {
        TopicInfo {
            name: name.to_owned(),
            type_name: type_name.to_owned(),
            encoding: "cdr".to_owned(),
            schema_encoding: if self.schema.is_empty() { String::new() } else { "ros2msg".to_owned() },
            schema: self.schema.into_bytes().into(),
            offered_qos_profiles,
            type_hash: self.hash,
            ..TopicInfo::default()
        }
    }
}

/// Where definitions come from, and what was found.
pub(super) struct Definitions {
    folders: Vec<PathBuf>,
    known: BTreeMap<Wanted, KnownDefinition>,
    asked: BTreeMap<Wanted, Inquiry>,
}

/// A question that is under way.
struct Inquiry {
    clients: Vec<Client<TypeRequest, TypeResponse>>,
    until: Until,
    again: Until,
}

impl Definitions {
    /// From folders that hold `package/msg/Type.msg` (also below `share`), besides those of ROS in `AMENT_PREFIX_PATH`.
    pub(super) fn new(folders: &[PathBuf]) -> Self {
        let ament = std::env::var_os("AMENT_PREFIX_PATH").unwrap_or_default();
        let folders = folders.iter().cloned().chain(std::env::split_paths(&ament)).collect();
        Self { folders, known: BTreeMap::new(), asked: BTreeMap::new() }
    }

    /// The definition of a type as it is published; `None` while somebody is still asked. `process` is that of the publisher.
    pub(super) fn get(&mut self, offer: &Offer, bus: &mut Bus) -> Option<KnownDefinition> {
        let Offer { type_name, type_hash: hash, .. } = offer;
        let wanted = (type_name.clone(), hash.clone());
        if let Some(known) = self.known.get(&wanted) {
            return Some(known.clone());
        }
        let found = self.carried_or_filed(&wanted).or_else(|| self.answered(&wanted));
        let found = match found {
            Some(schema) => KnownDefinition { hash: or_own(hash, type_name, &schema), schema },
            None if self.ask(&wanted, offer.process, bus) => return None,
            None => KnownDefinition { schema: String::new(), hash: hash.clone() },
        };
        self.asked.remove(&wanted);
        self.known.insert(wanted, found.clone());
        Some(found)
    }

    /// Looks for a definition anew the next time, where nobody knew it.
    pub(super) fn forget(&mut self, type_name: &str, hash: &str) {
        self.known.remove(&(type_name.to_owned(), hash.to_owned()));
    }

    fn carried_or_filed(&self, (type_name, hash): &Wanted) -> Option<String> {
        let carried = |name: &str| text_of(name).map(str::to_owned);
        let filed = |name: &str| self.filed(name).map_or_else(|| carried(name), Ok);
        fitting(type_name, hash, &carried).or_else(|| fitting(type_name, hash, &filed))
    }

    /// The text of a type in one of the folders.
    fn filed(&self, type_name: &str) -> Option<String> {
        let mut parts = type_name.split('/');
        let (package, kind, name) = (parts.next()?, parts.next()?, parts.next()?);
        // They come from the bus.
        let is_name = |part: &&str| part.bytes().all(|letter| letter.is_ascii_alphanumeric() || letter == b'_');
        if ![package, kind, name].iter().all(is_name) {
            return None;
        }
        let relative = Path::new(package).join(kind).join(format!("{name}.msg"));
        let places =
            self.folders.iter().flat_map(|folder| [folder.join(&relative), folder.join("share").join(&relative)]);
        places.into_iter().find_map(|place| read_text(&place, LARGEST_FILE_BYTES).ok())
    }

    /// What was answered, where it fits.
    fn answered(&self, wanted: &Wanted) -> Option<String> {
        let (type_name, hash) = wanted;
        let clients = &self.asked.get(wanted)?.clients;
        let answers = clients.iter().filter_map(|client| client.receive_response().ok().flatten());
        answers.filter(|(_, answer)| answer.successful).find_map(|(_, answer)| {
            let texts: BTreeMap<&str, &str> = answer
                .type_sources
                .iter()
                .filter(|source| source.encoding == "msg")
                .map(|source| (source.type_name.as_str(), source.raw_file_contents.as_str()))
                .collect();
            let written = texts_of(&answer.type_description);
            let text = |name: &str| {
                let text = texts.get(name).map(|text| (*text).to_owned()).or_else(|| written.get(name).cloned());
                text.ok_or_else(|| DefinitionError::Unknown(name.to_owned()))
            };
            fitting(type_name, hash, &text)
        })
    }

    /// Asks whoever may know, as long as there is hope; whether there is.
    fn ask(&mut self, wanted: &Wanted, process: Participant, bus: &mut Bus) -> bool {
        if !self.asked.contains_key(wanted) {
            let mut describers: Vec<Describer> = bus.describers();
            // The publisher's own process first.
            describers.sort_by_key(|describer| describer.process != process);
            let mut seen = BTreeSet::new();
            describers.retain(|describer| seen.insert(describer.service.clone()));
            let open = |describer: Describer| {
                let mapping = match describer.process {
                    [a, b, ..] if [a, b] == CYCLONE => ServiceMapping::Cyclone,
                    _ => ServiceMapping::Enhanced,
                };
                bus.call::<GetTypeDescription>(mapping, &describer.service).ok()
            };
            let clients: Vec<_> = describers.into_iter().take(MOST_ASKED).filter_map(open).collect();
            if clients.is_empty() {
                return false;
            }
            let inquiry = Inquiry { clients, until: Until::after(Some(PATIENCE)), again: Until::after(Some(AGAIN)) };
            self.asked.insert(wanted.clone(), inquiry);
            // They are found first; the request goes out with the next look.
            return true;
        }
        let Some(inquiry) = self.asked.get_mut(wanted) else { return false };
        if inquiry.again.comes_round(AGAIN) {
            let (type_name, type_hash) = wanted.clone();
            let request = TypeRequest { type_name, type_hash, include_type_sources: true };
            for client in &inquiry.clients {
                // Who cannot be reached is asked again.
                let _ = client.send_request(request.clone());
            }
        }
        !inquiry.until.is_past()
    }
}

/// The schema of a type from texts by name, where it has the wanted hash or none is wanted.
fn fitting(type_name: &str, hash: &str, text: &dyn Fn(&str) -> Result<String, DefinitionError>) -> Option<String> {
    let closure = closure_with(type_name, text).ok()?;
    let fits = hash.is_empty() || hash_of(&closure) == hash;
    if fits { schema_with(type_name, text).ok() } else { None }
}

/// The announced hash, or that of the schema.
fn or_own(hash: &str, type_name: &str, schema: &str) -> String {
    let own = || govtwin_bag::msg::definition::parse_schema(type_name, schema).map(|closure| hash_of(&closure));
    if hash.is_empty() { own().unwrap_or_default() } else { hash.to_owned() }
}
