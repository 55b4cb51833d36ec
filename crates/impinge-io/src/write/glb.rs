//! Writing GLB.

use std::collections::HashMap;
use std::path::Path;

use serde_json::{Value, json};

use super::atomic::AtomicFile;
use super::surface::surface;
use super::{ColoredMesh, check};
use crate::error::{Error, Name, Place};

/// Numbers of the glTF 2.0 specification.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_BYTE: u32 = 5121;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes bodies into one GLB file (glTF 2.0), one node per body, with colours that every viewer
/// shows.
///
/// glTF colours vertices only, so a vertex between faces of different colours is written once per
/// colour, in the order in which the triangles use them; vertices that no triangle uses are
/// omitted. Positions are f32 in this format: f64 is rounded to nearest. For tetrahedra, their
/// surface is written. Bodies without triangles are omitted.
///
/// # Errors
/// [`Error::Io`]; [`Error::Mismatch`] or [`Error::Index`] if the parts of a body do not fit
/// together; [`Error::NotFinite`] if a coordinate is not finite in f32, which JSON can't express;
/// [`Error::TooLarge`] beyond 4 GiB, the limit of the format.
pub fn write_glb(path: &Path, meshes: &[ColoredMesh]) -> Result<(), Error> {
    check(path, meshes)?;
    let name = path.display().to_string();
    let mut glb = Glb::default();
    for mesh in meshes {
        glb.add(Name(&name), mesh)?;
    }
    let (json, binary) = glb.into_chunks();
    let length = 12
        + 8
        + json.len() as u64
        + if binary.is_empty() {
            0
        } else {
            8 + binary.len() as u64
        };
    let Ok(length) = u32::try_from(length) else {
        return Err(Name(&name).too_large(
            Place::File,
            "number of bytes",
            u64::from(u32::MAX),
            length,
        ));
    };
    let mut file = AtomicFile::create(path)?;
    file.put(b"glTF")?;
    file.put(&2u32.to_le_bytes())?;
    file.put(&length.to_le_bytes())?;
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &binary)] {
        if !chunk.is_empty() {
            // Both chunks are shorter than the file, whose length is a u32.
            file.put(&(chunk.len() as u32).to_le_bytes())?;
            file.put(kind)?;
            file.put(chunk)?;
        }
    }
    file.finish()
}

/// A file being assembled.
#[derive(Default)]
struct Glb {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Glb {
    fn add(&mut self, name: Name, mesh: &ColoredMesh) -> Result<(), Error> {
        let faces = surface(mesh.positions, mesh.elements);
        if faces.is_empty() {
            return Ok(());
        }
        let mut written: HashMap<(u32, [u8; 3]), u32> = HashMap::new();
        let mut vertices: Vec<(u32, [u8; 3])> = Vec::new();
        let mut indices: Vec<u8> = Vec::with_capacity(12 * faces.len());
        for (face, element_ix) in faces {
            let color = mesh.color(element_ix);
            for corner in face {
                let ix = *written.entry((corner, color)).or_insert_with(|| {
                    vertices.push((corner, color));
                    // There may be more than 2^32 corners, but not within the 4 GiB checked at the
                    // end.
                    (vertices.len() - 1) as u32
                });
                indices.extend_from_slice(&ix.to_le_bytes());
            }
        }
        let all = mesh.positions.to_f32_rounded();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let mut positions = Vec::with_capacity(12 * vertices.len());
        let mut colors = Vec::with_capacity(4 * vertices.len());
        for &(vertex, [red, green, blue]) in &vertices {
            let position = all[vertex as usize];
            crate::collect::finite(name, Place::File, vertex as usize, position.map(f64::from))?;
            for axis in 0..3 {
                low[axis] = low[axis].min(position[axis]);
                high[axis] = high[axis].max(position[axis]);
                positions.extend_from_slice(&position[axis].to_le_bytes());
            }
            colors.extend_from_slice(&[red, green, blue, 255]);
        }
        let n = vertices.len();
        let position = self.accessor(
            &positions,
            ARRAY_BUFFER,
            json!({"componentType": FLOAT, "type": "VEC3", "count": n, "min": low, "max": high}),
        );
        let color = self.accessor(
            &colors,
            ARRAY_BUFFER,
            json!({"componentType": UNSIGNED_BYTE, "normalized": true, "type": "VEC4", "count": n}),
        );
        let index = self.accessor(
            &indices,
            ELEMENT_ARRAY_BUFFER,
            json!({"componentType": UNSIGNED_INT, "type": "SCALAR", "count": indices.len() / 4}),
        );
        self.nodes
            .push(json!({"name": mesh.name, "mesh": self.meshes.len()}));
        self.meshes.push(json!({"name": mesh.name, "primitives": [
            {"attributes": {"POSITION": position, "COLOR_0": color}, "indices": index, "material": 0}
        ]}));
        Ok(())
    }

    /// Adds `bytes`, whose length is a multiple of 4, as a view with an accessor for all of it;
    /// returns the accessor's index.
    fn accessor(&mut self, bytes: &[u8], target: u32, mut accessor: Value) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len(), "target": target}));
        self.binary.extend_from_slice(bytes);
        accessor["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// The contents of the two chunks, padded to multiples of 4.
    fn into_chunks(self) -> (Vec<u8>, Vec<u8>) {
        let mut root = json!({
            "asset": {"version": "2.0", "generator": "impinge"},
            "scene": 0,
            "scenes": [{}],
        });
        // The format forbids empty arrays.
        if !self.nodes.is_empty() {
            root["scenes"][0]["nodes"] = (0..self.nodes.len()).collect();
            root["nodes"] = self.nodes.into();
            root["meshes"] = self.meshes.into();
            root["accessors"] = self.accessors.into();
            root["bufferViews"] = self.views.into();
            root["buffers"] = json!([{"byteLength": self.binary.len()}]);
            root["materials"] = json!([{"doubleSided": true, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}}]);
        }
        let mut json = root.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        (json, self.binary)
    }
}
