//! Exact expressions.
