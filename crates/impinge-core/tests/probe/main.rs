//! Points and rays: every decision held against rational arithmetic.

mod cast;
mod closest;
mod inside;
mod oracle;

use impinge_core::{BodyId, Scene};

/// The surface of each body, element by element.
fn elements(scene: &Scene) -> Vec<(BodyId, u32, Vec<[f64; 3]>)> {
    let mut all = Vec::new();
    for (id, body) in scene.bodies() {
        let elements = match body.faces().is_empty() {
            false => body.faces(),
            true => body.elements(),
        };
        for element in 0..elements.len() {
            let corners = elements.corners(element).iter();
            let points = corners.map(|&vertex| body.positions().point(vertex as usize));
            all.push((id, element as u32, points.collect()));
        }
    }
    all
}
