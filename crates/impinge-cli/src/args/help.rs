//! The help. Options that many commands share are shown once, by `impinge help detection`,
//! `help rows` and `help picture`; the help of a command names them in one line per topic.

use clap::{Arg, ArgAction, Args as _, Command, CommandFactory, FromArgMatches};

use super::{Cli, DetectorArgs, PictureArgs, RowsArgs};

/// Options that many commands share.
struct Topic {
    /// The word after `impinge help`.
    name: &'static str,
    about: &'static str,
    /// The options, in an empty command.
    options: fn(Command) -> Command,
    text: &'static str,
}

const TOPICS: [Topic; 3] = [
    Topic {
        name: "detection",
        about: "How pairs are found: options that change the time, never the answer",
        options: DetectorArgs::augment_args,
        text: "",
    },
    Topic {
        name: "picture",
        about: "Options of pictures: --png FILE of most commands",
        options: |command| {
            let png = Arg::new("png").long("png").value_name("FILE");
            PictureArgs::augment_args(command.arg(png.help("The picture (.png)")))
        },
        text: "\
Pictures are drawn on a GPU if there is one, else on the CPU; they look alike. Colliding elements of body 0 are red,
those of body 1 blue, then green, orange, …; hidden ones show through faintly. Elsewhere colours go from red to yellow:
`near` red where bodies touch, yellow at --distance; `safe` red at a bound of 0, yellow at --most; `step` at the start,
red what touches then, yellow what touches at the end.",
    },
    Topic {
        name: "rows",
        about: "Files of rows, one per pair that is found: --rows, --candidates, --contacts, --regions",
        options: RowsArgs::augment_args,
        text: "\
Without --rows-format the name of the file decides: .csv, .jsonl, .npy or .parquet; standard output is CSV. If the rows go to
standard output, the summary goes to standard error. Rows are sorted. Bodies are numbered from 0 as given,
vertices and faces as in the file, welded vertices as the first of them; edges are the unique pairs (low, high) of vertices
in the order of (high, low). Faces of tetrahedra are those of the surface, by tetrahedron, then by the opposite corner.
Columns of numbers alone are a plain array in .npy files, others a structured one.

`pairs`, `self`: body_a, element_a, body_b, element_b
`near`: kind, body_a, element_a, body_b, element_b, type, feature_a, feature_b, parallel, distance, ax, ay, az, bx,
  by, bz. The kind names the elements: vf a vertex and a face, ee two edges, and so on. The type says which
  features are nearest, with ipc-toolkit's names: P_T, P_E0, EA_EB, ... A feature is v0, v1 or v2 (a vertex of
  the element), e0, e1 or e2 (edge k goes from vertex k to the next) or f. Points are point_a and point_b
  in .jsonl and .npy files. Points are rounded, the distance is rounded down.
`probe`: point, element, feature, distance, x, y, z, with --signed then place: inside, on or outside, and the distance is
  negative outside. Distances are rounded down. The nearest point is one column, nearest, in .jsonl and .npy files. With
  --nearest K up to K rows per point, nearest first. --locate adds a last column: tetrahedron, -1 for none.
`safe`: body, vertex, safe: how far it may move, rounded down; a row per vertex of the file, or of a node's or group's faces
`cast`: ray, element, feature, t, t_end, b0, b1, b2 (barycentrics in .jsonl and .npy files); with --hits any: ray, hit
`step`: kind, body_a, element_a, body_b, element_b, toi. Of kind vf, a is the vertex and b the face. Mesh files
  hold faces, so kinds are vf and ee; ev and vv are of bodies of edges or points, which the library and the
  Python module have.
`sequence`: the columns of `pairs`, with --ccd those of `step`, after the number of the frame
--candidates of `step`: those of `step` without toi, written run by run, so that memory need not hold all of
  them: see --memory-budget
--contacts of `pairs` and `self`: one row per corner of the intersection of two triangles, which is a point, the
  two ends of a segment, or the corners of a polygon if both lie in one plane. feature_a and feature_b say
  where the corner lies in each triangle: on vertex 7 (v7), edge 7-9 (e7-9) or face 3 (f3). In .npy files a shape is
  1 (point), 2 (segment) or 3 (polygon); kind_a and kind_b are 0 (vertex), 1 (edge) or 2 (face), beside two numbers.
--regions of `pairs` and `self`: body_a, body_b, contacts, x, y, z, low_x, …, high_z, length, patch_area, area_x, area_y,
  area_z, nx, ny, nz, depth, volume, inside_a, inside_b. A region is connected contacts of two bodies: how many, its
  middle, its box, the length of its curves, the area in common planes, the area that the curves span. Push body a along
  (nx, ny, nz), and the overlap shrinks fastest. Of two closed surfaces also depth, the extent of the region along
  (nx, ny, nz) (pushed that far, they may still overlap), the volume in common, and how many vertices of each are
  inside the other; no volume where vertices or edges meet exactly what they meet, as of aligned boxes. Where a surface
  crosses itself, volume, area, normal, depth and regions mean nothing. What is not known is empty, in .npy files NaN.",
    },
];

/// Options that write rows, whichever command has them.
const ROWS: [&str; 5] = ["rows", "rows_format", "candidates", "contacts", "regions"];

/// Reads the command line. Prints help, or an error of usage, and ends the program if that is all
/// there is to do.
pub fn parse() -> Cli {
    let matches = command().get_matches();
    if let Some(topic) = matches
        .subcommand_name()
        .and_then(|name| TOPICS.iter().find(|topic| topic.name == name))
    {
        // As for `--help`, a closed pipe is no error.
        let _ = topic.command().print_long_help();
        std::process::exit(0);
    }
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// The command line, with the topics as hidden commands, so that `impinge help TOPIC` finds them.
pub fn command() -> Command {
    // Once: every argument of every command is looked for in them.
    let options = TOPICS.each_ref().map(Topic::own_options);
    let with_commands = Cli::command().mut_subcommands(|command| shortened(command, &options));
    with_help(with_commands).subcommands(TOPICS.iter().map(Topic::command))
}

impl Topic {
    fn command(&self) -> Command {
        (self.options)(Command::new(self.name))
            .about(self.about)
            .after_help(self.text)
            .override_usage("impinge COMMAND … [OPTIONS]")
            .disable_help_flag(true)
            .disable_version_flag(true)
            .hide(true)
    }

    /// Its options that have a heading.
    fn own_options(&self) -> Vec<Arg> {
        let command = (self.options)(Command::new(self.name));
        let own = command.get_arguments();
        own.filter(|own| own.get_help_heading().is_some())
            .cloned()
            .collect()
    }

    /// Whether an option of a command belongs to this topic, which has these options.
    fn has(&self, own: &[Arg], arg: &Arg) -> bool {
        match self.name {
            "rows" => ROWS.contains(&arg.get_id().as_str()),
            _ => own.iter().any(|own| {
                own.get_id() == arg.get_id() && own.get_help_heading() == arg.get_help_heading()
            }),
        }
    }
}

/// The command without the options of the topics in its help, which names them in one line per
/// topic.
fn shortened(command: Command, options: &[Vec<Arg>; TOPICS.len()]) -> Command {
    let mut more = String::new();
    for (topic, own) in TOPICS.iter().zip(options) {
        let of_topic = command.get_arguments().filter(|arg| topic.has(own, arg));
        let names: Vec<String> = of_topic
            .filter_map(|arg| Some(format!("--{}", arg.get_long()?)))
            .collect();
        if !names.is_empty() {
            let start = if more.is_empty() { "More:\n" } else { "" };
            let call = format!("impinge help {}", topic.name);
            more += &format!("{start}  {call:<24}{}\n", names.join(" "));
        }
    }
    let examples = command.get_after_help().map(ToString::to_string);
    let after = [Some(more).filter(|more| !more.is_empty()), examples];
    let after: Vec<String> = after.into_iter().flatten().collect();
    // A row's file stays among the command's own options, because its help says what is written.
    let shared = |arg: &Arg| {
        TOPICS
            .iter()
            .zip(options)
            .any(|(topic, own)| topic.name != "rows" && topic.has(own, arg))
    };
    let short = command
        .mut_args(|arg| match shared(&arg) {
            true => arg.hide(true),
            false => arg,
        })
        .mut_subcommands(|command| shortened(command, options));
    with_help(match after.is_empty() {
        true => short,
        false => short.after_help(after.join("\n")),
    })
}

/// `--help` prints one line per option; `impinge help COMMAND` also says what each of its values
/// means.
fn with_help(command: Command) -> Command {
    if command.is_disable_help_flag_set() {
        return command;
    }
    command.disable_help_flag(true).arg(
        Arg::new("help")
            .short('h')
            .long("help")
            .help_heading(None)
            .help("Print help; `impinge help COMMAND` explains the values of options")
            .action(ArgAction::HelpShort),
    )
}
