//! Which elements intersect, on the CPU: against the oracle, whatever the method, threshold,
//! instruction set and history.

mod changes;
mod creases;
mod culled;
mod data;
mod edges;
mod golden;
mod hubs;
mod left_out;
mod limits;
mod many;
mod methods;
mod regular;
mod short;
mod transform;
mod tuning;
