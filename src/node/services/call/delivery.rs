//! Responses on their way: to the readers of their caller and to nobody else, once these are matched.
//!
//! A client may call before the node has matched its reader of responses, and a response written then would be lost. Services of Fast DDS and
//! of Cyclone DDS wait for that reader too.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use rustdds::bytes::Bytes;
use rustdds::{GUID, SampleIdentity};

use crate::transport::{Participant, participant_of};

/// Most responses that wait for a reader; of more the oldest is lost, as its caller has gone.
const MOST_WAITING: usize = 256;

/// Most clients that are remembered; beyond them counting starts anew.
const MOST_CLIENTS: usize = 1024;

/// A response on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Response {
    /// What it answers.
    pub(super) request: SampleIdentity,
    /// The response behind the head of its sample.
    pub(super) body: Bytes,
}

/// Who reads responses, and those that wait.
#[derive(Debug, Default)]
pub(super) struct Delivery {
    readers: BTreeSet<GUID>,
    clients: BTreeSet<GUID>,
    /// How many clients a participant has, where it has more than one.
    counts: BTreeMap<Participant, usize>,
    waiting: VecDeque<Response>,
}

impl Delivery {
    /// Takes note of a client's writer; whether it is new.
    pub(super) fn meet(&mut self, client: GUID) -> bool {
        if self.clients.len() >= MOST_CLIENTS {
            self.clients.clear();
            self.counts.clear();
        }
        self.clients.insert(client)
    }

    /// A participant has so many clients of the service now.
    pub(super) fn count(&mut self, participant: Participant, clients: usize) {
        self.counts.insert(participant, clients);
    }

    /// Takes a response, and gives what can be sent now: to each reader that may be its caller's, or nothing while that one is not matched.
    pub(super) fn take(&mut self, response: Response) -> Vec<(GUID, Response)> {
        let readers = self.readers_of(&response);
        if readers.is_empty() {
            if self.waiting.len() >= MOST_WAITING {
                self.waiting.pop_front();
            }
            self.waiting.push_back(response);
            return Vec::new();
        }
        readers.into_iter().map(|reader| (reader, response.clone())).collect()
    }

    /// Whether a response waits for its reader.
    pub(super) fn has_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// A reader is matched: gives what waited for it.
    pub(super) fn matched(&mut self, reader: GUID) -> Vec<(GUID, Response)> {
        self.readers.insert(reader);
        self.waiting_of(participant_of(reader))
    }

    /// A reader has gone, and its client with it.
    pub(super) fn lost(&mut self, reader: GUID) -> Vec<(GUID, Response)> {
        self.readers.remove(&reader);
        let participant = participant_of(reader);
        if let Some(count) = self.counts.get_mut(&participant) {
            *count = count.saturating_sub(1);
        }
        if !self.readers.iter().any(|other| participant_of(*other) == participant) {
            self.counts.remove(&participant);
            self.clients.retain(|client| participant_of(*client) != participant);
        }
        self.waiting_of(participant_of(reader))
    }

    fn waiting_of(&mut self, participant: Participant) -> Vec<(GUID, Response)> {
        let (due, waiting): (Vec<_>, Vec<_>) = std::mem::take(&mut self.waiting).into_iter().partition(|response| {
            participant_of(response.request.writer_guid) == participant && !self.readers_of(response).is_empty()
        });
        self.waiting = waiting.into();
        due.into_iter().flat_map(|response| self.take(response)).collect()
    }

    /// The caller's reader, where the caller names it as Fast DDS does; else all of its participant, once each client there has one.
    fn readers_of(&self, response: &Response) -> Vec<GUID> {
        let caller = response.request.writer_guid;
        if self.readers.contains(&caller) {
            return vec![caller];
        }
        let participant = participant_of(caller);
        let readers = self.readers.iter().copied().filter(|reader| participant_of(*reader) == participant);
        let readers: Vec<GUID> = readers.collect();
        let clients = self.counts.get(&participant).copied().unwrap_or(1);
        if readers.len() < clients { Vec::new() } else { readers }
    }
}

#[cfg(test)]
mod tests {
    use rustdds::bytes::Bytes;
    use rustdds::{GUID, SampleIdentity, SequenceNumber};

    use super::{Delivery, MOST_WAITING, Response, participant_of};

    fn id(participant: u8, entity: u8) -> GUID {
        let [mut bytes, end] = [[participant; 16], [entity; 16]];
        bytes[12..].copy_from_slice(&[end[0], 0, 0, 4]);
        GUID::from_bytes(bytes)
    }

    fn response(caller: GUID, number: i64) -> Response {
        let request = SampleIdentity { writer_guid: caller, sequence_number: SequenceNumber::from(number) };
        Response { request, body: Bytes::from(vec![number as u8]) }
    }

    fn addressees(due: &[(GUID, Response)]) -> Vec<(GUID, u8)> {
        due.iter().map(|(reader, response)| (*reader, response.body[0])).collect()
    }

    #[test]
    fn a_response_waits_for_the_reader_of_its_caller_and_goes_to_no_other() {
        let mut delivery = Delivery::default();
        assert!(delivery.matched(id(2, 1)).is_empty(), "another participant");
        let (client, reader) = (id(1, 9), id(1, 1));
        assert!(delivery.meet(client) && !delivery.meet(client));
        delivery.count(participant_of(client), 1);
        assert!(delivery.take(response(client, 5)).is_empty());
        assert_eq!(addressees(&delivery.matched(reader)), [(reader, 5)]);
        assert_eq!(addressees(&delivery.take(response(client, 6))), [(reader, 6)]);
    }

    #[test]
    fn a_second_client_of_a_participant_is_not_answered_at_the_reader_of_the_first() {
        let mut delivery = Delivery::default();
        delivery.matched(id(1, 1));
        assert!(delivery.meet(id(1, 9)));
        delivery.count(participant_of(id(1, 9)), 2);
        assert!(delivery.take(response(id(1, 9), 5)).is_empty());
        assert_eq!(addressees(&delivery.matched(id(1, 2))), [(id(1, 1), 5), (id(1, 2), 5)]);
        // The first client goes; the second is alone.
        delivery.lost(id(1, 1));
        assert_eq!(addressees(&delivery.take(response(id(1, 9), 6))), [(id(1, 2), 6)]);
    }

    #[test]
    fn a_caller_that_names_its_reader_is_answered_there() {
        let mut delivery = Delivery::default();
        delivery.matched(id(1, 1));
        delivery.matched(id(1, 2));
        assert_eq!(addressees(&delivery.take(response(id(1, 2), 7))), [(id(1, 2), 7)]);
    }

    #[test]
    fn callers_that_never_read_take_bounded_room() {
        let mut delivery = Delivery::default();
        for number in 0..2000 {
            assert!(delivery.take(response(id(3, 3), number)).is_empty());
            delivery.meet(id((number % 250) as u8, (number / 8) as u8));
        }
        assert_eq!(delivery.waiting.len(), MOST_WAITING);
        assert!(delivery.clients.len() <= super::MOST_CLIENTS);
    }
}
