// Between stages: turns a counter into the arguments of the next dispatch, an indirect one.
//
// In: one counter. Out: workgroups in x and y, neither above 32,768, for the elements that fitted.
// Cost: one thread.

@group(0) @binding(0) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> arguments: array<Arguments>;
@group(0) @binding(2) var<uniform> params: Params;

@compute @workgroup_size(1)
fn main() {
    let n = min(atomicLoad(&counters[params.counter]), params.capacity);
    arguments[params.slot] = arguments_for(n, params.per_group);
}
