//! The whole detector on scenes made from bytes: every method must agree with the oracle, and nothing
//! may panic, whatever the numbers.
//!
//! The first byte chooses how coordinates are read: as small integers, where everything is degenerate, or
//! as raw bits of f32 or f64, including NaN. Then bodies follow: a byte for kind and size, vertices, corners.

#![no_main]

use impinge::{Backend, Detector, Elements, Error, Method, Pairs, Query, Scene, Settings, SharedVertex};
use libfuzzer_sys::fuzz_target;

struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, tail) = self.0.split_first_chunk::<N>()?;
        self.0 = tail;
        Some(*head)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    fn coordinate(&mut self, mode: u8) -> Option<f64> {
        match mode % 3 {
            0 => self.byte().map(|byte| f64::from(byte % 4)),
            1 => self.take().map(|bits| f64::from(f32::from_le_bytes(bits))),
            _ => self.take().map(f64::from_le_bytes),
        }
    }
}

fn build(bytes: &mut Bytes<'_>) -> Option<(Scene, Query)> {
    let mode = bytes.byte()?;
    let mut scene = Scene::new();
    while let Some(what) = bytes.byte() {
        let n_vertices = 3 + what as usize % 16;
        let n_primitives = 1 + bytes.byte()? as usize % 80;
        let mut positions = Vec::with_capacity(n_vertices);
        for _ in 0..n_vertices {
            positions.push([
                bytes.coordinate(mode)?,
                bytes.coordinate(mode)?,
                bytes.coordinate(mode)?,
            ]);
        }
        let mut corner = || bytes.byte().map(|byte| u32::from(byte) % (n_vertices as u32 + 1));
        let elements: Option<Elements> = if what & 0x80 == 0 {
            let faces: Option<Vec<[u32; 3]>> =
                (0..n_primitives).map(|_| Some([corner()?, corner()?, corner()?])).collect();
            faces.map(Into::into)
        } else {
            let tets: Option<Vec<[u32; 4]>> = (0..n_primitives)
                .map(|_| Some([corner()?, corner()?, corner()?, corner()?]))
                .collect();
            tets.map(Into::into)
        };
        let added = if what & 0x40 == 0 {
            let positions: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|x| x as f32)).collect();
            scene.add(elements?, positions)
        } else {
            scene.add(elements?, positions)
        };
        match added {
            Ok(_)
            | Err(
                Error::NonFinitePosition { .. }
                | Error::CoordinateOutOfRange { .. }
                | Error::VertexIndexOutOfRange { .. },
            ) => {}
            Err(error) => panic!("{error}"),
        }
        if scene.n_bodies() == 4 {
            break;
        }
    }
    let rule = if mode & 0x80 == 0 { SharedVertex::Skip } else { SharedVertex::Resolve };
    Some((scene, Query::everything().shared_vertex(rule)))
}

fn answer(scene: &Scene, query: &Query, method: Method) -> Pairs {
    let mut detector = Detector::with_settings(Settings {
        method,
        backend: Backend::Cpu,
        threads: 1,
        ..Settings::default()
    })
    .expect("these settings are allowed");
    detector.detect(scene, query).expect("a checked scene is answered").clone()
}

fuzz_target!(|data: &[u8]| {
    let Some((scene, query)) = build(&mut Bytes(data)) else {
        return;
    };
    let expected = answer(&scene, &query, Method::Naive);
    for method in [Method::Clusters, Method::Cells] {
        let found = answer(&scene, &query, method);
        assert!(expected.same_as(&found), "{method:?}");
    }
});
