//! What is known of bodies.

use crate::scene::bodies::Scene;
use crate::scene::ids::BodyId;

/// At most one value per body.
#[derive(Debug)]
pub(crate) struct ByBody<T>(Vec<Option<T>>);

impl<T> Default for ByBody<T> {
    fn default() -> Self {
        ByBody(Vec::new())
    }
}

impl<T> ByBody<T> {
    pub fn get(&self, id: BodyId) -> Option<&T> {
        self.0.get(id.index())?.as_ref()
    }

    /// Where the value of a body is.
    pub fn entry(&mut self, id: BodyId) -> &mut Option<T> {
        if self.0.len() <= id.index() {
            self.0.resize_with(id.index() + 1, || None);
        }
        &mut self.0[id.index()]
    }

    /// Forgets bodies that the scene does not hold.
    pub fn forget_removed(&mut self, scene: &Scene) {
        for (slot, known) in self.0.iter_mut().enumerate() {
            known.take_if(|_| !scene.holds(slot));
        }
    }

    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.0.iter().flatten()
    }
}
