//! The numbers behind an accessor.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::json::{Accessor, Root, index_error};
use crate::base64;
use crate::binary::{Endian, Scalar};
use crate::budget::Budget;
use crate::error::{Error, Name, Place, shown};
use crate::files::{Source, leads_out, outside};
use crate::mesh::Positions;
use crate::options::ReadOptions;

/// The buffers of a file, loaded when they are needed.
pub(super) struct Data<'a, 'r> {
    name: Name<'a>,
    root: &'r Root,
    /// The binary chunk of a GLB.
    binary: Option<&'r [u8]>,
    /// The folder of the files that buffers refer to; `None` if no files may be read.
    folder: Option<&'r Path>,
    buffers: HashMap<usize, Cow<'r, [u8]>>,
    budget: Budget,
    options: &'r ReadOptions,
}

impl<'a, 'r> Data<'a, 'r> {
    pub(super) fn new(
        name: Name<'a>,
        root: &'r Root,
        binary: Option<&'r [u8]>,
        folder: Option<&'r Path>,
        budget: Budget,
        options: &'r ReadOptions,
    ) -> Self {
        Data {
            name,
            root,
            binary,
            folder,
            buffers: HashMap::new(),
            budget,
            options,
        }
    }

    /// Charges `n` elements of `size` bytes to the budget.
    pub(super) fn charge(&mut self, n: u64, size: u64) -> Result<(), Error> {
        self.budget.charge(self.name, Place::File, n, size)
    }

    /// The positions of an accessor: f32 if the file has floats, else f64.
    pub(super) fn positions(&mut self, accessor_ix: usize) -> Result<Positions, Error> {
        let accessor = self.accessor(accessor_ix, "VEC3")?;
        let scalar = component(self.name, accessor.component_type)?;
        if scalar == Scalar::F32 {
            let f32s = self.read(accessor, 3, scalar, |bytes| {
                [0, 4, 8].map(|at| scalar.narrow(&bytes[at..], Endian::Little))
            })?;
            return Ok(Positions::F32(f32s));
        }
        // Integers of KHR_mesh_quantization; normalized ones stand for -1 to 1 or 0 to 1.
        let (size, normalized) = (scalar.size(), accessor.normalized);
        let most = match scalar {
            Scalar::I8 => 127.0,
            Scalar::U8 => 255.0,
            Scalar::I16 => 32767.0,
            _ => 65535.0,
        };
        let f64s = self.read(accessor, 3, scalar, |bytes| {
            [0, 1, 2].map(|axis| {
                let value = scalar.float(&bytes[axis * size..], Endian::Little);
                if normalized {
                    (value / most).max(-1.0)
                } else {
                    value
                }
            })
        })?;
        Ok(Positions::F64(f64s))
    }

    /// The vertex indices of an accessor.
    pub(super) fn indices(&mut self, accessor_ix: usize) -> Result<Vec<i64>, Error> {
        let accessor = self.accessor(accessor_ix, "SCALAR")?;
        let scalar = component(self.name, accessor.component_type)?;
        if !matches!(scalar, Scalar::U8 | Scalar::U16 | Scalar::U32) {
            return Err(self.name.syntax(
                Place::File,
                "unsigned integers as indices",
                format!("component type {}", accessor.component_type),
            ));
        }
        self.read(accessor, 1, scalar, |bytes| {
            scalar.integer(bytes, Endian::Little)
        })
    }

    fn accessor(&self, accessor_ix: usize, kind: &str) -> Result<&'r Accessor, Error> {
        let accessors = &self.root.accessors;
        let accessor = accessors
            .get(accessor_ix)
            .ok_or_else(|| index_error(self.name, "accessors", accessor_ix, accessors.len()))?;
        if accessor.kind != kind {
            return Err(self.name.syntax(
                Place::File,
                format!("the type {kind} of accessor {accessor_ix}"),
                shown(accessor.kind.as_bytes()),
            ));
        }
        Ok(accessor)
    }

    /// All values of an accessor; `value` converts the bytes of one value (`n_components` numbers).
    fn read<T: Clone>(
        &mut self,
        accessor: &Accessor,
        n_components: usize,
        scalar: Scalar,
        value: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Error> {
        let size = n_components * scalar.size();
        let name = self.name;
        self.charge(accessor.count as u64, size_of::<T>() as u64)?;
        let mut values: Vec<T> = match accessor.buffer_view {
            Some(view) => {
                let (bytes, stride) =
                    self.view(view, accessor.byte_offset, accessor.count, size)?;
                // The last value may end before its stride does.
                (0..accessor.count)
                    .map(|ix| value(&bytes[ix * stride..]))
                    .collect()
            }
            // Without a view all values are zero; the budget has been charged.
            None => vec![value(&[0; 24]); accessor.count],
        };
        if let Some(sparse) = &accessor.sparse {
            let index = component(name, sparse.indices.component_type)?;
            self.charge(sparse.count as u64, 8)?;
            let (bytes, stride) = self.view(
                sparse.indices.buffer_view,
                sparse.indices.byte_offset,
                sparse.count,
                index.size(),
            )?;
            let indices: Vec<i64> = (0..sparse.count)
                .map(|ix| index.integer(&bytes[ix * stride..], Endian::Little))
                .collect();
            let (bytes, stride) = self.view(
                sparse.values.buffer_view,
                sparse.values.byte_offset,
                sparse.count,
                size,
            )?;
            for (ix, &target) in indices.iter().enumerate() {
                let n = values.len();
                let slot = usize::try_from(target)
                    .ok()
                    .and_then(|target| values.get_mut(target));
                let slot = slot.ok_or_else(|| {
                    name.syntax(
                        Place::File,
                        format!("a sparse index below {n}"),
                        target.to_string(),
                    )
                })?;
                *slot = value(&bytes[ix * stride..]);
            }
        }
        Ok(values)
    }

    /// The bytes of `n` values of `size` bytes in a view, and the step from one to the next.
    fn view(
        &mut self,
        view_ix: usize,
        offset: usize,
        n: usize,
        size: usize,
    ) -> Result<(&[u8], usize), Error> {
        let (name, root) = (self.name, self.root);
        let view = root
            .buffer_views
            .get(view_ix)
            .ok_or_else(|| index_error(name, "buffer views", view_ix, root.buffer_views.len()))?;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(name.syntax(
                Place::File,
                format!("a stride of buffer view {view_ix} of at least {size}"),
                stride.to_string(),
            ));
        }
        let buffer = self.buffer(view.buffer)?;
        let end = view.byte_offset.saturating_add(view.byte_length);
        let short = |what: String, expected: usize, found: usize| {
            name.truncated(Place::File, what, expected as u64, found as u64)
        };
        let bytes = buffer
            .get(view.byte_offset..end)
            .ok_or_else(|| short(format!("buffer view {view_ix}"), end, buffer.len()))?;
        let needed = if n == 0 {
            0
        } else {
            (n - 1).saturating_mul(stride).saturating_add(size)
        };
        let left = bytes.len().saturating_sub(offset);
        if needed > left {
            return Err(short(
                format!("{n} values in buffer view {view_ix}"),
                needed,
                left,
            ));
        }
        Ok((bytes.get(offset..).unwrap_or_default(), stride))
    }

    fn buffer(&mut self, buffer_ix: usize) -> Result<&[u8], Error> {
        if !self.buffers.contains_key(&buffer_ix) {
            let loaded = self.load(buffer_ix)?;
            self.buffers.insert(buffer_ix, loaded);
        }
        Ok(&self.buffers[&buffer_ix])
    }

    fn load(&mut self, buffer_ix: usize) -> Result<Cow<'r, [u8]>, Error> {
        let (name, root) = (self.name, self.root);
        let buffer = root
            .buffers
            .get(buffer_ix)
            .ok_or_else(|| index_error(name, "buffers", buffer_ix, root.buffers.len()))?;
        let bytes = match &buffer.uri {
            None => Cow::Borrowed(self.binary.ok_or_else(|| {
                name.syntax(
                    Place::File,
                    format!("a URI of buffer {buffer_ix}, or a binary chunk"),
                    "neither",
                )
            })?),
            Some(uri) if uri.starts_with("data:") => {
                let (_, text) = uri.split_once(";base64,").ok_or_else(|| {
                    name.unsupported(
                        Place::File,
                        format!("the data URI of buffer {buffer_ix} (supported: base64)"),
                    )
                })?;
                Cow::Owned(base64::decode(text.as_bytes(), usize::MAX).map_err(
                    |base64::Wrong(ix)| {
                        name.syntax(
                            Place::File,
                            format!("base64 in the URI of buffer {buffer_ix}"),
                            format!("something else at its byte {ix}"),
                        )
                    },
                )?)
            }
            Some(uri) => Cow::Owned(self.load_file(buffer_ix, uri)?),
        };
        if bytes.len() < buffer.byte_length {
            return Err(name.truncated(
                Place::File,
                format!("buffer {buffer_ix}"),
                buffer.byte_length as u64,
                bytes.len() as u64,
            ));
        }
        Ok(bytes)
    }

    /// Reads a buffer from the file that `uri` names, which must lie beside this one.
    fn load_file(&mut self, buffer_ix: usize, uri: &str) -> Result<Vec<u8>, Error> {
        let name = self.name;
        let refused = |why: &str| {
            name.unsupported(
                Place::File,
                format!("buffer {buffer_ix} at {} ({why})", shown(uri.as_bytes())),
            )
        };
        let folder = self.folder.ok_or_else(|| {
            refused("files beside a mesh in memory are not read; a .glb file has its buffers in it")
        })?;
        let relative = unescaped(uri).ok_or_else(|| refused("not a path in UTF-8"))?;
        let relative = Path::new(&relative);
        // A colon ends a scheme, such as `http:`, or a drive's letter.
        if uri.contains(':') || relative.to_string_lossy().contains(':') || leads_out(relative) {
            return Err(outside(Path::new(uri), folder));
        }
        let path = folder.join(relative);
        let source = Source::Beside(&path, folder);
        let (_, length) = source.open()?;
        self.charge(length, 1)?;
        source.read(self.options)
    }
}

fn component(name: Name, component_type: u32) -> Result<Scalar, Error> {
    Ok(match component_type {
        5120 => Scalar::I8,
        5121 => Scalar::U8,
        5122 => Scalar::I16,
        5123 => Scalar::U16,
        5125 => Scalar::U32,
        5126 => Scalar::F32,
        other => {
            return Err(name.syntax(
                Place::File,
                "a component type, 5120 to 5126",
                other.to_string(),
            ));
        }
    })
}

/// A URI without its percent escapes.
fn unescaped(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, behind)) = rest.split_first() {
        rest = behind;
        if byte == b'%' {
            let digits = std::str::from_utf8(rest.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &rest[2..];
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}
