// Stage `bounds`, second kernel: the boxes of one wide level of the trees from the level below.
//
// In and out: nodes `first .. first + count`, one thread each. Cost: at most eight boxes read.

@group(0) @binding(0) var<storage, read> bodies: array<Body>;
@group(0) @binding(1) var<storage, read_write> nodes: array<Node>;
@group(0) @binding(2) var<uniform> params: Params;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    if ix < params.count {
        refit(params.first + ix);
    }
}
