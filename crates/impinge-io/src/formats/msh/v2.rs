//! Version 2: one line per node, one line per element with its own tags; binary elements come in
//! blocks of one type.

use super::{File, MOST_NODES, Nodes, RawNodes, count_line, put, shape, text_tags};
use crate::binary::Scalar;
use crate::collect::Collector;
use crate::error::Error;

pub(super) fn nodes(file: &mut File) -> Result<RawNodes, Error> {
    let place = file.text.place();
    let n = count_line(file, "the number of nodes")?;
    let name = file.name;
    let Some(endian) = file.binary else {
        let mut nodes = RawNodes::with_capacity(place, n, file.text.room(8));
        for _ in 0..n {
            nodes.tags.push(file.text.number("a node tag")?);
            let place = file.text.place();
            let position = [
                file.text.number("x")?,
                file.text.number("y")?,
                file.text.number("z")?,
            ];
            nodes.push_position(name, place, position)?;
        }
        return Ok(nodes);
    };
    const RECORD: usize = 4 + 3 * 8;
    let mut cursor = file.cursor(endian);
    let place = cursor.place();
    let records = cursor.take(n, RECORD, "the nodes")?;
    let mut nodes = RawNodes::with_capacity(place, n, n);
    for record in records.chunks_exact(RECORD) {
        nodes.tags.push(Scalar::I32.integer(record, endian));
        let position = [4, 12, 20].map(|at| Scalar::F64.float(&record[at..], endian));
        nodes.push_position(name, place, position)?;
    }
    file.advance(&cursor);
    Ok(nodes)
}

pub(super) fn elements(file: &mut File, nodes: &Nodes, parts: &mut Collector) -> Result<(), Error> {
    let n = count_line(file, "the number of elements")?;
    let name = file.name;
    let mut tags = [0; MOST_NODES];
    let Some(endian) = file.binary else {
        for _ in 0..n {
            let _number: u64 = file.text.number("an element's number")?;
            let place = file.text.place();
            let (shape, n_nodes) = shape(name, place, file.text.number("an element type")?)?;
            let n_tags: u64 = file.text.number("the number of tags")?;
            for _ in 0..n_tags {
                file.text.need_word("a tag")?;
            }
            let tags = text_tags(file, &mut tags, n_nodes)?;
            put(parts, nodes, shape, tags, place)?;
        }
        return Ok(());
    };
    let mut cursor = file.cursor(endian);
    let mut n_read = 0u64;
    while n_read < n {
        let place = cursor.place();
        let (shape, n_nodes) = shape(name, place, cursor.integer(Scalar::I32, "an element type")?)?;
        let n_block = cursor.count(Scalar::I32, "the number of elements in a block")?;
        let n_tags = cursor.count(Scalar::I32, "the number of tags")?;
        // A count of at most 2^31 and a handful of nodes: far from overflow.
        let before = 4 * (1 + n_tags as usize);
        let record = before + 4 * n_nodes;
        let start = cursor.offset();
        let block = cursor.take(n_block, record, "a block of elements")?;
        for (ix, bytes) in block.chunks_exact(record).enumerate() {
            for (tag, bytes) in tags.iter_mut().zip(bytes[before..].chunks_exact(4)) {
                *tag = Scalar::I32.integer(bytes, endian);
            }
            put(
                parts,
                nodes,
                shape,
                &tags[..n_nodes],
                crate::Place::Byte((start + ix * record) as u64),
            )?;
        }
        n_read += n_block;
        if n_read > n {
            return Err(name.count(place, "elements", n, n_read));
        }
    }
    file.advance(&cursor);
    Ok(())
}
