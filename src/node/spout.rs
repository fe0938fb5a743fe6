//! Samples of any type, published as a bag keeps them.

use serde::ser::{Serialize, SerializeTuple, Serializer};

/// The head of a sample in a bag that names its layout, little-endian CDR, behind which two bytes of options stand.
const CDR_LE: [u8; 2] = [0, 1];

/// Length of that head, bytes.
const HEAD_LEN: usize = 4;

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
}

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

#[cfg(test)]
mod tests {
    use super::Encoded;
    use govtwin_bag::cdr;

    #[test]
    fn a_sample_is_written_as_it_was_read() {
        for length in [4, 5, 11, 12, 13, 29, 4 + 65_536] {
            let sample: Vec<u8> = [0, 1, 0, 0].into_iter().chain((4..length).map(|n: u32| (n * 7) as u8)).collect();
            assert_eq!(cdr::encode(&Encoded::of(sample.clone()).unwrap()).unwrap(), sample, "{length} bytes");
        }
        assert_eq!(Encoded::of(vec![0, 0, 0, 0, 1]), None, "big-endian");
        assert_eq!(Encoded::of(vec![0, 1, 0]), None, "without a whole head");
    }
}
