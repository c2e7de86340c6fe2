//! Models of any size that show how cost grows: each a short text, with the number of its cells as a parameter.

/// A family of models, one for each size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// `n` sections of a resistor and a capacitor: a band.
    Ladder,
    /// A square net of `n` times `n` nodes whose resistors are on causal loops.
    Mesh,
    /// `n` rigid links in a plane with springs and dampers between them, and dependent inertias.
    Beam,
    /// A plane pendulum of `n` rods.
    Chain,
    /// A square grid of `n` times `n` capacitors, with a cubic law in every third resistor: stiff.
    Grid,
    /// `n` four-bar linkages one behind the other: a closed loop each, one degree of freedom together.
    FourBars,
}

impl Family {
    /// All of them.
    pub const ALL: [Family; 6] =
        [Family::Ladder, Family::Mesh, Family::Beam, Family::Chain, Family::Grid, Family::FourBars];

    /// What it is called on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Family::Ladder => "ladder",
            Family::Mesh => "mesh",
            Family::Beam => "beam",
            Family::Chain => "chain",
            Family::Grid => "grid",
            Family::FourBars => "fourbars",
        }
    }

    fn text(self) -> &'static str {
        match self {
            Family::Ladder => include_str!("families/ladder.bond"),
            Family::Mesh => include_str!("families/mesh.bond"),
            Family::Beam => include_str!("families/beam.bond"),
            Family::Chain => include_str!("families/chain.bond"),
            Family::Grid => include_str!("families/grid.bond"),
            Family::FourBars => include_str!("families/fourbars.bond"),
        }
    }

    /// The model text of a size, with a name of its own. `--set n=...` gives it another size.
    ///
    /// ```
    /// use halfarrow::{Family, Form, Model};
    /// let text = Family::FourBars.model("Linkages", 3);
    /// let linkages = Model::from_text("linkages.bond", &text, &[])?;
    /// assert_eq!(linkages.equations(Form::Minimal)?.dof, 1);
    /// # Ok::<(), halfarrow::Error>(())
    /// ```
    pub fn model(self, name: &str, size: usize) -> String {
        let sized = |line: &str| match line.strip_prefix("param n = ").and_then(|rest| rest.split_once(' ')) {
            Some((_, rest)) => format!("param n = {size} {rest}\n"),
            None => format!("{line}\n"),
        };
        let text: String = self.text().lines().map(sized).collect();
        text.replacen("model Family", &format!("model {name}"), 1)
    }
}
