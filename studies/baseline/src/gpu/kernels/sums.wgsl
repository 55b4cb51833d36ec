// Sums over the lanes of a workgroup of 256 or fewer.

var<workgroup> running: array<u32, 256>;

// The sum of `n` over the lanes up to this one. All `width` lanes of the workgroup must call it.
fn sum_up_to(lane: u32, n: u32, width: u32) -> u32 {
    var sum = n;
    running[lane] = sum;
    workgroupBarrier();
    // Each step adds the sum that ends twice as far back.
    for (var back = 1u; back < width; back *= 2u) {
        var before = 0u;
        if lane >= back {
            before = running[lane - back];
        }
        workgroupBarrier();
        sum += before;
        running[lane] = sum;
        workgroupBarrier();
    }
    return sum;
}
