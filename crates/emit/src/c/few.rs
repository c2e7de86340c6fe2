//! The elimination of few equations written out: the operations of `lu.c` in the same order, without its loops.

use std::fmt::Write;
use std::ops::RangeInclusive;
use std::sync::LazyLock;

/// How many equations are few.
pub(super) const FEW: RangeInclusive<usize> = 2..=4;

/// The template of all of them.
pub(super) static TEMPLATE: LazyLock<String> =
    LazyLock::new(|| FEW.map(|n| factor(n) + &substitute(n) + &solve(n)).collect());

/// `ha_lu_factor_full` where the matrix is not symmetric.
fn factor(n: usize) -> String {
    let mut text = format!(
        "//item ha_lu_factor_{n}
/* The same of {n} equations, written out. */
static int ha_lu_factor_{n}(ha_lu *l)
{{
    const $real *a = l->matrix;
    $real *f = l->factors;
    $real *s = l->scale;
    $real own;
    $real most;
    $real other;
    int pivot;
"
    );
    for row in 0..n {
        line(&mut text, 1, format_args!("l->order[{row}] = {row};"));
        line(&mut text, 1, format_args!("s[{row}] = $DBL_MIN;"));
        for at in row * n..(row + 1) * n {
            line(&mut text, 1, format_args!("f[{at}] = a[{at}];"));
            line(&mut text, 1, format_args!("s[{row}] = $fabs(a[{at}]) > s[{row}] ? $fabs(a[{at}]) : s[{row}];"));
        }
    }
    for k in 0..n {
        let diagonal = k * n + k;
        line(&mut text, 1, format_args!("own = $fabs(f[{diagonal}]) / s[{k}];"));
        line(&mut text, 1, format_args!("most = own;"));
        line(&mut text, 1, format_args!("pivot = {k};"));
        for row in k + 1..n {
            line(&mut text, 1, format_args!("other = $fabs(f[{}]) / s[{row}];", row * n + k));
            line(&mut text, 1, format_args!("if (other > most || other != other) {{"));
            line(&mut text, 2, format_args!("pivot = {row};"));
            line(&mut text, 2, format_args!("most = other;"));
            line(&mut text, 1, format_args!("}}"));
        }
        line(&mut text, 1, format_args!("if (own >= $0.1 * most) {{"));
        line(&mut text, 2, format_args!("pivot = {k};"));
        line(&mut text, 2, format_args!("most = own;"));
        line(&mut text, 1, format_args!("}}"));
        line(&mut text, 1, format_args!("if (!(most > $DBL_EPSILON * ($real){n} && $ha_finite(most))) {{"));
        line(&mut text, 2, format_args!("return 0;"));
        line(&mut text, 1, format_args!("}}"));
        if k + 1 < n {
            line(&mut text, 1, format_args!("if (pivot != {k}) {{"));
            line(&mut text, 2, format_args!("$ha_lu_swap(l, {k}, pivot);"));
            line(&mut text, 1, format_args!("}}"));
        }
        for row in k + 1..n {
            let below = row * n + k;
            line(&mut text, 1, format_args!("if (f[{below}] != $0.0) {{"));
            line(&mut text, 2, format_args!("const $real factor = f[{below}] / f[{diagonal}];"));
            for j in k + 1..n {
                line(&mut text, 2, format_args!("const $real product_{j} = factor * f[{}];", k * n + j));
            }
            line(&mut text, 2, format_args!("f[{below}] = factor;"));
            for j in k + 1..n {
                line(&mut text, 2, format_args!("f[{}] -= product_{j};", row * n + j));
            }
            line(&mut text, 1, format_args!("}}"));
        }
    }
    text + "    return 1;\n}\n\n"
}

/// `ha_lu_substitute`.
fn substitute(n: usize) -> String {
    let mut text = format!(
        "//item ha_lu_substitute_{n}
static void ha_lu_substitute_{n}(const ha_lu *l, $real *b)
{{
    const $real *f = l->factors;
    const int *o = l->order;
"
    );
    (0..n).for_each(|row| line(&mut text, 1, format_args!("$real w{row} = b[o[{row}]];")));
    line(&mut text, 1, format_args!("$real product;"));
    for row in 0..n {
        (0..row).for_each(|k| less(&mut text, format_args!("w{row}"), format_args!("f[{}] * w{k}", row * n + k)));
    }
    for row in (0..n).rev() {
        (row + 1..n).for_each(|k| less(&mut text, format_args!("w{row}"), format_args!("f[{}] * w{k}", row * n + k)));
        line(&mut text, 1, format_args!("w{row} /= f[{}];", row * n + row));
        line(&mut text, 1, format_args!("b[{row}] = w{row};"));
    }
    text + "}\n\n"
}

/// What `ha_lu_solve` does with factors of a matrix that is not symmetric.
fn solve(n: usize) -> String {
    let mut text = format!(
        "//item ha_lu_solve_{n}
static void ha_lu_solve_{n}(const ha_lu *l, $real *b)
{{
    const $real *a = l->matrix;
    $real rest[{n}];
    $real product;
"
    );
    (0..n).for_each(|row| line(&mut text, 1, format_args!("rest[{row}] = b[{row}];")));
    line(&mut text, 1, format_args!("$ha_lu_substitute_{n}(l, b);"));
    for row in 0..n {
        (0..n).for_each(|k| less(&mut text, format_args!("rest[{row}]"), format_args!("a[{}] * b[{k}]", row * n + k)));
    }
    line(&mut text, 1, format_args!("$ha_lu_substitute_{n}(l, rest);"));
    for row in 0..n {
        line(&mut text, 1, format_args!("if ($ha_finite(rest[{row}])) {{"));
        line(&mut text, 2, format_args!("b[{row}] += rest[{row}];"));
        line(&mut text, 1, format_args!("}}"));
    }
    text + "}\n\n"
}

/// Takes a product off, which is rounded first.
fn less(text: &mut String, from: std::fmt::Arguments, product: std::fmt::Arguments) {
    line(text, 1, format_args!("product = {product};"));
    line(text, 1, format_args!("{from} -= product;"));
}

fn line(text: &mut String, depth: usize, of: std::fmt::Arguments) {
    writeln!(text, "{:depth$}{of}", "", depth = 4 * depth).expect("texts take all that is written");
}
