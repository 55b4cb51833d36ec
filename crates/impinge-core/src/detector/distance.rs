//! Whether two bodies touch whose distance is asked for.
//!
//! Where boxes of clusters overlap, whether the bodies touch is asked first, with the clusters, filters and threads of intersections. Boxes of
//! very many long triangles overlap: a search by distances would compare most of these one by one.

use std::sync::Arc;

use crate::cpu::Cpu;
use crate::error::Error;
use crate::frame::Frame;
use crate::ids::BodyId;
use crate::index::pair_numbers;
use crate::progress::Control;
use crate::query::Query;
use crate::run::Job;
use crate::scene::Scene;
use crate::settings::Settings;
use crate::sink::{Answer, Limits, Wanted};
use crate::stats::Statistics;
use crate::workers::Workers;

/// Memory kept from call to call.
#[derive(Debug, Default)]
pub(super) struct Touching {
    frame: Frame,
    answer: Arc<Answer>,
    stats: Statistics,
}

impl Touching {
    /// The lowest pair of elements of two bodies that intersects.
    ///
    /// # Errors
    /// Bad positions that were written in place, a memory budget that is too small, cancellation.
    pub fn lowest(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        (workers, control): (&Workers, &Control<'_>),
        cpu: &mut Cpu,
        settings: &Settings,
    ) -> Result<Option<[u32; 2]>, Error> {
        let Touching {
            frame,
            answer,
            stats,
        } = self;
        frame.resolve(scene, &Query::between(a, b))?;
        let _shift = workers.shift(frame.n_primitives());
        let limits = Limits {
            max_pairs: None,
            ..settings.limits()
        };
        // Layers are in the order of the bodies.
        let by_second = b < a;
        answer.begin(limits, Wanted::Lowest { by_second }, [Vec::new()]);
        stats.clear();
        let job = Job {
            scene,
            frame,
            workers,
            control,
        };
        cpu.clusters().run(job, answer, settings, stats)?;
        let lowest = answer.lowest();
        answer.finish()?;
        Ok(lowest.map(|key| {
            let mut elements = pair_numbers(key).map(|number| frame.locate(number).1.raw());
            if by_second {
                elements.reverse();
            }
            elements
        }))
    }
}
