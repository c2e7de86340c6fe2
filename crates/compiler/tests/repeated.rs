//! Repetitions and indices: models written with them are those written out by hand.

use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, Elaborated, NoFiles, Override};
use halfarrow_compiler::compile::{Text, compile, to_equations};
use halfarrow_compiler::diagnostic::{Diagnostics, Sources, render};
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::textbook::show;

fn elaborate(text: &str, set: &[(&str, &str)]) -> Elaborated {
    let mut sources = Sources::new();
    let file = sources.add("main.bond", text);
    let parsed = ast::parse(text, file);
    let overrides: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: (*name).into(), value: (*value).into() }).collect();
    let mut result = bond_graph::elaborate(parsed.ast, sources, &NoFiles, &overrides);
    let mut all = parsed.diagnostics;
    all.append(&mut result.diagnostics.0);
    result.diagnostics = Diagnostics(all);
    result
}

fn graph(text: &str, set: &[(&str, &str)]) -> BondGraph {
    let result = elaborate(text, set);
    let said = render(&result.diagnostics, &result.sources, false);
    let graph = result.graph.unwrap_or_else(|| panic!("{said}\n{text}"));
    bond_graph::verify(&graph).unwrap();
    graph
}

/// A text whose names have no brackets: `m[1]` is `m_1_`.
fn plain(text: impl ToString) -> String {
    text.to_string().replace(['[', ']'], "_").replace("units in", "")
}

/// Both texts give the same graph, equations and program but for the names. In the first names have indices, in the
/// second the brackets are underscores.
fn alike(repeated: &str, by_hand: &str) {
    let (a, b) = (graph(repeated, &[]), graph(by_hand, &[]));
    // Lines of parameters that only the first has are those that shape it.
    let without = |text: String| {
        text.lines().filter(|l| !l.contains("const n")).map(|l| l.to_string() + "\n").collect::<String>()
    };
    let (a, b) = (without(plain(a)), without(plain(b)));
    assert_eq!(a.replace("parameters _SI_\n\n", ""), b.replace("parameters _SI_\n\n", ""));
    let text = |text| Text { name: "main.bond", text, files: &NoFiles, overrides: &[] };
    for form in [Form::Minimal, Form::Break, Form::Lagrange] {
        let (a, b) = (to_equations(text(repeated), form).unwrap().ir, to_equations(text(by_hand), form).unwrap().ir);
        assert_eq!(plain(show(a)), plain(show(b)), "{form:?}");
    }
    let program = |t| compile(text(t), Form::Minimal).unwrap().ir;
    assert_eq!(program(repeated).states.len(), program(by_hand).states.len());
}

#[test]
fn a_row_of_masses_is_the_one_written_out() {
    let repeated = "model M
        for i in 1..3 {
            1:m[i] -> I:body[i](2*i, f0 = 0.1*i)
            if i == 1 {
                Se:push(3) -> m[i]
            } else {
                m[i-1] -> 0:x[i] -> m[i] as link[i]
                x[i] -> C:spring[i](k = 10*i)
                guess spring[i].q = i/10
                prefer spring[i]
            }
            m[i] -> R:drag[i](0.1)
            state s[i]' = m[i].f from i
            let e[i] = body[i].f^2
            output y[i] = s[i] + e[i]
        }
        stroke link[2] at x[2]
        output all = sum(i in 1..3, e[i]) - sum(i in 1..0, e[i])
        constraint still: m[3].f = m[1].f
    ";
    let by_hand = "model M
        1:m_1_ -> I:body_1_(2, f0 = 0.1)
        Se:push(3) -> m_1_
        m_1_ -> R:drag_1_(0.1)
        1:m_2_ -> I:body_2_(4, f0 = 0.2)
        m_1_ -> 0:x_2_ -> m_2_ as link_2_
        x_2_ -> C:spring_2_(k = 20)
        m_2_ -> R:drag_2_(0.1)
        1:m_3_ -> I:body_3_(6, f0 = 0.3)
        m_2_ -> 0:x_3_ -> m_3_ as link_3_
        x_3_ -> C:spring_3_(k = 30)
        m_3_ -> R:drag_3_(0.1)
        state s_1_' = m_1_.f from 1
        state s_2_' = m_2_.f from 2
        state s_3_' = m_3_.f from 3
        let e_1_ = body_1_.f^2
        let e_2_ = body_2_.f^2
        let e_3_ = body_3_.f^2
        output y_1_ = s_1_ + e_1_
        output y_2_ = s_2_ + e_2_
        output y_3_ = s_3_ + e_3_
        guess spring_2_.q = 2/10, spring_3_.q = 3/10
        prefer spring_2_, spring_3_
        stroke link_2_ at x_2_
        output all = e_1_ + e_2_ + e_3_
        constraint still: m_3_.f = m_1_.f
    ";
    alike(repeated, by_hand);
}

#[test]
fn a_net_with_two_indices_is_the_one_written_out() {
    let repeated = "model M
        param n = 2
        for i in 1..n {
            for j in 1..n {
                0:v[i,j] -> C:c[i,j](i + 2*j)
                if j > 1 { v[i,j - 1] -> 1:h[i,j] -> v[i,j]
                    h[i,j] -> R:rh[i,j](1) }
                if i > 1 { v[i - 1,j] -> 1:w[i,j] -> v[i,j]
                    w[i,j] -> R:rw[i,j](2) }
            }
        }
        Sf:in(1) -> v[1,1]
    ";
    let mut by_hand = String::from("model M\n");
    for (i, j) in [(1, 1), (1, 2), (2, 1), (2, 2)] {
        by_hand += &format!("0:v_{i},{j}_ -> C:c_{i},{j}_({})\n", i + 2 * j);
        if j > 1 {
            by_hand += &format!("v_{i},{0}_ -> 1:h_{i},{j}_ -> v_{i},{j}_\nh_{i},{j}_ -> R:rh_{i},{j}_(1)\n", j - 1);
        }
        if i > 1 {
            by_hand += &format!("v_{0},{j}_ -> 1:w_{i},{j}_ -> v_{i},{j}_\nw_{i},{j}_ -> R:rw_{i},{j}_(2)\n", i - 1);
        }
    }
    by_hand += "Sf:in(1) -> v_1,1_\n";
    // A name has no comma; the letter in its place is one that nothing else has.
    let result = graph(repeated, &[]).to_string().replace("const n = 2\n", "");
    let hand = graph(&by_hand.replace(',', "ï"), &[]).to_string();
    let lines =
        |text: String| text.lines().skip_while(|l| *l != "elements").map(|l| l.to_string() + "\n").collect::<String>();
    assert_eq!(plain(lines(result)), lines(hand).replace('ï', ","));
}

#[test]
fn components_are_repeated_and_shaped_by_their_parameters() {
    let repeated = "model M
        component Line(param n = 2, r[n] = 1; port tap; out y) {
            1:w[1]
            tap -> w[1]
            for i in 1..n {
                if i > 1 { w[i-1] -> 1:w[i] }
                w[i] -> R:r[i](r[i])
            }
            let y = sum(i in 1..n, r[i].f)
        }
        for i in 1..2 {
            Se:s[i](i) -> Line:a[i](n = i, r = [10*j for j in 1..i])
        }
        Se:t(1) -> Line:b
        output y = a[2].y + b.r[2].f + sum(i in 1..2, a[i].y)
    ";
    let by_hand = "model M
        component One(port tap; out y) {
            param r = 10
            tap -> 1:w -> R:r(r)
            let y = r.f
        }
        component Two(param r, s; port tap; out y) {
            tap -> 1:w -> R:r(r)
            w -> 1:v -> R:s(s)
            let y = r.f + s.f
        }
        Se:s1(1) -> One:a1
        Se:s2(2) -> Two:a2(r = 10, s = 20)
        Se:t(1) -> Two:b(r = 1, s = 1)
        output y = a2.y + b.s.f + a1.y + a2.y
    ";
    let counts = |g: &BondGraph| (g.elements.len(), g.bonds.len(), g.lets.len());
    let (a, b) = (graph(repeated, &[]), graph(by_hand, &[]));
    assert_eq!(counts(&a), counts(&b));
    let names: Vec<&str> = a.elements.values().map(|e| e.name.as_str()).filter(|n| n.contains(".r[")).collect();
    assert_eq!(names, ["a[1].r[1]", "a[2].r[1]", "a[2].r[2]", "b.r[1]", "b.r[2]"]);
    let value = |g: &BondGraph, name: &str| {
        let p = g.parameters.values().find(|p| p.name == name).unwrap_or_else(|| panic!("{name}"));
        g.exprs.is_number(p.value).map(|n| n.to_f64())
    };
    assert_eq!(value(&a, "a[2].r[2]"), Some(20.0));
    let c = graph(repeated, &[("b.n", "3"), ("b.r", "7"), ("b.r[3]", "8"), ("a[2].r[1]", "5")]);
    assert_eq!((value(&c, "b.r[1]"), value(&c, "b.r[3]"), value(&c, "a[2].r[1]")), (Some(7.0), Some(8.0), Some(5.0)));
    assert_eq!(c.elements.len(), a.elements.len() + 2);
}

#[test]
fn arrays_take_one_value_a_list_or_another_array() {
    let g = graph(
        "model M
        param n = 3, one[n] = 2, list[n] = [1 kN/m, 2 kN/m, 3 kN/m], each[n] = [10*i for i in 1..n]
        param twice[n] = 2*each, net[2, n] = [[i + j for j in 1..n] for i in 1..2], unit[n] : mm = [1, 2, 3]
        param empty[0] = 1, last = each[n]
        for i in 1..n { param own[i] = i^2 }
        Se:s(one[1] + sum(i in 1..n, twice[i]) + sum(i in 1..0, empty[i]) + own[3]) -> R:r(1)
        ",
        &[],
    );
    let values: Vec<String> = g.to_string().lines().skip(3).take(26).map(|l| l.trim().to_string()).collect();
    let expected = "const n = 3|one[1] = 2|one[2] = 2|one[3] = 2|list[1] = 1000 [N/m, shown in kN/m]|list[2] = 2000 [N/m, shown in kN/m]|list[3] = 3000 [N/m, shown in kN/m]|each[1] = 10|each[2] = 20|each[3] = 30|twice[1] = 2*each[1]|twice[2] = 2*each[2]|twice[3] = 2*each[3]|net[1,1] = 2|net[1,2] = 3|net[1,3] = 4|net[2,1] = 3|net[2,2] = 4|net[2,3] = 5|unit[1] = 0.001 [m, shown in mm]|unit[2] = 0.002 [m, shown in mm]|unit[3] = 0.003 [m, shown in mm]|last = each[3]|own[1] = 1|own[2] = 4|own[3] = 9";
    assert_eq!(values.join("|"), expected);
}

#[test]
fn what_shapes_a_model_is_fixed_when_it_is_compiled() {
    let text = "model M
        param m = 2, n = 2*m, free = 3, size = 4 m
        for i in 1..n { Se:s[i](free*n) -> R:r[i](size) }
    ";
    let constant = |g: &BondGraph| {
        let shaping = g.parameters.values().filter(|p| p.constant && p.shapes);
        shaping.map(|p| p.name.clone()).collect::<Vec<_>>()
    };
    let g = graph(text, &[]);
    assert_eq!((constant(&g), g.elements.len()), (vec!["m".to_string(), "n".to_string()], 8));
    assert_eq!(graph(text, &[("n", "5")]).elements.len(), 10);
    assert_eq!(graph(text, &[("m", "1")]).elements.len(), 4);
    let said = elaborate(text, &[("m", "0.3")]).diagnostics;
    assert!(said.to_string().contains("where a repetition ends must be a whole number"), "{said}");
}

#[test]
fn names_in_brackets_are_ports_unless_they_are_whole_numbers() {
    let text = |a: &str| {
        format!(
            "model M\nparam a = {a}, b = 1 m\n1:u -> I:i(1)\n1:v -> I:j(1)\nR:leak[a, b](f.a = e.a, f.b = e.b)\nu -> leak.a\nv -> leak.b\n"
        )
    };
    graph(&text("1 m"), &[]);
    graph(&text("1"), &[]);
    let both = elaborate("model M\nparam a = 1, b = 2\nSe:s(1) -> R:leak[a, b](1)\noutput y = leak[1, 2].f\n", &[]);
    assert_eq!(both.graph.expect("an element with indices").elements.values().nth(1).expect("two").name, "leak[1,2]");
}

#[test]
fn cells_tell_where_elements_come_from() {
    let g = graph("model M\nfor i in 1..2 { for j in 3..4 { Se:s[i,j](1) -> R:r[i,j](1) } }\nSe:t(1) -> R:u(1)\n", &[]);
    let cell = |name: &str| g.elements.values().find(|e| e.name == name).and_then(|e| e.cell);
    assert_eq!((g.cells.len(), cell("t")), (6, None));
    let inner = &g.cells[cell("r[2,4]").expect("a cell")];
    let outer = &g.cells[inner.outer.expect("an outer cell")];
    let told = [inner, outer].map(|c| (g.repetitions[c.repetition].variable.as_str(), c.value));
    assert_eq!(told, [("j", 4), ("i", 2)]);
    let text = "component X(param n; port p) { p -> 1:w\nfor i in 1..n { w -> R:r[i](1) } }";
    let g = graph(
        &format!("model M\n{text}\nfor k in 1..2 {{ Se:s[k](1) -> X:x[k](n = k) }}\nSe:t(1) -> X:y(n = 2)\n"),
        &[],
    );
    let around = |name: &str| {
        let mut cell = g.elements.values().find(|e| e.name == name).and_then(|e| e.cell);
        let mut all = Vec::new();
        while let Some(id) = cell {
            let of = &g.repetitions[g.cells[id].repetition];
            all.push(format!("{}{}={}", of.within, of.variable, g.cells[id].value));
            cell = g.cells[id].outer;
        }
        all.join(" ")
    };
    assert_eq!(["x[2].r[2]", "x[1].w", "y.r[1]", "t"].map(around), ["x[2]i=2 k=2", "k=1", "yi=1", ""]);
}
