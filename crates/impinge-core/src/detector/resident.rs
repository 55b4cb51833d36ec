//! Steps that stay on the device of a detector.

use std::collections::BTreeMap;

use super::Detector;
use crate::gpu::ResidentStep;
use crate::plan::Plan;
use crate::query::goal::Goal;
use crate::query::progress::Control;
use crate::query::step::Step;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::search::stats::Statistics;

impl Detector {
    /// Encodes a whole step into the caller's encoder: positions at the start and at the end come from buffers on the device,
    /// and the pairs of elements that may touch stay there. Nothing is read back.
    ///
    /// The pairs are those of [`impacts`](Detector::impacts), and others that the filter on the device does not prove free: a
    /// superset of the impacts, for a solver that treats every pair of the list as one that may touch. Whether pairs touch at the start
    /// makes no difference, nor does the precision of times that is asked for.
    ///
    /// `starts` and `ends` name bodies whose positions at that end are taken from a buffer: `(v, 3)` f32 tightly packed, with the
    /// usage `COPY_SRC`, copied when the encoder's commands run. All other positions come from the scene. A body that has no positions
    /// at the end, in a buffer or in the scene, does not move. For bodies named in `starts`, the scene's positions only serve to
    /// find clusters, once. Positions on the device are not checked: if one is not finite, the pairs of its elements are unspecified.
    ///
    /// At most one step of a detector may be encoded per submission, besides one frame of [`encode`](Detector::encode). If there
    /// is not enough room, the list is incomplete and its count says so, see [`ResidentStep`];
    /// [`make_room`](Detector::make_room) then grows it.
    ///
    /// # Errors
    /// A stale id, a buffer that is too small or lacks its usage, a step with a separation, a clearance or a filter, or for one cell, a step larger than the
    /// device or the memory budget can hold, a detector without a GPU. Device errors go to the device's owner, and so do those of
    /// kernels, which the first step compiles.
    pub fn encode_step(
        &mut self,
        scene: &Scene,
        step: &Step,
        starts: &[(BodyId, &wgpu::Buffer)],
        ends: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentStep, Error> {
        step.check()?;
        if step.separation > 0.0 {
            return Err(Error::Setting {
                setting: "separation",
                given: step.separation.to_string(),
                allowed: "0 for a step that stays on a device",
            });
        }
        if step.clearance.distance > 0.0 {
            return Err(Error::Setting {
                setting: "clearance",
                given: step.clearance.distance.to_string(),
                allowed: "0 for a step that stays on a device",
            });
        }
        if step.filter.is_some() {
            return Err(Error::Setting {
                setting: "filter",
                given: "a filter of pairs in a step that stays on a device".to_owned(),
                allowed: "only steps that are read back",
            });
        }
        if step.query.cell.is_some() {
            return Err(Error::Setting {
                setting: "owned_by",
                given: "a cell in a step that stays on a device".to_owned(),
                allowed: "only steps and candidates that are read back",
            });
        }
        let Some(engine) = &mut self.gpu else {
            return Err(Error::NoAdapter {
                found: "this detector works on the CPU".to_owned(),
            });
        };
        let plan = Plan::contacts(scene, step, Goal::All, self.settings.limits())?;
        let control = Control::new();
        let job = self.runner.job(scene, &plan, &control)?;
        let resident: BTreeMap<BodyId, &wgpu::Buffer> = starts.iter().copied().collect();
        let judges = |body| !resident.contains_key(&body);
        let stats = &mut Statistics::default();
        let clusterings = self.clusterings.of_frame(job, judges, stats)?;
        engine.encode_step(job, &clusterings, [starts, ends], encoder)
    }
}
