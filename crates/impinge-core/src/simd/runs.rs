//! Runs of sixteen vertices as they lie in memory: 48 coordinates, interleaved x, y, z, and which
//! of them belong to a group.
//!
//! `extents` turns the results into boxes and intervals; each instruction set has its own kernel.

use crate::bvh::bounds::{greater, lesser};

/// Vertices per run: they are read together.
pub(crate) const RUN: usize = 16;
/// Coordinates per run.
pub(crate) const COORDINATES: usize = 3 * RUN;
/// Coordinates in a row of members: the bits of a u16.
pub(crate) const ROW: usize = u16::BITS as usize;

/// Which coordinates of a run belong to a group: the x of vertices in groups that lie beside others
/// along x, and likewise for y and z. One bit per coordinate, in rows: first those of the groups
/// below, then above. A vertex of several clusters may be in several groups.
pub(crate) type Members = [[u16; COORDINATES / ROW]; 2];

/// The results of a kernel, one per coordinate of a run.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct RunExtents {
    pub min: [f32; COORDINATES],
    pub max: [f32; COORDINATES],
    pub sum: [f32; COORDINATES],
    pub group_min: [[f32; COORDINATES]; 2],
    pub group_max: [[f32; COORDINATES]; 2],
}

impl RunExtents {
    pub const EMPTY: RunExtents = RunExtents {
        min: [f32::INFINITY; COORDINATES],
        max: [f32::NEG_INFINITY; COORDINATES],
        sum: [0.0; COORDINATES],
        group_min: [[f32::INFINITY; COORDINATES]; 2],
        group_max: [[f32::NEG_INFINITY; COORDINATES]; 2],
    };
}

/// Adds runs with their members, one coordinate after the other.
#[inline(always)]
pub(crate) fn add_runs(runs: &[[[f32; 3]; RUN]], members: &[Members], into: &mut RunExtents) {
    for (run, members) in runs.iter().zip(members) {
        for (k, &x) in run.as_flattened().iter().enumerate() {
            into.min[k] = lesser(x, into.min[k]);
            into.max[k] = greater(x, into.max[k]);
            into.sum[k] += x;
            for (end, members) in members.iter().enumerate() {
                if members[k / ROW] >> (k % ROW) & 1 == 1 {
                    into.group_min[end][k] = lesser(x, into.group_min[end][k]);
                    into.group_max[end][k] = greater(x, into.group_max[end][k]);
                }
            }
        }
    }
}
