// Stage `bounds`, third kernel: all the narrow levels at the top of the trees in one launch.
//
// One workgroup walks levels `first .. first + count` upward, with a barrier between levels instead
// of one launch per level. Cost: the boxes of these levels, read and written once.

@group(0) @binding(0) var<storage, read> bodies: array<Body>;
@group(0) @binding(1) var<storage, read> levels: array<Level>;
@group(0) @binding(2) var<storage, read_write> nodes: array<Node>;
@group(0) @binding(3) var<uniform> params: Params;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    for (var level_ix = 0u; level_ix < params.count; level_ix++) {
        let level = levels[params.first + level_ix];
        for (var ix = lane; ix < level.count; ix += 256u) {
            refit(level.first + ix);
        }
        storageBarrier();
    }
}
