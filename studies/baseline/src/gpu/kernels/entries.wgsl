// Declarations shared by the kernels of the uniform grid. The Rust version of `Entry` is in `gpu/kernels.rs`.

// A cell-element pair: a cell and a kept element. Sorted by key, the elements of a cell are
// adjacent, those of the first body before those of the second:
//
//   key   31                    1   0
//        +-----------------------+------+
//        |         cell          | body |
//        +-----------------------+------+
struct Entry {
    key: u32,
    kept: u32,
}

// Entries that one workgroup of a sort counts and scatters.
const BLOCK: u32 = 4096u;
// Values of a digit.
const DIGITS: u32 = 256u;

fn n_blocks_of(n: u32) -> u32 {
    return n / BLOCK + select(0u, 1u, n % BLOCK != 0u);
}
