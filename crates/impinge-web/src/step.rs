//! Questions about steps, and their answers as flat arrays.

use impinge::{Impact, Query, Start, Step, Toi};

use crate::error::Error;

/// Everything about a step's question except its bodies.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepOptions {
    start: Start,
    toi: Toi,
    separation: f64,
}

impl StepOptions {
    /// `start` is `"report"` or `"skip"`, `toi` is `"f32"` or `"f64"`, `separation` a distance in the unit of the scene.
    ///
    /// # Errors
    /// Another word. A bad separation is refused when the question is asked.
    pub fn new(start: &str, toi: &str, separation: f64) -> Result<Self, Error> {
        let word = |what, given: &str, allowed| Error::Word {
            what,
            given: given.to_owned(),
            allowed,
        };
        Ok(StepOptions {
            start: match start {
                "report" => Start::Report,
                "skip" => Start::Skip,
                _ => return Err(word("start", start, "\"report\" or \"skip\"")),
            },
            toi: match toi {
                "f32" => Toi::F32,
                "f64" => Toi::F64,
                _ => return Err(word("toi", toi, "\"f32\" or \"f64\"")),
            },
            separation,
        })
    }

    pub(crate) fn step(self, query: Query) -> Step {
        Step::new(query)
            .start(self.start)
            .toi(self.toi)
            .separation(self.separation)
    }
}

/// Impacts as flat arrays, one entry or row per impact.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FlatImpacts {
    /// The kind, as its index in [`PairKind::ALL`](impinge::PairKind::ALL).
    pub kinds: Vec<u8>,
    /// Rows `[body_a, element_a, body_b, element_b]`.
    pub rows: Vec<u32>,
    /// Times in [0, 1].
    pub times: Vec<f64>,
    /// 1 for impacts at the start, else 0.
    pub at_start: Vec<u8>,
}

impl FlatImpacts {
    /// Flattens impacts; `number` maps the library's body index to the caller's number.
    pub(crate) fn new<'a>(
        impacts: impl IntoIterator<Item = &'a Impact>,
        number: impl Fn(u32) -> u32,
    ) -> Self {
        let mut flat = FlatImpacts::default();
        for impact in impacts {
            let [body_a, a, body_b, b] = impact.row();
            flat.kinds.push(impact.kind as u8);
            flat.rows.extend([number(body_a), a, number(body_b), b]);
            flat.times.push(impact.toi);
            flat.at_start.push(u8::from(impact.at_start));
        }
        flat
    }
}
