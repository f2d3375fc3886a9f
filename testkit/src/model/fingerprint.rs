//! 128-bit fingerprints, stored in place of visited states.

use core::hash::{Hash, Hasher};

/// Returns the fingerprint of a state. Two states share one with a chance of 10⁻²² when there are 10⁸.
pub(crate) fn fingerprint<T: Hash>(state: &T) -> u128 {
    let mut hasher = Fingerprint(0x243F_6A88_85A3_08D3, 0x1319_8A2E_0370_7344);
    state.hash(&mut hasher);
    u128::from(hasher.0) << 64 | u128::from(hasher.1)
}

/// Two lanes of 64 bits, each multiplied by a constant of its own.
#[derive(Clone, Copy)]
struct Fingerprint(u64, u64);

impl Hasher for Fingerprint {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u64(&mut self, n: u64) {
        let mix = |a: u64, k: u64| {
            let wide = u128::from(a ^ n) * u128::from(k);
            (wide >> 64) as u64 ^ wide as u64
        };
        self.0 = mix(self.0, 0x9E37_79B9_7F4A_7C15).rotate_left(23).wrapping_add(n);
        self.1 = mix(self.1.rotate_left(5), 0xD6E8_FEB8_6659_FD93).wrapping_add(n.rotate_left(32));
    }

    fn write_u8(&mut self, n: u8) {
        self.write_u64(n.into());
    }

    fn write_u16(&mut self, n: u16) {
        self.write_u64(n.into());
    }

    fn write_u32(&mut self, n: u32) {
        self.write_u64(n.into());
    }

    fn write_usize(&mut self, n: usize) {
        self.write_u64(n as u64);
    }
}

/// The hasher of a map whose keys are fingerprints already.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Identity(u64);

impl Hasher for Identity {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, _: &[u8]) {
        unreachable!("a fingerprint is a u128")
    }

    fn write_u128(&mut self, n: u128) {
        self.0 = n as u64;
    }
}
