// The slot of an invocation's entry in a list, if it has one: one entry of the counter per
// workgroup. All invocations of a workgroup call it together.
var<workgroup> n_entries: atomic<u32>;
var<workgroup> first_slot: u32;

fn slot_in(counter: u32, has_entry: bool, lane: u32) -> u32 {
    if lane == 0u {
        atomicStore(&n_entries, 0u);
    }
    workgroupBarrier();
    var slot = 0u;
    if has_entry {
        slot = atomicAdd(&n_entries, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        first_slot = reserve(counter, atomicLoad(&n_entries));
    }
    workgroupBarrier();
    return first_slot + slot;
}
