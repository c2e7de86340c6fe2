//! Model text to syntax tree.
