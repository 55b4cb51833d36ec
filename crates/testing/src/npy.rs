//! Arrays in NumPy's format, version 1.0.

/// The header of a file, and the bytes after it.
///
/// # Panics
/// If it is no such file.
pub fn split(file: &[u8]) -> (&str, &[u8]) {
    assert_eq!(&file[..8], b"\x93NUMPY\x01\x00", "NumPy format 1.0");
    let start = 10 + usize::from(u16::from_le_bytes([file[8], file[9]]));
    let header = std::str::from_utf8(&file[10..start]).expect("header in ASCII");
    (header, &file[start..])
}

/// The numbers of an array in C order, in rows of `K`. Each is of a type such as `<u4`, of `N`
/// bytes.
///
/// # Panics
/// If it is another array.
pub fn rows<T, const K: usize, const N: usize>(
    file: &[u8],
    kind: &str,
    read: impl Fn([u8; N]) -> T,
) -> Vec<[T; K]> {
    let (header, data) = split(file);
    assert!(
        header.contains(&format!("'descr': '{kind}'")) && header.contains("'fortran_order': False"),
        "{header}"
    );
    let (numbers, rest) = data.as_chunks::<N>();
    let (rows, others) = numbers.as_chunks::<K>();
    assert!(rest.is_empty() && others.is_empty(), "{header}");
    rows.iter().map(|row| row.map(&read)).collect()
}
