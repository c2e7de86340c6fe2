//! Evaluation takes no memory once the model is made.

mod common;

use common::Sketch;
use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, NoFiles};
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::diagnostic::Sources;
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::equations::{LinearBlock, NewtonBlock};
use halfarrow_compiler::sparse::SparseMatrix;
use halfarrow_exec::Model;
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Events, Stepwise, System};
use std::alloc::{GlobalAlloc, Layout, System as Memory};
use std::cell::Cell;

struct Counting;

thread_local!(static COUNT: Cell<usize> = const { Cell::new(0) });

// SAFETY: every call goes to the system's allocator unchanged.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { Memory.alloc(layout) }
    }
    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        unsafe { Memory.dealloc(place, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations_during(work: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

/// A linear block, a diode and a condition, evaluated, differentiated, recorded and accepted.
#[test]
fn a_step_takes_no_memory() {
    let mut s = Sketch::default();
    let x = s.state("x");
    let (u, ue) = s.symbol("u");
    let (three, one) = (s.number(3.0), s.number(1.0));
    s.step(
        LinearBlock {
            unknowns: vec![u],
            matrix: SparseMatrix::full(vec![vec![three]]),
            right: vec![x],
            elements: vec![],
        }
        .into(),
    );
    let (e, ee) = s.symbol("e");
    let exp = s.call(Function::Exp, ee);
    let terms = [exp, ee, ue];
    let residual = s.x.add(&terms);
    s.step(NewtonBlock { unknowns: vec![e], body: vec![], residuals: vec![residual], elements: vec![] }.into());
    let size = s.call(Function::Abs, x);
    let limit = s.x.call(Function::Min, &[size, one]);
    let rate = s.x.mul(&[ee, limit]);
    s.rate("x", rate);
    let model = s.model();
    takes_no_memory(model.clone());
    let mut machine = model;
    if machine.compile_machine().and_then(|()| machine.compile_directional()).is_ok() {
        takes_no_memory(machine);
    }
}

fn takes_no_memory(mut model: halfarrow_exec::Model) {
    let mut x = model.initialise(0.0).unwrap();
    model.handle_event(0.0, &mut x).unwrap();
    let (mut dx, mut out, mut g) = ([0.0], [0.0], vec![0.0; model.indicators()]);
    let count = allocations_during(|| {
        for i in 0..100 {
            let (t, x) = (0.01 * f64::from(i), [0.1 + f64::from(i)]);
            model.rates(t, &x, &mut dx).unwrap();
            model.directional_derivative(t, &x, &[1.0], &mut dx).unwrap();
            model.observe(t, &x, &mut out).unwrap();
            model.event_indicators(t, &x, &mut g).unwrap();
            model.accept(t, &x).unwrap();
            assert_eq!(model.next_time_event(t), None);
        }
    });
    assert_eq!(count, 0);
}

/// Periodic events with discrete variables, a state that is reset and impulses that go through a lever; one whose crossing is
/// located within a step, one of time alone; what follows from them at the same instant.
#[test]
fn events_take_no_memory() {
    let text = "model Periodic
discrete u = 0, n = 0, k = 0
1:a -> I:one(1, f0 = 1)
a -> TF:lever(f_out = 2 + 0.1*n) -> 1:b -> I:two(3)
Se:force(u) -> a
state x' = a.f from 0
when every 3 ms { u = -x - one.f; n = n + 1 }
when every 7 ms { reset two.f = -two.f; reset x = 0 }
when n > 10 { n = 0 }
when a.f < -0.1 { k = k + 1 }
when sin(200*t) > 0.5 { k = k + 1 }
";
    let closed = "model Closed
discrete k = 0
1:crank -> I:one(1)
1:coupler -> I:two(1)
1:rocker -> I:three(1)
state th1' = crank.f from 0.6
state th2' = coupler.f
state th3' = rocker.f
constraint along: 0.2*cos(th1) + 0.5*cos(th2) = 0.5 + 0.4*cos(th3)
constraint across: 0.2*sin(th1) + 0.5*sin(th2) = 0.4*sin(th3)
guess th2 = -1.2, th3 = -2
Se:push(3) -> crank
when every 11 ms { reset two.f = 0.9*two.f; k = k + 1 }
";
    use FixedMethod::{Heun, LinearlyImplicitBdf2, Rk4, Rosenbrock};
    for method in [Heun, Rk4, Rosenbrock, LinearlyImplicitBdf2] {
        takes_no_memory_at_events(text, method);
        takes_no_memory_at_events(closed, method);
    }
}

fn takes_no_memory_at_events(text: &str, method: FixedMethod) {
    let text = Text { name: "p.bond", text, files: &NoFiles, overrides: &[] };
    let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
    let mut model = Model::new(program).unwrap();
    let mut x = model.initialise(0.0).unwrap();
    let mut run = Stepwise::new(method, 0.0, &model);
    run.start(&mut model, &mut x).unwrap();
    let mut advance = |from: u32, to: u32| {
        for tick in from..to {
            run.advance(&mut model, f64::from(tick) * 1e-3, &mut x).unwrap();
        }
    };
    advance(1, 20);
    assert_eq!(allocations_during(|| advance(20, 500)), 0, "{method:?}");
    let mut values = [0.0; 2];
    model.record(&["two.impulse", "k"]).unwrap();
    model.observe(0.499, &x, &mut values).unwrap();
    assert!(values[0] != 0.0 && values[1] >= 1.0, "all of them happen: {values:?}");
}

/// Positions that only speeds keep, put back after each step, and moved by an event.
#[test]
fn putting_positions_back_takes_no_memory() {
    let text = "model Crank
state th' = w.f from 0.3
state ph' = v.f from 0.09866525406
state x' = slide.f from 0.39407462
1:w -> I:crank(0.002, f0 = 20)
1:v -> I:rod(0.001)
w -> TF:wx(f_out = -0.1*sin(th)) -> 0:along
v -> TF:vx(f_out = -0.3*sin(ph)) -> along -> 1:slide -> I:slider(0.5)
w -> TF:wy(f_out = 0.1*cos(th)) -> 0:across
v -> TF:vy(f_out = -0.3*cos(ph)) -> across -> ZC:guide
when every 50 ms { reset x = x + 0.001 }
";
    let text = Text { name: "p.bond", text, files: &NoFiles, overrides: &[] };
    let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
    let mut model = Model::new(program).unwrap();
    let mut x = model.initialise(0.0).unwrap();
    let mut run = Stepwise::new(FixedMethod::Rk4, 0.0, &model).projecting(true);
    run.start(&mut model, &mut x).unwrap();
    let taken = allocations_during(|| {
        for tick in 1..500 {
            run.advance(&mut model, f64::from(tick) * 1e-3, &mut x).unwrap();
        }
    });
    assert_eq!(taken, 0);
    assert!(run.summary().projections > 250, "{}", run.summary().projections);
}

/// What it takes to elaborate a row of cells, counted in pieces of memory, grows with its length.
#[test]
fn large_rows_take_memory_in_proportion_to_their_length() {
    let pieces = |n: usize| {
        let text = format!(
            "model M\nparam n = {n}, r[n] = 1\n0:v[0]\nSe:s(1) -> v[0]\nfor i in 1..n {{\n1:w[i]\nv[i - 1] -> w[i] -> R:r[i](r[i])\nw[i] -> 0:v[i] -> C:c[i](1)\n}}\n"
        );
        allocations_during(|| {
            let mut sources = Sources::new();
            let file = sources.add("main.bond", &text);
            let parsed = ast::parse(&text, file);
            let graph = bond_graph::elaborate(parsed.ast, sources, &NoFiles, &[]).graph;
            assert_eq!(graph.map(|graph| graph.elements.len()), Some(4 * n + 2));
        })
    };
    let (short, long) = (pieces(1_000), pieces(10_000));
    assert!(long < 11 * short, "1,000 cells take {short} pieces, 10,000 take {long}");
}
