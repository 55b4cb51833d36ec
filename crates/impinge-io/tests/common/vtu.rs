//! The sample as VTU, in every storage.

use super::{Order, TETRAHEDRA, base64, coordinates};

#[derive(Clone, Copy, PartialEq)]
pub enum VtuStorage {
    Ascii,
    Inline,
    InlineZlib,
    Raw,
    RawLz4,
    Base64,
    Base64Zlib,
}

pub const STORAGES: [(&str, VtuStorage); 7] = [
    ("vtu ascii", VtuStorage::Ascii),
    ("vtu inline", VtuStorage::Inline),
    ("vtu inline zlib", VtuStorage::InlineZlib),
    ("vtu raw", VtuStorage::Raw),
    ("vtu raw lz4", VtuStorage::RawLz4),
    ("vtu base64", VtuStorage::Base64),
    ("vtu base64 zlib", VtuStorage::Base64Zlib),
];

pub fn vtu(storage: VtuStorage) -> Vec<u8> {
    use VtuStorage::*;
    let order = Order::Little;
    let offsets: Vec<i64> = (1..=TETRAHEDRA.len() as i64).map(|n| 4 * n).collect();
    let arrays = [
        (
            "Float32",
            "Points",
            " NumberOfComponents=\"3\"",
            order.f32s(coordinates().map(|c| c as f32)),
            words(coordinates()),
        ),
        (
            "Int32",
            "connectivity",
            "",
            order.i32s(TETRAHEDRA.as_flattened().iter().map(|&ix| ix as i32)),
            words(TETRAHEDRA.as_flattened()),
        ),
        (
            "Int64",
            "offsets",
            "",
            order.i64s(offsets.clone()),
            words(offsets),
        ),
        (
            "UInt8",
            "types",
            "",
            vec![10; TETRAHEDRA.len()],
            words([10; TETRAHEDRA.len()]),
        ),
    ];
    let mut appended: Vec<u8> = Vec::new();
    let mut elements = Vec::new();
    for (kind, name, more, bytes, ascii) in arrays {
        let start = format!("<DataArray type=\"{kind}\" Name=\"{name}\"{more}");
        let encoded = encode(storage, &bytes);
        elements.push(match storage {
            Ascii => format!("{start} format=\"ascii\">\n{ascii}\n</DataArray>\n"),
            Inline | InlineZlib => format!(
                "{start} format=\"binary\">\n  {}\n</DataArray>\n",
                String::from_utf8(encoded).unwrap()
            ),
            _ => {
                let offset = appended.len();
                appended.extend(encoded);
                format!("{start} format=\"appended\" offset=\"{offset}\"/>\n")
            }
        });
    }
    let compressor = match storage {
        InlineZlib | Base64Zlib => " compressor=\"vtkZLibDataCompressor\"",
        RawLz4 => " compressor=\"vtkLZ4DataCompressor\"",
        _ => "",
    };
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\"{compressor}>\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"5\" NumberOfCells=\"2\">\n<PointData/>\n<Points>\n{}</Points>\n<Cells>\n{}</Cells>\n</Piece>\n</UnstructuredGrid>\n",
        elements[0],
        elements[1..].concat(),
    )
    .into_bytes();
    if matches!(storage, Raw | RawLz4 | Base64 | Base64Zlib) {
        let encoding = if matches!(storage, Raw | RawLz4) {
            "raw"
        } else {
            "base64"
        };
        out.extend(format!("<AppendedData encoding=\"{encoding}\">\n  _").bytes());
        out.extend(appended);
        out.extend(b"\n</AppendedData>\n");
    }
    out.extend(b"</VTKFile>\n");
    out
}

fn words<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
    values
        .into_iter()
        .map(|value| value.to_string())
        .collect::<Vec<_>>()
        .join(" ")
}

/// An array in the storage's encoding, after its header of u32 numbers.
fn encode(storage: VtuStorage, bytes: &[u8]) -> Vec<u8> {
    use VtuStorage::*;
    let u32s = |values: &[usize]| {
        values
            .iter()
            .flat_map(|&value| (value as u32).to_le_bytes())
            .collect::<Vec<u8>>()
    };
    // Two blocks, the second one shorter.
    let block = bytes.len() / 2 + 1;
    let blocks = |compress: &dyn Fn(&[u8]) -> Vec<u8>| {
        let blocks: Vec<Vec<u8>> = bytes.chunks(block).map(compress).collect();
        let mut header = vec![blocks.len(), block, bytes.len() % block];
        header.extend(blocks.iter().map(Vec::len));
        (u32s(&header), blocks.concat())
    };
    let zlib = |bytes: &[u8]| miniz_oxide::deflate::compress_to_vec_zlib(bytes, 6);
    match storage {
        Ascii => Vec::new(),
        Raw => [u32s(&[bytes.len()]), bytes.to_vec()].concat(),
        Inline | Base64 => base64(&[u32s(&[bytes.len()]), bytes.to_vec()].concat()).into_bytes(),
        InlineZlib | Base64Zlib => {
            // Header and data are encoded separately, each with its padding.
            let (header, data) = blocks(&zlib);
            (base64(&header) + &base64(&data)).into_bytes()
        }
        RawLz4 => {
            let (header, data) = blocks(&|bytes| lz4_flex::block::compress(bytes));
            [header, data].concat()
        }
    }
}
