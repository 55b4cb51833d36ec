//! Merges the contacts of a step: numbers their elements, sorts them.

use std::fs;
use std::path::Path;

use impinge::{PairKind, Precision, hash_impact_rows};
use impinge_io::{Cell, Table, TableFormat, impact_columns};

use super::{MergedStep, STEP, each_sorted, open_all};
use crate::disk;
use crate::error::Error;
use crate::npy;
use crate::plan::Plan;
use crate::run::TileResult;
use crate::step::{BOUNDARY, Contact, EDGES, Name, Row, WORDS, checksum};

/// An element that needs a number: body, part, name.
type Named = [u32; 4];

impl Plan {
    /// Writes all contacts to `path`. Returns their hash.
    pub(super) fn merge_step(
        &self,
        results: &[TileResult],
        path: &Path,
    ) -> Result<(u64, MergedStep), Error> {
        let mut contacts = Vec::new();
        for result in results {
            self.read_contacts(result, &mut contacts)?;
        }
        let numbers = self.numbers(results, &contacts)?;
        let mut rows: Vec<Row> = contacts
            .iter()
            .map(|contact| {
                let [(body_a, a), (body_b, b)] = contact.elements;
                let [a, b] = [(0, body_a, a), (1, body_b, b)].map(|(side, body, name)| match self
                    .needs_number(contact.kind, side, body, name)
                {
                    None => name[0],
                    Some(named) => numbers[find(&numbers, &named)].1,
                });
                (contact.kind, [body_a, a, body_b, b], contact.toi)
            })
            .collect();
        rows.sort_unstable_by_key(|&(kind, row, _)| (kind, row));
        // All tiles have answered the same question.
        let toi = results[0].step.map_or(Precision::F32, |step| step.toi);
        let table = Table::new(TableFormat::Npy, impact_columns(toi == Precision::F64));
        disk::replace(path, |to| {
            to.write_all(&table.header(Some(rows.len() as u64)))?;
            rows.iter().try_for_each(|&(kind, row, toi)| {
                table.row(to, &Cell::impact(kind.name(), row, toi))
            })
        })?;
        let first = |a: Row, b: Row| if b.2 < a.2 { b } else { a };
        let of = |kind: PairKind| rows.iter().filter(|row| row.0 == kind).count() as u64;
        let step = MergedStep {
            kinds: [PairKind::VertexFace, PairKind::EdgeEdge].map(|kind| (kind, of(kind))),
            touching_at_start: contacts.iter().filter(|contact| contact.at_start).count() as u64,
            earliest: rows.iter().copied().reduce(first),
        };
        Ok((hash_impact_rows(rows), step))
    }

    fn read_contacts(&self, result: &TileResult, to: &mut Vec<Contact>) -> Result<(), Error> {
        let path = self.rows_path(result.tile);
        let damaged = |what: &str| Error::damaged(&path, what, STEP);
        let bytes = fs::read(&path).map_err(|source| Error::io(&path, "read", source))?;
        let header = npy::parse(&bytes).ok_or_else(|| damaged("its header is invalid"))?;
        let (words, rest) = bytes[header.start as usize..].as_chunks::<4>();
        let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let (rows, more) = words.as_chunks::<WORDS>();
        let n = result.n_pairs;
        if header.descr != "<u4"
            || header.shape != [n, WORDS as u64]
            || (rows.len() as u64, rest.len() + more.len()) != (n, 0)
        {
            return Err(damaged(&format!("not {n} rows")));
        }
        if checksum(rows) != result.hash {
            return Err(damaged("the checksum of its rows differs"));
        }
        for &row in rows {
            to.push(Contact::from_words(row).ok_or_else(|| damaged("a row is no contact"))?);
        }
        Ok(())
    }

    /// An edge, or a boundary face of tetrahedra; other elements are numbered as in their file.
    fn needs_number(&self, kind: PairKind, side: usize, body: u32, name: Name) -> Option<Named> {
        let is_solid = || self.files[body as usize].shape.corners == 4;
        let part = match (kind, side) {
            (PairKind::EdgeEdge, _) => EDGES,
            (PairKind::VertexFace, 1) if is_solid() => BOUNDARY,
            _ => return None,
        };
        Some([body, part, name[0], name[1]])
    }

    /// The elements of the contacts that need numbers, ascending, with their numbers: their places
    /// among the elements of the same part of the same body that all tiles list.
    fn numbers(
        &self,
        results: &[TileResult],
        contacts: &[Contact],
    ) -> Result<Vec<(Named, u32)>, Error> {
        let elements = contacts.iter().flat_map(|contact| {
            let sides = contact.elements.into_iter().enumerate();
            sides.filter_map(|(side, (body, name))| {
                self.needs_number(contact.kind, side, body, name)
            })
        });
        let mut wanted: Vec<Named> = elements.collect();
        wanted.sort_unstable();
        wanted.dedup();
        let mut numbers: Vec<(Named, u32)> = Vec::with_capacity(wanted.len());
        let lists = results.iter().map(|result| {
            let step = result.step.map(|step| (step.n_names, step.names_hash));
            let (n, hash) = step.unwrap_or_default();
            (self.names_path(result.tile), n, hash)
        });
        let mut lists = open_all(lists.collect::<Vec<_>>().into_iter())?;
        let (mut part, mut number) = ([0, 0], 0);
        each_sorted(&mut lists, |_, [body, kind, high, low]| {
            if part != [body, kind] {
                (part, number) = ([body, kind], 0);
            }
            if wanted.get(numbers.len()) == Some(&[body, kind, high, low]) {
                numbers.push(([body, kind, high, low], number));
            }
            number += 1;
            Ok(())
        })?;
        match wanted.get(numbers.len()) {
            None => Ok(numbers),
            Some(lost) => Err(Error::damaged(
                &self.names_path(0),
                format!("no tile lists {lost:?}, which a contact names"),
                STEP,
            )),
        }
    }
}

/// The place of an element that is known to be there.
fn find(numbers: &[(Named, u32)], named: &Named) -> usize {
    numbers.partition_point(|held| held.0 < *named)
}
