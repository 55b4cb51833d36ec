// The names of a pair of a step: by global numbers for the caller's shaders, by slots for the host.
// Binding: `params`.

fn name_of(pair: PairKey) -> UnsureKey {
    let a = pair.low & ~FLAG;
    let b = pair.high & ~FLAG;
    if params.by_number == 0u {
        return UnsureKey(a, b);
    }
    let number_a = number_at(a);
    let number_b = number_at(b);
    return UnsureKey(min(number_a, number_b), max(number_a, number_b));
}
