//! Base64 as found in mesh files: with white space, and with padding in the middle if a writer
//! encoded header and data separately.

/// The offset of the first byte that is not valid base64.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Wrong(pub usize);

/// Decodes `text` until `most` bytes have come out or it ends. Source: RFC 4648, section 4.
pub(crate) fn decode(text: &[u8], most: usize) -> Result<Vec<u8>, Wrong> {
    let mut out = Vec::with_capacity(most.min(text.len() / 4 * 3 + 3));
    // Four digits make 24 bits, of which padding takes 8 or 16 away.
    let (mut bits, mut n_digits, mut n_padding) = (0u32, 0, 0);
    for (ix, &byte) in text.iter().enumerate() {
        if out.len() >= most {
            break;
        }
        let digit = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' if n_digits >= 2 => {
                n_padding += 1;
                0
            }
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return Err(Wrong(ix)),
        };
        if n_padding > 0 && byte != b'=' {
            return Err(Wrong(ix));
        }
        bits = bits << 6 | u32::from(digit);
        n_digits += 1;
        if n_digits == 4 {
            let [_, bytes @ ..] = bits.to_be_bytes();
            out.extend_from_slice(&bytes[..3 - n_padding]);
            (bits, n_digits, n_padding) = (0, 0, 0);
        }
    }
    // Some writers omit the padding at the very end; one digit alone holds no byte.
    if out.len() < most && n_digits > 0 {
        let n_bytes = (n_digits - n_padding).saturating_sub(1);
        if n_bytes == 0 {
            return Err(Wrong(text.len()));
        }
        let [_, bytes @ ..] = (bits << (6 * (4 - n_digits))).to_be_bytes();
        out.extend_from_slice(&bytes[..n_bytes]);
    }
    out.truncate(most);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decodes_the_vectors_of_the_rfc() {
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmFy", "foobar"),
            ("Zm8", "fo"),
        ] {
            assert_eq!(
                decode(text.as_bytes(), 99).unwrap(),
                bytes.as_bytes(),
                "{text}"
            );
        }
    }

    #[test]
    fn goes_on_behind_padding_and_stops_when_told() {
        assert_eq!(decode(b"Zg== Zm\n9v", 99).unwrap(), b"ffoo");
        assert_eq!(decode(b"Zm9vYmFy", 4).unwrap(), b"foob");
        assert_eq!(decode(b"Zm9v!!!!", 3).unwrap(), b"foo");
        assert_eq!(decode(b"Zm9v!", 4), Err(Wrong(4)));
        for text in ["Z", "=", "Z=", "Zg=v", "Zg=!"] {
            assert!(decode(text.as_bytes(), 99).is_err(), "{text}");
        }
    }
}
