//! Stable hashes of content, the same on every machine and in every version. They distinguish meshes and files and
//! reveal damage, but do not protect against forgery.

use glam::Vec3;

/// The hash of a mesh: of its positions and triangles in order, nothing else. Zeros of either sign are equal.
pub fn mesh_hash(points: &[Vec3], triangles: &[[u32; 3]]) -> u128 {
    let mut hash = Hash::new();
    hash.add(points.len() as u64);
    hash.add(triangles.len() as u64);
    let bits = |x: f32| u64::from(if x == 0.0 { 0 } else { x.to_bits() });
    for point in points {
        hash.add(bits(point.x) << 32 | bits(point.y));
        hash.add(bits(point.z));
    }
    for [a, b, c] in triangles {
        hash.add(u64::from(*a) << 32 | u64::from(*b));
        hash.add(u64::from(*c));
    }
    hash.finish()
}

/// The hash of bytes, as at the end of a skin file.
pub fn content_hash(bytes: &[u8]) -> u64 {
    let mut hash = Hash::new();
    hash.add(bytes.len() as u64);
    let (words, rest) = bytes.as_chunks::<8>();
    for word in words {
        hash.add(u64::from_le_bytes(*word));
    }
    hash.add(rest.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte)));
    hash.finish() as u64
}

/// Two independent 64-bit states; each word is folded into both through invertible steps, so that no single change of
/// a word can go unnoticed.
struct Hash {
    a: u64,
    b: u64,
}

impl Hash {
    fn new() -> Self {
        Self { a: 0x243F_6A88_85A3_08D3, b: 0x1319_8A2E_0370_7344 }
    }

    fn add(&mut self, word: u64) {
        self.a = (self.a ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.a ^= self.a >> 32;
        self.b = (self.b.rotate_left(23) ^ word).wrapping_mul(0xC2B2_AE3D_27D4_EB4F);
        self.b ^= self.b >> 29;
    }

    fn finish(&self) -> u128 {
        let mix = |mut z: u64| {
            z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            z ^ z >> 31
        };
        u128::from(mix(self.a ^ self.b.rotate_left(32))) | u128::from(mix(self.b)) << 64
    }
}
