//! What is told to the modeller.
