//! Numbers and hashes as text.

use impinge::{PairKind, Pairs};

pub use impinge_check::text::{counted, grouped, several};

/// How many pairs of each kind there are, without those of which there are none: `2 vf, 6 ee`.
pub fn kinds(kinds: impl IntoIterator<Item = (PairKind, u64)>) -> String {
    let found = kinds.into_iter().filter(|&(_, n)| n > 0);
    let counts: Vec<String> = found
        .map(|(kind, n)| format!("{} {}", grouped(n), kind.name()))
        .collect();
    counts.join(", ")
}

/// Bytes in a unit that keeps the number short.
pub fn shown_bytes(n: u64) -> String {
    let mut unit = 1u64;
    for name in ["bytes", "kB", "MB", "GB"] {
        if n / unit < 1000 {
            return match unit {
                1 => format!("{n} {name}"),
                _ => format!("{:.1} {name}", n as f64 / unit as f64),
            };
        }
        unit *= 1000;
    }
    format!("{:.1} TB", n as f64 / unit as f64)
}

/// A number that reads back to the same bits: 0.25, 2, 5e-324.
pub fn exactly(number: f64) -> String {
    let text = format!("{number:?}");
    text.strip_suffix(".0").unwrap_or(&text).to_owned()
}

/// The hash of an answer as 16 hexadecimal digits.
pub fn hash(pairs: &Pairs) -> String {
    hex(pairs.hash())
}

/// A hash as 16 hexadecimal digits.
pub fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_short() {
        assert_eq!(shown_bytes(0), "0 bytes");
        assert_eq!(shown_bytes(999), "999 bytes");
        assert_eq!(shown_bytes(1500), "1.5 kB");
        assert_eq!(shown_bytes(2_500_000_000_000), "2.5 TB");
    }
}
