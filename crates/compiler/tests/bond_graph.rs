//! Models to bond graphs.

use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, Elaborated, Files, NoFiles, Override};
use halfarrow_compiler::diagnostic::{Diagnostics, Sources, render};
use std::path::{Path, PathBuf};

/// Elaborates a text that stands alone.
fn elaborate(text: &str) -> Elaborated {
    elaborate_with("main.bond", text, &NoFiles, &[])
}

fn elaborate_with(name: &str, text: &str, files: &dyn Files, overrides: &[Override]) -> Elaborated {
    let mut sources = Sources::new();
    let file = sources.add(name, text);
    let parsed = ast::parse(text, file);
    let mut result = bond_graph::elaborate(parsed.ast, sources, files, overrides);
    let mut all = parsed.diagnostics;
    all.append(&mut result.diagnostics.0);
    result.diagnostics = Diagnostics(all);
    result
}

/// The graph of a text without faults.
fn graph(text: &str) -> BondGraph {
    let result = elaborate(text);
    let said = render(&result.diagnostics, &result.sources, false);
    let graph = result.graph.unwrap_or_else(|| panic!("{said}"));
    bond_graph::verify(&graph).unwrap();
    graph
}

fn models() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models")
}

/// Every model text below a folder.
fn model_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() && path.file_name().is_some_and(|n| n != "faulty") {
            model_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "bond") {
            found.push(path);
        }
    }
}

#[test]
fn every_model_elaborates() {
    let mut files = Vec::new();
    model_files(&models(), &mut files);
    assert!(files.len() > 20);
    let mut faults = String::new();
    for path in files {
        let text = std::fs::read_to_string(&path).unwrap();
        let result = elaborate_with(&path.display().to_string(), &text, &Disk, &[]);
        faults += &render(&result.diagnostics, &result.sources, false);
        if let Some(graph) = result.graph {
            bond_graph::verify(&graph).unwrap();
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

/// The files of this machine.
struct Disk;

impl Files for Disk {
    fn read(&self, path: &str) -> Result<String, bond_graph::FileError> {
        std::fs::read_to_string(path).map_err(|_| bond_graph::FileError::NotFound)
    }
}

#[test]
fn a_model_has_its_elements_in_order() {
    let g = graph("model M\nparam m = 2 kg\nSe:push(3 N) -> 1:cart -> I:mass(m)\ncart -> R:drag(0.5)\n");
    let names: Vec<&str> = g.elements.values().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["push", "cart", "mass", "drag"]);
    assert_eq!(g.bonds.len(), 3);
    assert_eq!(g.exprs.name(g.bonds.values().nth(1).unwrap().flow), "mass.f");
}

/// The value of an expression at the given parameters and these values of other symbols, by name.
fn value(g: &BondGraph, e: halfarrow_compiler::algebra::Expr, others: &[(&str, f64)]) -> f64 {
    g.exprs.eval(e, &mut |s| {
        let name = g.exprs.name(s);
        if let Some((_, v)) = others.iter().find(|(n, _)| *n == name) {
            return *v;
        }
        let given = g.exprs.facts(s).given.unwrap_or_else(|| panic!("{name} has no value"));
        g.exprs.given_value(given).unwrap()
    })
}

/// The graph as `show bond_graph` prints it.
fn printed(text: &str) -> String {
    graph(text).to_string()
}

#[test]
fn a_graph_prints_as_people_read_it() {
    let text = "model Car \"one corner\"
param ms = 320 kg, ks = 18 kN/m
param b = 900 N.s3/m3
input road : m/s = 0
Sf:ground(road) -> 0:tyre -> 1:hub -> I:wheel(40 kg)
tyre -> C:tread(k = 10*ks, q0 = 18.6 mm)
hub -> 0:strut -> 1:chassis -> I:body(ms)
strut -> 1:gap -> C:spring(k = ks)
gap -> R:damper(e = b*f^3)
output travel = spring.q : mm
prefer chassis.f, spring
";
    let expected = "model Car \"one corner\"

parameters (SI)
  ms = 320 [kg]
  ks = 18000 [N/m, shown in kN/m]
  b = 900 [N.s3/m3]

inputs
  road = 0 [m/s]

elements
  Sf  ground   ground.f = road
  0   tyre
  1   hub
  I   wheel    wheel.f = 0.025*wheel.p
  C   tread    tread.e = 10*ks*tread.q; tread.q(0) = 0.0186
  0   strut
  1   chassis
  I   body     body.f = body.p/ms
  1   gap
  C   spring   spring.e = ks*spring.q
  R   damper   damper.e = b*damper.f^3

bonds
  1    ground -> tyre    ground.e [N], ground.f [m/s]
  2    tyre -> hub       e2 [N], f2 [m/s]
  3    hub -> wheel      wheel.e [N], wheel.f [m/s]
  4    tyre -> tread     tread.e [N], tread.f [m/s]
  5    hub -> strut      strut.e [N], f5 [m/s]
  6    strut -> chassis  e6 [N], f6 [m/s]
  7    chassis -> body   body.e [N], body.f [m/s]
  8    strut -> gap      e8 [N], gap.f [m/s]
  9    gap -> spring     spring.e [N], spring.f [m/s]
  10   gap -> damper     damper.e [N], damper.f [m/s]

outputs
  travel = spring.q [m, shown in mm]

asked for
  prefer body.f
  prefer spring.e
";
    assert_eq!(printed(text), expected);
}

#[test]
fn a_constraint_puts_its_gradient_times_its_multiplier_on_the_motion() {
    // x = r*theta as a constraint: crank and slider at 1-junctions of their own.
    let g = graph(
        "model Rack
param r = 0.25 m
state theta' = w.f from 0 rad
state x' = s.f from 0 m
Se:drive(2 N.m) -> 1:w -> I:crank(0.1 kg.m2)
1:s -> I:slider(3 kg)
s -> R:drag(2 N.s/m)
constraint rack: x - r*theta = 0
",
    );
    let c = &g.constraints[0];
    assert!(c.holonomic);
    // The bonds of the modeller come first.
    let drawn: Vec<&str> = g.bonds.values().take(4).map(|b| g.exprs.name(b.flow)).collect();
    assert_eq!(drawn, ["drive.f", "crank.f", "slider.f", "drag.f"]);
    // d(x - r theta)/dt = 1*s.f - r*w.f: the slider is driven by +lambda, the crank by -r lambda.
    let tf = g.elements.values().find(|e| e.name == "rack.tf2" || e.name == "rack.tf1").unwrap();
    let bond_graph::Kind::Transformer { modulus } = tf.kind else { panic!("{tf:?}") };
    assert!((value(&g, modulus, &[]) - 0.25).abs() < 1e-15);
    let direct = g.bonds.values().find(|b| g.elements[b.to.element].name == "s").unwrap();
    assert_eq!(g.elements[direct.from.element].name, "rack.0");
    let zc = &g.elements[c.element];
    assert_eq!(zc.name, "rack");
    assert_eq!(g.exprs.name(g.bonds[zc.ports[0].bond].effort), "rack.e");
    power_is_conserved_at_constraints(&g);
}

#[test]
fn a_constraint_on_flows_takes_what_moves_by_itself_to_the_zero_compliance() {
    let g = graph(
        "model Belt
input belt : m/s = 1
param r = 0.5
1:w -> I:wheel(1)
1:s -> I:slider(3)
constraint roll: s.f - r*w.f = belt + 2*t
",
    );
    let c = &g.constraints[0];
    assert!(!c.holonomic);
    let bond_graph::Kind::ZeroCompliance { flow } = g.elements[c.element].kind else { panic!() };
    // s.f - r w.f - belt - 2 t = 0: the zero compliance gives what is left.
    assert_eq!(value(&g, flow, &[("belt", 3.0), ("t", 2.0)]), 7.0);
    power_is_conserved_at_constraints(&g);
}

#[test]
fn a_constraint_on_a_spring_at_a_0_junction_puts_a_1_junction_into_its_bond() {
    let g = graph(
        "model Stop
Sf:feed(1) -> 0:n -> C:spring(k = 3)
n -> R:leak(2)
constraint hold: 2*spring.q^2 = 8
",
    );
    let spring = g.elements.values().find(|e| e.name == "spring").unwrap();
    let bond = &g.bonds[spring.ports[0].bond];
    assert_eq!(spring.ports[0].bond.0, 1, "the drawn bond keeps its number");
    assert_eq!(g.elements[bond.from.element].name, "hold.1");
    power_is_conserved_at_constraints(&g);
}

/// With any flows that satisfy the constraint, the power that enters its transformers leaves at the zero compliance:
/// checked by putting random flows and a multiplier into the junctions around it.
fn power_is_conserved_at_constraints(g: &BondGraph) {
    use bond_graph::Kind;
    for c in &g.constraints {
        let lambda = 1.7;
        let zc = &g.elements[c.element];
        let node = g.bonds[zc.ports[0].bond].to.element;
        let others = [("belt", 3.0), ("t", 2.0), ("spring.q", 0.4)];
        let Kind::ZeroCompliance { flow } = zc.kind else { panic!() };
        // Power along half arrows into the node, apart from the zero compliance, as a function of the flows.
        let mut flows = Vec::new();
        for port in &g.elements[node].ports {
            let bond = &g.bonds[port.bond];
            let other = if port.inward { bond.from.element } else { bond.to.element };
            let sign = if port.inward { 1.0 } else { -1.0 };
            match g.elements[other].kind {
                Kind::Transformer { modulus } => flows.push(sign * value(g, modulus, &others)),
                Kind::One => flows.push(sign),
                Kind::ZeroCompliance { .. } => {}
                _ => panic!("an odd neighbour"),
            }
        }
        // Free flows but the last, which satisfies the relation.
        let mut speeds: Vec<f64> = (0..flows.len()).map(|i| 0.3 + i as f64).collect();
        let own = value(g, flow, &others);
        let known: f64 = flows.iter().zip(&speeds).skip(1).map(|(m, f)| m * f).sum();
        speeds[0] = -(known + own) / flows[0];
        let into: f64 = flows.iter().zip(&speeds).map(|(m, f)| m * f * lambda).sum();
        assert!((into + own * lambda).abs() < 1e-12);
    }
}

#[test]
fn components_become_parts_with_the_name_of_the_instance_in_front() {
    let g = graph(
        "model Motors
param kt = 0.1 V.s
component Motor(param k, r = 2 ohm; port el, me; out i) \"dc motor\" {
  el -> 1:mesh -> R:coil(r)
  mesh -> GY:conv(k) -> me
  let i = coil.f
}
Se:battery(12 V) -> m1.el
Motor:m1(k = kt)
m1.me -> 1:shaft -> I:load(0.1 kg.m2)
output current = m1.i : A
",
    );
    let names: Vec<&str> = g.elements.values().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["battery", "m1.mesh", "m1.coil", "m1.conv", "shaft", "load"]);
    let parameters: Vec<&str> = g.parameters.values().map(|p| p.name.as_str()).collect();
    assert_eq!(parameters, ["kt", "m1.r"], "what is given a parameter is that parameter");
    // The bond from outside and the one inside are one.
    assert_eq!(g.bonds.len(), 5);
    let first = g.bonds.values().next().unwrap();
    assert_eq!(
        (g.elements[first.from.element].name.as_str(), g.elements[first.to.element].name.as_str()),
        ("battery", "m1.mesh")
    );
    assert_eq!(g.outputs[0].value, {
        let mut x = g.exprs.clone();
        let coil = x.find_symbol("m1.coil.f").unwrap();
        x.sym(coil)
    });
}

#[test]
fn components_nest_and_are_imported_once() {
    let mut files = std::collections::BTreeMap::new();
    files.insert(
        "lib/tank.bond".to_string(),
        "const g = 9.81\nimport \"pipe.bond\"\ncomponent Tank(param area; port p) {\n p -> 0:n -> C:level(area/g)\n n -> Pipe:leak(r = 5)\n}\n".to_string(),
    );
    files.insert("lib/pipe.bond".to_string(), "component Pipe(param r; port p) {\n p -> R:flow(r)\n}\n".to_string());
    let text = "model Tanks\nimport \"lib/tank.bond\"\nimport \"lib/pipe.bond\"\nSf:feed(1) -> Tank:a(area = 2)\nSf:more(1) -> Tank:b(area = 3)\n";
    let result = elaborate_with("main.bond", text, &files, &[Override { name: "b.leak.r".into(), value: "7".into() }]);
    let said = render(&result.diagnostics, &result.sources, false);
    let g = result.graph.expect(&said);
    let names: Vec<&str> = g.elements.values().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["feed", "a.n", "a.level", "a.leak.flow", "more", "b.n", "b.level", "b.leak.flow"]);
    let r = g.parameters.values().find(|p| p.name == "b.leak.r").unwrap();
    assert_eq!(g.exprs.given_value(r.value), Some(7.0));
}

#[test]
fn overrides_come_before_what_is_derived() {
    let text = "model M\nparam k = 2 N/m, k2 = 2*k\nparam x : mm = 3\nconst c = 1\ninput u = 0\nSe:s(u*x*c) -> 1:a -> C:sp(k = k2)\n";
    let set = |name: &str, value: &str| Override { name: name.into(), value: value.into() };
    let result = elaborate_with("main.bond", text, &NoFiles, &[set("k", "3 kN/m"), set("x", "5")]);
    let g = result.graph.unwrap();
    let numbers: Vec<f64> = g.parameters.values().map(|p| value(&g, p.value, &[])).collect();
    assert_eq!(numbers, [3000.0, 6000.0, 0.005, 1.0]);
    let bad =
        [set("kk", "3"), set("c", "2"), set("u", "2"), set("k", "3 m"), set("k", "("), set("x", "1\nparam z = 2")];
    for one in bad {
        let result = elaborate_with("main.bond", text, &NoFiles, std::slice::from_ref(&one));
        assert!(result.graph.is_none() && result.diagnostics.has_errors(), "{one:?}");
    }
}

#[test]
fn a_signal_that_repeats_a_displacement_is_read_off_it() {
    let g = graph(
        "model M\nstate x' = cart.f from 0.5\nSe:push(x) -> 1:cart -> I:mass(2)\ncart -> C:spring(k = 3, q0 = 0.2)\n",
    );
    assert!(g.signals.is_empty());
    assert_eq!(g.lets[0].name, "x");
    assert!((value(&g, g.lets[0].value, &[("spring.q", 1.0)]) - 1.3).abs() < 1e-15);
    // Without start values on both sides nothing says how far apart they are.
    let g = graph("model M\nstate x' = cart.f from 0.5\nSe:push(x) -> 1:cart -> I:mass(2)\ncart -> C:spring(k = 3)\n");
    assert_eq!(g.signals.len(), 1);
}

#[test]
fn controllers_have_no_more_states_than_they_need() {
    let states = |law: &str| {
        let g = graph(&format!("model M\nlet y = {law}\nSe:push(y) -> 1:cart -> I:mass(2)\ncart -> C:spring(k = 3)\n"));
        g.signals.values().map(|s| s.name.clone()).collect::<Vec<_>>()
    };
    assert!(states("pid(1 - spring.q, 2, 0, 0)").is_empty());
    assert_eq!(states("pid(1 - spring.q, 2, 3, 0)"), ["y.integral"]);
    assert!(states("pid(1 - spring.q, 2, 0, 4)").is_empty(), "the rate of a displacement is known");
    assert_eq!(states("pid(mass.f, 2, 0, 4)"), ["y.filter"]);
    assert_eq!(states("tf(mass.f, [2], [1, 3, 5])"), ["y.x1", "y.x2"]);
}

#[test]
fn a_strictly_proper_loop_is_no_circle() {
    let g = graph("model M\nlet u = 1 - y\nlet y = tf(u, [1], [1, 2])\nSe:push(y) -> 1:cart -> I:mass(2)\n");
    // x' = u - 2 x with u = 1 - x.
    let rate = g.signals.values().next().unwrap().rate;
    assert_eq!(value(&g, rate, &[("y.x1", 0.5)]), 1.0 - 0.5 - 2.0 * 0.5);
    let result =
        elaborate("model M\nlet u = 1 - y\nlet y = tf(u, [1, 1], [1, 2])\nSe:push(y) -> 1:cart -> I:mass(2)\n");
    assert!(result.graph.is_none());
}

#[test]
fn transfer_functions_keep_their_gain_at_rest_and_at_once() {
    let g = graph("model M\nlet y = tf(t, [6, 4, 10], [2, 3, 5])\nSe:push(y) -> 1:cart -> I:mass(2)\n");
    let y = g.lets[0].value;
    // At once: 6/2 of the input. At rest with input 1: x1 = 1/5, x2 = 0, so y = 10/5.
    assert_eq!(value(&g, y, &[("t", 1.0), ("y.x1", 0.0), ("y.x2", 0.0)]), 3.0);
    assert!((value(&g, y, &[("t", 1.0), ("y.x1", 0.2), ("y.x2", 0.0)]) - 2.0).abs() < 1e-15);
}

#[test]
fn fields_get_their_laws_from_their_energy() {
    let g = graph(
        "model Gap
param eps = 8.9e-12 F/m, area = 1e-4 m2, x0 = 1 mm
C:gap[el, me](energy = q.el^2*(x0 - q.me)/(2*eps*area), q0.el = 1e-9 C)
Se:u(10 V) -> 1:mesh -> gap.el
mesh -> R:wire(1 kohm)
1:plate -> I:mass(1 g)
plate -> gap.me
output charge = gap.el.q : C
",
    );
    let gap = g.elements.values().find(|e| e.name == "gap").unwrap();
    let bond_graph::Kind::Compliance(storage) = &gap.kind else { panic!() };
    let bond_graph::StorageLaw::Integral(force) = storage.laws[1] else { panic!() };
    let at = [("gap.el.q", 1e-9), ("gap.me.q", 0.0)];
    assert!((value(&g, force, &at) + 1e-18 / (2.0 * 8.9e-12 * 1e-4)).abs() < 1e-12);
    assert_eq!(g.outputs[0].unit.as_ref().unwrap().to_string(), "C");
    assert!(bond_graph::warnings(&g).is_empty());
}

#[test]
fn long_chains_of_names_do_not_need_a_deep_stack() {
    let mut text = "model M\nSe:push(a20000) -> I:mass(2)\n".to_string();
    for i in (1..=20000).rev() {
        text += &format!("let a{i} = a{} + 1\n", i - 1);
    }
    text += "let a0 = 1\n";
    assert_eq!(graph(&text).lets.len(), 20001);
}

#[test]
fn a_pseudo_domain_is_exempt_from_power() {
    let g = graph(
        "model M\ndomain thermal pseudo {\nSe:room(300 K) -> 1:wall -> R:loss(2 K/W)\nwall -> 0:box -> C:air(5 J/K, e0 = 290 K)\n}\n",
    );
    assert!(g.bonds.values().all(|b| b.pseudo));
    let unit = |s| g.variables[&s].unit.as_ref().map(ToString::to_string);
    let last = g.bonds.values().last().unwrap();
    assert_eq!((unit(last.effort).as_deref(), unit(last.flow).as_deref()), (Some("K"), Some("W")));
}

/// A ladder of `n` sections of a resistor and a capacitor.
fn ladder(n: usize) -> String {
    use std::fmt::Write;
    let mut text = "model Ladder\nparam r = 1 kohm, c = 1 uF\nSe:u(1 V) -> 1:j1\n".to_string();
    for i in 1..=n {
        writeln!(text, "j{i} -> R:r{i}(r)\nj{i} -> 0:n{i} -> C:c{i}(c)").unwrap();
        if i < n {
            writeln!(text, "n{i} -> 1:j{}", i + 1).unwrap();
        }
    }
    text
}

#[test]
fn ladders_take_time_in_proportion_to_their_length() {
    // The least of some runs: other work on the machine only makes a run longer.
    let time = |n: usize| {
        let text = ladder(n);
        let once = || {
            let start = std::time::Instant::now();
            assert_eq!(elaborate(&text).graph.unwrap().bonds.len(), 4 * n);
            start.elapsed()
        };
        (0..5).map(|_| once()).min().unwrap()
    };
    let (short, long) = (time(500), time(5000));
    assert!(long < short * 40, "500 sections {short:?}, 5000 sections {long:?}");
}

/// Numbers that look random and are the same in every run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % n.max(1)
    }
}

/// Pieces of text that may break something when they stand in the wrong place.
const ODD: &[&str] = &[
    " ",
    "\n",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    "->",
    ":",
    ",",
    ".",
    "'",
    "=",
    "^",
    "*",
    "-",
    "0",
    "1",
    "1e300",
    "9^9",
    "t",
    "e",
    "f",
    "q",
    "p",
    "I:",
    "C:",
    "R:",
    "TF:",
    "0:",
    "1:",
    "constraint x: ",
    "state ",
    "param ",
    "let ",
    "energy = ",
    "m/s",
    "if ",
    "then ",
    "else ",
    "pid(",
    "tf(",
    "delay(",
    "table(",
    "prefer ",
    "stroke ",
    "causality ",
    "component ",
    "port ",
    "import ",
    "domain d pseudo {",
    "1e99999999",
    "2^1000000",
    "0.0000001",
    " rad",
    " kN",
    " degC",
    "x.y.z",
    ".in",
    ".out",
    "//",
    "\"",
];

#[test]
fn broken_models_are_answered_and_never_break_the_compiler() {
    let mut files = Vec::new();
    model_files(&models(), &mut files);
    model_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faulty"), &mut files);
    let texts: Vec<String> = files.iter().map(|p| std::fs::read_to_string(p).unwrap()).collect();
    let rounds = std::env::var("FUZZ_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(400);
    let mut dice = Dice(std::env::var("FUZZ_SEED").ok().and_then(|n| n.parse().ok()).unwrap_or(7));
    for _ in 0..rounds {
        let mut text: Vec<char> = texts[dice.below(texts.len())].chars().collect();
        for _ in 0..1 + dice.below(4) {
            let at = dice.below(text.len() + 1);
            match dice.below(3) {
                0 => {
                    let end = (at + 1 + dice.below(12)).min(text.len());
                    text.drain(at.min(end)..end);
                }
                1 => {
                    text.splice(at..at, ODD[dice.below(ODD.len())].chars());
                }
                _ => {
                    let other: Vec<char> = texts[dice.below(texts.len())].chars().collect();
                    let start = dice.below(other.len());
                    let end = (start + dice.below(40)).min(other.len());
                    text.splice(at..at, other[start..end].iter().copied());
                }
            }
        }
        let text: String = text.into_iter().collect();
        let start = std::time::Instant::now();
        let result = elaborate(&text);
        let time = start.elapsed();
        assert!(time.as_secs() < 5, "{time:?} for\n{text}");
        match result.graph {
            Some(graph) => {
                bond_graph::verify(&graph).unwrap_or_else(|why| panic!("{why}\n{text}"));
                let _ = bond_graph::warnings(&graph);
                let _ = graph.to_string();
            }
            None => assert!(result.diagnostics.has_errors(), "no graph and no reason\n{text}"),
        }
    }
}

#[test]
fn a_known_displacement_needs_only_its_stiffness() {
    let g = graph(
        "model M\nstate x' = a.f from 1 m\nSe:push(1 N) -> 1:a -> I:mass(2 kg)\na -> TF:lever(x/sqrt(x^2 + 4 m2)) -> C:cable(k = 3 N/m, q = sqrt(x^2 + 4 m2) - 2 m)\n",
    );
    let cable = g.elements.values().find(|e| e.name == "cable").unwrap();
    let bond_graph::Kind::Compliance(s) = &cable.kind else { panic!() };
    assert!(matches!(s.laws[0], bond_graph::StorageLaw::Known { .. }));
}

#[test]
fn a_parameter_may_be_called_like_a_bond() {
    let g = graph("model M\nparam e2 = 3\nSe:push(e2) -> 0:a -> 1:b -> I:mass(2)\na -> R:r(1)\n");
    assert_eq!(g.exprs.name(g.parameters.values().next().unwrap().symbol), "e2");
    let g = graph("model M\nparam e2 = 3\nSe:push(e2) -> 1:x -> 1:y -> I:mass(2)\nx -> R:r(1)\n");
    assert_eq!(g.exprs.name(g.parameters.values().next().unwrap().symbol), "e2");
}

#[test]
fn rotation_shows_its_units() {
    let g = graph("model M\nSe:push(1 N.m) -> 1:a -> I:rotor(2 kg.m2)\n");
    let unit = |s| g.variables[&s].unit.as_ref().unwrap().to_string();
    let bond = g.bonds.values().next().unwrap();
    assert_eq!((unit(bond.effort), unit(bond.flow)), ("N.m".to_string(), "rad/s".to_string()));
}

/// Prints how long a ladder of 10,000 sections takes: `cargo test --release --test all bond_graph -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement, to be run in release"]
fn time_of_a_long_ladder() {
    let text = ladder(10_000);
    for _ in 0..5 {
        let mut sources = Sources::new();
        let file = sources.add("ladder.bond", text.as_str());
        let start = std::time::Instant::now();
        let parsed = ast::parse(&text, file);
        let read = start.elapsed();
        let result = bond_graph::elaborate(parsed.ast, sources, &NoFiles, &[]);
        println!("parsed in {read:?}, elaborated in {:?}", start.elapsed() - read);
        assert!(result.graph.is_some());
    }
}

#[test]
fn two_ports_take_their_factor_from_in_to_out() {
    let law = |declared: &str| {
        let shown = graph(&format!("model M\nparam x = 4\nSe:s(1) -> {declared} -> I:m(1)\n")).to_string();
        shown
            .lines()
            .find(|line| line.starts_with("  TF") || line.starts_with("  GY"))
            .unwrap_or_else(|| panic!("{shown}"))
            .trim()
            .to_string()
    };
    assert_eq!(law("TF:t(f_out = x)"), law("TF:t(x)"));
    assert_eq!(law("TF:t(e_out = x)"), law("TF:t(1/x)"));
    assert_eq!(law("GY:t(e_out = x)"), law("GY:t(x)"));
    assert_eq!(law("GY:t(f_out = x)"), law("GY:t(1/x)"));
}
