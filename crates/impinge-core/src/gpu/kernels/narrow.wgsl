// Stage `narrow`: the filter with three answers.
//
// In: candidates. Out: keys of pairs that certainly intersect, and keys of unsure pairs for exact
// arithmetic on the host. One thread per candidate. Cost: 32 bytes of corners and 72 (96) of
// positions read.
// Invariant: yes and no are proofs, whatever the device's rounding (`docs/exactness.md`).
//
// A triangle's fourth corner repeats its third. `WITH_SOLIDS` is false when no body has
// tetrahedra, which keeps the code for them, and the registers it needs, out of the pipeline.

override WITH_SOLIDS: bool = true;

@group(0) @binding(0) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read_write> pairs: array<PairKey>;
@group(0) @binding(5) var<storage, read_write> unsure: array<UnsureKey>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read> bodies: array<Body>;

var<workgroup> n_yes: atomic<u32>;
var<workgroup> n_unsure: atomic<u32>;
var<workgroup> first_yes: u32;
var<workgroup> first_unsure: u32;

fn vertex_bits(vertex: u32) -> vec3<u32> {
    let word = 3u * vertex;
    return vec3<u32>(positions[word], positions[word + 1u], positions[word + 2u]);
}

fn magnitude(bits: vec3<u32>) -> vec3<u32> {
    return bits & vec3<u32>(0x7fffffffu);
}

fn decide(candidate: Candidate) -> i32 {
    let are_neighbours = (candidate.b & FLAG) != 0u;
    let a = corners[candidate.a & ~FLAG];
    let b = corners[candidate.b & ~FLAG];
    let a0 = vertex_bits(a.x);
    let a1 = vertex_bits(a.y);
    let a2 = vertex_bits(a.z);
    let a3 = vertex_bits(a.w);
    let b0 = vertex_bits(b.x);
    let b1 = vertex_bits(b.y);
    let b2 = vertex_bits(b.z);
    let b3 = vertex_bits(b.w);
    // Compared as integers: infinities never reach the arithmetic.
    let of_a = max(max(magnitude(a0), magnitude(a1)), max(magnitude(a2), magnitude(a3)));
    let of_b = max(max(magnitude(b0), magnitude(b1)), max(magnitude(b2), magnitude(b3)));
    let of_both = max(of_a, of_b);
    let largest = max(max(of_both.x, of_both.y), of_both.z);
    if largest > LARGEST_BITS {
        return UNSURE;
    }
    let slack = select(0.0, NARROWING * bitcast<f32>(largest), (candidate.a & FLAG) != 0u);
    if WITH_SOLIDS {
        if a.z != a.w || b.z != b.w {
            if are_neighbours {
                return UNSURE;
            }
            var solid_a = Solid(array<vec3<f32>, 4>(bitcast<vec3<f32>>(a0), bitcast<vec3<f32>>(a1),
                bitcast<vec3<f32>>(a2), bitcast<vec3<f32>>(a3)), a.z == a.w);
            var solid_b = Solid(array<vec3<f32>, 4>(bitcast<vec3<f32>>(b0), bitcast<vec3<f32>>(b1),
                bitcast<vec3<f32>>(b2), bitcast<vec3<f32>>(b3)), b.z == b.w);
            return solids(&solid_a, &solid_b, slack);
        }
    }
    if are_neighbours {
        return neighbours(a.xyz, b.xyz,
            bitcast<vec3<f32>>(a0), bitcast<vec3<f32>>(a1), bitcast<vec3<f32>>(a2),
            bitcast<vec3<f32>>(b0), bitcast<vec3<f32>>(b1), bitcast<vec3<f32>>(b2), slack,
        );
    }
    return triangles(
        bitcast<vec3<f32>>(a0), bitcast<vec3<f32>>(a1), bitcast<vec3<f32>>(a2),
        bitcast<vec3<f32>>(b0), bitcast<vec3<f32>>(b1), bitcast<vec3<f32>>(b2), slack,
    );
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = min(atomicLoad(&counters[N_CANDIDATES]), arrayLength(&candidates));
    if lane == 0u {
        atomicStore(&n_yes, 0u);
        atomicStore(&n_unsure, 0u);
    }
    workgroupBarrier();
    var answer = NO;
    var low = 0u;
    var high = 0u;
    var slot = 0u;
    if ix < n {
        let candidate = candidates[ix];
        if candidate.a != NOTHING {
            answer = decide(candidate);
        }
        if answer != NO {
            let a = number_at(candidate.a & ~FLAG);
            let b = number_at(candidate.b & ~FLAG);
            low = min(a, b);
            high = max(a, b);
        }
    }
    if answer == YES {
        slot = atomicAdd(&n_yes, 1u);
    } else if answer == UNSURE {
        slot = atomicAdd(&n_unsure, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        first_yes = reserve(N_PAIRS, atomicLoad(&n_yes));
        first_unsure = reserve(N_UNSURE, atomicLoad(&n_unsure));
    }
    workgroupBarrier();
    if answer == YES {
        slot += first_yes;
        if slot < arrayLength(&pairs) {
            pairs[slot] = PairKey(low, high);
        }
    } else if answer == UNSURE {
        slot += first_unsure;
        if slot < arrayLength(&unsure) {
            unsure[slot] = UnsureKey(low, high);
        }
    }
}
