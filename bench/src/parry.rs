//! parry3d as a peer: its `Bvh` over elements, refitted each frame, its traversals, and the plain
//! pair test. parry has no self-collision and no triangle-pair query for meshes, but it offers
//! these parts; [`tuned`] tries several ways to combine them.

use std::fmt;
use std::time::Instant;

use impinge::Elements;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhLeafUpdateStatus, BvhNode, BvhWorkspace};
use rayon::prelude::*;

use crate::Failure;
use crate::plain::Corners;
use crate::problem::{Ask, Problem};
use crate::runner::{Answer, Runner};
use crate::tune;

/// One way to run parry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    strategy: BvhBuildStrategy,
    refit: Refit,
    /// Whether candidates are collected and tested in parallel, or tested one by one as they come.
    parallel_test: bool,
    /// For many bodies: whether to use a tree over bodies, with all box pairs of two bodies that
    /// meet, or a tree over elements.
    over_bodies: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Refit {
    /// Leaves one by one, then `refit_without_opt`; several trees at once.
    InPlace,
    /// The same with `refit`, which also reorders nodes.
    Reordered,
    /// Leaves and tree with rayon, one tree after the other.
    Parallel,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let refit = match self.refit {
            Refit::InPlace => "refit in place",
            Refit::Reordered => "refit reordered",
            Refit::Parallel => "refit in parallel",
        };
        let test = if self.parallel_test {
            "parallel"
        } else {
            "serial"
        };
        let over = if self.over_bodies {
            ", tree over bodies"
        } else {
            ""
        };
        write!(f, "{:?} build, {refit}, {test} tests{over}", self.strategy)
    }
}

/// parry with a setting, or with the one that is fastest on this problem.
pub fn tuned(
    problem: &Problem,
    setting: Option<Setting>,
) -> Result<(Box<dyn Runner>, Setting), Failure> {
    let build = |setting: &Setting| -> Result<Box<dyn Runner>, Failure> {
        match problem.bodies.first().map(|body| &*body.elements) {
            Some(Elements::Tetrahedra(_)) => {
                Ok(Box::new(Parry::<[[f64; 3]; 4]>::new(problem, *setting)?))
            }
            _ => Ok(Box::new(Parry::<[[f64; 3]; 3]>::new(problem, *setting)?)),
        }
    };
    let mut settings = Vec::new();
    for strategy in [BvhBuildStrategy::Binned, BvhBuildStrategy::Ploc] {
        for refit in [Refit::InPlace, Refit::Reordered, Refit::Parallel] {
            for parallel_test in [false, true] {
                for over_bodies in [false, true] {
                    if over_bodies && problem.ask != Ask::All {
                        continue;
                    }
                    settings.push(Setting {
                        strategy,
                        refit,
                        parallel_test,
                        over_bodies,
                    });
                }
            }
        }
    }
    if let Some(setting) = setting {
        settings = vec![setting];
    }
    tune::fastest(problem, &settings, build)
}

/// The elements of one tree: a body, or all bodies.
struct Side {
    positions: Vec<[f32; 3]>,
    /// Corner indices, `P::N` per element.
    corners: Vec<u32>,
    owners: Vec<u32>,
    /// The first element of each body, and one past the last.
    starts: Vec<usize>,
    /// The first vertex of each body, and one past the last.
    vertex_starts: Vec<usize>,
    /// The boxes of the leaves in this frame, if leaves are bodies.
    body_boxes: Vec<Aabb>,
    bvh: Bvh,
    workspace: BvhWorkspace,
    updates: Vec<(Aabb, u32, f32)>,
    statuses: Vec<BvhLeafUpdateStatus>,
}

fn aabb(points: impl Iterator<Item = [f32; 3]>) -> Aabb {
    let (mut min, mut max) = (
        Vector::splat(f32::INFINITY),
        Vector::splat(f32::NEG_INFINITY),
    );
    for p in points {
        min = min.min(Vector::from(p));
        max = max.max(Vector::from(p));
    }
    Aabb::new(min, max)
}

impl Side {
    fn new<P: Corners>(
        problem: &Problem,
        bodies: &[usize],
        setting: Setting,
    ) -> Result<Self, Failure> {
        let mut side = Side {
            positions: Vec::new(),
            corners: Vec::new(),
            owners: Vec::new(),
            starts: vec![0],
            vertex_starts: vec![0],
            body_boxes: Vec::new(),
            bvh: Bvh::new(),
            workspace: BvhWorkspace::default(),
            updates: Vec::new(),
            statuses: Vec::new(),
        };
        for &body_ix in bodies {
            let body = &problem.bodies[body_ix];
            let first = u32::try_from(side.positions.len())?;
            side.positions.extend(&body.poses[0]);
            for element in 0..body.elements.len() {
                let corners = body.elements.corners(element);
                if corners.len() != P::N {
                    return Err("bodies of different kinds in one problem".into());
                }
                side.corners
                    .extend(corners.iter().map(|corner| corner + first));
                side.owners.push(u32::try_from(body_ix)?);
            }
            side.starts.push(side.owners.len());
            side.vertex_starts.push(side.positions.len());
        }
        let n_leaves = side.n_leaves(setting.over_bodies);
        let leaves: Vec<Aabb> = (0..n_leaves)
            .map(|leaf| side.leaf_box::<P>(leaf, setting.over_bodies))
            .collect();
        side.bvh = Bvh::from_leaves(setting.strategy, &leaves);
        Ok(side)
    }

    fn n_leaves(&self, over_bodies: bool) -> usize {
        if over_bodies {
            self.starts.len() - 1
        } else {
            self.owners.len()
        }
    }

    #[inline]
    fn element_box<P: Corners>(&self, element: usize) -> Aabb {
        let indices = self.indices::<P>(element);
        aabb(indices.iter().map(|&index| self.positions[index as usize]))
    }

    #[inline]
    fn leaf_box<P: Corners>(&self, leaf: usize, over_bodies: bool) -> Aabb {
        if over_bodies {
            let vertices = self.vertex_starts[leaf]..self.vertex_starts[leaf + 1];
            aabb(self.positions[vertices].iter().copied())
        } else {
            self.element_box::<P>(leaf)
        }
    }

    #[inline(always)]
    fn indices<P: Corners>(&self, element: usize) -> &[u32] {
        &self.corners[element * P::N..][..P::N]
    }

    #[inline(always)]
    fn corners<P: Corners>(&self, element: usize) -> P {
        let indices = self.indices::<P>(element);
        P::from_fn(|k| self.positions[indices[k] as usize].map(f64::from))
    }

    fn refit<P: Corners>(&mut self, setting: Setting) {
        let n_leaves = self.n_leaves(setting.over_bodies);
        if setting.refit == Refit::Parallel {
            let mut updates = std::mem::take(&mut self.updates);
            let side = &*self;
            (0..n_leaves)
                .into_par_iter()
                .with_min_len(1024)
                .map(|leaf| {
                    (
                        side.leaf_box::<P>(leaf, setting.over_bodies),
                        leaf as u32,
                        0.0,
                    )
                })
                .collect_into_vec(&mut updates);
            self.bvh
                .insert_or_update_batch_partially_parallel(&updates, &mut self.statuses);
            self.bvh.refit_parallel(&mut self.workspace);
            if setting.over_bodies {
                self.body_boxes.clear();
                self.body_boxes
                    .extend(updates.iter().map(|(aabb, _, _)| *aabb));
            }
            self.updates = updates;
            return;
        }
        self.body_boxes.clear();
        for leaf in 0..n_leaves {
            let aabb = self.leaf_box::<P>(leaf, setting.over_bodies);
            if setting.over_bodies {
                self.body_boxes.push(aabb);
            }
            self.bvh.insert_or_update_partially(aabb, leaf as u32, 0.0);
        }
        match setting.refit {
            Refit::Reordered => self.bvh.refit(&mut self.workspace),
            _ => self.bvh.refit_without_opt(),
        }
    }
}

/// parry set up for a problem of elements `P`.
struct Parry<P> {
    sides: Vec<Side>,
    layout: Vec<Vec<(usize, usize)>>,
    ask: Ask,
    setting: Setting,
    candidates: Vec<(u32, u32)>,
    hits: Vec<(u32, u32)>,
    elements: std::marker::PhantomData<P>,
}

impl<P: Corners> Parry<P> {
    fn new(problem: &Problem, setting: Setting) -> Result<Self, Failure> {
        let groups: Vec<Vec<usize>> = match problem.ask {
            Ask::Between => vec![vec![0], vec![1]],
            Ask::Within | Ask::Resolved | Ask::All => vec![(0..problem.bodies.len()).collect()],
        };
        let mut sides = Vec::new();
        let mut layout = Vec::new();
        for group in &groups {
            sides.push(Side::new::<P>(problem, group, setting)?);
            let mut first = 0;
            layout.push(
                group
                    .iter()
                    .map(|&body_ix| {
                        let start = first;
                        first += problem.bodies[body_ix].poses[0].len();
                        (body_ix, start)
                    })
                    .collect(),
            );
        }
        Ok(Parry {
            sides,
            layout,
            ask: problem.ask,
            setting,
            candidates: Vec::new(),
            hits: Vec::new(),
            elements: std::marker::PhantomData,
        })
    }

    fn run(&mut self) {
        let setting = self.setting;
        match (&mut self.sides[..], setting.refit) {
            ([a, b], Refit::InPlace | Refit::Reordered) => {
                rayon::join(|| a.refit::<P>(setting), || b.refit::<P>(setting));
            }
            (sides, _) => sides.iter_mut().for_each(|side| side.refit::<P>(setting)),
        }
        self.hits.clear();
        self.candidates.clear();
        let ask = self.ask;
        if let [a, b] = &self.sides[..] {
            let pairs = a
                .bvh
                .leaf_pairs(&b.bvh, |x: &BvhNode, y: &BvhNode| x.intersects(y));
            if setting.parallel_test {
                self.candidates.extend(pairs);
            } else {
                let meet = |&(i, j): &(u32, u32)| {
                    a.corners::<P>(i as usize).meet(&b.corners::<P>(j as usize))
                };
                self.hits.extend(pairs.filter(meet));
            }
        } else {
            let side = &mut self.sides[0];
            let mut workspace = std::mem::take(&mut side.workspace);
            let side = &self.sides[0];
            let (candidates, hits) = (&mut self.candidates, &mut self.hits);
            if setting.refit == Refit::Parallel {
                *candidates = side.bvh.traverse_bvtt_single_tree_parallel::<false>();
            } else {
                side.bvh
                    .traverse_bvtt_single_tree::<false>(&mut workspace, &mut |i, j| {
                        if setting.parallel_test {
                            candidates.push((i, j));
                        } else {
                            test::<P>(side, side, ask, setting.over_bodies, (i, j), hits);
                        }
                    });
            }
            self.sides[0].workspace = workspace;
        }
        let a = &self.sides[0];
        let b = &self.sides[self.sides.len() - 1];
        if setting.parallel_test {
            let parts: Vec<Vec<(u32, u32)>> = self
                .candidates
                .par_chunks(2048)
                .map(|chunk| {
                    let mut hits = Vec::new();
                    for &pair in chunk {
                        test::<P>(a, b, ask, setting.over_bodies, pair, &mut hits);
                    }
                    hits
                })
                .collect();
            self.hits.extend(parts.into_iter().flatten());
        } else {
            // Empty unless a parallel traversal collected candidates.
            for &pair in &self.candidates {
                test::<P>(a, b, ask, setting.over_bodies, pair, &mut self.hits);
            }
        }
    }
}

/// Tests one pair of leaves, which are elements or bodies.
#[inline]
fn test<P: Corners>(
    a: &Side,
    b: &Side,
    ask: Ask,
    over_bodies: bool,
    (i, j): (u32, u32),
    hits: &mut Vec<(u32, u32)>,
) {
    if over_bodies {
        let elements =
            |side: &Side, body: u32| side.starts[body as usize]..side.starts[body as usize + 1];
        for p in elements(a, i) {
            let of_p = a.element_box::<P>(p);
            if !of_p.intersects(&b.body_boxes[j as usize]) {
                continue;
            }
            for q in elements(b, j) {
                if of_p.intersects(&b.element_box::<P>(q))
                    && a.corners::<P>(p).meet(&b.corners::<P>(q))
                {
                    hits.push((p as u32, q as u32));
                }
            }
        }
        return;
    }
    let (p, q) = (i as usize, j as usize);
    let asked = match ask {
        Ask::Between => true,
        Ask::All => a.owners[p] != b.owners[q],
        Ask::Within | Ask::Resolved => {
            let of_q = b.indices::<P>(q);
            !a.indices::<P>(p).iter().any(|corner| of_q.contains(corner))
        }
    };
    if asked && a.corners::<P>(p).meet(&b.corners::<P>(q)) {
        hits.push((i, j));
    }
}

impl<P: Corners> Runner for Parry<P> {
    fn name(&self) -> String {
        "parry3d".to_owned()
    }

    fn setting(&self) -> String {
        self.setting.to_string()
    }

    fn load(&mut self, problem: &Problem, pose: usize) -> Result<(), Failure> {
        for (side, layout) in self.sides.iter_mut().zip(&self.layout) {
            for &(body_ix, first) in layout {
                let pose = &problem.bodies[body_ix].poses[pose];
                side.positions[first..first + pose.len()].copy_from_slice(pose);
            }
        }
        Ok(())
    }

    fn frame(&mut self, _verify: bool) -> Result<Answer, Failure> {
        let start = Instant::now();
        self.run();
        Ok(Answer {
            n_pairs: self.hits.len() as u64,
            hash: None,
            ms: start.elapsed().as_secs_f64() * 1e3,
        })
    }
}
