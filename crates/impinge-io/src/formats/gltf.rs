//! glTF 2.0 and GLB: all triangles of the default scene, placed by their nodes, as one body or as a
//! body per node.
//!
//! Source: Khronos, "glTF 2.0 Specification". Triangles, strips and fans are read; points and lines
//! are counted. Within a node, primitives that use the same positions share their vertices.
//! Positions stay f32 if no node moves them; otherwise they are computed in f64 (each sum and
//! product rounded to nearest) and stay f64. Faces of a node that mirrors are turned, so that
//! matter stays inside. Skins and morph targets are not applied: the mesh is in its rest pose.

mod accessor;
mod json;

use std::collections::HashMap;
use std::path::Path;

use self::accessor::Data;
use self::json::{Node, Primitive, Root, index_error};
use crate::binary::{Cursor, Endian, Scalar};
use crate::bodies::PartName;
use crate::budget::Budget;
use crate::collect::{Collector, check_n_vertices, finite, vertex_ix};
use crate::error::{Error, Name, Place, printable, shown};
use crate::mesh::Positions;
use crate::options::ReadOptions;

pub(crate) fn read<'a>(
    bytes: &[u8],
    name: Name<'a>,
    folder: Option<&Path>,
    options: &ReadOptions,
) -> Result<Collector<'a>, Error> {
    let (json, binary) = if bytes.starts_with(b"glTF") {
        chunks(bytes, name)?
    } else {
        // A byte order mark is not allowed here, but some editors write one.
        (
            (bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None),
            None,
        )
    };
    let root = parse(json, name)?;
    let scene = Scene {
        name,
        data: Data::new(
            name,
            &root,
            binary,
            folder,
            Budget::new(options.max_expanded_bytes.max(16 * bytes.len() as u64)),
            options,
        ),
        root: &root,
        is_f64: false,
        f32s: Vec::new(),
        f64s: Vec::new(),
        parts: Collector::new(name),
    };
    scene.read()
}

/// The JSON of a file, and its offset if the file is a GLB.
type Json<'b> = (&'b [u8], Option<usize>);

/// The JSON and binary chunks of a GLB file.
fn chunks<'b>(bytes: &'b [u8], name: Name<'b>) -> Result<(Json<'b>, Option<&'b [u8]>), Error> {
    let mut cursor = Cursor::new(name, bytes, 4, Endian::Little);
    let version = cursor.count(Scalar::U32, "the version")?;
    if version != 2 {
        return Err(name.unsupported(
            Place::Byte(4),
            format!("GLB version {version} (supported: 2)"),
        ));
    }
    let length = cursor.count(Scalar::U32, "the length")?;
    if length > bytes.len() as u64 {
        return Err(name.truncated(
            Place::File,
            "a GLB file of this header",
            length,
            bytes.len() as u64,
        ));
    }
    let mut chunk = |expected: &[u8; 4]| {
        let at = cursor.place();
        let length = cursor.count(Scalar::U32, "the length of a chunk")?;
        let kind = cursor.take(4, 1, "the type of a chunk")?;
        let start = cursor.offset();
        let content = cursor.take(length, 1, "a chunk")?;
        if kind != expected {
            return Err(name.syntax(
                at,
                format!("the chunk {}", shown(expected.trim_ascii_end())),
                shown(kind),
            ));
        }
        Ok::<_, Error>((content, start, cursor.left()))
    };
    let (json, start, left) = chunk(b"JSON")?;
    let binary = if left >= 8 {
        Some(chunk(b"BIN\0")?.0)
    } else {
        None
    };
    Ok(((json, Some(start)), binary))
}

fn parse((json, start): Json, name: Name) -> Result<Root, Error> {
    let root: Root = serde_json::from_slice(json).map_err(|error| {
        let place = match start {
            None => Place::Line(error.line() as u64),
            // The JSON of a GLB is usually one line.
            Some(start) => {
                Place::Byte((start + if error.line() == 1 { error.column() } else { 0 }) as u64)
            }
        };
        name.syntax(
            place,
            "glTF in JSON",
            error.to_string().replace(['\n', '\r'], " "),
        )
    })?;
    if !root.asset.version.starts_with("2.") {
        return Err(name.unsupported(
            Place::File,
            format!(
                "glTF version {} (supported: 2.x)",
                shown(root.asset.version.as_bytes())
            ),
        ));
    }
    const HARMLESS: [&str; 6] = [
        "KHR_materials_",
        "KHR_texture_",
        "KHR_lights_",
        "KHR_mesh_quantization",
        "EXT_texture_",
        "KHR_xmp",
    ];
    if let Some(extension) = root
        .extensions_required
        .iter()
        .find(|extension| !HARMLESS.iter().any(|start| extension.starts_with(start)))
    {
        let advice = match extension.as_str() {
            "KHR_draco_mesh_compression"
            | "EXT_meshopt_compression"
            | "KHR_meshopt_compression" => {
                " (a compressed mesh: export it again without compression)"
            }
            _ => "",
        };
        // Names of extensions are short; a hostile one is cut.
        let extension = match extension.len() <= 64 {
            true => format!("'{}'", printable(extension)),
            false => shown(extension.as_bytes()),
        };
        return Err(name.unsupported(Place::File, format!("the extension {extension}{advice}")));
    }
    Ok(root)
}

/// A transformation: columns of x, y, z axes and the origin. `None` moves nothing.
type Transform = Option<[[f64; 3]; 4]>;

/// A scene being assembled.
struct Scene<'a, 'r> {
    name: Name<'a>,
    root: &'r Root,
    data: Data<'a, 'r>,
    /// Whether positions have become f64.
    is_f64: bool,
    f32s: Vec<[f32; 3]>,
    f64s: Vec<[f64; 3]>,
    parts: Collector<'a>,
}

impl<'a> Scene<'a, '_> {
    fn read(mut self) -> Result<Collector<'a>, Error> {
        let (name, root) = (self.name, self.root);
        let roots: Vec<usize> = match root.scenes.get(root.scene.unwrap_or(0)) {
            Some(scene) => scene.nodes.clone(),
            None if root.scene.is_some() => {
                return Err(index_error(
                    name,
                    "scenes",
                    root.scene.unwrap_or(0),
                    root.scenes.len(),
                ));
            }
            // A file without scenes is a library of nodes: take all nodes that are not children.
            None => {
                let mut is_child = vec![false; root.nodes.len()];
                for &child in root.nodes.iter().flat_map(|node| &node.children) {
                    if let Some(is_child) = is_child.get_mut(child) {
                        *is_child = true;
                    }
                }
                (0..root.nodes.len())
                    .filter(|&node| !is_child[node])
                    .collect()
            }
        };
        let mut is_visited = vec![false; root.nodes.len()];
        let mut stack: Vec<(usize, Transform)> =
            roots.into_iter().rev().map(|node| (node, None)).collect();
        while let Some((node_ix, parent)) = stack.pop() {
            let node = root
                .nodes
                .get(node_ix)
                .ok_or_else(|| index_error(name, "nodes", node_ix, root.nodes.len()))?;
            if std::mem::replace(&mut is_visited[node_ix], true) {
                return Err(name.syntax(
                    Place::File,
                    "nodes that form a tree",
                    format!("node {node_ix} twice"),
                ));
            }
            if node.extensions.contains_key("EXT_mesh_gpu_instancing") {
                return Err(
                    name.unsupported(Place::File, "the extension 'EXT_mesh_gpu_instancing'")
                );
            }
            if let Some(m) = node.matrix {
                let row = [m[3], m[7], m[11], m[15]];
                // Programs that write matrices round them.
                let is_close = |(x, to): (f64, f64)| (x - to).abs() <= 1e-6;
                if !row.into_iter().zip([0.0, 0.0, 0.0, 1.0]).all(is_close) {
                    let expected =
                        format!("0, 0, 0, 1 as the fourth row of the matrix of node {node_ix}");
                    let [x, y, z, w] = row;
                    return Err(name.syntax(Place::File, expected, format!("{x}, {y}, {z}, {w}")));
                }
            }
            let transform = compose(parent, local(node));
            if let Some(mesh_ix) = node.mesh {
                let mesh = root
                    .meshes
                    .get(mesh_ix)
                    .ok_or_else(|| index_error(name, "meshes", mesh_ix, root.meshes.len()))?;
                let named = node.name.as_deref().or(mesh.name.as_deref());
                let named = named.filter(|name| !name.is_empty());
                let stand_in = format!("node {node_ix}");
                let named = named.map_or(PartName::StandIn(&stand_in), PartName::Given);
                let base = self.f32s.len() + self.f64s.len();
                self.parts.begin_part(named, true, base);
                let weights = node.weights.as_ref().unwrap_or(&mesh.weights);
                if node.skin.is_some() || weights.iter().any(|&weight| weight != 0.0) {
                    self.parts.n_at_rest += 1;
                }
                let mut bases = HashMap::new();
                let first = self.parts.triangles.len();
                for primitive in &mesh.primitives {
                    self.add(primitive, transform, &mut bases)?;
                }
                if transform.is_some_and(|columns| determinant(&columns) < 0.0) {
                    for face in &mut self.parts.triangles[first..] {
                        face.swap(1, 2);
                    }
                }
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, transform)));
        }
        let unseen = root.nodes.iter().zip(&is_visited);
        let left_out = unseen.filter(|&(node, &is_visited)| node.mesh.is_some() && !is_visited);
        self.parts.n_out_of_scene = left_out.count() as u64;
        self.parts.positions = if self.is_f64 {
            Positions::F64(self.f64s)
        } else {
            Positions::F32(self.f32s)
        };
        Ok(self.parts)
    }

    /// Adds a primitive; `bases` are the first vertices of the accessors that this node has used
    /// already.
    fn add(
        &mut self,
        primitive: &Primitive,
        transform: Transform,
        bases: &mut HashMap<usize, (u64, u64)>,
    ) -> Result<(), Error> {
        const TRIANGLES: u32 = 4;
        const STRIP: u32 = 5;
        const FAN: u32 = 6;
        let name = self.name;
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        match mode {
            0 => self.parts.n_points += 1,
            1..=3 => self.parts.n_lines += 1,
            TRIANGLES | STRIP | FAN => {}
            _ => {
                return Err(name.syntax(
                    Place::File,
                    "a mode of a primitive, 0 to 6",
                    mode.to_string(),
                ));
            }
        }
        let Some(accessor) = primitive.attributes.position.filter(|_| mode >= TRIANGLES) else {
            return Ok(());
        };
        let (base, n_vertices) = match bases.get(&accessor) {
            Some(&base) => base,
            None => {
                let base = self.add_positions(accessor, transform)?;
                bases.insert(accessor, base);
                base
            }
        };
        let indices = match primitive.indices {
            Some(accessor) => self.data.indices(accessor)?,
            None => {
                self.data.charge(n_vertices, 8)?;
                (0..n_vertices as i64).collect()
            }
        };
        self.data.charge(indices.len() as u64, 16)?;
        let corners = &mut self.parts.corners;
        corners.clear();
        for index in indices {
            // The sum is the index of an existing vertex, so it does not overflow.
            corners.push(base as u32 + vertex_ix(name, index, 0, n_vertices, Place::File)?);
        }
        match mode {
            TRIANGLES if !corners.len().is_multiple_of(3) => {
                let whole = corners.len().next_multiple_of(3) as u64;
                return Err(name.count(
                    Place::File,
                    "indices of triangles",
                    whole,
                    corners.len() as u64,
                ));
            }
            TRIANGLES => self
                .parts
                .triangles
                .extend_from_slice(corners.as_chunks::<3>().0),
            STRIP => self.parts.strip(),
            _ if corners.len() < 3 => {}
            _ => {
                let first = corners[0];
                self.parts.triangles.extend(
                    corners[1..]
                        .windows(2)
                        .map(|edge| [first, edge[0], edge[1]]),
                );
            }
        }
        Ok(())
    }

    /// Adds the positions of an accessor; returns the first vertex and their number.
    fn add_positions(
        &mut self,
        accessor: usize,
        transform: Transform,
    ) -> Result<(u64, u64), Error> {
        let name = self.name;
        let positions = self.data.positions(accessor)?;
        let base = (self.f32s.len() + self.f64s.len()) as u64;
        let n_vertices = positions.len() as u64;
        check_n_vertices(name, Place::File, base + n_vertices)?;
        self.data.charge(n_vertices, 24)?;
        match (positions, transform) {
            (Positions::F32(positions), None) if !self.is_f64 => {
                for (ix, &position) in positions.iter().enumerate() {
                    finite(
                        name,
                        Place::File,
                        base as usize + ix,
                        position.map(f64::from),
                    )?;
                }
                self.f32s.extend(positions);
            }
            (positions, transform) => {
                if !self.is_f64 {
                    self.is_f64 = true;
                    self.f64s = std::mem::take(&mut self.f32s)
                        .into_iter()
                        .map(|position| position.map(f64::from))
                        .collect();
                }
                for (ix, position) in positions.to_f64().into_iter().enumerate() {
                    let placed = transform.map_or(position, |columns| apply(&columns, position));
                    self.f64s
                        .push(finite(name, Place::File, base as usize + ix, placed)?);
                }
            }
        }
        Ok((base, n_vertices))
    }
}

/// The transformation of a node.
fn local(node: &Node) -> Transform {
    if let Some(m) = node.matrix {
        let columns = [
            [m[0], m[1], m[2]],
            [m[4], m[5], m[6]],
            [m[8], m[9], m[10]],
            [m[12], m[13], m[14]],
        ];
        return (columns != IDENTITY).then_some(columns);
    }
    let translation = node.translation.unwrap_or([0.0; 3]);
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let scale = node.scale.unwrap_or([1.0; 3]);
    let rotation = [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + w * z),
            2.0 * (x * z - w * y),
        ],
        [
            2.0 * (x * y - w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + w * x),
        ],
        [
            2.0 * (x * z + w * y),
            2.0 * (y * z - w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ];
    let [a, b, c] = [0, 1, 2].map(|axis| rotation[axis].map(|entry| entry * scale[axis]));
    let columns = [a, b, c, translation];
    (columns != IDENTITY).then_some(columns)
}

const IDENTITY: [[f64; 3]; 4] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, 0.0],
];

/// The transformed position.
fn apply(columns: &[[f64; 3]; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|row| {
        columns[0][row] * x + columns[1][row] * y + columns[2][row] * z + columns[3][row]
    })
}

/// Negative if the transformation mirrors.
fn determinant([a, b, c, _]: &[[f64; 3]; 4]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// First `local`, then `parent`.
fn compose(parent: Transform, local: Transform) -> Transform {
    let (Some(parent), Some(local)) = (parent, local) else {
        return parent.or(local);
    };
    let linear = [parent[0], parent[1], parent[2], [0.0; 3]];
    Some([
        apply(&linear, local[0]),
        apply(&linear, local[1]),
        apply(&linear, local[2]),
        apply(&parent, local[3]),
    ])
}
