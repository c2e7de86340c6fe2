//! What a build without pages that move says.

use super::Scene;
use crate::error::Problem;

impl Scene {
    /// Makes nothing.
    ///
    /// # Errors
    /// This build lacks the program that draws in space.
    pub fn page(&self) -> Result<String, Problem> {
        Err(Problem::NotBuilt { what: "write pages that move", feature: "animation" })
    }
}
