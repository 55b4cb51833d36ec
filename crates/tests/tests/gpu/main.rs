//! The GPU backend: against the oracle and the CPU, and its filters in a model of its arithmetic,
//! which needs neither device nor feature.

#[cfg(feature = "gpu")]
mod caller;
#[cfg(feature = "gpu")]
mod empty;
mod filters;
#[cfg(feature = "gpu")]
mod kept;
#[cfg(feature = "gpu")]
mod left_out;
#[cfg(feature = "gpu")]
mod liars;
#[cfg(feature = "gpu")]
mod lists;
#[cfg(feature = "gpu")]
mod lost;
#[cfg(feature = "gpu")]
mod pairs;
#[cfg(feature = "gpu")]
mod recording;
#[cfg(feature = "gpu")]
mod resident_steps;
#[cfg(feature = "gpu")]
mod safe;
#[cfg(feature = "gpu")]
mod stages;
#[cfg(feature = "gpu")]
mod steps;
#[cfg(feature = "gpu")]
mod submissions;
