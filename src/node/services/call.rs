//! One server for callers on Fast DDS and on Cyclone DDS alike: it looks at the caller's vendor before it reads what the caller sent.
//!
//! The two lay a call out differently, and nothing on the wire says which. Cyclone DDS puts sixteen bytes before each request and response, the
//! caller's id and a number, which Fast DDS keeps beside the sample. A call read the wrong way decodes into other, valid-looking numbers. With a
//! server for each layout a client would count the wrong one of them as ready, and its first call would be lost.

mod delivery;

use std::sync::Mutex;
use std::time::Duration;

use futures::stream::{LocalBoxStream, StreamExt, select};
use ros2_client::{Gid, MessageInfo, ServiceMapping, Subscription};
use rustdds::bytes::Bytes;
use rustdds::{
    DataWriterStatus, DomainParticipant, GUID, SampleIdentity, SequenceNumber, StatusEvented, Timestamp, Topic,
    TopicDescription, WriteOptionsBuilder,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::super::bus::ListedWriter;
use super::super::spout::Encoded;
use super::super::transport::participant_of;
use super::{Aftermath, ServiceContext};
use delivery::{Delivery, Response};
use govtwin_bag::cdr;

/// What names the layout of a sample, before its bytes: little-endian CDR, as every ROS 2 writes on machines of today.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// What Cyclone DDS puts before each request and response: the caller's id and a number, eight bytes each.
const CYCLONE_LEN: usize = 16;

/// To whom a response goes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Caller {
    request: SampleIdentity,
    cyclone: Option<[u8; CYCLONE_LEN]>,
}

/// The server of one service.
pub(crate) struct Calls {
    // Dropped in this order.
    requests: Subscription<Encoded>,
    responses: ListedWriter,
    participant: DomainParticipant,
    request_topic: String,
    delivery: Mutex<Delivery>,
}

impl Calls {
    /// A server of these endpoints.
    pub(in super::super) fn new(
        participant: DomainParticipant,
        (topic, requests): (&Topic, Subscription<Encoded>),
        responses: ListedWriter,
    ) -> Self {
        Self { requests, responses, participant, request_topic: topic.name(), delivery: Mutex::default() }
    }

    /// Hands each call to `take`; what does not decode is none.
    pub(crate) fn attend<'a, 's: 'a, Request: DeserializeOwned + 'a>(
        &'s self,
        context: &'a ServiceContext<'a>,
        take: impl Fn(Request, Caller, &mut Aftermath) + 'a,
    ) -> LocalBoxStream<'a, Aftermath> {
        let answered = self.requests.async_stream().map(move |call| {
            let mut aftermath = Aftermath::default();
            let Ok((body, info)) = call else { return aftermath };
            let request = identity(&info);
            let sender = info.publisher_gid();
            self.meet(sender);
            context.caller.set(sender);
            let id = sender.to_bytes16();
            if let Some((asked, cyclone)) = decode(body.bytes(), context.layout_of([id[0], id[1]])) {
                take(asked, Caller { request, cyclone }, &mut aftermath);
            }
            aftermath
        });
        // Readers of responses come and go: what waited for one is sent.
        let matched = self.responses.as_async_status_stream().map(|status| {
            self.follow(&status);
            Aftermath::default()
        });
        select(answered, matched).boxed_local()
    }

    /// Answers each call at once.
    pub(super) fn answer<'a, 's: 'a, Request: DeserializeOwned + 'a, Answer: Serialize>(
        &'s self,
        context: &'a ServiceContext<'a>,
        respond: impl Fn(Request, &ServiceContext<'_>, &mut Aftermath) -> Answer + 'a,
    ) -> LocalBoxStream<'a, Aftermath> {
        self.attend(context, move |request, caller, aftermath| {
            let response = respond(request, context, aftermath);
            if !self.respond(&caller, &response) {
                aftermath.words.push("an answer to a service call was lost".to_owned());
            }
        })
    }

    /// Answers a caller, as soon as its reader is matched; `false` where the answer is lost.
    pub(crate) fn respond(&self, caller: &Caller, response: &impl Serialize) -> bool {
        let Ok(encoded) = cdr::encode(response) else { return false };
        let head = caller.cyclone.as_ref().map_or(&[][..], |head| head);
        let body = Bytes::from([head, &encoded[HEAD.len()..]].concat());
        let Ok(mut delivery) = self.delivery.lock() else { return false };
        delivery.take(Response { request: caller.request, body }).into_iter().all(|due| self.send(&due))
    }

    /// Whether all responses have arrived.
    pub(super) fn is_answered(&self) -> bool {
        let has_sent_all = self.delivery.lock().is_ok_and(|delivery| !delivery.has_waiting());
        has_sent_all && self.responses.wait_for_acknowledgments(Duration::ZERO).unwrap_or(true)
    }

    /// Counts the clients of a participant where one of them calls for the first time: each has a reader that must be matched.
    fn meet(&self, sender: Gid) {
        let Ok(mut delivery) = self.delivery.lock() else { return };
        let sender = GUID::from(sender);
        if delivery.meet(sender) {
            let participant = participant_of(sender);
            let writers = self.participant.discovered_writers();
            let data = writers.iter().map(|writer| &writer.publication_topic_data);
            let clients =
                data.filter(|data| data.topic_name == self.request_topic && participant_of(data.key) == participant);
            delivery.count(participant, clients.count());
        }
    }

    fn follow(&self, status: &DataWriterStatus) {
        let DataWriterStatus::PublicationMatched { reader, current, .. } = status else { return };
        let Ok(mut delivery) = self.delivery.lock() else { return };
        let due = if current.count_change() > 0 { delivery.matched(*reader) } else { delivery.lost(*reader) };
        for one in due {
            self.send(&one);
        }
    }

    /// Sends a response to one reader, and to no other: those of the other layout could not decode it.
    fn send(&self, (reader, Response { request, body }): &(GUID, Response)) -> bool {
        let options = WriteOptionsBuilder::new()
            .related_sample_identity(*request)
            .source_timestamp(Timestamp::now())
            .to_single_reader(*reader);
        self.responses.write_with_options(body.clone(), options.build()).is_ok()
    }
}

/// By what a caller knows its response: what it says, with the number of the sample where it leaves that out, as Fast DDS does, or else
/// the sample itself.
fn identity(info: &MessageInfo) -> SampleIdentity {
    let sequence_number = SequenceNumber::from(info.sequence_number());
    let own = SampleIdentity { writer_guid: GUID::from(info.publisher_gid()), sequence_number };
    match info.related_request_id().map(SampleIdentity::from) {
        Some(said) if said.sequence_number == SequenceNumber::UNKNOWN => SampleIdentity { sequence_number, ..said },
        Some(said) => said,
        None => own,
    }
}

/// A request, and what Cyclone DDS puts before it.
fn decode<Request: DeserializeOwned>(
    body: &[u8],
    layout: ServiceMapping,
) -> Option<(Request, Option<[u8; CYCLONE_LEN]>)> {
    let request = |body: &[u8]| cdr::decode(&[&HEAD[..], body].concat()).ok();
    if layout != ServiceMapping::Cyclone {
        return request(body).map(|request| (request, None));
    }
    let (cyclone, body) = body.split_first_chunk::<CYCLONE_LEN>()?;
    request(body).map(|request| (request, Some(*cyclone)))
}

#[cfg(test)]
mod tests {
    use ros2_client::ServiceMapping::{Cyclone, Enhanced};

    use super::{HEAD, decode};
    use govtwin_bag::cdr;
    use govtwin_bag::msg::action::SendStepsRequest;

    #[test]
    fn a_request_is_read_in_the_layout_of_its_caller() {
        let request = SendStepsRequest { goal_id: [7; 16], steps: 40 };
        let plain = cdr::encode(&request).unwrap().split_off(HEAD.len());
        let behind_head = [&[9; 16][..], &plain].concat();
        assert_eq!(decode::<SendStepsRequest>(&plain, Enhanced), Some((request, None)));
        assert_eq!(decode::<SendStepsRequest>(&behind_head, Cyclone), Some((request, Some([9; 16]))));
        assert_eq!(decode::<SendStepsRequest>(&plain, Cyclone), None, "too short behind the head");
        assert_eq!(decode::<SendStepsRequest>(&[0, 1], Enhanced), None);
    }
}
