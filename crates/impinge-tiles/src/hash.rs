//! A checksum that detects damage and identifies plans: two rounds of a folded 128-bit product per
//! 8 bytes. It is not cryptographic.

/// The checksum of bytes.
pub fn checksum(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let state = words.iter().fold(bytes.len() as u64, |state, word| {
        fold(state, u64::from_le_bytes(*word))
    });
    fold(state, u64::from_le_bytes(last))
}

fn fold(state: u64, word: u64) -> u64 {
    let a = state ^ 0x9E37_79B9_7F4A_7C15;
    let product = u128::from(a.rotate_left(23) ^ word) * u128::from(0xD6E8_FEB8_6659_FD93_u64);
    ((product as u64) ^ ((product >> 64) as u64)).wrapping_add(a)
}

#[cfg(test)]
mod tests {
    use super::checksum;

    #[test]
    fn one_bit_or_one_byte_changes_it() {
        let bytes: Vec<u8> = (0..100).collect();
        let whole = checksum(&bytes);
        for ix in 0..bytes.len() {
            let mut other = bytes.clone();
            other[ix] ^= 1 << (ix % 8);
            assert_ne!(checksum(&other), whole);
        }
        assert_ne!(checksum(&bytes[..99]), whole);
        assert_ne!(checksum(&[0; 8]), checksum(&[0; 16]));
    }
}
