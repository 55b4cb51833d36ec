// Takes room for `n` elements from a counter. A counter that wraps around at 2^32 sets `TOO_MUCH`.
fn reserve(counter: u32, n: u32) -> u32 {
    if n == 0u {
        return 0u;
    }
    let first = atomicAdd(&counters[counter], n);
    if first + n < first {
        atomicStore(&counters[TOO_MUCH], 1u);
    }
    return first;
}
