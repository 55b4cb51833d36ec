//! What no reader accepts, whatever the format: text in UTF-16, and pointers of Git LFS.

use crate::error::{Error, Name, Place};
use crate::format::Format;
use crate::formats::stl;

/// Refuses text in UTF-16, which some editors and shells write, with an error that says so.
///
/// Without a byte order mark, UTF-16 is recognised by a zero in every other byte. Only binary STL
/// can start like that, because its title may be anything; binary STL is recognised by its length.
pub(crate) fn check_encoding(bytes: &[u8], format: Format, name: Name) -> Result<(), Error> {
    if bytes.starts_with(b"version https://git-lfs.github.com/spec/") {
        let what = "a pointer of Git LFS in place of the mesh (git lfs pull fetches it)";
        return Err(name.unsupported(Place::File, what));
    }
    let is_utf16 = match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => true,
        &[a, 0, b, 0, ..] | &[0, a, 0, b, ..] => a != 0 && b != 0 && a.is_ascii() && b.is_ascii(),
        _ => false,
    };
    if is_utf16 && !(format == Format::Stl && stl::is_binary(bytes)) {
        return Err(name.unsupported(Place::File, "text in UTF-16 (save the file as UTF-8)"));
    }
    Ok(())
}
