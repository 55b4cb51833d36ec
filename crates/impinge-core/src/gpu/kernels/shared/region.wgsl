// The region of a frame as floats: keys are clamped to magnitudes of at most 2^120, where
// differences cannot overflow, and turned back into floats. This keeps their order.

const KEY_LOWEST: u32 = 0x047fffffu; // of -2^120
const KEY_HIGHEST: u32 = 0xfb800000u; // of 2^120

fn value(key: u32) -> f32 {
    let inside = clamp(key, KEY_LOWEST, KEY_HIGHEST);
    return bitcast<f32>(select(~inside, inside & ~FLAG, (inside & FLAG) != 0u));
}

fn values(keys: vec3<u32>) -> vec3<f32> {
    return vec3<f32>(value(keys.x), value(keys.y), value(keys.z));
}
