//! SHA-256 as text, which identifies contents.

use sha2::{Digest as _, Sha256};

/// A digest that is still being fed.
#[derive(Clone, Debug, Default)]
pub struct Digest(Sha256);

impl Digest {
    /// Feeds bytes; where the pieces were cut makes no difference.
    pub fn update(&mut self, bytes: impl AsRef<[u8]>) {
        self.0.update(bytes);
    }

    /// Feeds a number, to the last bit.
    pub fn update_f64(&mut self, value: f64) {
        self.update(value.to_bits().to_le_bytes());
    }

    /// The digest: 64 hexadecimal digits.
    #[must_use]
    pub fn text(self) -> String {
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// The digest of bytes that are there as a whole.
#[must_use]
pub fn sha256(bytes: impl AsRef<[u8]>) -> String {
    let mut digest = Digest::default();
    digest.update(bytes);
    digest.text()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_those_of_the_standard() {
        // FIPS 180-4, example for one block.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256("abc"), expected);
        let mut pieces = Digest::default();
        pieces.update("a");
        pieces.update("bc");
        assert_eq!(pieces.text(), expected);
    }
}
