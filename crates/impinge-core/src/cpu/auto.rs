//! The method `Auto`: which of the others answers a frame.
//!
//! Clusters are made once for each body, and that costs several times as much as the frame itself
//! does in the grid of `Cells`. It pays as soon as the body comes back. So a frame whose elements
//! are mostly of new bodies goes through the grid, except: bodies that another question has
//! clustered already; so few elements that neither takes long; small bodies, which are few
//! clusters each; cells that turn out crowded (the grid is uniform, so small details in a large
//! scene can all be in one cell); neighbours that must be resolved, which `Clusters` decides per
//! vertex; and memory budgets, which the grid would need more of.

use crate::clusterings::Clusterings;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::workers::tuning::Tuning;

/// The bodies that were in a frame before.
#[derive(Debug, Default)]
pub(super) struct Acquaintances {
    /// By slot, the stamp of the topology that was last there; 0 for none.
    stamps: Vec<u64>,
}

impl Acquaintances {
    /// Whether the grid may be the faster way to answer this frame. Its bodies are known from now
    /// on.
    pub fn prefer_grid(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        tuning: &Tuning,
        clusterings: &Clusterings,
    ) -> bool {
        let mut n_new = 0;
        for (ix, part) in plan.numbered_parts() {
            let slot = part.id.index();
            if self.stamps.len() <= slot {
                self.stamps.resize(slot + 1, 0);
            }
            let body = plan.body(scene, ix);
            let stamp = body.topology_stamp();
            let is_new = std::mem::replace(&mut self.stamps[slot], stamp) != stamp;
            if is_new && part.n_elements >= tuning.auto_body_from && !clusterings.has(part.id, body)
            {
                n_new += u64::from(part.n_elements);
            }
        }
        n_new >= tuning.auto_from && n_new > plan.n_elements() / 2 && !plan.resolves()
    }
}
