//! Uids: identities that survive renaming, reparenting and later versions.

use std::{fmt, str::FromStr};

use bevy::prelude::*;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use super::Rig;

/// A 64-bit random number that identifies a rig, group, joint or tag for good; written as 16 hexadecimal digits.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[component(immutable)]
#[reflect(Component)]
pub struct Uid(pub u64);

impl Uid {
    /// The uid that follows from names: the same for the same texts in the same order; never zero.
    pub fn derived<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let mut hash = 0x5249_4753_4d49_5448;
        for name in names {
            // The length keeps ("ab", "c") and ("a", "bc") apart.
            hash = mix(hash ^ name.len() as u64);
            for byte in name.bytes() {
                hash = mix(hash ^ u64::from(byte));
            }
        }
        Self(hash.max(1))
    }
}

/// One round of SplitMix64's finaliser.
pub(crate) fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl fmt::Display for Uid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// Error for a text that is not a [`Uid`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is no uid; write 16 hexadecimal digits, such as 00c0ffee00c0ffee")]
pub struct UidError(pub String);

impl FromStr for Uid {
    type Err = UidError;

    fn from_str(text: &str) -> Result<Self, UidError> {
        let hexadecimal = text.len() == 16 && text.bytes().all(|b| b.is_ascii_hexdigit());
        let number = hexadecimal.then(|| u64::from_str_radix(text, 16).ok()).flatten();
        number.map(Self).ok_or_else(|| UidError(text.to_owned()))
    }
}

impl Serialize for Uid {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Uid {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(deserializer)?;
        text.parse().map_err(D::Error::custom)
    }
}

/// Source of uids; the same seed gives the same uids (SplitMix64).
#[derive(Resource, Debug, Clone, PartialEq, Eq)]
pub struct UidSource {
    state: u64,
}

impl UidSource {
    /// A source that gives the same uids for the same seed.
    pub fn seeded(seed: u64) -> Self {
        Self { state: seed }
    }

    /// A seed that follows from another one and from a rig: a rig that was made with the same seed already has its first uids.
    pub(crate) fn seed_beside(seed: u64, rig: &Rig) -> u64 {
        let known = rig.walk().map(|joint| joint.data.uid).chain([rig.uid()]);
        known.fold(seed, |seed, uid| seed.rotate_left(1) ^ uid.0)
    }

    /// A source that differs from run to run, for interactive work.
    pub fn random() -> Self {
        use std::hash::{BuildHasher, RandomState};
        Self::seeded(RandomState::new().hash_one(std::time::SystemTime::now()))
    }

    /// The next uid; never zero.
    pub fn next_uid(&mut self) -> Uid {
        loop {
            let z = mix(self.state);
            self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            if z != 0 {
                return Uid(z);
            }
        }
    }
}

impl Default for UidSource {
    fn default() -> Self {
        Self::random()
    }
}
