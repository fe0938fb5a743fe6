//! CDR: the bytes of one message, with the four-byte encapsulation header that names the byte order.

use byteorder::{BigEndian, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Why bytes are not the message they should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// Less than the encapsulation header.
    #[error("expected at least 4 bytes of CDR, found {found}")]
    Short {
        /// Bytes found.
        found: usize,
    },
    /// An encapsulation other than plain CDR.
    #[error("expected plain CDR (0x0000 big or 0x0001 little endian), found encapsulation {found:#06x}")]
    Encapsulation {
        /// The first two bytes.
        found: u16,
    },
    /// The body does not hold the message.
    #[error("{0}")]
    Body(String),
}

/// Encodes a message, little endian, with encapsulation header.
///
/// # Errors
/// On types that CDR cannot hold; none of this crate's messages is one.
pub fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let mut bytes = Vec::with_capacity(4 + 2 * size_of::<T>());
    bytes.extend([0, 1, 0, 0]);
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message).map_err(body)?;
    Ok(bytes)
}

/// Decodes a message with its encapsulation header, either byte order.
///
/// Bytes after the message are allowed: some middlewares pad to a multiple of four.
///
/// # Errors
/// On bytes that are not plain CDR, or end before the message does.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let [high, low, _, _, body_bytes @ ..] = bytes else { return Err(CdrError::Short { found: bytes.len() }) };
    let decoded = match u16::from_be_bytes([*high, *low]) {
        0 => cdr_encoding::from_bytes::<T, BigEndian>(body_bytes),
        1 => cdr_encoding::from_bytes::<T, LittleEndian>(body_bytes),
        found => return Err(CdrError::Encapsulation { found }),
    };
    decoded.map(|(message, _)| message).map_err(body)
}

#[expect(clippy::needless_pass_by_value, reason = "the shape that map_err wants")]
fn body(error: cdr_encoding::Error) -> CdrError {
    CdrError::Body(error.to_string())
}
