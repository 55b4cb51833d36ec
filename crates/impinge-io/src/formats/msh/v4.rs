//! Version 4.1: nodes and elements in blocks, one block per entity of the geometry.

use super::{File, MOST_NODES, Nodes, RawNodes, put, shape, text_tags};
use crate::binary::{Cursor, Scalar};
use crate::collect::Collector;
use crate::error::{Error, Place};

/// The source of a section's numbers; both storages have the same numbers in the same order.
enum Numbers<'a> {
    Text,
    Binary(Cursor<'a>),
}

impl<'a> Numbers<'a> {
    fn new(file: &mut File<'a>) -> Self {
        match file.binary {
            None => Numbers::Text,
            Some(endian) => {
                file.text.line();
                Numbers::Binary(file.cursor(endian))
            }
        }
    }

    fn place(&self, file: &File) -> Place {
        match self {
            Numbers::Text => file.text.place(),
            Numbers::Binary(cursor) => cursor.place(),
        }
    }

    /// An `int`.
    fn int(&mut self, file: &mut File, what: &str) -> Result<i64, Error> {
        match self {
            Numbers::Text => file.text.number(what),
            Numbers::Binary(cursor) => cursor.integer(Scalar::I32, what),
        }
    }

    /// A `size_t`.
    fn size(&mut self, file: &mut File, what: &str) -> Result<u64, Error> {
        match self {
            Numbers::Text => file.text.number(what),
            Numbers::Binary(cursor) => cursor.count(file.size, what),
        }
    }

    /// Reads the header of a section: returns the number of blocks and the total number of nodes or
    /// elements, and skips the least and the greatest tag.
    fn header(&mut self, file: &mut File) -> Result<(u64, u64), Error> {
        let n_blocks = self.size(file, "the number of blocks")?;
        let n = self.size(file, "the number in all")?;
        self.size(file, "the least tag")?;
        self.size(file, "the greatest tag")?;
        Ok((n_blocks, n))
    }

    fn finish(self, file: &mut File) {
        if let Numbers::Binary(cursor) = self {
            file.advance(&cursor);
        }
    }
}

pub(super) fn nodes(file: &mut File) -> Result<RawNodes, Error> {
    let name = file.name;
    let mut numbers = Numbers::new(file);
    let place = numbers.place(file);
    let (n_blocks, n) = numbers.header(file)?;
    let mut nodes = RawNodes::with_capacity(place, n, file.text.room(8));
    for _ in 0..n_blocks {
        let dimension = numbers.int(file, "the dimension of an entity")?;
        numbers.int(file, "the tag of an entity")?;
        let is_parametric = numbers.int(file, "0 or 1 (parametric)")? != 0;
        let place = numbers.place(file);
        let extra = match (is_parametric, dimension) {
            (false, _) => 0,
            (true, 0..=3) => dimension as usize,
            _ => {
                return Err(name.syntax(
                    place,
                    "the dimension of an entity, 0 to 3",
                    dimension.to_string(),
                ));
            }
        };
        let n_block = numbers.size(file, "the number of nodes in a block")?;
        match &mut numbers {
            Numbers::Text => {
                for _ in 0..n_block {
                    nodes.tags.push(file.text.number("a node tag")?);
                }
                for _ in 0..n_block {
                    let position = [
                        file.text.number("x")?,
                        file.text.number("y")?,
                        file.text.number("z")?,
                    ];
                    nodes.push_position(name, file.text.place(), position)?;
                    for _ in 0..extra {
                        file.text.need_word("a parametric coordinate")?;
                    }
                }
            }
            Numbers::Binary(cursor) => {
                let (size, endian) = (file.size, cursor.endian);
                let tags = cursor.take(n_block, size.size(), "the tags of nodes")?;
                nodes.tags.extend(
                    tags.chunks_exact(size.size())
                        .map(|bytes| size.integer(bytes, endian)),
                );
                let record = 8 * (3 + extra);
                let start = cursor.offset();
                let records = cursor.take(n_block, record, "the positions of nodes")?;
                for (ix, bytes) in records.chunks_exact(record).enumerate() {
                    let position = [0, 8, 16].map(|at| Scalar::F64.float(&bytes[at..], endian));
                    nodes.push_position(
                        name,
                        Place::Byte((start + ix * record) as u64),
                        position,
                    )?;
                }
            }
        }
    }
    if nodes.tags.len() as u64 != n {
        return Err(name.count(place, "nodes", n, nodes.tags.len() as u64));
    }
    numbers.finish(file);
    Ok(nodes)
}

pub(super) fn elements(file: &mut File, nodes: &Nodes, parts: &mut Collector) -> Result<(), Error> {
    let name = file.name;
    let mut numbers = Numbers::new(file);
    let place = numbers.place(file);
    let (n_blocks, n) = numbers.header(file)?;
    let mut n_read = 0u64;
    let mut tags = [0; MOST_NODES];
    for _ in 0..n_blocks {
        numbers.int(file, "the dimension of an entity")?;
        numbers.int(file, "the tag of an entity")?;
        let place = numbers.place(file);
        let (shape, n_nodes) = shape(name, place, numbers.int(file, "an element type")?)?;
        let n_block = numbers.size(file, "the number of elements in a block")?;
        match &mut numbers {
            Numbers::Text => {
                for _ in 0..n_block {
                    let _tag: u64 = file.text.number("an element's tag")?;
                    let place = file.text.place();
                    let tags = text_tags(file, &mut tags, n_nodes)?;
                    put(parts, nodes, shape, tags, place)?;
                }
            }
            Numbers::Binary(cursor) => {
                let (size, endian) = (file.size, cursor.endian);
                let record = size.size() * (1 + n_nodes);
                let start = cursor.offset();
                let records = cursor.take(n_block, record, "a block of elements")?;
                for (ix, bytes) in records.chunks_exact(record).enumerate() {
                    for (tag, bytes) in tags
                        .iter_mut()
                        .zip(bytes[size.size()..].chunks_exact(size.size()))
                    {
                        *tag = size.integer(bytes, endian);
                    }
                    put(
                        parts,
                        nodes,
                        shape,
                        &tags[..n_nodes],
                        Place::Byte((start + ix * record) as u64),
                    )?;
                }
            }
        }
        n_read = n_read.saturating_add(n_block);
    }
    if n_read != n {
        return Err(name.count(place, "elements", n, n_read));
    }
    numbers.finish(file);
    Ok(())
}
