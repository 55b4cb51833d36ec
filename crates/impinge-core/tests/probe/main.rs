//! Points and rays: every decision held against rational arithmetic.

mod closest;
mod inside;
mod oracle;
