//! The paper's own numbers, each with its table.
//!
//! Source: "Real-time Collision Detection with Two-level Spatial Hashing on GPU", section 4.
//! Figures 5 and 7 contain no numbers; one point of figure 7 is known from table 3.

use serde::Serialize;

/// The paper's machine (section 4.1).
pub const MACHINE: &str = "Intel i7 CPU at 3.2 GHz, 16 GB RAM, NVIDIA GeForce GTX 680, CUDA 5.0";

/// The paper's graphics card, in short.
pub const GPU: &str = "GTX 680";

/// λ of the two-level method (section 4.1).
pub const LAMBDA: f64 = 1.0;

/// λ of \[FWZS11\] "for their best performance" (section 4.1).
pub const LAMBDA_FWZS11: f64 = 5.0;

/// "The average time of our method … is more than twice as fast" as \[FWZS11\] (section 4.1).
pub const CLAIMED_SPEED_UP: f64 = 2.0;

/// A row of table 1: surfaces, two copies of each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Surface {
    /// Triangles of one copy, in thousands as printed.
    pub n_triangles: u64,
    /// "#Cells": resolution of the first level.
    pub n_cells: u64,
    /// "#Sub": cells that went through the second level.
    pub n_subdivided: u64,
    /// "#CT": average number of colliding triangles.
    pub n_colliding: u64,
    /// Average time in milliseconds.
    pub ms: f64,
}

/// A row of table 2: solids, two copies of each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Volume {
    /// Tetrahedra of one copy.
    pub n_tetrahedra: u64,
    /// "#Cells": resolution of the first level.
    pub n_cells: u64,
    /// "#Sub": cells that went through the second level.
    pub n_subdivided: u64,
    /// "#CT": average number of colliding tetrahedra.
    pub n_colliding: u64,
    /// Average time in milliseconds.
    pub ms: f64,
}

/// A row of table 3: pairs that meet in several cells, and the DJB2 table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Duplicates {
    /// "#Time (without hash)" in milliseconds.
    pub ms_without: f64,
    /// "#Time (with hash)" in milliseconds.
    pub ms_with: f64,
    /// "#CT (without hash)".
    pub n_colliding_without: u64,
    /// "#CT (with hash)".
    pub n_colliding_with: u64,
    /// "#Missing rate": missing collisions divided by colliding elements.
    pub missing_rate: f64,
    /// "#MCT": share of pairs that are checked more than once.
    pub share_repeated: f64,
    /// "#Checking times": how often, on average.
    pub times_checked: f64,
}

/// Table 1 by the scene's name.
pub fn surface(scene: &str) -> Option<Surface> {
    let (n_triangles, n_cells, n_subdivided, n_colliding, ms) = match scene {
        "ball" => (15_000, 8_450, 422, 355, 2.77),
        "bunny" => (69_000, 40_068, 1_014, 1_202, 3.66),
        "buddha" => (100_000, 189_000, 7_284, 2_152, 5.17),
        "dragon" => (400_000, 229_900, 4_290, 3_571, 8.31),
        _ => return None,
    };
    Some(Surface {
        n_triangles,
        n_cells,
        n_subdivided,
        n_colliding,
        ms,
    })
}

/// Table 2 by the scene's name.
pub fn volume(scene: &str) -> Option<Volume> {
    let (n_tetrahedra, n_cells, n_subdivided, n_colliding, ms) = match scene {
        "bunny-7k" => (8_022, 647, 469, 2_452, 7.61),
        "bunny-19k" => (19_095, 1_741, 649, 4_645, 9.67),
        "dragon-8k" => (8_265, 676, 277, 1_063, 6.31),
        "dragon-15k" => (14_922, 1_316, 337, 1_793, 7.27),
        _ => return None,
    };
    Some(Volume {
        n_tetrahedra,
        n_cells,
        n_subdivided,
        n_colliding,
        ms,
    })
}

/// Table 3 by the scene's name.
pub fn duplicates(scene: &str) -> Option<Duplicates> {
    let (ms, n_colliding, missing_rate, share_repeated, times_checked) = match scene {
        "ball" => ([2.77, 2.43], [355, 345], 0.027, 0.83, 3.51),
        "bunny" => ([3.66, 3.53], [1_202, 1_158], 0.037, 0.63, 2.11),
        "buddha" => ([5.17, 4.42], [2_152, 2_060], 0.043, 0.72, 3.72),
        "dragon" => ([8.31, 8.09], [3_571, 3_452], 0.033, 0.62, 2.31),
        _ => return None,
    };
    Some(Duplicates {
        ms_without: ms[0],
        ms_with: ms[1],
        n_colliding_without: n_colliding[0],
        n_colliding_with: n_colliding[1],
        missing_rate,
        share_repeated,
        times_checked,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tables are consistent with each other, which finds typing errors.
    #[test]
    fn tables_agree_with_each_other() {
        for scene in ["ball", "bunny", "buddha", "dragon"] {
            let (table_1, table_3) = (surface(scene).unwrap(), duplicates(scene).unwrap());
            assert_eq!(table_1.ms, table_3.ms_without);
            assert_eq!(table_1.n_colliding, table_3.n_colliding_without);
            // The missing rate follows from the two counts, up to rounding.
            let missing =
                1.0 - table_3.n_colliding_with as f64 / table_3.n_colliding_without as f64;
            assert!((missing - table_3.missing_rate).abs() < 0.0015, "{scene}");
        }
        assert!(surface("blocks").is_none() && volume("bunny").is_none());
    }
}
