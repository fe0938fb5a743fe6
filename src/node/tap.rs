//! Topics of any type, heard as bytes: each sample as it stands on the wire, with the head that rosbag2 keeps.

use std::io;

use futures::stream::{Stream, StreamExt, unfold};
use ros2_client::Gid;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SimpleDataReader};
use rustdds::{RepresentationIdentifier as Layout, Subscriber, Timestamp};

use govtwin_model::units::NANOS_PER_SECOND;

/// Layouts of samples: CDR in its first and second version, plain and with parameters, of both orders of bytes.
const LAYOUTS: &[Layout] = &[
    Layout::CDR_LE,
    Layout::CDR_BE,
    Layout::PL_CDR_LE,
    Layout::PL_CDR_BE,
    Layout::CDR2_LE,
    Layout::CDR2_BE,
    Layout::PL_CDR2_LE,
    Layout::PL_CDR2_BE,
    Layout::D_CDR_LE,
    Layout::D_CDR_BE,
    Layout::XCDR2_LE,
    Layout::XCDR2_BE,
    Layout::D_CDR2_LE,
    Layout::D_CDR2_BE,
    Layout::PL_XCDR2_LE,
    Layout::PL_XCDR2_BE,
];

/// Gives samples undecoded.
#[derive(Debug)]
pub(crate) struct Undecoded;

impl DeserializerAdapter<Vec<u8>> for Undecoded {
    type Error = io::Error;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [Layout] {
        LAYOUTS
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for Undecoded {
    type Decoder = Encapsulation;
    const DECODER: Encapsulation = Encapsulation;
}

/// Puts the four bytes before a sample that name its layout; the last two are options that say nothing.
#[derive(Clone, Debug)]
pub(crate) struct Encapsulation;

impl<'de> Decode<'de, Vec<u8>> for Encapsulation {
    type Error = io::Error;

    fn decode_bytes(self, bytes: &'de [u8], layout: Layout) -> Result<Vec<u8>, io::Error> {
        Ok([&layout.to_bytes()[..], &[0, 0], bytes].concat())
    }
}

/// A sample of a tapped topic.
#[derive(Debug)]
pub(super) struct TappedSample {
    /// Who sent it.
    pub(super) sender: Gid,
    /// When it came, ns since the epoch.
    pub(super) received_ns: i64,
    /// When it was sent, as its sender says; when it came where it does not.
    pub(super) sent_ns: i64,
    /// The number that its sender gave it.
    pub(super) number: i64,
    /// The sample behind four bytes that name its layout.
    pub(super) data: Vec<u8>,
}

/// A topic that is heard as bytes.
pub(super) struct Tap {
    // Dropped in this order.
    reader: SimpleDataReader<Vec<u8>, Undecoded>,
    _subscriber: Subscriber,
}

impl Tap {
    pub(super) fn new(subscriber: Subscriber, reader: SimpleDataReader<Vec<u8>, Undecoded>) -> Self {
        Self { reader, _subscriber: subscriber }
    }

    /// The next sample that has come; an error is one that cannot be handed on. `None` where there is none.
    pub(super) fn take(&self) -> Option<Result<TappedSample, String>> {
        self.reader.drain_read_notifications();
        match self.reader.try_take_one() {
            Ok(None) => None,
            Ok(Some(change)) => {
                let (sender, number) = (Gid::from(change.writer_guid()), i64::from(change.sequence_number));
                let times = (change.receive_instant, change.source_timestamp());
                Some(Ok(TappedSample::of(sender, number, times, change.into_value())))
            }
            Err(error) => Some(Err(error.to_string())),
        }
    }

    /// Samples as they come.
    pub(super) fn into_stream(self) -> impl Stream<Item = Result<TappedSample, String>> {
        unfold(self, |tap| async move {
            tap.reader.drain_read_notifications();
            let next = std::pin::pin!(tap.reader.as_async_stream()).next().await;
            let sample = next?.map(|change| {
                let (sender, number) = (Gid::from(change.writer_guid()), i64::from(change.sequence_number));
                let times = (change.receive_instant, change.source_timestamp());
                TappedSample::of(sender, number, times, change.into_value())
            });
            Some((sample.map_err(|error| error.to_string()), tap))
        })
    }
}

impl TappedSample {
    fn of(sender: Gid, number: i64, (received, sent): (Timestamp, Option<Timestamp>), data: Vec<u8>) -> Self {
        let received_ns = nanos(received);
        Self { sender, received_ns, sent_ns: sent.map_or(received_ns, nanos), number, data }
    }
}

/// A time of DDS (seconds, and 2^-32 of a second) in ns.
fn nanos(time: Timestamp) -> i64 {
    let ticks = time.to_ticks();
    let (seconds, fraction) = (ticks >> 32, ticks & 0xffff_ffff);
    let whole_ns = i64::try_from(seconds).unwrap_or_default() * NANOS_PER_SECOND;
    whole_ns + i64::try_from((fraction * 1_000_000_000) >> 32).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_keeps_its_bytes_behind_the_name_of_its_layout() {
        assert_eq!(Encapsulation.decode_bytes(&[7, 8], Layout::CDR_LE).unwrap(), [0, 1, 0, 0, 7, 8]);
        assert_eq!(Encapsulation.decode_bytes(&[], Layout::CDR_BE).unwrap(), [0, 0, 0, 0]);
    }

    #[test]
    fn times_of_dds_are_nanoseconds() {
        assert_eq!(nanos(Timestamp::from_ticks((1_700_000_000 << 32) | (1 << 31))), 1_700_000_000_500_000_000);
    }
}
