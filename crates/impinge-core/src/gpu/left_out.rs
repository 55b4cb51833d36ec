//! What a question leaves out because of its elements, as the device has it.
//!
//! One buffer of words, which `kernels/left_out.wgsl` draws. Vertices are numbered as positions
//! are, elements as the plan numbers them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::engine::Engine;
use super::layout::{
    PINNED, RULES_GROUPS, RULES_LISTS, RULES_MARKS, RULES_N_GROUPS, RULES_N_PAIRS, RULES_PAIRS,
    Rule,
};
use super::pass_buffers::RulesOf;
use super::view::Motion;
use crate::plan::{LeftOut, Plan};
use crate::scene::elements::VertexRings;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::search::sink::reserve;

/// What memory is for.
const WHAT: &str = "what is left out on the device";

impl Engine {
    /// Whether the device leaves out candidates of a question, by the rules that were sent. Of
    /// frames that the host reads, the host leaves them out, also where they are split.
    pub(super) fn has_rules(&self, plan: &Plan) -> bool {
        let is_of_host = self.lane.motion == Motion::Still && !self.lane.is_encoded;
        plan.leaves_out() && !is_of_host
    }

    /// Sends the rules of a question, if it has any and they are not there.
    ///
    /// # Errors
    /// More than the device can bind at once; no memory.
    pub(super) fn send_rules(&mut self, plan: &Plan) -> Result<(), Error> {
        let Some(left_out) = plan.left_out() else {
            return Ok(());
        };
        let bodies: Vec<(BodyId, u64)> = self.world.bodies().collect();
        let pass_buffers = &mut self.lane.pass_buffers;
        let is_held = |of: &RulesOf| of.left_out.is(left_out) && of.bodies == bodies;
        if !pass_buffers.rules_of.as_ref().is_some_and(is_held) {
            pass_buffers.rules_of = None;
            let rules = rules(plan, left_out, &bodies)?;
            pass_buffers.rules.upload(&self.gpu, &rules)?;
            let left_out = Arc::clone(left_out);
            pass_buffers.rules_of = Some(RulesOf { left_out, bodies });
        }
        Ok(())
    }
}

/// All words.
fn rules(plan: &Plan, left_out: &LeftOut, bodies: &[(BodyId, u64)]) -> Result<Vec<Rule>, Error> {
    // Numbers that do not fit 32 bits are of more words than any device can bind.
    let mut words: Vec<u32> = vec![0; RULES_MARKS as usize];
    let named: BTreeSet<u32> = left_out
        .groups()
        .iter()
        .flat_map(|&(g, h)| [g, h])
        .collect();
    let numbers: BTreeMap<u32, u32> = named.into_iter().zip(1..).collect();
    let number = |group: &u32| numbers.get(group).copied().unwrap_or(0);
    let parts = plan.first_parts();
    let mut firsts = BTreeMap::new();
    let mut first = 0;
    for &(body, n_vertices) in bodies {
        firsts.insert(body, first);
        first += n_vertices as u32;
        reserve(&mut words, n_vertices as usize, WHAT)?;
        let marks = parts.get(&body).map(|&part| left_out.marks(part));
        let (groups, pinned) = marks.unwrap_or((None, None));
        words.extend((0..n_vertices as usize).map(|vertex| {
            let group = groups.map_or(0, |groups| number(&groups[vertex]));
            group | pinned.map_or(0, |pinned| u32::from(pinned[vertex]) * PINNED)
        }));
    }
    let both = left_out
        .groups()
        .iter()
        .flat_map(|&(g, h)| [[g, h], [h, g]]);
    let both: BTreeSet<[u32; 2]> = both.map(|pair| pair.map(|group| number(&group))).collect();
    put(&mut words, RULES_GROUPS, both.len() as u32, RULES_N_GROUPS);
    words.extend(both.into_iter().flatten());
    let lists: Vec<([BodyId; 2], &VertexRings)> = left_out.lists(plan).collect();
    if !lists.is_empty() {
        words[RULES_LISTS as usize] = words.len() as u32;
        put_lists(&mut words, bodies, &firsts, &lists)?;
    }
    let mut keys: Vec<u64> = Vec::new();
    let n_keys = left_out.keys().map(<[u64]>::len).sum();
    reserve(&mut keys, n_keys, WHAT)?;
    keys.extend(left_out.keys().flatten());
    keys.sort_unstable();
    put(&mut words, RULES_PAIRS, keys.len() as u32, RULES_N_PAIRS);
    reserve(&mut words, 2 * keys.len(), WHAT)?;
    words.extend(
        keys.iter()
            .flat_map(|&key| [(key >> 32) as u32, key as u32]),
    );
    Ok(words.into_iter().map(|word| Rule { word }).collect())
}

/// Says that so many pairs begin here.
fn put(words: &mut [u32], at: u32, n: u32, n_at: u32) {
    words[at as usize] = words.len() as u32;
    words[n_at as usize] = n;
}

/// Appends where the list of each vertex begins, and all lists.
fn put_lists(
    words: &mut Vec<u32>,
    bodies: &[(BodyId, u64)],
    firsts: &BTreeMap<BodyId, u32>,
    lists: &[([BodyId; 2], &VertexRings)],
) -> Result<(), Error> {
    let starts = words.len();
    let n_vertices: u64 = bodies.iter().map(|(_, n)| n).sum();
    reserve(words, n_vertices as usize + 1, WHAT)?;
    words.resize(starts + n_vertices as usize + 1, 0);
    let mut vertex = starts;
    for &(body, n_vertices) in bodies {
        let own = lists.iter().filter(|([of, _], _)| *of == body);
        let own = own.filter_map(|&([_, to], list)| Some((*firsts.get(&to)?, list)));
        let own: Vec<(u32, &VertexRings)> = own.collect();
        for of in 0..n_vertices as u32 {
            let begin = words.len();
            words[vertex] = begin as u32;
            vertex += 1;
            for (first, list) in &own {
                let list = list.of(of);
                reserve(words, list.len(), WHAT)?;
                words.extend(list.iter().map(|other| first + other));
            }
            if own.len() > 1 {
                words[begin..].sort_unstable();
            }
        }
    }
    words[vertex] = words.len() as u32;
    Ok(())
}
