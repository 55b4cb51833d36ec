//! A scene and a query about it.

use impinge::{BodyId, Error, Query, Scene};

use crate::model::Model;

/// A scene ready to be detected.
#[derive(Debug, Clone)]
pub struct BuiltScene {
    /// Its name in tables.
    pub name: String,
    /// The bodies.
    pub scene: Scene,
    /// Their ids in the order in which they were added.
    pub bodies: Vec<BodyId>,
    /// The query.
    pub query: Query,
}

impl BuiltScene {
    /// A scene of models, with a query for the pairs of all different bodies.
    ///
    /// # Errors
    /// As [`Scene::add`].
    pub fn all(
        name: impl Into<String>,
        models: impl IntoIterator<Item = Model>,
    ) -> Result<Self, Error> {
        let mut scene = Scene::new();
        let bodies = models
            .into_iter()
            .map(|model| scene.add((model.elements, model.positions)))
            .collect::<Result<_, _>>()?;
        Ok(BuiltScene {
            name: name.into(),
            scene,
            bodies,
            query: Query::between_all(),
        })
    }

    /// Two bodies, with a query for the pairs between them.
    ///
    /// # Errors
    /// As [`Scene::add`].
    pub fn between(name: impl Into<String>, a: Model, b: Model) -> Result<Self, Error> {
        let mut built = BuiltScene::all(name, [a, b])?;
        built.query = Query::between(built.bodies[0], built.bodies[1]);
        Ok(built)
    }

    /// A model and its copy moved by `offset` (added in f32), with a query for the pairs between
    /// them.
    ///
    /// # Errors
    /// As [`Scene::add`].
    pub fn two_body(
        name: impl Into<String>,
        model: &Model,
        offset: [f32; 3],
    ) -> Result<Self, Error> {
        BuiltScene::between(name, model.clone(), model.translated(offset))
    }

    /// One body, with a query for its self-collision.
    ///
    /// # Errors
    /// As [`Scene::add`].
    pub fn within(name: impl Into<String>, model: Model) -> Result<Self, Error> {
        let mut built = BuiltScene::all(name, [model])?;
        built.query = Query::self_of(built.bodies[0]);
        Ok(built)
    }

    /// The number of elements of all bodies together.
    pub fn n_elements(&self) -> usize {
        self.scene.bodies().map(|(_, body)| body.n_elements()).sum()
    }
}
