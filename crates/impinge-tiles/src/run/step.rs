//! Runs one tile of a step: finds the first contacts among its surfaces, and keeps those that the
//! tile owns.

use std::ops::Range;

use impinge::{Detector, hash_rows};

use super::ranges::both;
use super::records::Records;
use super::surfaces::SurfaceScene;
use super::{Ask, OfStep, TileResult, refused, write_rows};
use crate::error::Error;
use crate::plan::Plan;
use crate::step::{Contact, checksum};

impl Plan {
    pub(super) fn run_step_tile(
        &self,
        tile: u32,
        records: &Records,
        ask: Ask,
        detector: &mut Detector,
    ) -> Result<TileResult, Error> {
        let refused = refused(tile);
        let is_mine = |point| self.cells.owner(point) == tile;
        let surfaces = records.surfaces().map_err(refused)?;
        let n_faces = surfaces.n_faces();
        let pieces = self.pieces(n_faces);
        let whole: Range<usize> = 0..n_faces;
        let whole = surfaces.scene(&[whole]).map_err(refused)?;
        let names = whole.to_number(is_mine).map_err(refused)?;
        let step = ask
            .query()
            .start(ask.start)
            .precision(ask.precision)
            .separation(self.separation);
        let (mut rows, mut n_elsewhere) = (Vec::new(), 0);
        let mut find = |part: &SurfaceScene<'_>| {
            let impacts = detector.impacts(&part.scene, &step)?;
            for impact in impacts.iter() {
                let (elements, point) = part.named(impact)?;
                if is_mine(point) {
                    let contact = Contact {
                        kind: impact.kind,
                        elements,
                        toi: impact.toi,
                        at_start: impact.at_start,
                    };
                    rows.push(contact.to_words());
                } else {
                    n_elsewhere += 1;
                }
            }
            Ok(())
        };
        if pieces.len() == 1 {
            find(&whole).map_err(refused)?;
        } else {
            drop(whole);
            for (ix, a) in pieces.iter().enumerate() {
                for b in &pieces[ix..] {
                    let part = surfaces.scene(&both(a, b)).map_err(refused)?;
                    find(&part).map_err(refused)?;
                }
            }
            // Two pieces have the pairs within each of them again, and pieces share edges and
            // vertices.
            rows.sort_unstable();
            rows.dedup();
        }
        let result = TileResult {
            tile,
            n_elements: records.len() as u64,
            n_pairs: rows.len() as u64,
            hash: checksum(&rows),
            step: Some(OfStep {
                n_names: names.len() as u64,
                names_hash: hash_rows(names.iter().copied()),
                toi: ask.precision,
            }),
            n_elsewhere,
            n_pieces: pieces.len() as u64,
            was_kept: false,
            ask: ask.name(),
        };
        self.remove_result(tile)?;
        write_rows(&self.rows_path(tile), &rows)?;
        write_rows(&self.names_path(tile), &names)?;
        self.write_result(&result)?;
        Ok(result)
    }
}
