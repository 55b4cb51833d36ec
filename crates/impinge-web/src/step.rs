//! Questions about steps, and their answers as flat arrays.

use impinge::{Clearance, Impact, Query, Start, Step, Toi};

use crate::error::Error;

/// Everything about a step's question except its bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepOptions {
    start: Start,
    toi: Toi,
    separation: f64,
    clearance: f64,
    clearance_share: f64,
}

impl StepOptions {
    /// `start` is `"report"`, `"skip"` or `"verify"`, `toi` is `"f32"` or `"f64"`. Separation and clearance are distances in the
    /// unit of the scene.
    ///
    /// # Errors
    /// Another word. Bad numbers are refused when the question is asked.
    pub fn new(
        start: &str,
        toi: &str,
        [separation, clearance, clearance_share]: [f64; 3],
    ) -> Result<Self, Error> {
        let word = |what, given: &str, allowed| Error::Word {
            what,
            given: given.to_owned(),
            allowed,
        };
        Ok(StepOptions {
            start: match start {
                "report" => Start::Report,
                "skip" => Start::Skip,
                "verify" => Start::Verify,
                _ => {
                    let allowed = "\"report\", \"skip\" or \"verify\"";
                    return Err(word("start", start, allowed));
                }
            },
            toi: match toi {
                "f32" => Toi::F32,
                "f64" => Toi::F64,
                _ => return Err(word("toi", toi, "\"f32\" or \"f64\"")),
            },
            separation,
            clearance,
            clearance_share,
        })
    }

    pub(crate) fn step(self, query: Query) -> Step {
        let clearance = Clearance::new(self.clearance).share(self.clearance_share);
        Step::new(query)
            .start(self.start)
            .toi(self.toi)
            .separation(self.separation)
            .clearance(clearance)
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
