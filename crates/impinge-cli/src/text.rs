//! Numbers and hashes as text.

use impinge::{PairKind, Pairs};

/// A number with a comma after every three digits.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (ix, digit) in digits.chars().enumerate() {
        if ix > 0 && (digits.len() - ix).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `n` with a noun, in the plural unless `n` is 1.
pub fn counted(n: u64, one: &str) -> String {
    format!("{} {one}{}", grouped(n), if n == 1 { "" } else { "s" })
}

/// `n` with a noun that has a plural of its own, or with more words.
pub fn several(n: u64, one: &str, many: &str) -> String {
    format!("{} {}", grouped(n), if n == 1 { one } else { many })
}

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
    fn digits_in_groups() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1000), "1,000");
        assert_eq!(grouped(1234567), "1,234,567");
    }

    #[test]
    fn bytes_are_short() {
        assert_eq!(shown_bytes(0), "0 bytes");
        assert_eq!(shown_bytes(999), "999 bytes");
        assert_eq!(shown_bytes(1500), "1.5 kB");
        assert_eq!(shown_bytes(2_500_000_000_000), "2.5 TB");
    }
}
