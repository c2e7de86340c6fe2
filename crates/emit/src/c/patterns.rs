//! Where the matrices of solve blocks have entries, and in which order sparse ones are eliminated, as tables of C.

use halfarrow_compiler::program::{BlockId, Matrix, Program};
use halfarrow_compiler::sparse::SymbolicFactors;

use super::written::{Written, needed, written};

/// Sparse matrices of more rows are not treated as full ones where the pivots of their order do not do: the room that
/// this takes is there for good.
pub(super) const FULL_AT_MOST: usize = 200;

/// The patterns of a model, each of them once.
#[derive(Debug, Clone, Default)]
pub(super) struct Patterns {
    different: Vec<Matrix>,
}

impl Patterns {
    /// Those of all solve blocks.
    pub fn of(program: &Program) -> Patterns {
        let mut patterns = Patterns::default();
        for block in program.blocks.values() {
            let matrix = block.matrix();
            if !patterns.different.iter().any(|other| is_alike(other, matrix)) {
                patterns.different.push(Matrix::clone(matrix));
            }
        }
        patterns
    }

    /// A pointer to the pattern of a block, and the number of its entries.
    pub fn of_block(&self, program: &Program, block: BlockId) -> (Written, usize) {
        let matrix = program.blocks[block].matrix();
        let number = self.different.iter().position(|other| is_alike(other, matrix)).expect("all blocks are known");
        (written!("&{}[{}]", needed("ha_patterns"), number), matrix.values.pattern().len())
    }

    /// Whether one of them has an order of its own.
    pub fn any_sparse(&self) -> bool {
        self.different.iter().any(|m| m.factors.is_some())
    }

    /// The tables.
    pub fn tables(&self) -> String {
        let mut text = String::new();
        let mut list = String::from("static const ha_pattern ha_patterns[] = {\n");
        for (i, matrix) in self.different.iter().enumerate() {
            let pattern = matrix.values.pattern();
            text += &table(&format!("ha_starts_{i}"), pattern.starts());
            text += &table(&format!("ha_columns_{i}"), pattern.columns());
            let symmetric = matrix.factors.is_some() && matrix.values.is_symmetric();
            let order = matrix.factors.as_ref().map(|f| order(&mut text, i, f, symmetric));
            let order = match (self.any_sparse(), order) {
                (false, _) => String::new(),
                (true, None) => ", NULL".to_string(),
                (true, Some(name)) => format!(", &{name}"),
            };
            list += &format!("    {{{}, ha_starts_{i}, ha_columns_{i}{order}}},\n", pattern.size());
        }
        text + &list + "};"
    }
}

/// Whether the same tables do for two matrices: what is symmetric is eliminated otherwise if it is large and sparse.
fn is_alike(one: &Matrix, other: &Matrix) -> bool {
    one.values.pattern() == other.values.pattern()
        && (one.factors.is_none() || one.values.is_symmetric() == other.values.is_symmetric())
}

/// The tables of an order; gives the name of the last one.
fn order(text: &mut String, number: usize, factors: &SymbolicFactors, symmetric: bool) -> String {
    let mirror = if symmetric { factors.mirror() } else { None };
    let lists = [
        ("rows", &factors.rows[..]),
        ("places", &factors.columns),
        ("lower_starts", factors.lower.starts()),
        ("lower", factors.lower.columns()),
        ("upper_starts", factors.upper.starts()),
        ("upper", factors.upper.columns()),
        ("matrix_starts", factors.matrix.starts()),
        ("matrix", factors.matrix.columns()),
        ("positions", &factors.positions),
    ];
    let names: Vec<String> = lists.iter().map(|(name, _)| format!("ha_{name}_{number}")).collect();
    names.iter().zip(lists).for_each(|(name, (_, values))| *text += &table(name, values));
    let mirror = mirror.map_or("NULL".to_string(), |mirror| {
        let name = format!("ha_mirror_{number}");
        *text += &table(&name, &mirror);
        name
    });
    let name = format!("ha_order_{number}");
    let lists = names.join(", ");
    let paired = paired(factors);
    *text += &format!("static const ha_order {name} = {{{}, {lists}, {mirror}, {paired}}};\n", u8::from(factors.odd));
    name
}

/// How many of the first places, two by two, have one entry above the diagonal each, two places on: the ends of a chain
/// that is eliminated from both of them.
fn paired(factors: &SymbolicFactors) -> usize {
    let upper = &factors.upper;
    let is_link = |place: usize| upper.row(place).len() == 1 && upper.columns()[place] as usize == place + 2;
    (0..factors.rows.len()).take_while(|&place| is_link(place)).count() / 2 * 2
}

fn table(name: &str, values: &[u32]) -> String {
    let texts: Vec<String> = values.iter().map(u32::to_string).collect();
    match texts.len() {
        0 => format!("static const int {name}[] = {{0}};\n"),
        1..=20 => format!("static const int {name}[] = {{{}}};\n", texts.join(", ")),
        _ => {
            let lines: Vec<String> = texts.chunks(20).map(|line| format!("    {}", line.join(", "))).collect();
            format!("static const int {name}[] = {{\n{}\n}};\n", lines.join(",\n"))
        }
    }
}
