//! A simulation's state as bytes, to stop and continue later.
//!
//! ```text
//! "impinge state 1\n" | fingerprint u64 | step u64 | n vertices u64 | positions 3n f64 | velocities 3n f64 | checksum u64
//! ```
//! All numbers are little-endian. The fingerprint identifies the solids and the settings that
//! affect the result; the checksum covers all bytes before it. Both are 64-bit FNV-1a (Fowler,
//! Noll, Vo).

use crate::error::Error;
use crate::settings::Settings;
use crate::solid::{Material, Solid};

const MAGIC: &[u8; 16] = b"impinge state 1\n";

/// Positions and velocities of all vertices after a number of steps.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub(crate) fingerprint: u64,
    pub(crate) step: u64,
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) velocities: Vec<[f64; 3]>,
}

impl State {
    /// The number of steps made so far.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// The state as bytes for a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        for number in [self.fingerprint, self.step, self.positions.len() as u64] {
            bytes.extend(number.to_le_bytes());
        }
        for vectors in [&self.positions, &self.velocities] {
            bytes.extend(vectors.iter().flatten().flat_map(|x| x.to_le_bytes()));
        }
        let checksum = Fingerprint::of(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }

    /// Reads the state from bytes written by [`to_bytes`](State::to_bytes).
    ///
    /// # Errors
    /// [`Error::State`] if the bytes are not a complete, undamaged state.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let damaged = |what: &str| Error::State(what.to_owned());
        let rest = bytes
            .strip_prefix(MAGIC)
            .ok_or_else(|| damaged("this is not a saved state"))?;
        let (words, odd) = rest.as_chunks::<8>();
        let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
        let [fingerprint, step, n_vertices, numbers @ .., checksum] = &words[..] else {
            return Err(damaged("it ends early"));
        };
        if !odd.is_empty() || n_vertices.checked_mul(6) != Some(numbers.len() as u64) {
            return Err(Error::State(format!(
                "it announces {n_vertices} vertices, but holds {} bytes of them",
                rest.len().saturating_sub(32)
            )));
        }
        if Fingerprint::of(&bytes[..bytes.len() - 8]) != *checksum {
            return Err(damaged("its checksum does not match"));
        }
        let vectors = |words: &[u64]| {
            let (vectors, _) = words.as_chunks::<3>();
            vectors.iter().map(|v| v.map(f64::from_bits)).collect()
        };
        let (positions, velocities) = numbers.split_at(numbers.len() / 2);
        Ok(State {
            fingerprint: *fingerprint,
            step: *step,
            positions: vectors(positions),
            velocities: vectors(velocities),
        })
    }
}

/// FNV-1a over bytes: short and the same everywhere. It detects mistakes, not malicious changes.
struct Fingerprint(u64);

impl Fingerprint {
    fn new() -> Self {
        Fingerprint(0xcbf2_9ce4_8422_2325)
    }

    fn of(bytes: &[u8]) -> u64 {
        let mut hash = Fingerprint::new();
        hash.add(bytes);
        hash.0
    }

    fn add(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    }

    /// Adds a list, its length first.
    fn add_numbers(&mut self, numbers: &[f64]) {
        self.add(&(numbers.len() as u64).to_le_bytes());
        for number in numbers {
            self.add(&number.to_bits().to_le_bytes());
        }
    }

    /// Adds a list, its length first.
    fn add_indices(&mut self, indices: &[u32]) {
        self.add(&(indices.len() as u64).to_le_bytes());
        for index in indices {
            self.add(&index.to_le_bytes());
        }
    }
}

/// A hash of the solids and of all settings that affect the result.
pub(crate) fn fingerprint(solids: &[Solid], settings: &Settings) -> u64 {
    let mut hash = Fingerprint::new();
    for solid in solids {
        hash.add_indices(solid.tets.as_flattened());
        hash.add_indices(&solid.fixed);
        for vectors in [&solid.rest, &solid.positions, &solid.velocities] {
            hash.add_numbers(vectors.as_flattened());
        }
        let Material {
            young,
            poisson,
            density,
        } = solid.material;
        hash.add_numbers(&[young, poisson, density]);
    }
    let &Settings {
        dt,
        gravity,
        ground,
        damping,
        contact_stiffness,
        friction,
        self_contact,
        tolerance,
        max_iterations,
        threads: _,
    } = settings;
    hash.add_numbers(&[dt, damping.mass, damping.stiffness]);
    hash.add_numbers(&gravity);
    match ground {
        Some(ground) => {
            hash.add_numbers(&ground.normal);
            hash.add_numbers(&[ground.height]);
        }
        None => hash.add_numbers(&[]),
    }
    hash.add_numbers(&[contact_stiffness, friction, tolerance]);
    hash.add(&[u8::from(self_contact)]);
    hash.add(&(max_iterations as u64).to_le_bytes());
    hash.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_and_damage_is_seen() {
        let state = State {
            fingerprint: 7,
            step: 12,
            positions: vec![[0.1, -0.0, 1e-300], [1.0, 2.0, 3.0]],
            velocities: vec![[4.0; 3], [f64::MIN_POSITIVE; 3]],
        };
        let bytes = state.to_bytes();
        assert_eq!(State::from_bytes(&bytes).unwrap(), state);
        for n in 0..bytes.len() {
            assert!(State::from_bytes(&bytes[..n]).is_err(), "{n} bytes");
            let mut damaged = bytes.clone();
            damaged[n] ^= 4;
            assert!(State::from_bytes(&damaged).is_err(), "byte {n}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(State::from_bytes(&longer).is_err());
    }
}
