//! Read-only view shared by all stages: the scene, its layers, and the cache kept per body.

use std::sync::Arc;

use crate::clusterings::{Clustered, Fit, Store};
use crate::elements::Elements;
use crate::grouping::bounds::Bounds;
use crate::grouping::clusters::Clustering;
use crate::index::{ElementIx, LayerIx, Number, Place};
use crate::plan::{Layer, Plan};
use crate::positions::Positions;
use crate::scene::Scene;
use impinge_exact::Point;

use super::bounds::TreeBounds;
use super::dispatch::Tree;
use super::folds::Folds;
use super::remote::body::Remote;

/// The data kept per body from frame to frame.
#[derive(Debug)]
pub(crate) struct BodyCache {
    /// The stamp of the topology that was clustered.
    pub topology_stamp: u64,
    /// The stamp of the positions that the boxes belong to; 0 for none.
    pub positions_stamp: u64,
    pub clustering: Arc<Clustering>,
    pub bounds: TreeBounds,
    /// The box of all primitives.
    pub whole: Bounds,
    /// The clusters that lie beside all bodies that this one could meet; only for bodies that are large enough.
    pub remote: Option<Box<Remote>>,
    /// The triangles that may meet a neighbour; found under `SharedVertex::Resolve` only.
    pub folds: Option<Box<Folds>>,
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
}

/// Caches by slot of the body.
pub(crate) type Caches = Store<BodyCache>;

/// The data that the narrow stage reads, for every method.
#[derive(Clone, Copy)]
pub struct World<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// The layers.
    pub frame: &'a Plan,
    /// `Clusters` only: places of primitives are places in the clusters' orders.
    pub(crate) caches: Option<&'a Caches>,
}

/// One layer's data. A *place* names a primitive: in the order of the clusters if there
/// are any, else as the body numbers it.
#[derive(Clone, Copy)]
pub struct BodyRef<'a> {
    /// The layer.
    pub layer: &'a Layer,
    /// The positions of its vertices.
    pub positions: &'a Positions,
    /// The corners at each place.
    pub elements: &'a Elements,
    order: Option<&'a [ElementIx]>,
}

impl<'a> World<'a> {
    /// A view in which places are the bodies' own numbers of primitives.
    pub fn new(scene: &'a Scene, frame: &'a Plan) -> Self {
        World {
            scene,
            frame,
            caches: None,
        }
    }

    /// Looks up a layer.
    #[inline(always)]
    pub fn body(&self, layer_ix: LayerIx) -> BodyRef<'a> {
        let layer = self.frame.layer(layer_ix);
        let body = self.scene.body_in(layer.id.slot());
        let clustering = self.caches.map(|_| &self.cache(layer_ix).clustering);
        BodyRef {
            layer,
            positions: body.positions(),
            elements: clustering.map_or(body.elements(), |clustering| &clustering.corners),
            order: clustering.map(|clustering| &clustering.order[..]),
        }
    }

    /// `Clusters` only: the cache of a layer.
    #[inline(always)]
    pub(crate) fn cache(&self, layer: LayerIx) -> &'a BodyCache {
        self.caches
            .expect("by the method `Clusters` only")
            .at(self.frame.layer(layer))
    }
}

impl BodyCache {
    #[inline(always)]
    pub fn tree(&self) -> Tree<'_> {
        Tree {
            shape: &self.clustering.shape,
            bounds: &self.bounds,
        }
    }
}

impl<'a> BodyRef<'a> {
    /// The global number of the primitive at a place.
    #[inline(always)]
    pub fn global(&self, place: Place) -> Number {
        self.layer.number(match self.order {
            Some(order) => order[place.index()],
            None => ElementIx::new(place.raw()),
        })
    }

    /// The vertex ids of the primitive at a place.
    #[inline(always)]
    pub fn corners(&self, place: Place) -> &'a [u32] {
        self.elements.corners(place.index())
    }

    /// The corners at a place in double precision; an element with fewer than four repeats its last.
    #[inline(always)]
    pub fn points(&self, place: Place) -> [Point; 4] {
        let corners = self.elements.four_corners(place.index());
        corners.map(|corner| self.positions.point(corner as usize))
    }
}
