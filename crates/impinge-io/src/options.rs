//! Options of reading a mesh, and a summary of what was read.

/// Which elements to take from a file that has triangles and tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prefer {
    /// The tetrahedra if there are any, else the triangles: files of volumes often repeat the
    /// surface.
    #[default]
    Volume,
    /// The triangles; a file without triangles is an error.
    Triangles,
    /// The tetrahedra; a file without tetrahedra is an error.
    Tetrahedra,
}

/// How to read a mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadOptions {
    /// Whether vertices at the same position become one; see [`weld`](crate::weld). On by default,
    /// here and in all that reads files: files repeat vertices along seams, whose faces would touch
    /// for ever. Arrays are taken as they are.
    pub weld: bool,
    /// Which elements to take if the file has both kinds.
    pub prefer: Prefer,
    /// The most bytes in memory for data that is smaller in the file: compressed arrays, and glTF
    /// meshes placed many times. 4 GiB by default. In addition, compressed arrays may take at most
    /// 200 times the bytes of their file, or 64 MiB if that is more.
    pub max_expanded_bytes: u64,
    /// The most bytes that a file may have; a longer one is refused before it is read. 16 GiB by
    /// default.
    pub max_file_bytes: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            weld: true,
            prefer: Prefer::Volume,
            max_expanded_bytes: 4 << 30,
            max_file_bytes: 16 << 30,
        }
    }
}

impl ReadOptions {
    /// The defaults, but vertices are those of the file, as its frames have them.
    pub fn as_they_are() -> Self {
        ReadOptions {
            weld: false,
            ..ReadOptions::default()
        }
    }
}

/// What a reader changed or skipped.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Summary {
    /// Polygons of four corners or more, each of which became several triangles. If it is 0,
    /// element ids are those of the file.
    pub n_polygons_fanned: u64,
    /// Lines skipped.
    pub n_lines_skipped: u64,
    /// Point cells skipped.
    pub n_points_skipped: u64,
    /// Triangles skipped because the file has tetrahedra.
    pub n_triangles_skipped: u64,
    /// Tetrahedra skipped because triangles were requested.
    pub n_tetrahedra_skipped: u64,
    /// Vertices removed by welding.
    pub n_welded: u64,
    /// Meshes of a glTF file that a skin moves, or morph targets with weights: they are read at
    /// rest.
    pub n_at_rest: u64,
    /// Nodes with a mesh of a glTF file that are not in the scene that was read: the one that the
    /// file names, or the first.
    pub n_out_of_scene: u64,
    /// The unit that a 3MF file names, unless it is a millimetre: numbers are read as they are.
    pub unit: Option<&'static str>,
    /// Named nodes, items, objects or groups with triangles, where they became one mesh.
    pub n_parts_joined: u64,
    /// Bytes after the data that the header announces, unless they are white space, zeros and
    /// comments alone. They were not read.
    pub n_bytes_beyond: u64,
    /// Lines of an OBJ file skipped, because their first word is not known.
    pub n_unknown_lines: u64,
    /// The number of the first of them, counted from 1, and its beginning in quotes.
    pub first_unknown_line: Option<(u64, String)>,
}

impl Summary {
    /// What readers of element numbers should know, or of answers that seem incomplete: a note
    /// per kind. Points and welded vertices are not among them.
    pub fn notes(&self) -> Vec<String> {
        let unit = self.unit.map(|unit| {
            format!("its unit is the {unit}; numbers are read as they are, whatever the unit of other files")
        });
        let unknown = self.first_unknown_line.as_ref().map(|(number, line)| {
            let n = grouped(self.n_unknown_lines);
            format!("lines skipped, whose first word is not known: {n}, the first of them line {number}, {line}")
        });
        let counts = [
            (
                self.n_polygons_fanned,
                "polygons split into triangles (element numbers count the triangles)",
            ),
            (
                self.n_triangles_skipped,
                "triangles skipped, because the file has tetrahedra",
            ),
            (
                self.n_tetrahedra_skipped,
                "tetrahedra skipped, because triangles were asked for",
            ),
            (
                self.n_lines_skipped,
                "lines skipped, which are edges or faces of two corners",
            ),
            (
                self.n_at_rest,
                "meshes with a skin or morph targets, which are not applied: they are read at rest",
            ),
            (
                self.n_out_of_scene,
                "nodes with a mesh left out, because they are not in the default scene",
            ),
            (
                self.n_bytes_beyond,
                "bytes left out, because they follow what the header announces",
            ),
        ];
        let counts = counts.into_iter().filter(|&(n, _)| n > 0);
        let counts = counts.map(|(n, what)| format!("{what}: {}", grouped(n)));
        unit.into_iter().chain(counts).chain(unknown).collect()
    }
}

/// A number with a comma after every three digits.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (ix, digit) in digits.chars().enumerate() {
        if ix > 0 && (digits.len() - ix).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_grouped_by_three() {
        for (n, text) in [(0, "0"), (999, "999"), (1_234_567, "1,234,567")] {
            assert_eq!(grouped(n), text);
        }
    }
}
