//! Exact predicates: written next.
