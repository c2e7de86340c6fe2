//! Parameters that end repetitions.

use super::tree::{Ast, Expr, ExprKind, Statement, StatementKind};

/// A parameter that ends a repetition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Count {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: i64,
}

/// The parameters of a model whose values are whole numbers, and which stand in an end of a repetition of statements; in the order
/// of the text.
///
/// ```
/// use halfarrow_compiler::{ast::{counts, parse}, span::FileId};
/// let text = "model M\nparam n = 90, m = 3\nfor i in 2..n { 0:a[i] -> R:b[i](m*1 ohm); a[i] -> 1:c[i] -> a[i - 1] }\n";
/// let found = &counts(&parse(text, FileId(0)).ast)[..];
/// assert!(matches!(found, [only] if only.name == "n" && only.value == 90));
/// ```
pub fn counts(model: &Ast) -> Vec<Count> {
    let mut ends = Vec::new();
    collect_ends(&model.statements, &mut ends);
    let declared = model.statements.iter().filter_map(|statement| match &statement.kind {
        StatementKind::Param(list) => Some(list),
        _ => None,
    });
    let counted = declared.flatten().filter_map(|d| {
        let plain = d.owner.is_none() && d.indices.is_empty() && d.unit.is_none();
        let value = d.value.as_ref().filter(|_| plain).and_then(whole)?;
        ends.contains(&d.name.text.as_str()).then(|| Count { name: d.name.text.clone(), value })
    });
    counted.collect()
}

/// The names in the ends of repetitions.
fn collect_ends<'t>(statements: &'t [Statement], ends: &mut Vec<&'t str>) {
    for statement in statements {
        match &statement.kind {
            StatementKind::For(l) => {
                [&l.from, &l.to].into_iter().for_each(|end| collect_names(end, ends));
                collect_ends(&l.body, ends);
            }
            StatementKind::Choice(c) => {
                collect_ends(&c.yes, ends);
                collect_ends(&c.no, ends);
            }
            StatementKind::Domain(d) => collect_ends(&d.body, ends),
            _ => {}
        }
    }
}

/// The names in a sum.
fn collect_names<'t>(e: &'t Expr, names: &mut Vec<&'t str>) {
    match &e.kind {
        ExprKind::Path(path) if path.parts.len() == 1 => names.push(&path.parts[0].name.text),
        ExprKind::Binary(b) => [&b.left, &b.right].into_iter().for_each(|side| collect_names(side, names)),
        _ => {}
    }
}

fn whole(e: &Expr) -> Option<i64> {
    match &e.kind {
        ExprKind::Number(n) if n.unit.is_none() => n.text.parse().ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::counts;
    use crate::ast::parse;
    use crate::span::FileId;

    fn found(body: &str) -> Vec<String> {
        let text =
            format!("model M\nparam n = 900 \"how many\"\nparam m = 4\nparam r = 1 ohm\nparam k = 2*m\n{body}\n");
        counts(&parse(&text, FileId(0)).ast).into_iter().map(|count| count.name).collect()
    }

    #[test]
    fn whole_numbers_that_end_repetitions_count() {
        assert_eq!(found("for i in 1..n { 0:a[i] -> R:b[i](r/n) }"), ["n"]);
        assert_eq!(found("for i in m..n - 1 { if i > 2 { for j in 1..k { 0:a[i, j] } } }"), ["n", "m"]);
        assert_eq!(found("if n > 3 { for i in 1..n { 0:a[i] } } else { for i in 1..m { 0:b[i] } }"), ["n", "m"]);
        assert_eq!(found("0:a -> R:b(r)\nlet s = sum(i in 1..n, i)"), [""; 0]);
    }
}
