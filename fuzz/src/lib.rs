//! The assertions of the fuzz targets: here those of file formats, in [`scene`] those of the
//! detector. libFuzzer checks for panics, endless loops and memory; the functions here check that
//! returned meshes and errors are valid.

pub mod scene;

use impinge_io::{
    Error, Format, Mesh, Positions, Prefer, ReadOptions, Sequence, SequenceFormat, read_bytes,
    read_tetgen_bytes,
};

/// A small limit for data that may expand, so that the fuzzer does not need gigabytes.
fn options(prefer: Prefer) -> ReadOptions {
    ReadOptions {
        weld: true,
        prefer,
        max_expanded_bytes: 1 << 24,
        ..ReadOptions::default()
    }
}

fn check_positions(positions: &Positions) {
    assert!((0..positions.len()).all(|ix| {
        positions
            .get(ix)
            .is_some_and(|p| p.iter().all(|c| c.is_finite()))
    }));
}

fn check(result: Result<Mesh, Error>) {
    match result {
        Ok(mut mesh) => {
            let n_vertices = mesh.n_vertices();
            assert!(!mesh.elements.is_empty());
            assert!(
                mesh.elements
                    .indices()
                    .iter()
                    .all(|&ix| (ix as usize) < n_vertices)
            );
            check_positions(&mesh.positions);
            let exact = mesh.positions.to_f64();
            mesh.positions.narrow_if_exact();
            assert!(exact == mesh.positions.to_f64());
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
}

/// Reads a mesh, for either kind of element.
pub fn mesh(bytes: &[u8], format: Format) {
    check(read_bytes(bytes, format, "file", &options(Prefer::Volume)));
    check(read_bytes(
        bytes,
        format,
        "file",
        &options(Prefer::Triangles),
    ));
}

/// Reads a TetGen mesh. A zero byte separates its two files; the first byte chooses the kind of
/// cells of the second file.
pub fn tetgen(bytes: &[u8]) {
    let Some((kind, bytes)) = bytes.split_first() else {
        return;
    };
    let mut files = bytes.splitn(2, |&byte| byte == 0);
    let (nodes, cells) = (
        files.next().unwrap_or_default(),
        files.next().unwrap_or_default(),
    );
    let cells_name = if kind % 2 == 0 {
        "file.ele"
    } else {
        "file.face"
    };
    check(read_tetgen_bytes(
        nodes,
        "file.node",
        cells,
        cells_name,
        &options(Prefer::Volume),
    ));
}

/// Reads some frames of a sequence.
pub fn sequence(bytes: &[u8], format: SequenceFormat) {
    match Sequence::from_bytes(bytes.to_vec(), format, "file") {
        Ok(sequence) => {
            for frame_ix in [
                0,
                1,
                sequence.n_frames() / 2,
                sequence.n_frames().wrapping_sub(1),
                sequence.n_frames(),
            ] {
                match sequence.frame(frame_ix) {
                    Ok(positions) => {
                        assert!(
                            frame_ix < sequence.n_frames()
                                && positions.len() == sequence.n_points()
                        );
                        check_positions(&positions);
                    }
                    Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
                }
            }
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
}
