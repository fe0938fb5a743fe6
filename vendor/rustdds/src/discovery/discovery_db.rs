use std::{
  collections::{BTreeMap, BTreeSet},
  sync::{Arc, RwLock, RwLockReadGuard, RwLockWriteGuard},
  time::Instant,
};

use chrono::Utc;
#[allow(unused_imports)]
use log::{debug, error, info, trace, warn};

use crate::{
  dds::{
    participant::DomainParticipant,
    qos::HasQoSPolicy,
    statusevents::{DomainParticipantStatusEvent, LostReason, StatusChannelSender},
    topic::{Topic, TopicDescription},
  },
  rtps::{
    reader::ReaderIngredients, rtps_reader_proxy::RtpsReaderProxy,
    rtps_writer_proxy::RtpsWriterProxy,
  },
  structure::{
    duration::Duration,
    entity::RTPSEntity,
    guid::{EntityId, GuidPrefix, GUID},
  },
};
use super::{
  sedp_messages::{
    topics_inconsistent, DiscoveredReaderData, DiscoveredTopicData, DiscoveredWriterData,
    ParticipantMessageData, ReaderProxy, SubscriptionBuiltinTopicData, TopicBuiltinTopicData,
    WriterProxy,
  },
  spdp_participant_data::SpdpDiscoveredParticipantData,
};
#[cfg(not(feature = "security"))]
use crate::no_security::EndpointSecurityInfo;
#[cfg(feature = "security")]
use crate::{discovery::secure_discovery::AuthenticationStatus, security::EndpointSecurityInfo};

// If remote participant does not specify lease duration, how long silence
// until we pronounce it dead.
const DEFAULT_PARTICIPANT_LEASE_DURATION: Duration = Duration::from_secs(60);

// How much longer to wait than lease duration before pronouncing lost.
const PARTICIPANT_LEASE_DURATION_TOLERANCE: Duration = Duration::from_secs(0);

// How many timed-out participants are remembered, so that they can be matched
// again at their next announcement. The one lost longest ago is forgotten first.
const MAX_ATTIC_PARTICIPANTS: usize = 128;

// What others may announce. Anybody on the network may announce participants,
// endpoints and topics without end, and each of them costs memory and, as long as
// it is matched, messages. Beyond these bounds what is new is not taken in, and
// what is known stays.
const MAX_PARTICIPANTS: usize = 1024;
// Readers and writers, each.
const MAX_EXTERNAL_ENDPOINTS: usize = 16_384;
const MAX_ENDPOINTS_PER_PARTICIPANT: usize = 2048;
// Pairs of a topic and one who announced it.
const MAX_TOPIC_ENTRIES: usize = 32_768;

// New participants are taken in at this rate, after a burst of so many. Those that
// have to wait announce themselves again, and so many of them are remembered, as
// their next announcement may be the same sample again.
const NEW_PARTICIPANTS_BURST: u32 = 256;
const NEW_PARTICIPANTS_PER_SECOND: u32 = 50;
const MAX_WAITING_PARTICIPANTS: usize = 128;

// An endpoint whose participant is not known is kept for this long, so that the
// participant may be announced after it, and at most so many of them.
const ORPHAN_ENDPOINT_DURATION: std::time::Duration = std::time::Duration::from_secs(60);
const MAX_ORPHAN_ENDPOINTS: usize = 256;

// TODO: Let DiscoveryDB itself become thread-safe and support smaller-scope
// lock
pub(crate) struct DiscoveryDB {
  my_guid: GUID,
  participant_proxies: BTreeMap<GuidPrefix, SpdpDiscoveredParticipantData>,
  participant_last_life_signs: BTreeMap<GuidPrefix, Instant>,

  // Authentication statuses of participants
  #[cfg(feature = "security")]
  authentication_statuses: BTreeMap<GuidPrefix, AuthenticationStatus>,

  // local writer proxies for topics (topic name acts as key)
  local_topic_writers: BTreeMap<GUID, DiscoveredWriterData>,
  // local reader proxies for topics (topic name acts as key)
  local_topic_readers: BTreeMap<GUID, DiscoveredReaderData>,

  // remote readers and writers (via discovery)
  external_topic_readers: BTreeMap<GUID, DiscoveredReaderData>,
  external_topic_writers: BTreeMap<GUID, DiscoveredWriterData>,

  // These are "attic" storages for participants that were lost due to time-out
  // and for their readers and writers. When such a participant is heard again,
  // all of it is restored. The participant itself must be kept too: its periodic
  // announcement may be the same sample again (same SequenceNumber), which the
  // topic cache discards as a duplicate, so Discovery would never see it.
  participants_attic: BTreeMap<GuidPrefix, (Instant, SpdpDiscoveredParticipantData)>,
  external_topic_readers_attic: BTreeMap<GUID, DiscoveredReaderData>,
  external_topic_writers_attic: BTreeMap<GUID, DiscoveredWriterData>,

  // Database of topic updates:
  // Outer level key is topic name
  // Inner key is topic data sender.
  topics: BTreeMap<String, BTreeMap<GUID, (DiscoveredVia, DiscoveredTopicData)>>,

  // The same the other way round: which topics a sender has an entry in. Entries
  // go with their endpoint or participant.
  topics_by_sender: BTreeMap<GUID, BTreeSet<String>>,
  topic_entry_count: usize,

  // New participants that had to wait, and how many may be taken in now.
  waiting_participants: BTreeMap<GuidPrefix, (Instant, SpdpDiscoveredParticipantData)>,
  admissions: AdmissionBudget,

  // External endpoints whose participant is not known, and since when.
  orphan_endpoints: BTreeMap<GUID, Instant>,

  // sender for notifying (potential) waiters in participant.find_topic() call
  topic_updated_sender: std::sync::mpsc::SyncSender<()>,

  participant_status_sender: StatusChannelSender<DomainParticipantStatusEvent>,
}

// How many new participants may be taken in now: a token bucket.
struct AdmissionBudget {
  tokens: f64,
  filled: Instant,
}

impl AdmissionBudget {
  fn new(now: Instant) -> Self {
    Self {
      tokens: f64::from(NEW_PARTICIPANTS_BURST),
      filled: now,
    }
  }

  fn take(&mut self, now: Instant) -> bool {
    let elapsed = now.saturating_duration_since(self.filled).as_secs_f64();
    self.filled = now;
    self.tokens = f64::from(NEW_PARTICIPANTS_BURST)
      .min(self.tokens + elapsed * f64::from(NEW_PARTICIPANTS_PER_SECOND));
    if self.tokens < 1.0 {
      return false;
    }
    self.tokens -= 1.0;
    true
  }
}

// How did we discover this topic
#[derive(PartialEq, Eq, Clone, Copy, Debug)]
pub(crate) enum DiscoveredVia {
  Topic,        // explicitly, via the topic topic (does this actually occur?)
  Publication,  // we discovered there is a writer on this topic
  Subscription, // we discovered a reader on this topic
  SelfDefined,  // not discovered, but defined by the local DomainParticipant
}

fn move_by_guid_prefix<D>(
  guid_prefix: GuidPrefix,
  from: &mut BTreeMap<GUID, D>,
  to: &mut BTreeMap<GUID, D>,
) {
  let to_move: Vec<GUID> = from.range(guid_prefix.range()).map(|(g, _)| *g).collect();
  for guid in to_move {
    from.remove(&guid).map(|d| to.insert(guid, d));
  }
}

fn remove_by_guid_prefix<D>(guid_prefix: GuidPrefix, from: &mut BTreeMap<GUID, D>) {
  let to_remove: Vec<GUID> = from.range(guid_prefix.range()).map(|(g, _)| *g).collect();
  for guid in to_remove {
    from.remove(&guid);
  }
}

pub(crate) fn discovery_db_read(
  discovery_db: &Arc<RwLock<DiscoveryDB>>,
) -> RwLockReadGuard<'_, DiscoveryDB> {
  match discovery_db.read() {
    Ok(db) => db,
    Err(e) => panic!("RustDDS internal bug: DiscoveryDB is poisoned after a prior panic: {e:?}."),
  }
}

pub(crate) fn discovery_db_write(
  discovery_db: &Arc<RwLock<DiscoveryDB>>,
) -> RwLockWriteGuard<'_, DiscoveryDB> {
  match discovery_db.write() {
    Ok(db) => db,
    Err(e) => panic!("RustDDS internal bug: DiscoveryDB is poisoned after a prior panic: {e:?}."),
  }
}

impl DiscoveryDB {
  pub fn new(
    my_guid: GUID,
    topic_updated_sender: std::sync::mpsc::SyncSender<()>,
    participant_status_sender: StatusChannelSender<DomainParticipantStatusEvent>,
  ) -> Self {
    Self {
      my_guid,
      participant_proxies: BTreeMap::new(),
      participant_last_life_signs: BTreeMap::new(),
      #[cfg(feature = "security")]
      authentication_statuses: BTreeMap::new(),
      local_topic_writers: BTreeMap::new(),
      local_topic_readers: BTreeMap::new(),
      external_topic_readers: BTreeMap::new(),
      external_topic_writers: BTreeMap::new(),
      participants_attic: BTreeMap::new(),
      external_topic_readers_attic: BTreeMap::new(),
      external_topic_writers_attic: BTreeMap::new(),
      topics: BTreeMap::new(),
      topics_by_sender: BTreeMap::new(),
      topic_entry_count: 0,
      waiting_participants: BTreeMap::new(),
      admissions: AdmissionBudget::new(Instant::now()),
      orphan_endpoints: BTreeMap::new(),
      topic_updated_sender,
      participant_status_sender,
    }
  }

  fn send_participant_status(&self, event: DomainParticipantStatusEvent) {
    self
      .participant_status_sender
      .try_send(event)
      .unwrap_or_else(|e| error!("Cannot report participant status: {e:?}"));
  }

  // Whether a participant that announces itself may be taken in now. One that is
  // known may, and so may one that is back after its lease had expired.
  // One that may not is remembered, so that its next sign of life asks again.
  pub fn admit_participant(&mut self, data: &SpdpDiscoveredParticipantData) -> bool {
    self.admit_participant_at(data, Instant::now())
  }

  fn admit_participant_at(&mut self, data: &SpdpDiscoveredParticipantData, now: Instant) -> bool {
    let guid_prefix = data.participant_guid.prefix;
    if guid_prefix == self.my_guid.prefix || self.participant_proxies.contains_key(&guid_prefix) {
      return true;
    }
    let is_back = self.participants_attic.contains_key(&guid_prefix);
    if self.participant_proxies.len() < MAX_PARTICIPANTS && (is_back || self.admissions.take(now)) {
      self.waiting_participants.remove(&guid_prefix);
      return true;
    }
    debug!("Participant {guid_prefix:?} has to wait: too many new ones");
    self
      .waiting_participants
      .insert(guid_prefix, (now, data.clone()));
    if self.waiting_participants.len() > MAX_WAITING_PARTICIPANTS {
      let first = self
        .waiting_participants
        .iter()
        .min_by_key(|(_, (t, _))| *t);
      if let Some(prefix) = first.map(|(prefix, _)| *prefix) {
        self.waiting_participants.remove(&prefix);
      }
    }
    false
  }

  // Returns if participant was previously unknown
  pub fn update_participant(&mut self, data: &SpdpDiscoveredParticipantData) -> bool {
    debug!("update_participant: {:?}", data);
    let guid = data.participant_guid;

    // sanity check
    if guid.entity_id != EntityId::PARTICIPANT {
      error!("Discovered participant GUID entity_id is not for participant: {guid:?}");
      // Maybe we should discard the participant here?
      return false;
    }

    // We allow discovery to discover self, since our discovery readers
    // will receive our own announcements via broadcast. If we do not recognize
    // our own participant, there is confusion about unknown writers on the
    // discovery topics.
    //
    // if guid == self.my_guid {
    //   debug!("DiscoveryDB discovered self. Skipping.");
    //   return
    // }

    let mut new_participant = false;
    if !self.participant_proxies.contains_key(&guid.prefix) {
      info!("New remote participant: {:?}", data);
      new_participant = true;
      if guid == self.my_guid {
        info!("Remote participant {guid:?} is myself, but some reflection is good.");
        new_participant = false;
      }

      // This may be a rediscovery: Participant lease time timed out, but then
      // came back, e.g. by network outage. We then restore readers/writers from
      // attic to discovery DB.
      self.participants_attic.remove(&guid.prefix);
      move_by_guid_prefix(
        guid.prefix,
        &mut self.external_topic_readers_attic,
        &mut self.external_topic_readers,
      );
      move_by_guid_prefix(
        guid.prefix,
        &mut self.external_topic_writers_attic,
        &mut self.external_topic_writers,
      );
      // Their topics went when the participant was lost.
      let (readers, writers) = self.external_endpoints_of(guid.prefix);
      for reader in readers {
        self.update_topic_data(
          &DiscoveredTopicData::new(Utc::now(), reader.subscription_topic_data.to_topic_data()),
          reader.reader_proxy.remote_reader_guid,
          DiscoveredVia::Subscription,
        );
      }
      for writer in writers {
        self.update_topic_data(
          &DiscoveredTopicData::new(Utc::now(), writer.publication_topic_data.to_topic_data()),
          writer.writer_proxy.remote_writer_guid,
          DiscoveredVia::Publication,
        );
      }
      // Endpoints that were announced before their participant have one now.
      let adopted: Vec<GUID> = self
        .orphan_endpoints
        .range(guid.prefix.range())
        .map(|(g, _)| *g)
        .collect();
      for endpoint in adopted {
        self.orphan_endpoints.remove(&endpoint);
      }
    }

    // In any case:
    // Update SpdpDiscoveredParticipantData to DB
    self.participant_proxies.insert(guid.prefix, data.clone());
    // Timestamp last life sign fro participant
    self
      .participant_last_life_signs
      .insert(guid.prefix, Instant::now());

    new_participant
  }

  // Returns the data of a participant that had timed out and is heard again. It
  // has to be processed like a newly received announcement.
  pub fn participant_is_alive(
    &mut self,
    guid_prefix: GuidPrefix,
  ) -> Option<SpdpDiscoveredParticipantData> {
    if let Some(ts) = self.participant_last_life_signs.get_mut(&guid_prefix) {
      let now = Instant::now();
      if now.duration_since(*ts) > std::time::Duration::from_secs(1) {
        debug!("Participant alive update for {guid_prefix:?}, but no full update.");
      }
      *ts = now;
      None
    } else if let Some((_, data)) = self.participants_attic.get(&guid_prefix) {
      info!("Participant {guid_prefix:?} is back after its lease had expired.");
      Some(data.clone())
    } else if let Some((_, data)) = self.waiting_participants.remove(&guid_prefix) {
      Some(data)
    } else {
      info!(
        "Participant alive update for unknown {guid_prefix:?}. This is normal, if the message \
         does not repeat."
      );
      None
    }
  }

  // Remote endpoints of a participant, as known by discovery.
  pub fn external_endpoints_of(
    &self,
    guid_prefix: GuidPrefix,
  ) -> (Vec<DiscoveredReaderData>, Vec<DiscoveredWriterData>) {
    let readers = self.external_topic_readers.range(guid_prefix.range());
    let writers = self.external_topic_writers.range(guid_prefix.range());
    (
      readers.map(|(_, reader)| reader.clone()).collect(),
      writers.map(|(_, writer)| writer.clone()).collect(),
    )
  }

  // Forget a timed-out participant for good.
  fn remove_from_attic(&mut self, guid_prefix: GuidPrefix) {
    self.participants_attic.remove(&guid_prefix);
    remove_by_guid_prefix(guid_prefix, &mut self.external_topic_readers_attic);
    remove_by_guid_prefix(guid_prefix, &mut self.external_topic_writers_attic);
  }

  // Which participant to forget first when too many are in the attic: one without
  // endpoints, as anybody announces them, and of those the one lost longest ago.
  fn first_to_forget(&self) -> Option<GuidPrefix> {
    let has_endpoints = |prefix: &GuidPrefix| {
      let (readers, writers) = (
        &self.external_topic_readers_attic,
        &self.external_topic_writers_attic,
      );
      readers.range(prefix.range()).next().is_some()
        || writers.range(prefix.range()).next().is_some()
    };
    self
      .participants_attic
      .iter()
      .min_by_key(|(prefix, (lost, _))| (has_endpoints(prefix), *lost))
      .map(|(prefix, _)| *prefix)
  }

  // active_disposal means that we received a discovery message announcing the
  // disposal of the participant. active_disposal=false means that the
  // participant timed out.
  pub fn remove_participant(&mut self, guid_prefix: GuidPrefix, active_disposal: bool) {
    info!("removing participant {guid_prefix:?}");
    let proxy = self.participant_proxies.remove(&guid_prefix);
    self.participant_last_life_signs.remove(&guid_prefix);
    self.waiting_participants.remove(&guid_prefix);
    self.forget_topics_of_participant(guid_prefix);
    #[cfg(feature = "security")]
    self.authentication_statuses.remove(&guid_prefix);

    if active_disposal {
      remove_by_guid_prefix(guid_prefix, &mut self.external_topic_readers);
      remove_by_guid_prefix(guid_prefix, &mut self.external_topic_writers);
      self.remove_from_attic(guid_prefix);
    } else {
      // move to attic
      if let Some(data) = proxy {
        self
          .participants_attic
          .insert(guid_prefix, (Instant::now(), data));
      }
      move_by_guid_prefix(
        guid_prefix,
        &mut self.external_topic_readers,
        &mut self.external_topic_readers_attic,
      );
      move_by_guid_prefix(
        guid_prefix,
        &mut self.external_topic_writers,
        &mut self.external_topic_writers_attic,
      );
      while self.participants_attic.len() > MAX_ATTIC_PARTICIPANTS
        || self.external_topic_readers_attic.len() > MAX_EXTERNAL_ENDPOINTS
        || self.external_topic_writers_attic.len() > MAX_EXTERNAL_ENDPOINTS
      {
        match self.first_to_forget() {
          Some(prefix) => self.remove_from_attic(prefix),
          None => break,
        }
      }
    }
  }

  pub fn find_participant_proxy(
    &self,
    guid_prefix: GuidPrefix,
  ) -> Option<&SpdpDiscoveredParticipantData> {
    self.participant_proxies.get(&guid_prefix)
  }

  pub fn remove_topic_reader(&mut self, guid: GUID) {
    info!("remove_topic_reader {guid:?}");
    self.external_topic_readers.remove(&guid);
    self.external_topic_readers_attic.remove(&guid);
    self.orphan_endpoints.remove(&guid);
    self.forget_topics_of(guid);
  }

  #[cfg(feature = "security")]
  pub fn get_topic_reader(&self, guid: &GUID) -> Option<&DiscoveredReaderData> {
    self.external_topic_readers.get(guid)
  }

  #[cfg(feature = "security")]
  pub fn get_topic_writer(&self, guid: &GUID) -> Option<&DiscoveredWriterData> {
    self.external_topic_writers.get(guid)
  }

  pub fn remove_topic_writer(&mut self, guid: GUID) {
    self.external_topic_writers.remove(&guid);
    self.external_topic_writers_attic.remove(&guid);
    self.orphan_endpoints.remove(&guid);
    self.forget_topics_of(guid);
  }

  // Removes endpoints whose participant was not announced in time. Returns them.
  pub fn orphan_cleanup(&mut self) -> Vec<GUID> {
    self.orphan_cleanup_at(Instant::now())
  }

  fn orphan_cleanup_at(&mut self, now: Instant) -> Vec<GUID> {
    let is_old = |since: &Instant| now.saturating_duration_since(*since) > ORPHAN_ENDPOINT_DURATION;
    let old: Vec<GUID> = self
      .orphan_endpoints
      .iter()
      .filter(|(_, since)| is_old(since))
      .map(|(guid, _)| *guid)
      .collect();
    for guid in &old {
      // Whoever announced it may have named the other kind.
      self.remove_topic_reader(*guid);
      self.remove_topic_writer(*guid);
    }
    old
  }

  // Whether an endpoint may be taken in. `known` are the readers or the writers.
  fn has_room_for_endpoint<D>(&self, guid: GUID, known: &BTreeMap<GUID, D>) -> bool {
    if known.contains_key(&guid) || guid.prefix == self.my_guid.prefix {
      return true;
    }
    let is_orphan = !self.participant_proxies.contains_key(&guid.prefix);
    let has_room = known.len() < MAX_EXTERNAL_ENDPOINTS
      && known.range(guid.prefix.range()).count() < MAX_ENDPOINTS_PER_PARTICIPANT
      && (!is_orphan || self.orphan_endpoints.len() < MAX_ORPHAN_ENDPOINTS);
    if !has_room {
      debug!("Endpoint {guid:?} is not taken in: too many of them");
    }
    has_room
  }

  // What there is to note when an endpoint was taken in.
  fn note_endpoint(&mut self, guid: GUID, topic_name: &str) {
    let has_participant =
      guid.prefix == self.my_guid.prefix || self.participant_proxies.contains_key(&guid.prefix);
    if !has_participant {
      self
        .orphan_endpoints
        .entry(guid)
        .or_insert_with(Instant::now);
    }
    // An endpoint has one topic.
    let has_other_topic = self
      .topics_by_sender
      .get(&guid)
      .is_some_and(|names| names.iter().any(|name| name != topic_name));
    if has_other_topic {
      self.forget_topics_of(guid);
    }
  }

  // Removes the entries of one sender from the topics.
  fn forget_topics_of(&mut self, sender: GUID) {
    for name in self.topics_by_sender.remove(&sender).unwrap_or_default() {
      if let Some(senders) = self.topics.get_mut(&name) {
        if senders.remove(&sender).is_some() {
          self.topic_entry_count -= 1;
        }
        if senders.is_empty() {
          self.topics.remove(&name);
        }
      }
    }
  }

  fn forget_topics_of_participant(&mut self, guid_prefix: GuidPrefix) {
    let senders: Vec<GUID> = self
      .topics_by_sender
      .range(guid_prefix.range())
      .map(|(sender, _)| *sender)
      .collect();
    for sender in senders {
      self.forget_topics_of(sender);
    }
  }

  // Delete participant proxies, if we have not heard of them within
  // lease_duration
  pub fn participant_cleanup(&mut self) -> Vec<(GuidPrefix, LostReason)> {
    let inow = Instant::now();

    let mut to_remove = Vec::new();
    // TODO: We are not cleaning up liast_life_signs table, but that should not be a
    // problem, except for a slight memory leak.
    for (&guid, sp) in &self.participant_proxies {
      if guid == self.my_guid.prefix {
        continue; // We are alive, even if this process was paused for longer than our lease.
      }
      let lease_duration = sp
        .lease_duration
        .unwrap_or(DEFAULT_PARTICIPANT_LEASE_DURATION);
      // let lease_duration = lease_duration + lease_duration; // double it
      match self.participant_last_life_signs.get(&guid) {
        Some(&last_life) => {
          // keep, if duration not exceeded
          let elapsed = Duration::from_std(inow.duration_since(last_life));
          if elapsed <= lease_duration + PARTICIPANT_LEASE_DURATION_TOLERANCE {
            // No timeout yet, we keep this, so do nothing.
          } else {
            info!(
              "participant cleanup - deleting participant proxy {guid:?}. lease_duration = \
               {lease_duration:?} elapsed = {elapsed:?}"
            );
            to_remove.push((
              guid,
              LostReason::Timeout {
                lease: lease_duration,
                elapsed,
              },
            ));
          }
        }
        None => {
          error!("Participant {guid:?} not in last_life_signs table?");
        }
      } // match
    } // for

    for (guid, _) in &to_remove {
      self.remove_participant(*guid, false); // false = removed due to timeout
    }

    to_remove
  }

  pub fn topic_cleanup(&mut self) {
    // removing topics that have no readers or writers
    let readers = self
      .local_topic_readers
      .values()
      .chain(self.external_topic_readers.values())
      .map(|r| r.subscription_topic_data.topic_name());
    let writers = self
      .local_topic_writers
      .values()
      .chain(self.external_topic_writers.values())
      .map(|w| w.publication_topic_data.topic_name());
    let used: BTreeSet<&String> = readers.chain(writers).collect();
    let dead_topics: Vec<String> = self
      .topics
      .keys()
      .filter(|name| !used.contains(name))
      .cloned()
      .collect();
    for dt in &dead_topics {
      for sender in self.topics.remove(dt).unwrap_or_default().keys() {
        self.topic_entry_count -= 1;
        if let Some(names) = self.topics_by_sender.get_mut(sender) {
          names.remove(dt);
          if names.is_empty() {
            self.topics_by_sender.remove(sender);
          }
        }
      }
    }
  }

  pub fn update_local_topic_writer(&mut self, writer: DiscoveredWriterData) {
    self
      .local_topic_writers
      .insert(writer.writer_proxy.remote_writer_guid, writer);
  }

  pub fn remove_local_topic_writer(&mut self, guid: GUID) {
    self.local_topic_writers.remove(&guid);
  }

  // TODO: This is silly. Returns one of the parameters cloned, or None
  // TODO: Why are we here checking if discovery db already has this? What about
  // reader proxies in writers?

  // Here we make updates when a new Reader is found via Discovery.
  // * It may be one of our own.
  // * We may have seen it before.
  //
  // In case DiscoveredReaderData does not have locators, we try to get
  // them from the remote participant.
  //
  // The topic is updated to the topics table.
  // Returns None, and changes nothing, if there are too many endpoints already.
  pub fn update_subscription(
    &mut self,
    data: &DiscoveredReaderData,
  ) -> Option<DiscoveredReaderData> {
    let guid = data.reader_proxy.remote_reader_guid;
    if !self.has_room_for_endpoint(guid, &self.external_topic_readers) {
      return None;
    }
    self.note_endpoint(guid, &data.subscription_topic_data.topic_name);

    // fill in the default locators from participant, in case DRD did not provide
    // any
    let default_locator_lists = self
      .find_participant_proxy(guid.prefix)
      .map(|pp| {
        debug!("Added participant locators to Reader {guid:?}");
        (
          pp.default_unicast_locators.clone(),
          pp.default_multicast_locators.clone(),
        )
      })
      .unwrap_or_else(|| {
        if guid.prefix != GuidPrefix::UNKNOWN {
          // This is normal, since we might not know about the participant yet.
          debug!(
            "No remote participant known for {:?}\nSearched with {:?} in {:?}",
            data,
            guid.prefix,
            self.participant_proxies.keys()
          );
        }
        (Vec::default(), Vec::default())
      });

    // Build enriched data with participant's default locators filled in, so that
    // later lookups via readers_on_topic() return usable locator information.
    let enriched = DiscoveredReaderData {
      reader_proxy: ReaderProxy::from(RtpsReaderProxy::from_discovered_reader_data(
        data,
        &default_locator_lists.0,
        &default_locator_lists.1,
      )),
      ..data.clone()
    };

    self.external_topic_readers.insert(guid, enriched.clone());
    debug!("External reader: {enriched:?}");

    // Now the topic update:
    let dtd = data.subscription_topic_data.to_topic_data();
    self.update_topic_data(
      &DiscoveredTopicData::new(Utc::now(), dtd),
      guid,
      DiscoveredVia::Subscription,
    );

    // TODO: Lookup the topic in DB, data sent by the same participant that sent the
    // reader update. If there is a DiscoveredVia::Topic record, use QosPolicies
    // from that record and modify by QoS given in the DRD.

    Some(enriched)
  }

  // TODO: This is silly. Returns one of the parameters cloned, or None
  // Returns None, and changes nothing, if there are too many endpoints already.
  pub fn update_publication(
    &mut self,
    data: &DiscoveredWriterData,
  ) -> Option<DiscoveredWriterData> {
    let guid = data.writer_proxy.remote_writer_guid;
    if !self.has_room_for_endpoint(guid, &self.external_topic_writers) {
      return None;
    }
    self.note_endpoint(guid, &data.publication_topic_data.topic_name);

    // fill in the default locators from participant, in case DRD did not provide
    // any
    let default_locator_lists = self
      .find_participant_proxy(guid.prefix)
      .map(|pp| {
        debug!("Added participant locators to Writer {guid:?}");
        (
          pp.default_unicast_locators.clone(),
          pp.default_multicast_locators.clone(),
        )
      })
      .unwrap_or_else(|| {
        if guid.prefix != GuidPrefix::UNKNOWN {
          // This is normal, since we might not know about the participant yet.
          debug!(
            "No remote participant known for {:?}\nSearched with {:?} in {:?}",
            data,
            guid.prefix,
            self.participant_proxies.keys()
          );
        }
        (Vec::default(), Vec::default())
      });

    // Build enriched data with participant's default locators filled in, so that
    // later lookups via writers_on_topic() return usable locator information.
    let enriched = DiscoveredWriterData {
      writer_proxy: WriterProxy::from(RtpsWriterProxy::from_discovered_writer_data(
        data,
        &default_locator_lists.0,
        &default_locator_lists.1,
      )),
      ..data.clone()
    };

    self.external_topic_writers.insert(guid, enriched.clone());
    debug!("External writer: {enriched:?}");

    // Now the topic update:
    let dtd = data.publication_topic_data.to_topic_data();
    self.update_topic_data(
      &DiscoveredTopicData::new(Utc::now(), dtd),
      guid,
      DiscoveredVia::Publication,
    );

    Some(enriched)
  }

  // This is for local participant updating the topic table
  pub fn update_topic_data_p(&mut self, topic: &Topic) {
    let topic_data = DiscoveredTopicData::new(
      Utc::now(),
      TopicBuiltinTopicData::new(
        None,
        topic.name(),
        topic.get_type().name().to_owned(),
        &topic.qos(),
      ),
    );
    self.update_topic_data(&topic_data, self.my_guid, DiscoveredVia::SelfDefined);
  }

  // Topic update sends notifications, in case someone was waiting to find a
  // topic. Return value indicates whether the topic (name) was new to us. This
  // is used to add
  pub fn update_topic_data(
    &mut self,
    dtd: &DiscoveredTopicData,
    updater: GUID,
    discovered_via: DiscoveredVia,
  ) {
    trace!("Update topic data: {:?}", dtd);
    let topic_name = dtd.topic_data.name.clone();
    let mut notify = false;
    let mut inconsistency_event_to_send = None;

    let is_known = self
      .topics_by_sender
      .get(&updater)
      .is_some_and(|names| names.contains(&topic_name));
    if !is_known {
      if self.topic_entry_count >= MAX_TOPIC_ENTRIES && updater.prefix != self.my_guid.prefix {
        debug!("Topic {topic_name:?} of {updater:?} is not taken in: too many of them");
        return;
      }
      self.topic_entry_count += 1;
      self
        .topics_by_sender
        .entry(updater)
        .or_default()
        .insert(topic_name.clone());
    }

    if let Some(t) = self.topics.get_mut(&dtd.topic_data.name) {
      if let Some(old_dtd) = t.get_mut(&updater) {
        // already have it from the same source, do some checking(?) and merging
        if !topics_inconsistent(&dtd.topic_data, &old_dtd.1.topic_data) {
          // If this discovery was from Topic topic and the old was not, then update
          // TODO: Why do we have this logic? Where is the spec? Or ant reason for it?
          // Is it even triggered ever?
          if discovered_via == DiscoveredVia::Topic {
            *old_dtd = (discovered_via, dtd.clone()); // update QoS
            notify = true;
          } else {
            debug!(
              "Topic {:?} update ignored from {:?}. Already have this.",
              topic_name, updater
            );
            // TODO: Here we could warn about QoS changes.
            //
            // It is normal to have different (but compatible) QoS policies
            // for Reader and Writer. We end up here if the same Participant has
            // both Reader and Writer with different QoS. Also
            // different Readers could have different QoS,
            // as could Writers.
          }
        } else {
          error!(
            "Inconsistent topic update from {:?}: type was: {:?} new type: {:?}",
            updater, old_dtd.1.topic_data.type_name, dtd.topic_data.type_name,
          );
          inconsistency_event_to_send = Some(DomainParticipantStatusEvent::InconsistentTopic {
            previous_topic_data: Box::new((&old_dtd.1.topic_data).into()),
            previous_source: updater,
            discovered_topic_data: Box::new((&dtd.topic_data).into()),
            discovery_source: updater,
          });
        }
      } else {
        for (source_guid, (_via, existing_dtd)) in t.iter() {
          if topics_inconsistent(&existing_dtd.topic_data, &dtd.topic_data) {
            inconsistency_event_to_send = Some(DomainParticipantStatusEvent::InconsistentTopic {
              previous_topic_data: Box::new((&existing_dtd.topic_data).into()),
              previous_source: *source_guid,
              discovered_topic_data: Box::new((&dtd.topic_data).into()),
              discovery_source: updater,
            });
            // Note: There are potentially several sources of inconsistency
            // (loop), but we will report only one of them.
          }
        }
        // We have to topic, but not from this participant
        // TODO: Check that there is agreement about topic type name (at least)
        t.insert(updater, (discovered_via, dtd.clone())); // this should return None
        notify = true;
      }
    } else {
      // new topic to us
      let mut b = BTreeMap::new();
      b.insert(updater, (discovered_via, dtd.clone()));
      self.topics.insert(topic_name, b);
      self.send_participant_status(DomainParticipantStatusEvent::TopicDetected {
        name: dtd.topic_data.name.clone(),
        type_name: dtd.topic_data.type_name.clone(),
      });
    };
    if let Some(ev) = inconsistency_event_to_send {
      self.send_participant_status(ev);
    }
    if notify {
      self
        .topic_updated_sender
        .try_send(())
        // It is quite normal for this to fail due to channel full,
        // because usually there is no-one at the other end receiving.
        .unwrap_or_else(|e| trace!("update_topic_data: Notification send failed: {e:?}"));
    }
  }

  // local topic readers

  /// Builds the discovery record of a local reader.
  ///
  /// This locks the participant (`dpi`, for its locators and GUID), so it is
  /// a separate step from [`Self::update_local_topic_reader`]: build the record
  /// first, then take the Discovery DB lock and insert it. The two locks are
  /// not held together. Calling this while holding `discovery_db` could
  /// deadlock against `DomainParticipant::find_topic()`, which holds `dpi`
  /// while reading the DB.
  pub fn local_topic_reader_data(
    domain_participant: &DomainParticipant,
    topic: &Topic,
    reader: &ReaderIngredients,
    sec_info_opt: Option<EndpointSecurityInfo>,
  ) -> DiscoveredReaderData {
    let reader_guid = reader.guid;

    let reader_proxy = RtpsReaderProxy::from_reader(reader, domain_participant);

    let subscription_data = SubscriptionBuiltinTopicData::new(
      reader_guid,
      Some(domain_participant.guid()),
      topic.name(),
      topic.get_type().name().to_string(),
      &reader.qos_policy,
      sec_info_opt,
    );

    // TODO: possibly change content filter to dynamic value
    let content_filter = None;

    DiscoveredReaderData {
      reader_proxy: ReaderProxy::from(reader_proxy),
      subscription_topic_data: subscription_data,
      content_filter,
      user_data: domain_participant.user_data_cdr(&topic.name()),
    }
  }

  /// Inserts a record built by [`Self::local_topic_reader_data`].
  pub fn update_local_topic_reader(&mut self, discovered_reader_data: DiscoveredReaderData) {
    self.local_topic_readers.insert(
      discovered_reader_data.reader_proxy.remote_reader_guid,
      discovered_reader_data,
    );
  }

  pub fn remove_local_topic_reader(&mut self, guid: GUID) {
    self.local_topic_readers.remove(&guid);
  }

  pub fn get_local_topic_reader(&self, guid: GUID) -> Option<&DiscoveredReaderData> {
    self.local_topic_readers.get(&guid)
  }

  pub fn get_local_topic_writer(&self, guid: GUID) -> Option<&DiscoveredWriterData> {
    self.local_topic_writers.get(&guid)
  }

  pub fn get_all_local_topic_readers(&self) -> impl Iterator<Item = &DiscoveredReaderData> {
    self.local_topic_readers.values()
  }

  pub fn get_all_local_topic_writers(&self) -> impl Iterator<Item = &DiscoveredWriterData> {
    self.local_topic_writers.values()
  }

  pub fn get_all_external_topic_readers(&self) -> impl Iterator<Item = &DiscoveredReaderData> {
    self.external_topic_readers.values()
  }

  pub fn get_all_external_topic_writers(&self) -> impl Iterator<Item = &DiscoveredWriterData> {
    self.external_topic_writers.values()
  }

  // Note:
  // If multiple participants announce the same topic, this will
  // return duplicates, one per announcing participant.
  // The duplicates are not necessarily identical, but may have different QoS.
  pub fn all_user_topics(&self) -> impl Iterator<Item = &DiscoveredTopicData> {
    self
      .topics
      .iter()
      .filter(|(s, _)| !s.starts_with("DCPS"))
      .flat_map(|(_, gm)| gm.values().map(|dtd| &dtd.1))
  }

  // a Topic may have multiple definitions, because there may be multiple
  // participants publishing the topic information.
  // At least the QoS details may be different.
  // This just returns the first one found in the database, which is indexed by
  // GUID.
  pub fn get_topic(&self, topic_name: &str) -> Option<&DiscoveredTopicData> {
    self
      .topics
      .get(topic_name)
      .and_then(|m| m.values().next().map(|t| &t.1))
  }

  pub fn writers_on_topic_and_participant(
    &self,
    topic_name: &str,
    participant: GuidPrefix,
  ) -> Vec<DiscoveredWriterData> {
    let on_participant = self
      .external_topic_writers
      .range(participant.range())
      .map(|(_guid, dwd)| dwd);
    debug!("Writers on participant {participant:?} are {on_participant:?}");
    on_participant
      .filter(|dwd| dwd.publication_topic_data.topic_name == topic_name)
      .cloned()
      .collect()
  }

  pub fn readers_on_topic_and_participant(
    &self,
    topic_name: &str,
    participant: GuidPrefix,
  ) -> Vec<DiscoveredReaderData> {
    self
      .external_topic_readers
      .range(participant.range())
      .map(|(_guid, drd)| drd)
      .filter(|drd| drd.subscription_topic_data.topic_name() == topic_name)
      .cloned()
      .collect()
  }

  pub fn writers_on_topic(&self, topic_name: &str) -> Vec<&DiscoveredWriterData> {
    // Get external & local writers on the topic
    let exernal_writers = self
      .external_topic_writers
      .values()
      .filter(|wd| wd.publication_topic_data.topic_name() == topic_name);
    let local_writers = self
      .local_topic_writers
      .values()
      .filter(|wd| wd.publication_topic_data.topic_name() == topic_name);
    // Combine & return
    let combined: Vec<&DiscoveredWriterData> = exernal_writers.chain(local_writers).collect();
    combined
  }

  pub fn readers_on_topic(&self, topic_name: &str) -> Vec<&DiscoveredReaderData> {
    // Get external & local readers on the topic
    let exernal_readers = self
      .external_topic_readers
      .values()
      .filter(|rd| rd.subscription_topic_data.topic_name() == topic_name);
    let local_readers = self
      .local_topic_readers
      .values()
      .filter(|rd| rd.subscription_topic_data.topic_name() == topic_name);
    // Combine & return
    let combined: Vec<&DiscoveredReaderData> = exernal_readers.chain(local_readers).collect();
    combined
  }

  // // TODO: return iterator somehow?
  #[cfg(test)] // used only for testing
  pub fn get_local_topic_readers<T: TopicDescription>(
    &self,
    topic: &T,
  ) -> Vec<&DiscoveredReaderData> {
    let topic_name = topic.name();
    self
      .local_topic_readers
      .iter()
      .filter(|(_, p)| *p.subscription_topic_data.topic_name() == topic_name)
      .map(|(_, p)| p)
      .collect()
  }

  pub fn update_lease_duration(&mut self, data: &ParticipantMessageData) {
    let now = Instant::now();
    let prefix = data.guid;
    // A liveliness message is a sign of life of the participant, too. Cyclone DDS
    // with its older defaults announces itself every 30 s under a lease of 10 s and
    // relies on these messages in between.
    if let Some(last_sign) = self.participant_last_life_signs.get_mut(&prefix) {
      *last_sign = now;
    }
    self
      .external_topic_writers
      .range_mut(prefix.range())
      .for_each(|(_guid, p)| p.last_updated = now);
  }

  #[cfg(feature = "security")]
  pub fn get_authentication_status(&self, guid_prefix: GuidPrefix) -> Option<AuthenticationStatus> {
    self.authentication_statuses.get(&guid_prefix).copied()
  }

  #[cfg(feature = "security")]
  pub fn update_authentication_status(
    &mut self,
    guid_prefix: GuidPrefix,
    status: AuthenticationStatus,
  ) {
    self.authentication_statuses.insert(guid_prefix, status);
  }
}

#[cfg(test)]
mod tests {
  use std::{sync::Mutex, time::Duration as StdDuration};

  use byteorder::LittleEndian;

  use super::*;
  use crate::{
    dds::{
      qos::QosPolicies,
      statusevents::{sync_status_channel, DataReaderStatus},
      topic::TopicKind,
      with_key::simpledatareader::ReaderCommand,
    },
    mio_source,
    polling::{wake_channel, LoopWaker},
    serialization::CDRSerializerAdapter,
    structure::guid::*,
    test::{
      random_data::RandomData,
      test_data::{reader_proxy_data, spdp_participant_data, subscription_builtin_topic_data},
      test_domain::test_domain_id,
    },
  };

  #[test]
  fn discdb_participant_operations() {
    let (discovery_db_event_sender, _discovery_db_event_receiver) =
      std::sync::mpsc::sync_channel::<()>(4);
    let (status_sender, _status_receiver) = sync_status_channel(16).unwrap();

    let mut discoverydb = DiscoveryDB::new(
      GUID::new_participant_guid(),
      discovery_db_event_sender,
      status_sender,
    );
    let mut data = spdp_participant_data().unwrap();
    data.lease_duration = Some(Duration::from(StdDuration::from_secs(1)));

    discoverydb.update_participant(&data);
    assert_eq!(discoverydb.participant_proxies.len(), 1);

    discoverydb.update_participant(&data);
    assert_eq!(discoverydb.participant_proxies.len(), 1);

    std::thread::sleep(StdDuration::from_secs(2));
    discoverydb.participant_cleanup();
    assert!(discoverydb.participant_proxies.is_empty());

    // A life sign brings a timed-out participant back, once.
    let prefix = data.participant_guid.prefix;
    let back = discoverydb.participant_is_alive(prefix).unwrap();
    assert_eq!(back.participant_guid, data.participant_guid);
    assert!(discoverydb.update_participant(&back));
    assert!(discoverydb.participant_is_alive(prefix).is_none());

    // One that was disposed of stays away.
    discoverydb.remove_participant(prefix, false);
    discoverydb.remove_participant(prefix, true);
    assert!(discoverydb.participant_is_alive(prefix).is_none());

    // TODO: more operations tests
  }

  fn empty_db() -> DiscoveryDB {
    let (topic_updated_sender, _) = std::sync::mpsc::sync_channel::<()>(4);
    let (status_sender, _) = sync_status_channel(16).unwrap();
    DiscoveryDB::new(
      GUID::new_participant_guid(),
      topic_updated_sender,
      status_sender,
    )
  }

  // The announcement of a participant that nobody saw before.
  fn stranger(number: u32) -> SpdpDiscoveredParticipantData {
    let mut prefix = *b"stranger....";
    prefix[8..].copy_from_slice(&number.to_be_bytes());
    let mut data = spdp_participant_data().unwrap();
    data.participant_guid = GUID::new(GuidPrefix::new(&prefix), EntityId::PARTICIPANT);
    data
  }

  fn reader_of(prefix: GuidPrefix, number: u32, topic_name: &str) -> DiscoveredReaderData {
    let [_, key @ ..] = number.to_be_bytes();
    let guid = GUID::new(
      prefix,
      EntityId::new(key, EntityKind::READER_NO_KEY_USER_DEFINED),
    );
    DiscoveredReaderData {
      reader_proxy: ReaderProxy::new(guid, false, vec![], vec![]),
      subscription_topic_data: SubscriptionBuiltinTopicData::new(
        guid,
        None,
        topic_name.to_string(),
        "Type".to_string(),
        &QosPolicies::qos_none(),
        None,
      ),
      content_filter: None,
      user_data: Vec::new(),
    }
  }

  fn is_consistent(db: &DiscoveryDB) -> bool {
    let entries: usize = db.topics.values().map(BTreeMap::len).sum();
    let named: usize = db.topics_by_sender.values().map(BTreeSet::len).sum();
    entries == db.topic_entry_count && named == entries
  }

  #[test]
  fn new_participants_are_taken_in_at_a_bounded_rate() {
    let mut db = empty_db();
    let begin = Instant::now();
    let mut try_all = |numbers: std::ops::Range<u32>, now| {
      let mut taken = Vec::new();
      for number in numbers {
        let data = stranger(number);
        if db.admit_participant_at(&data, now) {
          db.update_participant(&data);
          taken.push(number);
        }
      }
      (
        taken,
        db.participant_proxies.len(),
        db.waiting_participants.len(),
      )
    };
    let (taken, known, waiting) = try_all(0..2000, begin);
    assert_eq!(taken, (0..NEW_PARTICIPANTS_BURST).collect::<Vec<_>>());
    assert_eq!((known, waiting), (256, MAX_WAITING_PARTICIPANTS));
    // Those that are known are heard, and some of the others at their next announcement.
    let later = begin + StdDuration::from_secs(1);
    let (taken, known, _) = try_all(250..2000, later);
    assert_eq!(
      taken,
      (250..256 + NEW_PARTICIPANTS_PER_SECOND).collect::<Vec<_>>()
    );
    assert_eq!(known, 306);
    // However long they try, there are not more than so many.
    for seconds in 2..60 {
      try_all(0..2000, begin + StdDuration::from_secs(seconds));
    }
    assert_eq!(db.participant_proxies.len(), MAX_PARTICIPANTS);
    // One that had to wait asks again by its next sign of life.
    let (&waiting, _) = db.waiting_participants.iter().next().unwrap();
    assert!(db.participant_is_alive(waiting).is_some());
    // One that was lost and comes back need not wait.
    let lost = stranger(0);
    db.remove_participant(lost.participant_guid.prefix, false);
    let soon = begin + StdDuration::from_secs(60);
    while db.admissions.take(soon) {}
    let back = db
      .participant_is_alive(lost.participant_guid.prefix)
      .unwrap();
    assert!(db.admit_participant_at(&back, soon));
    assert!(!db.admit_participant_at(&stranger(9999), soon));
  }

  #[test]
  fn topics_and_endpoints_go_with_their_participant() {
    let mut db = empty_db();
    let data = stranger(1);
    let prefix = data.participant_guid.prefix;
    db.update_participant(&data);
    for number in 0..100 {
      db.update_subscription(&reader_of(prefix, number, &format!("topic {number}")));
    }
    assert_eq!((db.topics.len(), is_consistent(&db)), (100, true));
    // Lost, it takes them along; back, it brings them again.
    db.remove_participant(prefix, false);
    assert_eq!((db.topics.len(), is_consistent(&db)), (0, true));
    let back = db.participant_is_alive(prefix).unwrap();
    db.update_participant(&back);
    assert_eq!(
      (db.topics.len(), db.external_topic_readers.len()),
      (100, 100)
    );
    db.remove_topic_reader(reader_of(prefix, 7, "").reader_proxy.remote_reader_guid);
    assert_eq!((db.topics.len(), is_consistent(&db)), (99, true));
    db.remove_participant(prefix, true);
    assert_eq!((db.topics.len(), db.external_topic_readers.len()), (0, 0));
    assert!(is_consistent(&db) && db.topics_by_sender.is_empty());
  }

  #[test]
  fn what_a_participant_announces_is_bounded() {
    let mut db = empty_db();
    let data = stranger(1);
    let prefix = data.participant_guid.prefix;
    db.update_participant(&data);
    // One endpoint under ever new topics has one of them.
    for number in 0..1000 {
      db.update_subscription(&reader_of(prefix, 0, &format!("topic {number}")));
    }
    assert_eq!(db.topics.keys().collect::<Vec<_>>(), ["topic 999"]);
    for number in 0..3000 {
      let taken = db.update_subscription(&reader_of(prefix, number, &format!("topic {number}")));
      assert_eq!(
        taken.is_some(),
        (number as usize) < MAX_ENDPOINTS_PER_PARTICIPANT
      );
    }
    assert_eq!(
      db.external_topic_readers.len(),
      MAX_ENDPOINTS_PER_PARTICIPANT
    );
    assert_eq!(db.topics.len(), MAX_ENDPOINTS_PER_PARTICIPANT);
    // What is known may be announced again.
    assert!(db
      .update_subscription(&reader_of(prefix, 5, "topic 5"))
      .is_some());
    // Topics alone are bounded, too.
    let sender = GUID::new(prefix, EntityId::SEDP_BUILTIN_TOPIC_WRITER);
    let topic_of = |number: usize| {
      let reader = reader_of(prefix, 0, &format!("announced {number}"));
      DiscoveredTopicData::new(Utc::now(), reader.subscription_topic_data.to_topic_data())
    };
    for number in 0..MAX_TOPIC_ENTRIES {
      db.update_topic_data(&topic_of(number), sender, DiscoveredVia::Topic);
    }
    assert_eq!(
      (db.topics.len(), is_consistent(&db)),
      (MAX_TOPIC_ENTRIES, true)
    );
    db.topic_cleanup();
    assert_eq!(
      (db.topics.len(), is_consistent(&db)),
      (MAX_ENDPOINTS_PER_PARTICIPANT, true)
    );
    // Many lost participants with many endpoints are not all remembered.
    for number in 2..12 {
      let data = stranger(number);
      db.update_participant(&data);
      for endpoint in 0..2000 {
        db.update_subscription(&reader_of(data.participant_guid.prefix, endpoint, "same"));
      }
      db.remove_participant(data.participant_guid.prefix, false);
    }
    assert!(db.external_topic_readers_attic.len() <= MAX_EXTERNAL_ENDPOINTS);
  }

  #[test]
  fn endpoints_of_nobody_are_few_and_go() {
    let mut db = empty_db();
    let nobody = GuidPrefix::new(b"nobody......");
    let somebody = stranger(1);
    let prefix = somebody.participant_guid.prefix;
    db.update_subscription(&reader_of(prefix, 1, "early"));
    for number in 0..1000 {
      db.update_subscription(&reader_of(nobody, number, &format!("topic {number}")));
    }
    assert_eq!(db.external_topic_readers.len(), MAX_ORPHAN_ENDPOINTS);
    // A participant may be announced after its endpoints.
    db.update_participant(&somebody);
    assert!(db.orphan_cleanup_at(Instant::now()).is_empty());
    let later = Instant::now() + ORPHAN_ENDPOINT_DURATION + StdDuration::from_secs(1);
    assert_eq!(db.orphan_cleanup_at(later).len(), MAX_ORPHAN_ENDPOINTS - 1);
    assert_eq!(db.topics.keys().collect::<Vec<_>>(), ["early"]);
    assert_eq!(db.external_topic_readers.len(), 1);
    assert!(is_consistent(&db));
  }

  #[test]
  fn discdb_writer_proxies() {
    let (discovery_db_event_sender, _discovery_db_event_receiver) =
      std::sync::mpsc::sync_channel::<()>(4);
    let (status_sender, _status_receiver) = sync_status_channel(16).unwrap();
    let _discoverydb = DiscoveryDB::new(
      GUID::new_participant_guid(),
      discovery_db_event_sender,
      status_sender,
    );
    let topic_name = String::from("some_topic");
    let type_name = String::from("RandomData");
    let _dreader = DiscoveredReaderData::default(topic_name, type_name);

    // TODO: more tests :)
  }

  #[test]
  fn discdb_subscription_operations() {
    let (discovery_db_event_sender, _discovery_db_event_receiver) =
      std::sync::mpsc::sync_channel::<()>(4);
    let (status_sender, _status_receiver) = sync_status_channel(16).unwrap();

    let mut discovery_db = DiscoveryDB::new(
      GUID::new_participant_guid(),
      discovery_db_event_sender,
      status_sender,
    );

    let domain_participant =
      DomainParticipant::new(test_domain_id(0)).expect("Failed to create publisher");
    let topic = domain_participant
      .create_topic(
        "Foobar".to_string(),
        "RandomData".to_string(),
        &QosPolicies::qos_none(),
        TopicKind::WithKey,
      )
      .unwrap();
    let topic2 = domain_participant
      .create_topic(
        "Barfoo".to_string(),
        "RandomData".to_string(),
        &QosPolicies::qos_none(),
        TopicKind::WithKey,
      )
      .unwrap();

    let publisher1 = domain_participant
      .create_publisher(&QosPolicies::qos_none())
      .unwrap();
    let dw = publisher1
      .create_datawriter::<RandomData, CDRSerializerAdapter<RandomData, LittleEndian>>(&topic, None)
      .unwrap();

    let writer_data = DiscoveredWriterData::new(&dw, &topic, &domain_participant, None);

    discovery_db.update_local_topic_writer(writer_data);
    assert_eq!(discovery_db.local_topic_writers.len(), 1);

    let publisher2 = domain_participant
      .create_publisher(&QosPolicies::qos_none())
      .unwrap();
    let dw2 = publisher2
      .create_datawriter::<RandomData, CDRSerializerAdapter<RandomData, LittleEndian>>(
        &topic2, None,
      )
      .unwrap();
    let writer_data2 = DiscoveredWriterData::new(&dw2, &topic2, &domain_participant, None);
    discovery_db.update_local_topic_writer(writer_data2);
    assert_eq!(discovery_db.local_topic_writers.len(), 2);

    // creating data
    let reader1 = reader_proxy_data().unwrap();
    let reader1sub = subscription_builtin_topic_data().unwrap();
    // reader1sub.set_key(reader1.remote_reader_guid);
    // reader1sub.set_topic_name(&topic.name());
    let dreader1 = DiscoveredReaderData {
      reader_proxy: reader1.clone(),
      subscription_topic_data: reader1sub.clone(),
      content_filter: None,
      user_data: Vec::new(),
    };
    discovery_db.update_subscription(&dreader1);

    let reader2 = reader_proxy_data().unwrap();
    let reader2sub = subscription_builtin_topic_data().unwrap();
    // reader2sub.set_key(reader2.remote_reader_guid);
    // reader2sub.set_topic_name(&topic2.name());
    let dreader2 = DiscoveredReaderData {
      reader_proxy: reader2,
      subscription_topic_data: reader2sub,
      content_filter: None,
      user_data: Vec::new(),
    };
    discovery_db.update_subscription(&dreader2);

    let reader3 = reader1;
    let reader3sub = reader1sub;
    let dreader3 = DiscoveredReaderData {
      reader_proxy: reader3,
      subscription_topic_data: reader3sub,
      content_filter: None,
      user_data: Vec::new(),
    };
    discovery_db.update_subscription(&dreader3);

    // TODO: there might be a need for different scenarios
  }

  #[test]
  fn discdb_external_endpoint_snapshots() {
    let (discovery_db_event_sender, _discovery_db_event_receiver) =
      std::sync::mpsc::sync_channel::<()>(4);
    let (status_sender, _status_receiver) = sync_status_channel(16).unwrap();

    let mut discovery_db = DiscoveryDB::new(
      GUID::new_participant_guid(),
      discovery_db_event_sender,
      status_sender,
    );

    // Nothing discovered yet.
    assert_eq!(discovery_db.get_all_external_topic_readers().count(), 0);
    assert_eq!(discovery_db.get_all_external_topic_writers().count(), 0);

    // Discover one external Reader via SEDP subscription data.
    let reader = reader_proxy_data().unwrap();
    let reader_sub = subscription_builtin_topic_data().unwrap();
    let dreader = DiscoveredReaderData {
      reader_proxy: reader,
      subscription_topic_data: reader_sub,
      content_filter: None,
      user_data: Vec::new(),
    };
    discovery_db.update_subscription(&dreader);

    // Discover one external Writer via SEDP publication data.
    let domain_participant =
      DomainParticipant::new(test_domain_id(0)).expect("Failed to create participant");
    let topic = domain_participant
      .create_topic(
        "Foobar".to_string(),
        "RandomData".to_string(),
        &QosPolicies::qos_none(),
        TopicKind::WithKey,
      )
      .unwrap();
    let publisher = domain_participant
      .create_publisher(&QosPolicies::qos_none())
      .unwrap();
    let dw = publisher
      .create_datawriter::<RandomData, CDRSerializerAdapter<RandomData, LittleEndian>>(&topic, None)
      .unwrap();
    let writer_data = DiscoveredWriterData::new(&dw, &topic, &domain_participant, None);
    discovery_db.update_publication(&writer_data);

    // Both accessors return the discovered endpoints as a snapshot.
    let readers = discovery_db
      .get_all_external_topic_readers()
      .cloned()
      .collect::<Vec<_>>();
    let writers = discovery_db
      .get_all_external_topic_writers()
      .cloned()
      .collect::<Vec<_>>();
    assert_eq!(readers.len(), 1);
    assert_eq!(writers.len(), 1);
    assert_eq!(
      readers[0].reader_proxy.remote_reader_guid,
      dreader.reader_proxy.remote_reader_guid
    );
    assert_eq!(
      writers[0].writer_proxy.remote_writer_guid,
      writer_data.writer_proxy.remote_writer_guid
    );
  }

  #[test]
  fn discdb_local_topic_reader() {
    let (discovery_db_event_sender, _discovery_db_event_receiver) =
      std::sync::mpsc::sync_channel::<()>(4);

    let dp = DomainParticipant::new(test_domain_id(0)).expect("Failed to create participant");
    let topic = dp
      .create_topic(
        "some topic name".to_string(),
        "Wazzup".to_string(),
        &QosPolicies::qos_none(),
        TopicKind::WithKey,
      )
      .unwrap();
    let (status_sender, _status_receiver) = sync_status_channel(16).unwrap();
    let mut discoverydb = DiscoveryDB::new(
      GUID::new_participant_guid(),
      discovery_db_event_sender,
      status_sender,
    );

    // Create reader ingredients
    let (notification_sender1, _notification_receiver1) =
      crate::mio_source::notification_channel(100);
    let (_notification_event_source1, notification_event_sender1) =
      mio_source::make_poll_channel().unwrap();
    let data_reader_waker1 = Arc::new(Mutex::new(None));

    let (status_sender1, _status_receiver1) = sync_status_channel::<DataReaderStatus>(4).unwrap();
    let (_reader_commander1, reader_command_receiver1) =
      wake_channel::<ReaderCommand>(100, &LoopWaker::new());

    let topic_cache =
      dp.dds_cache()
        .write()
        .unwrap()
        .add_new_topic(topic.name(), topic.get_type(), &topic.qos());

    let reader1_ing = ReaderIngredients {
      guid: GUID::dummy_test_guid(EntityKind::READER_NO_KEY_USER_DEFINED),
      notification_sender: notification_sender1,
      status_sender: status_sender1,
      topic_name: topic.name(),
      topic_cache_handle: topic_cache.clone(),
      like_stateless: false,
      qos_policy: QosPolicies::qos_none(),
      data_reader_command_receiver: reader_command_receiver1,
      data_reader_waker: data_reader_waker1,
      poll_event_sender: notification_event_sender1,
      security_plugins: None,
      discovery_notify: None,
    };

    // Add the reader to the database and verify the info is updated
    discoverydb.update_local_topic_reader(DiscoveryDB::local_topic_reader_data(
      &dp,
      &topic,
      &reader1_ing,
      None,
    ));
    assert_eq!(discoverydb.local_topic_readers.len(), 1);
    assert_eq!(discoverydb.get_local_topic_readers(&topic).len(), 1);

    // Verify that the info does not change if the reader is added a second time
    discoverydb.update_local_topic_reader(DiscoveryDB::local_topic_reader_data(
      &dp,
      &topic,
      &reader1_ing,
      None,
    ));
    assert_eq!(discoverydb.local_topic_readers.len(), 1);
    assert_eq!(discoverydb.get_local_topic_readers(&topic).len(), 1);

    // Create second reader ingredients for the same topic
    let (notification_sender2, _notification_receiver2) =
      crate::mio_source::notification_channel(100);
    let (_notification_event_source2, notification_event_sender2) =
      mio_source::make_poll_channel().unwrap();
    let data_reader_waker2 = Arc::new(Mutex::new(None));

    let (status_sender2, _status_receiver2) = sync_status_channel::<DataReaderStatus>(4).unwrap();
    let (_reader_commander2, reader_command_receiver2) =
      wake_channel::<ReaderCommand>(100, &LoopWaker::new());

    let mut guid2 = GUID::dummy_test_guid(EntityKind::READER_NO_KEY_USER_DEFINED);
    guid2.prefix = GuidPrefix::new(b"Another fake"); // GUID needs to be different in order to be added

    let reader2_ing = ReaderIngredients {
      guid: guid2,
      notification_sender: notification_sender2,
      status_sender: status_sender2,
      topic_name: topic.name(),
      topic_cache_handle: topic_cache,
      like_stateless: false,
      qos_policy: QosPolicies::qos_none(),
      data_reader_command_receiver: reader_command_receiver2,
      data_reader_waker: data_reader_waker2,
      poll_event_sender: notification_event_sender2,
      security_plugins: None,
      discovery_notify: None,
    };

    // Add the second reader to the database and verify the info is updated
    discoverydb.update_local_topic_reader(DiscoveryDB::local_topic_reader_data(
      &dp,
      &topic,
      &reader2_ing,
      None,
    ));
    assert_eq!(discoverydb.get_local_topic_readers(&topic).len(), 2);
    assert_eq!(discoverydb.get_all_local_topic_readers().count(), 2);
  }
}
