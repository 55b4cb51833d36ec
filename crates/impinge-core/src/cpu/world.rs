//! Read-only view shared by all stages: the scene, its parts, and the cache kept per body.

use std::sync::Arc;

use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
use crate::clusterings::{Clustered, Fit, Store};
use crate::plan::{Plan, QueryPart};
use crate::scene::Scene;
use crate::scene::elements::Elements;
use crate::scene::index::{ElementIx, Number, PartIx, Slot};
use crate::scene::positions::Positions;
use crate::scene::words::debug_by_name;
use impinge_exact::Point;

use super::bounds::TreeBounds;
use super::creases::Creases;
use super::culled::body::Culled;
use super::traversal::BodyTree;

/// The data kept per body from frame to frame.
#[derive(Debug)]
pub(crate) struct BodyCache {
    /// The stamp of the topology that was clustered.
    pub topology_stamp: u64,
    /// The stamp of the positions that the boxes belong to; 0 for none.
    pub positions_stamp: u64,
    pub clustering: Arc<Clustering>,
    pub bounds: TreeBounds,
    /// The box of all elements.
    pub whole: Aabb,
    /// The clusters that lie beside all bodies that this one could meet; only for bodies that are
    /// large enough.
    pub culled: Option<Box<Culled>>,
    /// The triangles that may meet a neighbour; found under `SharedVertex::Resolve` only.
    pub creases: Option<Box<Creases>>,
    /// Half the summed surface of the clusters.
    pub surface: f64,
    /// How well the clusters have fitted the body.
    pub fit: Fit,
}

impl Clustered for BodyCache {
    fn topology_stamp(&self) -> u64 {
        self.topology_stamp
    }

    fn clustering(&self) -> &Arc<Clustering> {
        &self.clustering
    }

    fn bytes(&self) -> usize {
        let culled = self.culled.as_ref().map_or(0, |culled| culled.bytes());
        let creases = self.creases.as_ref().map_or(0, |creases| creases.bytes());
        size_of::<BodyCache>() + self.bounds.bytes() + culled + creases
    }
}

/// Caches by slot of the body.
pub(crate) type Caches = Store<BodyCache>;

debug_by_name!(World<'_> => "World", BodyRef<'_> => "BodyRef");

/// The data that the narrow stage reads, for every method.
#[derive(Clone, Copy)]
pub struct World<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// The parts.
    pub plan: &'a Plan,
    /// `Clusters` only: slots of elements are slots in the clusters' orders.
    pub(crate) caches: Option<&'a Caches>,
}

/// One part's data. A *slot* names an element: in the order of the clusters if there
/// are any, else as the body numbers it.
#[derive(Clone, Copy)]
pub struct BodyRef<'a> {
    /// The part.
    pub part: &'a QueryPart,
    /// The positions of its vertices.
    pub positions: &'a Positions,
    /// The corners at each slot.
    pub elements: &'a Elements,
    order: Option<&'a [ElementIx]>,
}

impl<'a> World<'a> {
    /// A view in which slots are the bodies' own numbers of elements.
    pub fn new(scene: &'a Scene, plan: &'a Plan) -> Self {
        World {
            scene,
            plan,
            caches: None,
        }
    }

    /// Looks up a part.
    #[inline(always)]
    pub fn body(&self, part_ix: PartIx) -> BodyRef<'a> {
        let part = self.plan.part(part_ix);
        let body = self.scene.body_in(part.id.slot());
        let clustering = self.caches.map(|_| &self.cache(part_ix).clustering);
        BodyRef {
            part,
            positions: body.positions(),
            elements: clustering.map_or(body.elements(), |clustering| &clustering.corners),
            order: clustering.map(|clustering| &clustering.order[..]),
        }
    }

    /// `Clusters` only: the cache of a part.
    #[inline(always)]
    pub(crate) fn cache(&self, part: PartIx) -> &'a BodyCache {
        self.caches
            .expect("by the method `Clusters` only")
            .at(self.plan.part(part))
    }
}

impl BodyCache {
    #[inline(always)]
    pub fn tree(&self) -> BodyTree<'_> {
        BodyTree {
            shape: &self.clustering.shape,
            bounds: &self.bounds,
        }
    }
}

impl<'a> BodyRef<'a> {
    /// The global number of the element at a slot.
    #[inline(always)]
    pub fn global(&self, slot: Slot) -> Number {
        self.part.number(match self.order {
            Some(order) => order[slot.index()],
            None => ElementIx::new(slot.raw()),
        })
    }

    /// The vertex ids of the element at a slot.
    #[inline(always)]
    pub fn corners(&self, slot: Slot) -> &'a [u32] {
        self.elements.corners(slot.index())
    }

    /// The corners at a slot in double precision; an element with fewer than four repeats its last.
    #[inline(always)]
    pub fn points(&self, slot: Slot) -> [Point; 4] {
        let corners = self.elements.four_corners(slot.index());
        corners.map(|corner| self.positions.point(corner as usize))
    }
}
