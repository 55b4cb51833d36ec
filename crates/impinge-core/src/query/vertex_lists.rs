//! Pairs of vertices whose elements a query leaves out.

use std::sync::{Arc, Mutex, PoisonError};

use crate::scene::elements::VertexRings;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;

/// For each vertex of one body, vertices of another, or of the same.
#[derive(Clone)]
pub(crate) struct VertexLists(Arc<ListsByVertex>);

struct ListsByVertex {
    bodies: [BodyId; 2],
    offsets: Vec<u64>,
    vertices: Vec<u32>,
    /// Sorted, with the numbers of vertices that both bodies had.
    sorted: Mutex<Option<([usize; 2], Arc<VertexRings>)>>,
}

impl PartialEq for VertexLists {
    fn eq(&self, other: &Self) -> bool {
        let (own, other) = (&*self.0, &*other.0);
        own.bodies == other.bodies && own.offsets == other.offsets && own.vertices == other.vertices
    }
}

impl std::fmt::Debug for VertexLists {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("VertexLists");
        short.field("bodies", &self.0.bodies);
        short.field("n_listed", &self.0.vertices.len());
        short.finish_non_exhaustive()
    }
}

impl VertexLists {
    pub fn new(bodies: [BodyId; 2], offsets: Vec<u64>, vertices: Vec<u32>) -> Self {
        VertexLists(Arc::new(ListsByVertex {
            bodies,
            offsets,
            vertices,
            sorted: Mutex::default(),
        }))
    }

    /// The body whose vertices have lists, and that whose vertices are listed.
    pub fn bodies(&self) -> [BodyId; 2] {
        self.0.bodies
    }

    /// The lists of bodies with so many vertices, each sorted; of one body both ways. They are
    /// checked and sorted again only when the numbers of vertices have changed.
    ///
    /// # Errors
    /// Offsets of another number of vertices, or that do not ascend from 0 to the number of listed
    /// vertices; a vertex that does not exist.
    pub fn sorted(&self, n_vertices: [usize; 2]) -> Result<Arc<VertexRings>, Error> {
        let ListsByVertex { bodies, sorted, .. } = &*self.0;
        let mut sorted = sorted.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, lists)) = &*sorted
            && *of == n_vertices
        {
            return Ok(Arc::clone(lists));
        }
        self.check(n_vertices)?;
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for vertex in 0..n_vertices[0] {
            let listed = self.of(vertex).iter();
            pairs.extend(listed.map(|&other| [vertex as u32, other]));
        }
        if bodies[0] == bodies[1] {
            let back: Vec<[u32; 2]> = pairs.iter().map(|&[a, b]| [b, a]).collect();
            pairs.extend(back);
        }
        pairs.sort_unstable();
        pairs.dedup();
        let lists = Arc::new(VertexRings::of_pairs(n_vertices[0], &pairs));
        *sorted = Some((n_vertices, Arc::clone(&lists)));
        Ok(lists)
    }

    fn of(&self, vertex: usize) -> &[u32] {
        let [start, end] = [0, 1].map(|next| self.0.offsets[vertex + next] as usize);
        &self.0.vertices[start..end]
    }

    fn check(&self, n_vertices: [usize; 2]) -> Result<(), Error> {
        let ListsByVertex {
            bodies,
            offsets,
            vertices,
            ..
        } = &*self.0;
        let refused = |given: String| {
            Err(Error::Lists {
                bodies: *bodies,
                given,
            })
        };
        if offsets.len() != n_vertices[0] + 1 {
            return refused(format!(
                "{} offsets, but body {} has {} vertices: one more is needed",
                offsets.len(),
                bodies[0],
                n_vertices[0]
            ));
        }
        if offsets[0] != 0 {
            return refused(format!(
                "{} as the first offset, which must be 0",
                offsets[0]
            ));
        }
        if let Some(ix) = offsets.windows(2).position(|two| two[0] > two[1]) {
            return refused(format!(
                "offset {} after {} at {}, but no offset may be below the one before it",
                offsets[ix + 1],
                offsets[ix],
                ix + 1
            ));
        }
        let last = offsets[n_vertices[0]];
        if last != vertices.len() as u64 {
            return refused(format!(
                "{last} as the last offset, but there are {} listed vertices",
                vertices.len()
            ));
        }
        let missing = vertices.iter().position(|&of| of as usize >= n_vertices[1]);
        match missing {
            None => Ok(()),
            Some(ix) => refused(format!(
                "vertex {} at {ix}, but body {} has {} vertices",
                vertices[ix], bodies[1], n_vertices[1]
            )),
        }
    }
}
