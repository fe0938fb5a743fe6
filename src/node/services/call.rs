//! Services whose types ros2-client cannot name: those of actions. One server hears callers on Fast DDS and on Cyclone DDS alike,
//! since it looks at the caller's vendor before it reads what the caller sent.

use std::convert::Infallible;

use futures::stream::{LocalBoxStream, StreamExt};
use ros2_client::ServiceMapping;
use rustdds::bytes::Bytes;
use rustdds::no_key::{DataWriter, SerializerAdapter, SimpleDataReader};
use rustdds::rpc::SampleIdentity;
use rustdds::{
    Publisher, RepresentationIdentifier as Layout, SequenceNumber, Subscriber, Timestamp, WriteOptionsBuilder,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::super::tap::Undecoded;
use super::{Aftermath, ServiceContext};
use govtwin_bag::cdr;

/// What names the layout of a sample, before its bytes.
const HEAD_LEN: usize = 4;

/// What Cyclone DDS puts before each request and response: the caller's id and a number, eight bytes each.
const CYCLONE_LEN: usize = 16;

/// Writes responses that are encoded already.
pub struct Body;

impl SerializerAdapter<Bytes> for Body {
    type Error = Infallible;

    fn output_encoding() -> Layout {
        Layout::CDR_LE
    }

    fn to_bytes(body: &Bytes) -> Result<Bytes, Infallible> {
        Ok(body.clone())
    }
}

/// To whom a response goes.
#[derive(Clone, Debug)]
pub struct Caller {
    request: SampleIdentity,
    cyclone: Option<[u8; CYCLONE_LEN]>,
}

/// The server of one service.
pub struct Calls {
    // Dropped in this order.
    requests: SimpleDataReader<Vec<u8>, Undecoded>,
    responses: DataWriter<Bytes, Body>,
    _subscriber: Subscriber,
    _publisher: Publisher,
    _listed: Option<Listed>,
}

/// A second pair of endpoints, which nobody reads and nobody writes: ros2-client lists in the graph of ROS what it opened itself, and
/// `ros2 node info` and bridges go by that list.
type Listed = (ros2_client::Subscription<()>, ros2_client::Publisher<()>);

impl Calls {
    /// A server of these endpoints.
    #[must_use]
    pub fn new(
        (subscriber, requests): (Subscriber, SimpleDataReader<Vec<u8>, Undecoded>),
        (publisher, responses): (Publisher, DataWriter<Bytes, Body>),
    ) -> Self {
        Self { requests, responses, _subscriber: subscriber, _publisher: publisher, _listed: None }
    }

    /// The same, with endpoints that stand for these in the graph.
    #[must_use]
    pub fn listed(self, listed: Listed) -> Self {
        Self { _listed: Some(listed), ..self }
    }

    /// Hands each call to `take`; what does not decode is none.
    pub fn attend<'a, 's: 'a, Request: DeserializeOwned + 'a>(
        &'s self,
        context: &'a ServiceContext<'a>,
        take: impl Fn(Request, Caller, &mut Aftermath) + 'a,
    ) -> LocalBoxStream<'a, Aftermath> {
        let answered = self.requests.as_async_stream().map(move |sample| {
            let mut aftermath = Aftermath::default();
            let Ok(sample) = sample else { return aftermath };
            let id = sample.writer_guid.to_bytes();
            let vendor = [id[0], id[1]];
            let layouts = [ServiceMapping::Enhanced, ServiceMapping::Cyclone];
            let Some(layout) = layouts.into_iter().find(|&layout| context.serves(layout, vendor)) else {
                aftermath.words.extend(context.turn_away(vendor));
                return aftermath;
            };
            let own = SampleIdentity { writer_guid: sample.writer_guid, sequence_number: sample.sequence_number };
            let caller = identity(sample.related_sample_identity(), own);
            if let Some((request, cyclone)) = decode(&sample.into_value(), layout) {
                take(request, Caller { request: caller, cyclone }, &mut aftermath);
            }
            aftermath
        });
        answered.boxed_local()
    }

    /// Answers a caller; `false` where the answer is lost.
    pub fn respond<Response: Serialize>(&self, caller: &Caller, response: &Response) -> bool {
        let Ok(encoded) = cdr::encode(response) else { return false };
        let head = caller.cyclone.as_ref().map_or(&[][..], |head| head);
        let body = Bytes::from([head, &encoded[HEAD_LEN..]].concat());
        let options =
            WriteOptionsBuilder::new().related_sample_identity(caller.request).source_timestamp(Timestamp::now());
        self.responses.write_with_options(body, options.build()).is_ok()
    }
}

/// By what a caller knows its response: what it says, with the number of the sample where it leaves that out, as Fast DDS does, or else
/// the sample itself.
fn identity(said: Option<SampleIdentity>, own: SampleIdentity) -> SampleIdentity {
    match said {
        Some(said) if said.sequence_number == SequenceNumber::UNKNOWN => {
            SampleIdentity { sequence_number: own.sequence_number, ..said }
        }
        Some(said) => said,
        None => own,
    }
}

/// A request, and what Cyclone DDS puts before it.
fn decode<Request: DeserializeOwned>(
    sample: &[u8],
    layout: ServiceMapping,
) -> Option<(Request, Option<[u8; CYCLONE_LEN]>)> {
    let (head, body) = sample.split_at_checked(HEAD_LEN)?;
    if layout != ServiceMapping::Cyclone {
        return cdr::decode(sample).ok().map(|request| (request, None));
    }
    let (cyclone, body) = body.split_first_chunk::<CYCLONE_LEN>()?;
    cdr::decode(&[head, body].concat()).ok().map(|request| (request, Some(*cyclone)))
}

#[cfg(test)]
mod tests {
    use ros2_client::ServiceMapping::{Cyclone, Enhanced};

    use super::{HEAD_LEN, decode};
    use govtwin_bag::cdr;
    use govtwin_bag::msg::action::SendStepsRequest;

    #[test]
    fn a_request_is_read_in_the_layout_of_its_caller() {
        let request = SendStepsRequest { goal_id: [7; 16], steps: 40 };
        let plain = cdr::encode(&request).unwrap();
        let behind_head = [&plain[..HEAD_LEN], &[9; 16][..], &plain[HEAD_LEN..]].concat();
        assert_eq!(decode::<SendStepsRequest>(&plain, Enhanced), Some((request, None)));
        assert_eq!(decode::<SendStepsRequest>(&behind_head, Cyclone), Some((request, Some([9; 16]))));
        assert_eq!(decode::<SendStepsRequest>(&plain, Cyclone), None, "too short behind the head");
        assert_eq!(decode::<SendStepsRequest>(&[0, 1], Enhanced), None);
    }
}
