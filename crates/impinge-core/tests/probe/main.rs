//! Points and rays: every decision held against rational arithmetic.

mod cast;
mod closest;
mod inside;
mod oracle;
