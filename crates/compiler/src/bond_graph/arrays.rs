//! Arrays of values: how many elements there are, and which shape their values have.

use super::families::Indices;
use super::repeat::Repeats;
use super::scope::TurnId;
use crate::ast::{self, ExprKind};
use crate::diagnostic::{Diagnostic, codes};

/// All indices of an array, each from 1, the last one fastest.
pub(super) struct Extents {
    extents: Vec<i64>,
    next: Option<Vec<i64>>,
}

impl Extents {
    /// Those of an array of so many elements each way; `None` if there are too many to count. Without indices there is one
    /// element.
    pub fn of(extents: &[i64]) -> Option<Extents> {
        extents.iter().try_fold(1i64, |count, e| count.checked_mul((*e).max(0)))?;
        let some = extents.iter().all(|e| *e > 0);
        Some(Extents { extents: extents.to_vec(), next: some.then(|| vec![1; extents.len()]) })
    }

    /// How many elements there are.
    pub fn count(&self) -> usize {
        self.extents.iter().map(|e| usize::try_from(*e).unwrap_or(0)).product()
    }
}

impl Iterator for Extents {
    type Item = Indices;

    fn next(&mut self) -> Option<Indices> {
        let now = self.next.take()?;
        let mut next = now.clone();
        for (index, extent) in next.iter_mut().zip(&self.extents).rev() {
            if *index < *extent {
                *index += 1;
                self.next = Some(next);
                break;
            }
            *index = 1;
        }
        Some(now.into())
    }
}

/// Whether an expression reads the variable of a repetition around it.
pub(super) fn reads_variable(repeats: &Repeats<'_>, turn: TurnId, e: &ast::Expr) -> bool {
    let reads = |e: &ast::Expr| reads_variable(repeats, turn, e);
    match &e.kind {
        ExprKind::Path(path) => {
            let bare = path.parts.len() == 1 && repeats.variable(turn, &path.parts[0].name.text).is_some();
            bare || path.parts.iter().any(|p| p.indices.iter().any(reads))
        }
        ExprKind::Rate(inner) => reads(inner),
        ExprKind::Call(call) => call.args.iter().any(|a| reads(&a.value)),
        ExprKind::List(list) => list.iter().any(reads),
        ExprKind::Repeated(r) | ExprKind::Sum(r) => reads(&r.value) || reads(&r.from) || reads(&r.to),
        ExprKind::Unary(u) => reads(&u.operand),
        ExprKind::Binary(b) => reads(&b.left) || reads(&b.right),
        ExprKind::If(i) => reads(&i.cond) || reads(&i.yes) || reads(&i.no),
        ExprKind::Number(_) | ExprKind::Text(_) | ExprKind::Missing => false,
    }
}

/// The fault of a value whose lists are not of the shape of its array. `length` gives the length of a list with `for`,
/// where it is known.
pub(super) fn misshapen<'a>(
    e: &'a ast::Expr,
    extents: &[i64],
    length: &mut dyn FnMut(&'a ast::Repeated) -> Option<i64>,
) -> Option<Diagnostic> {
    let (found, rest) = match &e.kind {
        ExprKind::List(list) => (Some(list.len() as i64), list.iter().collect::<Vec<_>>()),
        ExprKind::Repeated(r) => (length(r), vec![&*r.value]),
        ExprKind::Unary(u) => return misshapen(&u.operand, extents, length),
        ExprKind::Binary(b) => {
            return misshapen(&b.left, extents, length).or_else(|| misshapen(&b.right, extents, length));
        }
        ExprKind::If(i) => return misshapen(&i.yes, extents, length).or_else(|| misshapen(&i.no, extents, length)),
        _ => return None,
    };
    let Some((extent, inner)) = extents.split_first() else {
        let d = Diagnostic::error(codes::N021, "a list within a list has no place here", e.span, "one too many");
        return Some(d.hint("an array has as many lists within one another as it has indices"));
    };
    match found {
        Some(found) if found != *extent => {
            let title = format!("{extent} values are needed, not {found}");
            let d = Diagnostic::error(codes::N021, title, e.span, format!("a list of {found}"));
            Some(d.hint("give one value for all, or as many as there are elements"))
        }
        _ => rest.into_iter().find_map(|entry| misshapen(entry, inner, length)),
    }
}
