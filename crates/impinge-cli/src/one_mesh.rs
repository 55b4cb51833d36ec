//! A mesh about which points or rays ask.

use std::path::Path;

use impinge::{BodyId, BodyKind, CancelToken, Control, Detector, Scene};
use impinge_io::{ReadOptions, read_rows_bytes};

use crate::args::OneMeshArgs;
use crate::asked;
use crate::detection::on_cpu;
use crate::error::Error;
use crate::load::{Bodies, Loading, NAME_OF_STDIN, STDIN, stdin_bytes};
use crate::report;

/// Rows of numbers from standard input, if that is the name of the file; `None` if not. The mesh
/// cannot come from there, too.
pub fn rows_of_stdin<const N: usize>(
    option: &str,
    path: &Path,
    mesh: &Path,
) -> Result<Option<Vec<[f64; N]>>, Error> {
    if path != Path::new(STDIN) {
        return Ok(None);
    }
    if mesh == path {
        let text = format!(
            "{option}: the mesh comes from standard input already: give one of them a file"
        );
        return Err(Error::Usage(text));
    }
    let bytes = stdin_bytes(&ReadOptions::as_they_are())?;
    Ok(Some(read_rows_bytes(&bytes, NAME_OF_STDIN)?))
}

/// A scene of one mesh.
pub struct OneMesh {
    bodies: Bodies,
    pub id: BodyId,
    /// The file as given.
    pub name: String,
}

impl OneMesh {
    pub fn read(path: &Path, args: &OneMeshArgs, cancel: &CancelToken) -> Result<Self, Error> {
        let weld = args.no_weld.then_some(false);
        // Whether a surface is closed depends on which vertices are welded, as self-collision does.
        let loading = Loading::as_they_are(!args.json, cancel).asked(weld, true, args.format);
        let mut bodies = Bodies::default();
        let (id, _) = bodies.add(path, loading)?;
        let name = bodies.names[0].clone();
        Ok(OneMesh { bodies, id, name })
    }

    pub fn scene(&self) -> &Scene {
        &self.bodies.scene
    }

    /// As many faces as it may have, at least 1: those of tetrahedra are their surface.
    pub fn most_faces(&self) -> Result<u32, Error> {
        let body = self.scene().body(self.id)?;
        let of_each = match body.kind() {
            BodyKind::Tetrahedra => 4,
            _ => 1,
        };
        let n = body.n_elements().saturating_mul(of_each);
        Ok(u32::try_from(n).unwrap_or(u32::MAX).max(1))
    }

    /// A detector for it.
    pub fn detector(&self, args: &OneMeshArgs, cancel: &CancelToken) -> Result<Detector, Error> {
        let mut detector = Detector::new(on_cpu(args.threads))?;
        detector.set_control(Control::new().cancel(cancel));
        Ok(detector)
    }

    /// The error with the name of the file, and vertices as the file numbers them.
    pub fn refused(&self, mut error: impinge::Error) -> Error {
        if let impinge::Error::NotClosed { edge, .. } = &mut error {
            *edge = edge.map(|vertex| self.bodies.origins.vertex(0, vertex));
        }
        match error {
            impinge::Error::NotClosed { .. } | impinge::Error::WrongKind { .. } => Error::Refused {
                what: self.name.clone(),
                source: error,
            },
            error => error.into(),
        }
    }

    /// How many vertices were welded, in words.
    pub fn welded(&self) -> String {
        asked::welded(&self.bodies.vertices)
    }

    /// What every answer says of a body.
    pub fn report(&self) -> Result<report::Body, Error> {
        let (name, vertices) = (&self.name, &self.bodies.vertices[0]);
        Ok(report::Body::new(self.scene(), self.id, name, vertices)?)
    }
}
