//! The words of the libraries' enumerations as values of options, each with a line of help.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use impinge::{Backend, Hit, Method, PairKind, Precision, SharedVertex, Start};
use impinge_check::Repair;

/// Reads one of some words.
fn one_of<T: Copy + Send + Sync + 'static>(
    name: fn(T) -> &'static str,
    words: &'static [(T, &'static str)],
) -> impl TypedValueParser<Value = T> {
    let values = words
        .iter()
        .map(|&(one, help)| PossibleValue::new(name(one)).help(help));
    PossibleValuesParser::new(values).try_map(move |word| {
        let found = words.iter().find(|&&(one, _)| name(one) == word);
        found.map(|&(one, _)| one).ok_or("no such word")
    })
}

/// Parsers of the words that enumerations have in every language, and a test that none is left out.
macro_rules! words {
    ($($parser:ident: $type:ident { $($variant:ident: $help:literal,)+ })+) => {
        $(pub fn $parser() -> impl TypedValueParser<Value = $type> {
            one_of($type::name, &[$(($type::$variant, $help)),+])
        })+

        #[test]
        fn every_word_is_a_value() {
            $(let parser = $parser();
            let values = parser.possible_values().expect("values").map(|value| value.get_name().to_owned());
            let (mut given, mut all) = (values.collect::<Vec<_>>(), $type::ALL.map($type::name));
            given.sort_unstable();
            all.sort_unstable();
            assert_eq!(given, all);)+
        }
    };
}

words! {
    method: Method {
        Auto: "The grid for large meshes that are asked about for the first time, clusters as \
            soon as they come back",
        Clusters: "Groups fixed by topology; the fastest method for meshes that move",
        Cells: "The two-level grid; for `near`, `safe` and `step`, which do not use it, clusters",
        Naive: "Every box against every box; slow, the reference for the other methods",
    }
    backend: Backend {
        Auto: "A GPU if there is one, else the CPU",
        Cpu: "The CPU",
        Gpu: "A GPU, or an error if there is none",
    }
    shared_vertex: SharedVertex {
        Skip: "None",
        Resolve: "Those that also meet outside their common vertices, edge or face",
    }
    precision: Precision {
        F32: "Single precision",
        F64: "Double precision",
    }
    start: Start {
        Verify: "Reported with the time 0, and the start is asked for intersections",
        Report: "Reported with the time 0",
        Skip: "Ignored, whatever they do later in the step",
    }
    kind: PairKind {
        VertexFace: "A vertex and a face",
        EdgeEdge: "Two edges",
        EdgeVertex: "An edge and a vertex",
        VertexVertex: "Two vertices",
        EdgeFace: "An edge and a face",
        FaceFace: "Two faces",
    }
    hits: Hit {
        First: "What it hits first; of several elements there the lowest",
        Any: "Whether it hits anything",
        All: "All that it hits",
    }
    repair: Repair {
        Weld: "Vertices at exactly the same position become one",
        Duplicates: "Of faces with the same vertices the first stays; none where two of opposite \
            orientations are an inner wall or a fin of a closed surface",
        Degenerate: "Faces of zero area go; one along an edge divides its neighbours there, at most \
            16, so that no gap opens",
        Orient: "Neighbours get the same orientation, by turning the fewest faces of each piece",
        SplitEdges: "Edges of more than two faces come apart",
        SplitVertices: "Vertices of several fans come apart",
        CloseHoles: "Holes of up to --close-holes edges are closed",
        Outward: "Closed shells are turned outward, cavities inward",
        Unused: "Vertices of no face go",
    }
}

/// As [`start`] for tiles, without help for the word that they refuse: the error says why.
pub fn start_of_tiles() -> impl TypedValueParser<Value = Start> {
    let words = start();
    let values = words.possible_values().into_iter().flatten();
    let values = values.map(|value| {
        let is_refused = value.get_name() == Start::Verify.name();
        value.hide(is_refused)
    });
    PossibleValuesParser::new(values.collect::<Vec<_>>()).try_map(|word| {
        let found = Start::ALL.into_iter().find(|start| start.name() == word);
        found.ok_or("no such word")
    })
}

/// What becomes a body of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BodiesArg {
    /// Each node of a glTF file that has a mesh, each item of a 3MF file; other files are one body
    /// each
    Nodes,
    /// Each object (o) of an OBJ file, or each group (g) of one without objects; other files are
    /// one body each
    Groups,
    /// Each file
    File,
}

impl BodiesArg {
    /// The error where no file has such parts.
    pub fn misfit(self) -> String {
        match self {
            BodiesArg::Nodes => "--bodies nodes: only glTF and 3MF files have nodes",
            BodiesArg::Groups => "--bodies groups: only OBJ files have groups",
            BodiesArg::File => "--bodies file: every file is a body",
        }
        .to_owned()
    }
}
