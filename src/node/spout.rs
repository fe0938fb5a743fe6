//! Samples of any type as bytes: published as a bag keeps them, received and sent by services.

use std::fmt;

use ros2_client::Message;
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};

use govtwin_bag::msg::Time;

/// The head of a sample in a bag that names its layout, little-endian CDR, behind which two bytes of options stand.
const CDR_LE: [u8; 2] = [0, 1];

/// Length of that head, bytes.
const HEAD_LEN: usize = 4;

/// Bytes of a received sample that are looked at; the rest of a longer one is left out, and it does not decode.
const MOST_RECEIVED: usize = 1 << 20;

/// A sample in little-endian CDR without its head. Written as such again it is the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Encoded(Vec<u8>);

impl Encoded {
    /// A sample as it stands in a bag; `None` for one in another layout, which no ROS 2 writes on machines of today.
    pub(super) fn of(mut sample: Vec<u8>) -> Option<Self> {
        if sample.len() < HEAD_LEN || sample[..2] != CDR_LE {
            return None;
        }
        sample.drain(..HEAD_LEN);
        Some(Self(sample))
    }

    /// Gives the header at its beginning another stamp; a sample that is too short has none.
    pub(super) fn restamp(&mut self, stamp: impl FnOnce(Time) -> Time) {
        let Some((head, _)) = self.0.split_first_chunk_mut::<8>() else { return };
        let [a, b, c, d, rest @ ..] = *head;
        let before = Time { sec: i32::from_le_bytes([a, b, c, d]), nanosec: u32::from_le_bytes(rest) };
        let Time { sec, nanosec } = stamp(before);
        head[..4].copy_from_slice(&sec.to_le_bytes());
        head[4..].copy_from_slice(&nanosec.to_le_bytes());
    }

    /// The bytes behind the head.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// The same, given away.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.0
    }
}

impl Message for Encoded {}

impl Serialize for Encoded {
    /// As whole words: CDR puts nothing between numbers of eight bytes that begin at a multiple of eight, nor between single bytes.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (words, rest) = self.0.as_chunks::<8>();
        let mut tuple = serializer.serialize_tuple(words.len() + rest.len())?;
        for word in words {
            tuple.serialize_element(&u64::from_le_bytes(*word))?;
        }
        for byte in rest {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

impl<'de> Deserialize<'de> for Encoded {
    /// All bytes up to the end of the sample: CDR reads a tuple that is longer byte by byte until nothing is left.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Bytes;

        impl<'de> Visitor<'de> for Bytes {
            type Value = Encoded;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("bytes")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<Encoded, A::Error> {
                let mut body = Vec::new();
                while let Ok(Some(byte)) = bytes.next_element() {
                    body.push(byte);
                }
                Ok(Encoded(body))
            }
        }

        deserializer.deserialize_tuple(MOST_RECEIVED, Bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::{Encoded, Time};
    use govtwin_bag::cdr;
    use govtwin_bag::msg::Header;

    #[test]
    fn a_sample_is_written_as_it_was_read() {
        for length in [4, 5, 11, 12, 13, 29, 4 + 65_536] {
            let sample: Vec<u8> = [0, 1, 0, 0].into_iter().chain((4..length).map(|n: u32| (n * 7) as u8)).collect();
            assert_eq!(cdr::encode(&Encoded::of(sample.clone()).unwrap()).unwrap(), sample, "{length} bytes");
        }
        for length in [0, 1, 7, 8, 1000] {
            let body: Vec<u8> = (0..length).map(|n: u32| (n * 7) as u8).collect();
            let sample = [&[0, 1, 0, 0][..], &body].concat();
            assert_eq!(cdr::decode::<Encoded>(&sample).unwrap().bytes(), body, "{length} bytes received");
        }
        let header = Header { stamp: Time { sec: 7, nanosec: 8 }, frame_id: "plant".to_owned() };
        let mut sample = Encoded::of(cdr::encode(&header).unwrap()).unwrap();
        sample.restamp(|stamp| Time { sec: stamp.sec + 1, nanosec: 9 });
        let expected = Header { stamp: Time { sec: 8, nanosec: 9 }, ..header };
        assert_eq!(cdr::decode::<Header>(&cdr::encode(&sample).unwrap()).unwrap(), expected);
        assert_eq!(Encoded::of(vec![0, 0, 0, 0, 1]), None, "big-endian");
        assert_eq!(Encoded::of(vec![0, 1, 0]), None, "without a whole head");
    }
}
