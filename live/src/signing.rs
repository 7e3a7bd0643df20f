//! Signing of MAVLink 2: the key that vehicle and ground station share.
//!
//! Each message carries 48 bits of SHA-256 over key, message and a time stamp that never decreases. Reference: MAVLink guide,
//! "Message Signing".

use mavlink::{SigningConfig, SigningData};
use sha2::{Digest, Sha256};

/// Number of this program's connection in its signatures.
const LINK_ID: u8 = 1;

/// A secret key of 32 bytes.
#[derive(Clone, PartialEq, Eq)]
pub struct Key([u8; 32]);

impl Key {
    /// The key of a passphrase: its SHA-256, as Mission Planner and MAVProxy make it.
    pub fn of_passphrase(passphrase: &str) -> Self {
        Self(Sha256::digest(passphrase.as_bytes()).into())
    }

    /// The bytes.
    pub fn bytes(&self) -> [u8; 32] {
        self.0
    }

    pub(crate) fn signing(&self) -> SigningData {
        SigningData::from_config(SigningConfig::new(self.0, LINK_ID, true, false))
    }
}

impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Key(..)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // FIPS 180-2, appendix B.1: SHA-256 of "abc".
    #[test]
    fn key_of_a_passphrase() {
        let bytes = Key::of_passphrase("abc").bytes();
        assert_eq!(bytes[..4], [0xba, 0x78, 0x16, 0xbf]);
        assert_eq!(bytes[28..], [0xf2, 0x00, 0x15, 0xad]);
        assert_eq!(format!("{:?}", Key::of_passphrase("abc")), "Key(..)");
    }
}
