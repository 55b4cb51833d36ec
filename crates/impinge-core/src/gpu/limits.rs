//! How near elements may come and how far vertices may move, as the device has it: a number per
//! vertex, in the order of positions.

use std::iter::repeat_n;

use super::engine::Engine;
use super::layout::Share;
use super::pass_buffers::{LimitsOf, ThicknessOf};
use super::view::{Asks, StepTest};
use crate::bvh::bounds::{round_down, round_up};
use crate::plan::Plan;
use crate::scene::Scene;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;

/// The thickest body, and the largest separation, that a device can take.
pub(crate) const MOST_KEPT: f64 = (1u128 << 100) as f64;

impl Engine {
    /// Asks whether elements keep the separation of a step and their thickness, if there is either.
    ///
    /// # Errors
    /// More than the device can bind at once.
    pub(super) fn ask_kept(&mut self, scene: &Scene, plan: &Plan) -> Result<(), Error> {
        if !plan.keeps_distance() {
            return Ok(());
        }
        let half = plan.distance() / 2.0;
        let thickest = self.send_thickness(scene, half)?;
        if half.max(thickest) > MOST_KEPT {
            return Err(Error::Gpu {
                what: format!("{} cannot take what elements keep", self.gpu.name()),
            });
        }
        self.ask(StepTest::Keep, half + thickest);
        Ok(())
    }

    /// Asks how far vertices may move: those of each of these bodies so far. The first bodies are
    /// those of the world, in its order.
    ///
    /// # Errors
    /// More than the device can bind at once.
    pub(super) fn ask_safe(
        &mut self,
        scene: &Scene,
        bodies: &[(BodyId, u64)],
        most: f64,
        of_body: impl Fn(BodyId) -> f64,
    ) -> Result<(), Error> {
        let limits = bodies.iter().map(|&(body, len)| LimitsOf {
            body,
            // No body has more vertices than 32 bits number.
            len: len as u32,
            most: round_down(of_body(body)).to_bits(),
        });
        let limits = Vec::from_iter(limits);
        let pass_buffers = &mut self.lane.pass_buffers;
        if pass_buffers.limits_of != limits || pass_buffers.limits.bytes() == 0 {
            pass_buffers.limits_of.clear();
            let of_body = |of: &LimitsOf| repeat_n(Share { bits: of.most }, of.len as usize);
            let of_vertices: Vec<Share> = limits.iter().flat_map(of_body).collect();
            pass_buffers.limits.upload(&self.gpu, &of_vertices)?;
            pass_buffers.limits_of = limits;
        }
        let thickest = self.send_thickness(scene, 0.0)?;
        self.ask(StepTest::Safe, most + thickest);
        Ok(())
    }

    fn ask(&mut self, test: StepTest, reach: f64) {
        // A little more than asked for, and more than what is flushed.
        let reach = round_up(reach * (1.0 + 2f64.powi(-20)) + 2f64.powi(-100));
        let reach = reach.to_bits();
        self.asks = Asks { test, reach };
    }

    /// Sends how thick vertices are, and what each keeps besides. Returns how thick the thickest
    /// is.
    fn send_thickness(&mut self, scene: &Scene, besides: f64) -> Result<f64, Error> {
        let (mut all, mut thickest) = (Vec::new(), 0.0f64);
        for (body, len) in self.world.bodies() {
            let held = scene.body(body)?;
            thickest = thickest.max(held.thickness());
            all.push(ThicknessOf {
                body,
                len,
                thickness: (held.thickness() + besides).to_bits(),
                each: held.thickness_of_each().map(|each| each.stamp()),
            });
        }
        let pass_buffers = &mut self.lane.pass_buffers;
        let of = Some((besides.to_bits(), all));
        if pass_buffers.thickness_of != of {
            pass_buffers.thickness_of = None;
            let all = &of.as_ref().expect("set above").1;
            let thickness = thickness(scene, all, besides)?;
            pass_buffers.thickness.upload(&self.gpu, &thickness)?;
            pass_buffers.thickness_of = of;
        }
        Ok(thickest)
    }
}

/// How thick each vertex is, with what it keeps besides, rounded up: as the thickest of its
/// elements. One 0 if none is thick.
fn thickness(scene: &Scene, bodies: &[ThicknessOf], besides: f64) -> Result<Vec<Share>, Error> {
    let share = |of_vertex: f64| Share {
        bits: round_up(of_vertex).to_bits(),
    };
    let mut all = Vec::new();
    for of in bodies {
        match scene.body(of.body)?.thickness_of_each() {
            Some(each) => {
                let each = each.of(Part::Vertices).iter();
                all.extend(each.map(|&own| share(own + besides)));
            }
            None => all.extend(repeat_n(
                share(f64::from_bits(of.thickness)),
                of.len as usize,
            )),
        }
    }
    if all.iter().all(|of_vertex| of_vertex.bits == 0) {
        all = vec![share(0.0)];
    }
    Ok(all)
}
