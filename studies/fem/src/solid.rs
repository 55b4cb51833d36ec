//! A body to simulate: a mesh at rest, its material, its initial state.

use crate::error::{Error, check};

/// An isotropic elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Young's modulus in pascal, above 0.
    pub young: f64,
    /// Poisson's ratio, from 0 up to, but not including, 0.5. Linear tetrahedra lock near 0.5.
    pub poisson: f64,
    /// Mass per volume at rest in kg/m³, above 0.
    pub density: f64,
}

impl Default for Material {
    /// A soft gel: 10⁵ Pa, 0.4, 1000 kg/m³.
    fn default() -> Self {
        Material {
            young: 1e5,
            poisson: 0.4,
            density: 1e3,
        }
    }
}

impl Material {
    /// Lamé's constants λ and μ in pascal.
    pub fn lame(self) -> (f64, f64) {
        let Material { young, poisson, .. } = self;
        (
            young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
            young / (2.0 * (1.0 + poisson)),
        )
    }

    pub(crate) fn check(self) -> Result<(), Error> {
        check(
            "Young's modulus",
            self.young,
            self.young > 0.0,
            "a number above 0",
        )?;
        let poisson = self.poisson;
        check(
            "Poisson's ratio",
            poisson,
            (0.0..0.5).contains(&poisson),
            "0 to below 0.5",
        )?;
        check(
            "density",
            self.density,
            self.density > 0.0,
            "a number above 0",
        )
    }
}

/// A body to be simulated. It starts at rest in its rest pose unless told otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// `(n, 4)` vertex indices. Orientation does not matter.
    pub tets: Vec<[u32; 4]>,
    /// `(v, 3)` rest positions in metres.
    pub rest: Vec<[f64; 3]>,
    /// `(v, 3)` positions at the start, in metres.
    pub positions: Vec<[f64; 3]>,
    /// `(v, 3)` velocities at the start, in m/s.
    pub velocities: Vec<[f64; 3]>,
    /// Vertices that stay where they start.
    pub fixed: Vec<u32>,
    /// The material.
    pub material: Material,
}

impl Solid {
    /// A solid at rest: `tets` is `(n, 4)` vertex indices, `rest` `(v, 3)` positions in metres.
    pub fn new(tets: Vec<[u32; 4]>, rest: Vec<[f64; 3]>, material: Material) -> Self {
        Solid {
            tets,
            positions: rest.clone(),
            velocities: vec![[0.0; 3]; rest.len()],
            rest,
            fixed: Vec::new(),
            material,
        }
    }

    /// The same solid with every initial position mapped: moved, turned, stretched.
    pub fn posed(mut self, map: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        self.positions.iter_mut().for_each(|p| *p = map(*p));
        self
    }

    /// The same solid with this initial velocity in m/s at every vertex.
    pub fn moving(mut self, velocity: [f64; 3]) -> Self {
        self.velocities.fill(velocity);
        self
    }

    /// The same solid, with those vertices fixed whose rest position satisfies the predicate.
    pub fn fixed_where(mut self, pick: impl Fn([f64; 3]) -> bool) -> Self {
        self.fixed = (0u32..)
            .zip(&self.rest)
            .filter(|&(_, &p)| pick(p))
            .map(|(vertex, _)| vertex)
            .collect();
        self
    }

    /// The same solid without the vertices that no tetrahedron names; the others keep their order.
    /// Indices out of range stay out of range.
    pub fn without_unused_vertices(mut self) -> Self {
        let n_vertices = self.rest.len();
        let mut used = vec![false; n_vertices];
        for &corner in self.tets.as_flattened() {
            if let Some(used) = used.get_mut(corner as usize) {
                *used = true;
            }
        }
        let mut next = 0u32;
        let map: Vec<u32> = used
            .iter()
            .map(|&used| {
                let new = next;
                next += u32::from(used);
                new
            })
            .collect();
        for corner in self.tets.as_flattened_mut() {
            if let Some(&new) = map.get(*corner as usize) {
                *corner = new;
            }
        }
        for values in [&mut self.rest, &mut self.positions, &mut self.velocities] {
            let mut used = used.iter();
            values.retain(|_| used.next().copied().unwrap_or(true));
        }
        self.fixed
            .retain(|&vertex| used.get(vertex as usize).copied().unwrap_or(true));
        for vertex in &mut self.fixed {
            if let Some(&new) = map.get(*vertex as usize) {
                *vertex = new;
            }
        }
        self
    }

    /// Checks everything except volumes, which need the tetrahedra's geometry.
    pub(crate) fn check(&self, solid: usize) -> Result<(), Error> {
        self.material.check()?;
        let n_vertices = self.rest.len();
        for (what, values) in [
            ("rest position", &self.rest),
            ("position", &self.positions),
            ("velocity", &self.velocities),
        ] {
            if values.len() != n_vertices {
                return Err(Error::WrongNumber {
                    solid,
                    what: if what == "velocity" {
                        "velocities"
                    } else {
                        "positions"
                    },
                    given: values.len(),
                    expected: n_vertices,
                });
            }
            check_finite(solid, what, values)?;
        }
        let mut used = vec![false; n_vertices];
        for (tetrahedron, corners) in self.tets.iter().enumerate() {
            for &index in corners {
                let Some(used) = used.get_mut(index as usize) else {
                    return Err(Error::VertexIndexOutOfRange {
                        solid,
                        tetrahedron,
                        index,
                        n_vertices,
                    });
                };
                *used = true;
            }
        }
        if let Some(vertex) = used.iter().position(|used| !used) {
            return Err(Error::UnusedVertex { solid, vertex });
        }
        match self.fixed.iter().find(|&&v| v as usize >= n_vertices) {
            Some(&vertex) => Err(Error::FixedOutOfRange {
                solid,
                vertex,
                n_vertices,
            }),
            None => Ok(()),
        }
    }
}

/// Refuses the first vector that is not finite.
fn check_finite(solid: usize, what: &'static str, values: &[[f64; 3]]) -> Result<(), Error> {
    let bad = values
        .iter()
        .position(|value| value.iter().any(|x| !x.is_finite()));
    match bad {
        None => Ok(()),
        Some(vertex) => Err(Error::NotFinite {
            solid,
            vertex,
            what,
            value: values[vertex],
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unused_vertices_go() {
        let rest: Vec<[f64; 3]> = (0..6).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let mut solid = Solid::new(vec![[5, 1, 2, 4]], rest, Material::default());
        solid.fixed = vec![0, 2, 5];
        assert!(matches!(
            solid.check(7),
            Err(Error::UnusedVertex {
                solid: 7,
                vertex: 0
            })
        ));
        let solid = solid.without_unused_vertices();
        assert_eq!(solid.tets, [[3, 0, 1, 2]]);
        assert_eq!(solid.fixed, [1, 3]);
        let x: Vec<f64> = solid.positions.iter().map(|p| p[0]).collect();
        assert_eq!(x, [1.0, 2.0, 4.0, 5.0]);
        assert!(solid.check(0).is_ok());
    }
}
