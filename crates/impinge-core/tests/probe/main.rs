//! Points and rays: every decision held against rational arithmetic.

mod inside;
mod oracle;
