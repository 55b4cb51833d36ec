// Stage `narrow`, first: candidates that the question leaves out because of their elements become
// NOTHING.
//
// In: candidates; the rules, see `gpu/left_out.rs`. Out: the same list. One thread per candidate.
// Cost: 32 bytes of corners, a mark per corner; where there are lists, up to 32 binary searches.
//
//   rules  [..5]: where each of the following begins, see RULES in layout.wgsl
//          of each vertex: bit 31 pinned, below the number of its group; 0: none that is named
//          pairs of groups that do not meet, both ways, sorted
//          of each vertex: where its list begins, and where the last one ends; the lists, each sorted
//          pairs of element numbers, sorted

@group(0) @binding(0) var<storage, read_write> candidates: array<Candidate>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> rules: array<u32>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> bodies: array<Body>;

fn mark(vertex: u32) -> u32 {
    return rules[RULES_MARKS + vertex];
}

fn are_pinned(corner: vec4<u32>) -> bool {
    return (mark(corner.x) & mark(corner.y) & mark(corner.z) & mark(corner.w) & PINNED) != 0u;
}

// Whether a pair is among n sorted ones.
fn has_pair(first: u32, n: u32, pair: vec2<u32>) -> bool {
    var low = 0u;
    var high = n;
    while low < high {
        let middle = low + (high - low) / 2u;
        let held = vec2<u32>(rules[first + 2u * middle], rules[first + 2u * middle + 1u]);
        if all(held == pair) {
            return true;
        }
        if held.x < pair.x || (held.x == pair.x && held.y < pair.y) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return false;
}

// Whether each vertex of one is in a group that does not meet that of each vertex of the other.
fn are_apart(a: vec4<u32>, b: vec4<u32>) -> bool {
    let n = rules[RULES_N_GROUPS];
    if n == 0u {
        return false;
    }
    let groups = rules[RULES_GROUPS];
    var of_a = array<u32, 4>(a.x, a.y, a.z, a.w);
    var of_b = array<u32, 4>(b.x, b.y, b.z, b.w);
    for (var i = 0u; i < 4u; i++) {
        if i > 0u && of_a[i] == of_a[i - 1u] {
            continue;
        }
        for (var j = 0u; j < 4u; j++) {
            let pair = vec2<u32>(mark(of_a[i]) & ~PINNED, mark(of_b[j]) & ~PINNED);
            if !has_pair(groups, n, pair) {
                return false;
            }
        }
    }
    return true;
}

fn has_in_list(lists: u32, vertex: u32, other: u32) -> bool {
    var low = rules[lists + vertex];
    var high = rules[lists + vertex + 1u];
    while low < high {
        let middle = low + (high - low) / 2u;
        let held = rules[middle];
        if held == other {
            return true;
        }
        if held < other {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return false;
}

// Whether some vertex of one has some vertex of the other in its list. Corners that are repeated
// come last.
fn are_listed(a: vec4<u32>, b: vec4<u32>) -> bool {
    let lists = rules[RULES_LISTS];
    if lists == 0u {
        return false;
    }
    var of_a = array<u32, 4>(a.x, a.y, a.z, a.w);
    var of_b = array<u32, 4>(b.x, b.y, b.z, b.w);
    for (var i = 0u; i < 4u; i++) {
        if i > 0u && of_a[i] == of_a[i - 1u] {
            continue;
        }
        for (var j = 0u; j < 4u; j++) {
            if j > 0u && of_b[j] == of_b[j - 1u] {
                continue;
            }
            if has_in_list(lists, of_a[i], of_b[j]) || has_in_list(lists, of_b[j], of_a[i]) {
                return true;
            }
        }
    }
    return false;
}

fn are_named(candidate: Candidate) -> bool {
    let n = rules[RULES_N_PAIRS];
    if n == 0u {
        return false;
    }
    let numbers = vec2<u32>(number_at(candidate.a & ~FLAG), number_at(candidate.b & ~FLAG));
    let pair = vec2<u32>(min(numbers.x, numbers.y), max(numbers.x, numbers.y));
    return has_pair(rules[RULES_PAIRS], n, pair);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = min(atomicLoad(&counters[N_CANDIDATES]), arrayLength(&candidates));
    if ix >= n {
        return;
    }
    let candidate = candidates[ix];
    let a = corners[candidate.a & ~FLAG];
    let b = corners[candidate.b & ~FLAG];
    if (are_pinned(a) && are_pinned(b)) || are_apart(a, b) || are_listed(a, b) || are_named(candidate) {
        candidates[ix] = Candidate(NOTHING, NOTHING);
    }
}
