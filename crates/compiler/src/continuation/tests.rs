use super::tree::{Kept, Part, Tree};
use super::*;
use crate::bond_graph::{NoFiles, Override};
use crate::compile::{self, to_bond_graph};

/// A line of resistors with a capacitor to ground behind each of them.
const LADDER: &str = "
param r = 1 ohm
param c = 1 mF
param volts = 1 V
for i in 1..n {
    1:wire[i] -> R:r[i](r)
    wire[i] -> 0:node[i] -> C:c[i](c)
    if i == 1 {
        Se:source(volts) -> wire[i]
    } else {
        node[i - 1] -> wire[i]
    }
}
output end = c[n].e : V
";

/// Masses in a row between springs, with friction to the ground that is solved for.
const ROW: &str = "
param k = 0.5 N/m
param m = 3 kg
for i in 1..n {
    1:v[i] -> I:m[i](m)
    v[i] -> R:b[i](e = 2 N.s/m*f + 0.5 N.s3/m3*f^3)
    if i > 1 {
        v[i - 1] -> 0:spring[i] -> v[i]
        spring[i] -> C:k[i](k = k, q0 = if i == 3 then 1 cm else 0 cm)
    }
}
Se:pull(2 N) -> v[1]
";

/// A line of pipes each of which is a component, with a loop of class 2 in each.
const PIPES: &str = "
component Pipe(param r = 1 Pa.s/m3, c = 2 m3/Pa; port left, right) {
    left -> 1:along -> 0:inside -> right
    along -> R:first(r)
    inside -> 1:leak -> R:law(f = 0.3 m3/s/Pa*e + 0.1 m3/s/Pa^3*e^3)
    leak -> R:second(2*r)
    inside -> C:store(c)
}
Se:source(3 Pa) -> 1:feed
feed -> R:inlet(1 Pa.s/m3)
for i in 1..n {
    Pipe:pipe[i](r = 1.5 Pa.s/m3)
    if i == 1 { feed -> pipe[i].left } else { pipe[i - 1].right -> pipe[i].left }
}
pipe[n].right -> R:outlet(4 Pa.s/m3)
";

/// Cells with an inner repetition, sampled and integrated signals, a table, and steps of a `when`.
const SIGNALS: &str = "
input push = 1 V
discrete level = 1
for i in 1..n {
    1:wire[i] -> R:r[i](3 ohm)
    wire[i] -> 0:node[i] -> C:c[i](0.2 F, q0 = 0.1 C)
    for j in 1..2 {
        node[i] -> 1:arm[i, j] -> I:l[i, j](0.5 H*j)
        arm[i, j] -> R:loss[i, j](e = 2 ohm*f*abs(f)/(1 A))
    }
    state turns[i]' = wire[i].f : C
    if i == 1 {
        Se:source(push) -> wire[i]
    } else {
        node[i - 1] -> wire[i]
    }
    if i > 2 and i != n {
        node[i - 2] -> TF:ratio[i](2) -> 1:far[i] -> node[i]
        far[i] -> R:damp[i](if level > 1 then 2 ohm else 3 ohm)
    }
}
when c[1].e > 2 V { level = 2 }
let last = turns[n] - turns[n - 1] : C
output end = c[n].e : V
";

fn model(n: usize, body: &str) -> String {
    format!("model Many\nparam n = {n}\n{body}")
}

fn text(text: &str) -> Text<'_> {
    Text { name: "many.bond", text, files: &NoFiles, overrides: &[] }
}

fn family_of(text: Text<'_>) -> Option<Family> {
    Family::of(text, &read(text))
}

fn larger(family: &Family, text: Text<'_>) -> Option<Family> {
    family.larger(text, &read(text))
}

/// A model as the continuation of smaller ones.
fn continued(text: Text<'_>) -> Option<(Family, Reached<BondGraph>)> {
    let mut family = family_of(text)?;
    loop {
        if let Some(reached) = family.bond_graph() {
            return Some((family, reached));
        }
        family = larger(&family, text)?;
    }
}

/// Where two trees differ first.
fn difference(a: &Tree, b: &Tree) -> Option<String> {
    match (a, b) {
        (Tree::Group(x, a), Tree::Group(y, b)) if x == y && a.len() == b.len() => differences(a, b),
        (Tree::Row(a), Tree::Row(b)) if a.len() == b.len() => differences(a, b),
        (Tree::Row(a), Tree::Row(b)) => {
            Some(differences(a, b).unwrap_or_default() + &format!(" ({} and {} entries)", a.len(), b.len()))
        }
        _ => (a != b).then(|| format!(": {a:?}, {b:?}")),
    }
}

fn differences(a: &[Tree], b: &[Tree]) -> Option<String> {
    let each = a.iter().zip(b).enumerate();
    each.filter_map(|(at, (a, b))| difference(a, b).map(|d| format!(" {at}{d}"))).next()
}

/// Where three trees have no rule.
fn obstacle(sizes: [&Tree; 3]) -> Option<String> {
    if Rule::learned(sizes).is_some() {
        return None;
    }
    let [a, b, c] = sizes.map(|tree| match tree {
        Tree::Group(_, parts) | Tree::Row(parts) => &parts[..],
        _ => &[],
    });
    let parts = a.iter().zip(b).zip(c).enumerate().map(|(at, ((a, b), c))| (at, [a, b, c]));
    let lengths = [a.len(), b.len(), c.len()];
    if lengths != [a.len(); 3] {
        let runs =
            |row: &[Tree]| super::segments::segments(row).into_iter().filter(|s| s.turns > 1).collect::<Vec<_>>();
        return Some(format!(": {lengths:?} entries, runs {:?}", [a, b, c].map(runs)));
    }
    let within = parts.filter_map(|(at, sizes)| obstacle(sizes).map(|o| format!(" {at}{o}"))).next();
    Some(within.unwrap_or_else(|| format!(": {sizes:?}")))
}

fn same<T: Part>(a: &T, b: &T) {
    let mut kept = Kept::default();
    if let Some(difference) = difference(&a.tree(&mut kept), &b.tree(&mut kept)) {
        panic!("continued and as it stands: {difference}");
    }
}

/// Where a rule gives another tree.
fn misfit(rule: &Rule, tree: &Tree, turn: i64, size: i64) -> String {
    let of_parts = |rules: &[Rule], trees: &[Tree]| {
        let found = rules.iter().zip(trees).enumerate().find(|(_, (rule, tree))| !rule.gives(tree, turn, size));
        found.map(|(at, (rule, tree))| format!(" {at}{}", misfit(rule, tree, turn, size))).unwrap_or_default()
    };
    match (rule, tree) {
        (Rule::Group(_, rules), Tree::Group(_, trees)) | (Rule::Few(rules), Tree::Row(trees)) => of_parts(rules, trees),
        (Rule::Row(_), Tree::Row(trees)) => {
            let kept = Kept::default();
            let (mut at, mut found) = (0, String::new());
            rule.for_each_entry(&At { turn, size, kept: &kept }, |rule, place| {
                let fits = trees.get(at).is_some_and(|tree| rule.gives(tree, place.turn, size));
                if !fits {
                    let turn = place.turn;
                    found = format!(" {at} of {} in turn {turn}: {rule:?}, {:?}", trees.len(), trees.get(at));
                }
                at += 1;
                fits.then_some(())
            });
            found
        }
        _ => format!(": {rule:?}, {tree:?}"),
    }
}

/// Why a family has no continued program.
fn obstacles(family: &Family) -> String {
    let mut kept = Kept::default();
    let program = |(graph, _): &Member| {
        schedule(&derive_equations(&assign_causality(graph).unwrap(), Form::Minimal).unwrap()).tree(&mut kept)
    };
    let trees: Vec<Tree> = family.members.iter().map(program).collect();
    all_obstacles(&trees, family.steps.members[3])
}

/// Why a model has no continued graph.
fn obstacle_of_graph(own: &str) -> String {
    let Some(sized) = Sized::of(text(own), &read(text(own))) else { return ": nothing counts".into() };
    let mut kept = Kept::default();
    let mut trees = Vec::new();
    for size in [16, 18, 20, 104] {
        let Some(member) = sized.member(size, NEAR[0]) else { return ": something is to be said of a member".into() };
        trees.push(member.ir.tree(&mut kept));
    }
    all_obstacles(&trees, 44)
}

/// Where trees have no rule, or not the one of the largest, which is so much larger.
fn all_obstacles(trees: &[Tree], size: i64) -> String {
    let first = [&trees[0], &trees[1], &trees[2]];
    let misfit = || misfit(&Rule::learned(first).unwrap(), &trees[3], 0, size);
    obstacle(first).unwrap_or_else(|| format!(", the largest is another:{}", misfit()))
}

/// A model of so many cells is continued, to exactly what it is compiled to as it stands.
fn exactly(n: usize, body: &str) {
    let own = model(n, body);
    let stands = to_bond_graph(text(&own)).unwrap_or_else(|found| panic!("{}", found.render(false)));
    assert!(stands.found.diagnostics.0.is_empty(), "{}", stands.found.render(false));
    let (family, reached) =
        continued(text(&own)).unwrap_or_else(|| panic!("no continued graph{}", obstacle_of_graph(&own)));
    assert_eq!(reached.found, stands.found);
    same(&reached.ir, &stands.ir);
    let by_larger = || larger(&family, text(&own))?.program(Form::Minimal);
    let program = family.program(Form::Minimal).or_else(by_larger);
    let program = program.unwrap_or_else(|| {
        panic!("no continued program{}", obstacles(larger(&family, text(&own)).as_ref().unwrap_or(&family)))
    });
    same(&program, &compile::compile(text(&own), Form::Minimal).unwrap().ir);
}

#[test]
fn a_ladder_is_continued_exactly() {
    exactly(1000, LADDER);
    exactly(1237, LADDER);
}

#[test]
fn masses_between_springs_are_continued_exactly() {
    exactly(900, ROW);
}

#[test]
fn signals_and_inner_repetitions_are_continued_exactly() {
    exactly(840, SIGNALS);
}

#[test]
fn components_with_loops_are_continued_exactly() {
    exactly(1700, PIPES);
}

#[test]
fn what_is_used_as_a_number_or_is_small_is_compiled_as_it_stands() {
    for (n, body) in [(1000, LADDER.replace("R:r[i](r)", "R:r[i](r*i)")), (200, LADDER.into())] {
        assert!(continued(text(&model(n, &body))).is_none());
    }
}

#[test]
fn a_number_that_some_sizes_share_with_another_does_not_deceive() {
    // The pool of a model has each number once, and 1000 is the number of cells here.
    let body = LADDER.replace("param c = 1 mF", "param c = 1000 F");
    let own = model(1000, &body);
    if let Some((_, reached)) = continued(text(&own)) {
        same(&reached.ir, &to_bond_graph(text(&own)).unwrap().ir);
    }
    let single = LADDER.replace("output end", "1:wire[500] -> R:twice(r)\noutput end");
    assert!(continued(text(&model(1000, &single))).is_none());
}

/// Nodes in a row, each with a storage; with more text in each turn, and behind the repetition.
fn row(within: &str, behind: &str) -> String {
    format!(
        "for i in 1..n {{
    0:a[i] -> C:c[i](1, e0 = 1)
    {within}
    if i > 1 {{
        a[i - 1] -> 1:w[i] -> a[i]
        w[i] -> R:r[i](3)
    }} else {{
        a[i] -> R:g(2)
    }}
}}
{behind}
"
    )
}

#[test]
fn numbers_that_grow_from_cell_to_cell_are_not_continued() {
    let counter = "if i == 1 {\n let y[1] = 1\n } else {\n let y[i] = y[i - 1] + 1\n }";
    let cell = "component Cell(CONST k = 1; port p; out next) {
    p -> 0:z -> R:x(2)
    let next = k + 1
    if k == 500 {
        z -> R:y(1)
    }
}";
    let chained = "if i == 1 {\n Cell:x[1](k = 1)\n } else {\n Cell:x[i](k = x[i - 1].next)\n }\n a[i] -> x[i].p";
    let cells = |kind: &str| format!("{}\n{}", cell.replace("CONST ", kind), row(chained, ""));
    for body in [
        row("", "param h = 1*n\nfor j in 1..h {\n if j == 500 {\n a[j] -> R:leak(1)\n }\n }"),
        row("", "param big = if 1*n > 500 then 1 else 0\nif big == 1 {\n a[3] -> R:leak(1)\n }"),
        row("", "param z = sum(j in 1..2*n, if j > 500 then 1 else 0)\na[2] -> R:leak(1 + z)"),
        row("", "const k[n] = 1\na[2] -> R:leak(min(dot(k, k), 300))"),
        row(&format!("{counter}\n if y[i] == 500 {{\n a[i] -> R:leak(1)\n }}"), ""),
        row(counter, "let z = 2*y[n]\na[1] -> R:leak(min(z, 1000))"),
        row(counter, "let z = y[n]\na[1] -> R:leak(min(z, 300))"),
        row(counter, "let m = y[n]\nfor q in 1..m {\n a[q] -> R:leak[q](1)\n }"),
        cells("const "),
        cells("param "),
    ] {
        let own = model(900, &body);
        assert!(continued(text(&own)).is_none(), "{own}");
        let small = model(20, &body);
        to_bond_graph(text(&small)).unwrap_or_else(|found| panic!("{}", found.render(false)));
    }
    exactly(900, &row("", ""));
    exactly(900, &row("", "a[3] -> R:same_as_a_size(16)\na[4] -> R:and_another(20)"));
    exactly(900, &row("", "param m = 3\nfor j in 1..m {\n a[j] -> R:leak[j](1)\n }"));
}

/// A rod, a line of so many parts of what it has as a whole.
const ROD: &str = "
param length = 2 m
param area = 3 cm^2
param modulus = 200 GPa
param mass = 5 kg
param drag = 0.1 N.s/m
param h = length/n
for i in 1..n {
    1:v[i] -> I:m[i](mass/n)
    v[i] -> R:b[i](drag/n + drag*min(n, 300)/n)
    if i == 1 { 1:v0 -> 0:force[1] -> v[1] } else { v[i - 1] -> 0:force[i] -> v[i] }
    force[i] -> C:k[i](k = modulus*area/h)
}
Sf:wall(0 m/s) -> v0
v[n] -> R:end(drag/(1 + h/(1 m)))
Se:pull(if n > 3 then 20 N else 1 N) -> v[n]
";

#[test]
fn what_is_divided_among_the_cells_is_continued_exactly() {
    exactly(900, ROD);
    exactly(901, &row("", "param h = 1*n\na[2] -> R:leak(1 + min(h, 300))\na[3] -> R:other(min(max(h - 200, 1), 4))"));
    exactly(902, &row("a[i] -> R:leak[i](1 + min(n, 500)/(2*n))", "let z = n\na[2] -> R:other(z)"));
}

#[test]
fn what_follows_from_the_count_decides_nothing_that_is_continued() {
    for body in [
        row("", "param half = n/2\na[half] -> R:leak(1)"),
        row("", "param far = 2*n\nfor j in 1..3 {\n if far > 1000 {\n a[j] -> R:leak[j](1)\n }\n }"),
        row("", "const far = n - 100\na[far] -> R:leak(1)"),
        row("", "let far = n - 100\nfor j in 1..far {\n a[j] -> R:leak[j](1)\n }"),
        format!(
            "component Few(param k = 2; port p) {{\n p -> 0:z\n for j in 1..k {{\n z -> R:r[j](1)\n }}\n}}\n{}",
            row("", "Few:few(k = n)\na[2] -> few.p")
        ),
    ] {
        let own = model(900, &body);
        to_bond_graph(text(&own)).unwrap_or_else(|found| panic!("{}", found.render(false)));
        assert!(continued(text(&own)).is_none(), "{own}");
    }
}

#[test]
fn a_size_that_is_set_counts() {
    let own = model(10, LADDER);
    let overrides = [("n", "900"), ("r", "3 ohm"), ("n", "1000")]
        .map(|(name, value)| Override { name: name.into(), value: value.into() });
    let text = Text { overrides: &overrides, ..text(&own) };
    let (_, reached) = continued(text).unwrap();
    let stands = to_bond_graph(text).unwrap();
    assert_eq!(reached.found, stands.found);
    same(&reached.ir, &stands.ir);
}

#[test]
fn what_is_otherwise_far_into_the_cells_is_not_continued() {
    let of_array = |array: &str, cell: &str| format!("{array}\n{}", row(cell, ""));
    let list = "let k = [if j > 500 then 2 else 1 for j in 1..1000]";
    let each = "for j in 1..1000 {\n let k[j] = floor(j/500)\n }";
    let parts = |name: &str| {
        format!("for j in 1..500 {{\n {name}[j] = 1\n }}\nparam other = 7\nfor j in 501..1000 {{\n {name}[j] = 2\n }}")
    };
    let inside = "component K(const r = 1; port p) {\n p -> 0:z\n for j in 1..r {\n z -> R:x[j](1)\n }\n}";
    for body in [
        // Conditions over several lines.
        row("", "if (n) >\n 500 {\n a[3] -> R:leak(1)\n }"),
        row("", "if (n - 500)*2 >\n 500 {\n a[3] -> R:leak(1)\n }"),
        row("", "if 2 > 1 and\n (n) > 500 and\n 3 > 2 {\n a[3] -> R:leak(1)\n }"),
        row("", "if min(n, 300) ==\n 300 {\n a[3] -> R:leak(1)\n }"),
        row("", "param limit = 500\nif 2*n + 10 >\n limit {\n a[3] -> R:leak(1)\n }"),
        row("if i > limit {\n a[i] -> R:x[i](1)\n }", "param limit = 500"),
        // Arrays whose entries are known far into the cells.
        of_array(list, "a[i] -> R:x[i](k[i])"),
        of_array(list, "a[i] -> 1:z[i] -> C:x[i](1, q0 = k[i])"),
        of_array(each, "a[i] -> R:x[i](1 + k[i])"),
        of_array(each, "if k[i] == 1 {\n a[i] -> R:x[i](1)\n }"),
        of_array("param k[1000] = [j for j in 1..1000]\nparam same = 300", "a[i] -> R:x[i](k[i])"),
        of_array(
            "for j in 1..1000 {\n if j == 500 {\n param k[j] = 7\n } else {\n param k[j] = 1\n }\n }",
            "a[i] -> R:x[i](k[i])",
        ),
        of_array(&parts("param k"), "a[i] -> R:x[i](k[i])"),
        of_array(&parts("discrete k"), "a[i] -> R:x[i](k[i])"),
        format!("{inside}\n{each}\n{}", row("K:x[i](r = 1 + k[i])\n a[i] -> x[i].p", "")),
        // Values that grow from cell to cell.
        row("if i == 1 {\n param k[1] = 500.5\n } else {\n param k[i] = k[i - 1] - 1\n }\n a[i] -> R:x[i](k[i])", ""),
        row("if i == 1 {\n param k[1] = 4\n } else {\n param k[i] = k[i - 1]/2\n }\n a[i] -> C:x[i](k[i])", ""),
        // Sums over all cells, and arrays of them.
        row("", "a[2] -> R:leak(min(max(sum(j in 1..n, 1), 200), 300))"),
        row("let y[i] = 1", "a[2] -> R:leak(min(max(dot(y, y), 200), 300))"),
        row("a[i] -> R:x[i](max(i, 300))", ""),
        row("", "param m = n - 899\na[3] -> R:leak[m](1)"),
    ] {
        let own = model(900, &body);
        to_bond_graph(text(&own)).unwrap_or_else(|found| panic!("{}\n{own}", found.render(false)));
        assert!(continued(text(&own)).is_none(), "{own}");
    }
    exactly(900, &row("let y[i] = 3", "let k = [1, 2, 3]\nfor j in 1..3 {\n a[j] -> R:leak[j](k[j])\n }"));
    exactly(900, &row("param k[i] = 2*r\n a[i] -> R:x[i](k[i])", "param r = 1/n"));
}

#[test]
fn what_is_between_both_ends_is_seen_or_not_continued() {
    let window = |near: usize| row(&format!("if i < n - {near} and i > {near} {{\n a[i] -> R:z[i](1)\n }}"), "");
    let steps = |by: usize, times: usize, then: &str| {
        let variable = |at: usize| if at == 0 { "i".to_string() } else { format!("b{at}") };
        let end = |at: usize| format!("{} - {by}", variable(at));
        let heads = (0..times).map(|at| format!("for {} in {}..{} {{\n", variable(at + 1), end(at), end(at)));
        row(&(heads.collect::<String>() + &then.replace("LAST", &variable(times)) + &"\n }".repeat(times)), "")
    };
    for body in [
        window(104),
        window(60),
        row("if i < n - 104 {\n if i > 104 {\n a[i] -> R:z[i](1)\n }\n }", ""),
        row("if not (i >= n - 104 or i <= 104) {\n a[i] -> R:z[i](1)\n }", ""),
        row(
            "for m in n - 104..n - 104 {\n let u[i] = if i < m and i > 104 then 2 else 1\n }\n a[i] -> R:z[i](u[i])",
            "",
        ),
        steps(104, 2, "if LAST == 50 {\n a[i] -> R:z[i](1)\n }"),
        steps(16, 7, "if LAST == 4 {\n a[i] -> R:z[i](1)\n }"),
        row("", "for b in n - 104..n - 104 {\n for d in b - 104..b - 104 {\n a[d] -> R:z(1)\n }\n }"),
        row("output s[i] = a[i].e*sum(j in 1..16, sum(k in 1..16, sum(l in 1..16, sum(m in 1..4, 1))))", ""),
    ] {
        let own = model(1700, &body);
        assert!(continued(text(&own)).is_none(), "{own}");
    }
    exactly(1700, &window(16));
    exactly(1700, &window(32));
}

#[test]
fn faults_far_into_the_cells_are_found() {
    for (body, fault) in [
        (row("let k[i] = 1", "let k[500] = 3"), "declared twice"),
        (row("output k[i] = a[i].e", "let k[500] = 3"), "declared twice"),
        (format!("for j in 1..500 {{\n param k[j] = 1\n }}\n{}", row("a[i] -> R:x[i](k[i])", "")), "there is no"),
        (format!("state s[1]' = 1\ninput u[500] = 1\n{}", row("a[i] -> R:x[i](u[i])", "")), "there is no"),
        (row("", "param m = n - 895\nparam k[4] = [1*j for j in 1..m]\na[3] -> R:x(k[2])"), "values"),
    ] {
        let own = model(900, &body);
        assert!(continued(text(&own)).is_none(), "{own}");
        let found = to_bond_graph(text(&own)).expect_err(&own).render(false);
        assert!(found.contains(fault), "{found}");
    }
}

#[test]
fn an_element_of_an_array_that_is_set_is_seen() {
    let own = model(900, &format!("param k[10] = 1\n{}", row("", "a[3] -> R:leak(k[3])")));
    assert!(continued(text(&own)).is_some());
    let overrides = [Override { name: "k[3]".into(), value: "2".into() }];
    assert!(continued(Text { overrides: &overrides, ..text(&own) }).is_none());
}

#[test]
fn what_is_imported_decides_as_the_text_does() {
    struct Imported(&'static str);
    impl crate::bond_graph::Files for Imported {
        fn read(&self, _: &str) -> Result<String, crate::bond_graph::FileError> {
            Ok(self.0.to_string())
        }
    }
    let of = |imported, own: &str| {
        let files = Imported(imported);
        let text = Text { files: &files, ..text(own) };
        to_bond_graph(text).unwrap_or_else(|found| panic!("{}", found.render(false)));
        continued(text).is_some()
    };
    let own = model(900, &format!("import \"more.bond\"\n{}", row("", "a[3] -> R:leak(lk)")));
    assert!(of("param lk = 1\n", &own));
    assert!(!of("if n > 500 {\n param lk = 1\n } else {\n param lk = 7\n }\n", &own));
}

/// Numbers without a pattern.
struct Random(u64);

impl Random {
    fn below(&mut self, count: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % count
    }

    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.below(of.len() as u64) as usize]
    }
}

/// A line of cells, each of which has some of what cells may have.
fn random_line(seed: u64) -> String {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let laws = ["3", "r", "e = 2*f + 0.3*f^3", "f = 0.2*e + 0.1*e^3", "f = 0.1*sinh(e)", "e = 2*f + f*abs(f)"];
    let starts = ["", ", q0 = 0.2", ", q0 = if i == 2 then 0.7 else 0"];
    let mut cell =
        String::from("    1:s[i]\n    0:p[i]\n    if i == 1 { Se:source(2) -> s[i] } else { p[i - 1] -> s[i] }\n");
    // What goes through all cells without a storage between them is one long sum, and its own at each size.
    cell += "    s[i] -> p[i] -> C:store[i](c)\n";
    let mut add = |random: &mut Random, chance: u64, line: String| {
        if random.below(100) < chance {
            cell += &format!("    {line}\n");
        }
    };
    for (at, name) in [("s[i]", "s"), ("p[i]", "p")] {
        let (law, start) = (random.one(&laws), random.one(&starts));
        add(&mut random, 60, format!("{at} -> R:r{name}[i]({law})"));
        add(&mut random, 40, format!("{at} -> C:c{name}[i](c{start})"));
        add(&mut random, 30, format!("{at} -> I:l{name}[i](0.4)"));
    }
    let law = random.one(&laws);
    add(&mut random, 30, format!("if i > 2 {{\n p[i - 2] -> 1:x[i] -> p[i]\n x[i] -> R:rx[i]({law})\n }}"));
    add(
        &mut random,
        30,
        "for j in 1..2 {\n p[i] -> 1:y[i, j] -> R:ry[i, j](j + 1.5)\n y[i, j] -> C:cy[i, j](0.1*j)\n }".into(),
    );
    add(&mut random, 20, "if i != n { p[i] -> R:ground[i](7) }".into());
    add(&mut random, 20, "state z[i]' = s[i].f - z[i]".into());
    format!("param r = 1.5\nparam c = 0.25\nfor i in 1..n {{\n{cell}}}\np[n] -> R:end(4)\n")
}

/// Lines of random cells are continued to exactly what they are compiled to, if they are; how many of them are.
fn random_lines(seeds: std::ops::Range<u64>) -> usize {
    let is_continued = |seed: &u64| {
        let own = model(1700 + *seed as usize % 7, &random_line(*seed));
        let stands = to_bond_graph(text(&own)).unwrap_or_else(|found| panic!("{}\n{own}", found.render(false)));
        let Some((family, reached)) = continued(text(&own)) else {
            println!("{seed}: no continued graph{}", obstacle_of_graph(&own));
            return false;
        };
        assert_eq!(reached.found, stands.found, "{own}");
        same(&reached.ir, &stands.ir);
        let by_larger = larger(&family, text(&own)).unwrap_or_else(|| panic!("{seed}: no larger members"));
        let Some(program) = family.program(Form::Minimal).or_else(|| by_larger.program(Form::Minimal)) else {
            println!("{seed}: no continued program{}", obstacles(&by_larger));
            return false;
        };
        same(&program, &compile::compile(text(&own), Form::Minimal).unwrap().ir);
        true
    };
    seeds.filter(is_continued).count()
}

#[test]
fn lines_of_random_cells_are_continued_exactly() {
    let continued = random_lines(0..8);
    assert!(continued >= 4, "{continued} of 8");
}

/// `SEEDS=200 FROM=0 cargo test -p halfarrow-compiler --lib -- continuation::tests::many --ignored --nocapture`
#[test]
#[ignore = "long"]
fn many_lines_of_random_cells() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let (from, count) = (number("FROM").unwrap_or(0), number("SEEDS").unwrap_or(100));
    println!("{} of {count} continued", random_lines(from..from + count));
}

/// What keeps a model of a file from being continued:
/// `MODEL=line.bond cargo test -p halfarrow-compiler --lib -- continuation::tests::obstacle --ignored --nocapture`
#[test]
#[ignore = "asks for a file"]
fn obstacle_of_a_file() {
    let own = std::fs::read_to_string(std::env::var("MODEL").expect("MODEL names a file")).expect("it can be read");
    let Some(family) = family_of(text(&own)) else { return println!("no family{}", obstacle_of_graph(&own)) };
    let is_whole = |family: &Family| family.bond_graph().is_some() && family.program(Form::Minimal).is_some();
    let family = if is_whole(&family) { family } else { larger(&family, text(&own)).unwrap_or(family) };
    match (family.bond_graph(), family.program(Form::Minimal)) {
        (Some(_), Some(_)) => println!("continued"),
        (None, _) => println!("no continued graph{}", obstacle_of_graph(&own)),
        (_, None) => println!("no continued program{}", obstacles(&family)),
    }
}
