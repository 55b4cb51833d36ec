//! The program from outside: the built binary, on files made for the test.

mod advance;
mod answer;
mod check;
mod contacts;
mod demo;
#[cfg(feature = "gpu")]
mod devices;
mod doors;
mod first_sight;
mod fix;
mod harness;
mod hostile;
mod near;
mod probe;
mod render;
mod rows;
mod safe;
mod schema;
mod sequence;
mod shared_data;
mod signals;
mod step;
mod tiles;
mod usage;
mod vertices;
