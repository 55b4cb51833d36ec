//! Details that the paper does not give, and our guesses.

use super::heading;
use crate::document::Block;
use crate::report::Report;

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let waving = &report.waving;
    let stand_ins: Vec<&str> = report
        .surfaces
        .iter()
        .chain(&report.volumes)
        .filter(|scene| scene.is_stand_in)
        .map(|scene| scene.name.as_str())
        .collect();
    let mut points = vec![
        format!(
            "**Waving.** The paper only says \"the waving effect\". Here it is p + a d sin(2π (p·x − s t) / l) with d along z, \
             amplitude a = {}, wave length l = {}, crests that travel s = {} in the whole run (all in box diagonals of a body), t from 0 in the \
             first frame to 1 in the last, and crests of the second body running the other way. This is a guess (`--amplitude`, \
             `--wave-length`, `--wave-speed`).",
            waving.amplitude, waving.wave_length, waving.speed
        ),
        "**How bodies meet.** The paper does not say. Here the second body drifts along x into the first one; table 1 gives its start and end. \
         These were chosen so that the average number of colliding triangles is close to the paper's with the scans. So #CT agrees by choice, \
         and #Cells and #Sub follow from it: with λ = 1, #Cells is about the number of triangles in the region where the \
         bodies' boxes overlap. The paper's buddhas have 189,000 cells for 200,000 triangles, so nearly all of \
         their triangles were in that region; here the bodies are side by side, and most triangles are outside."
            .to_owned(),
        "**Meshes.** Ball: the paper gives no details; here a geodesic ball of exactly 15,000 triangles. Buddha and dragon: Stanford's scans, \
         decimated to the paper's sizes, perhaps by another method. Solids: other meshes with about the same numbers of \
         tetrahedra (7,356 for 8,022; 19,379 for 19,095; 8,408 for 8,265; 15,047 for 14,922)."
            .to_owned(),
        "**Finite elements.** The paper names the method (corotated, [MG04], [ITF04]) but no material, time step, contact force or \
         motion. Here: longest side of a body 1 m, density 1000 kg/m³, Young's modulus 3·10⁴ Pa, Poisson's ratio 0.4, steps of 5 ms, Rayleigh \
         damping (0.5/s and 4 ms), a penalty proportional to the common volume, friction 0.3; the upper body is turned by 0.5 rad and thrown \
         down with 2 m/s. All of these are guesses. The paper's averages of colliding tetrahedra are those of bodies that stay pressed together."
            .to_owned(),
        "**#CT** counts the colliding elements of both bodies here; the paper does not say whether it does."
            .to_owned(),
        "**`Cells`** has the owner rule instead of the paper's hash table. On the CPU it drops elements that the other body comes nowhere \
         near before it fills the grid. It compares boxes in floats after the masks, gives an axis along which the \
         region is thinner than a cell only one cell, and makes the grid coarser if lists would exceed 16 entries per element. \
         Its pairs are exact; the paper does not say which test of triangles or tetrahedra it uses, nor how exact it is."
            .to_owned(),
        "**[FWZS11]** follows the paper's description of it (one uniform grid with λ = 5, radix sort, compaction, all pairs of a \
         cell tested). It uses the boxes, threads, vector instructions and exact test of the library, so that methods are compared, not \
         programs. The original ran on several GPUs."
            .to_owned(),
        "**DJB2.** The paper says neither which key it hashes nor which pair of a slot survives. Here the key is the pair of element \
         numbers, and the lowest pair of a slot survives, so that the answer does not depend on threads."
            .to_owned(),
        "**Clocks.** The paper does not say whether its times include transfers to and from the card. Ours include transfers and sorting \
         the answer."
            .to_owned(),
    ];
    if !stand_ins.is_empty() {
        points.insert(
            0,
            format!(
                "**Stand-ins.** There was no scan for {}: generated meshes of about the same size stand in. Their pairs and times are not \
                 those of the scans.",
                stand_ins.join(", ")
            ),
        );
    }
    vec![heading("What differs from the paper"), Block::List(points)]
}
