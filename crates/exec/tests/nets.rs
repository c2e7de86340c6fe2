//! Sparse solve blocks of random nets: what they give as full ones, by every kernel, with exact derivatives.

use std::fmt::Write;
use std::sync::Arc;

use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::ids::Table;
use halfarrow_compiler::program::{Block, Matrix, Program};
use halfarrow_exec::Model;
use halfarrow_sim::{Events, System};

/// The same numbers on every machine (minimal standard generator).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0 * 48271 % 2147483647;
        (self.0 >> 8) as usize % n
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.below(1000) as f64 / 1000.0
    }
}

/// Junctions in a tree with some more bonds, resistors, transformers and gyrators between them, a resistor at each, storages
/// at some; some resistors read states, some are nonlinear if `nonlinear`.
fn net(seed: u64, nonlinear: bool) -> String {
    let mut r = Random(seed * 7919 + 1);
    let n = 50 + r.below(40);
    let mut text =
        String::from("model Net\n0:in -> R:feed(2)\nSe:source(sin(3*t)) -> 1:s\ns -> R:r(1)\ns -> in -> n0\n");
    let serial: Vec<bool> = (0..n).map(|i| i > 0 && r.below(3) == 0).collect();
    let mut states = Vec::new();
    for (i, &serial) in serial.iter().enumerate() {
        let _ = writeln!(text, "{}:n{i}", u8::from(serial));
        let value = r.between(0.5, 3.0);
        match r.below(8) {
            0 => (_ = writeln!(text, "n{i} -> C:C{i}({value})"), states.push(format!("C{i}.q"))).1,
            1 => (_ = writeln!(text, "n{i} -> I:I{i}({value})"), states.push(format!("I{i}.p"))).1,
            _ => {}
        }
    }
    let law = |r: &mut Random| {
        let value = r.between(0.5, 3.0);
        match r.below(6) {
            0 if !states.is_empty() => format!("{value}*(2 + sin({}))", states[r.below(states.len())]),
            1 if nonlinear => format!("f = {value}*(e + e^3)"),
            2 if nonlinear => format!("e = {value}*(f + f^3)"),
            _ => format!("{value}"),
        }
    };
    (0..n).for_each(|i| _ = writeln!(text, "n{i} -> R:R{i}({})", law(&mut r)));
    let tree: Vec<(usize, usize)> = (1..n).map(|i| (i - 1 - r.below(i.min(6)), i)).collect();
    let more = (0..n * 2 / 3).map(|_| (r.below(n), 1 + r.below(8))).map(|(i, far)| (i, i + far));
    let more: Vec<(usize, usize)> = more.filter(|&(_, j)| j < n).collect();
    for (k, (i, j)) in tree.into_iter().chain(more).enumerate() {
        let between = u8::from(!serial[i]);
        let _ = match r.below(8) {
            0 => writeln!(text, "n{i} -> TF:T{k}({}) -> n{j}", r.between(0.5, 2.0)),
            1 => writeln!(text, "n{i} -> GY:G{k}({}) -> n{j}", r.between(0.5, 2.0)),
            _ if serial[i] == serial[j] => {
                writeln!(text, "n{i} -> {between}:e{k} -> n{j}\ne{k} -> R:E{k}({})", law(&mut r))
            }
            _ => writeln!(text, "n{i} -> n{j}"),
        };
    }
    text
}

/// The program with all its solve blocks as full matrices; how many were sparse.
fn full(program: &Program) -> (Program, usize) {
    let (mut blocks, mut sparse) = (Table::new(), 0);
    for block in program.blocks.values() {
        let mut block = block.clone();
        let (Block::Linear { matrix, .. } | Block::Newton { jacobian: matrix, .. }) = &mut block;
        sparse += usize::from(matrix.factors.is_some());
        *matrix = Arc::new(Matrix { factors: None, ..Matrix::clone(matrix) });
        blocks.push(block);
    }
    (Program { blocks, ..program.clone() }, sparse)
}

fn close(a: &[f64], b: &[f64], what: &str) {
    let size = b.iter().fold(1.0f64, |most, b| most.max(b.abs()));
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        assert!((a - b).abs() <= 1e-11 * size, "{what} {i}: {a:e} and {b:e}");
    }
}

#[test]
fn sparse_blocks_give_what_full_ones_give() {
    let mut sparse = [0, 0];
    for (seed, nonlinear) in (0..24).map(|seed| (seed, seed % 2 == 1)) {
        let text = net(seed, nonlinear);
        let text = Text { name: "net.bond", text: &text, files: &NoFiles, overrides: &[] };
        let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
        let (as_full, found) = full(&program);
        sparse[usize::from(nonlinear)] += found;
        let model = |program| Model::with_jacobian(program).expect("a model");
        let (mut here, mut there) = (model(program), model(as_full));
        let n = here.states();
        let mut x = vec![0.0; n];
        for model in [&mut here, &mut there] {
            model.handle_event(0.0, &mut x).expect("a start");
            model.accept(0.0, &x).expect("a start");
        }
        let mut r = Random(seed + 12345);
        for step in 1..=3 {
            let t = 0.1 * f64::from(step);
            x.iter_mut().for_each(|x| *x += r.between(-0.05, 0.05));
            let v: Vec<f64> = (0..n).map(|_| r.between(-1.0, 1.0)).collect();
            let mut values = Vec::new();
            for model in [&mut here, &mut there] {
                let (mut rates, mut along) = (vec![0.0; n], vec![0.0; n]);
                model.rates(t, &x, &mut rates).expect("rates");
                model.directional_derivative(t, &x, &v, &mut along).expect("a derivative");
                let mut jacobian = vec![0.0; model.sparsity().nonzeros()];
                model.jacobian(t, &x, &mut jacobian).expect("a Jacobian");
                let mut product = vec![0.0; n];
                let entries = model.sparsity().entries().zip(&jacobian);
                entries.for_each(|((row, column), entry)| product[row] += entry * v[column]);
                close(&product, &along, &format!("net {seed}, derivative along v"));
                model.accept(t, &x).expect("a step");
                values.push([rates, along, jacobian].concat());
            }
            close(&values[0], &values[1], &format!("net {seed}, rates and derivatives"));
        }
    }
    assert!(sparse.iter().all(|&found| found >= 6), "{sparse:?} sparse blocks");
}

/// A gear train with ratios of 16 digits: every wheel costs the same, and what they make together is what one of them with
/// the inertia of all does.
#[test]
fn gear_trains_cost_the_same_for_every_wheel() {
    let mut lengths = Vec::new();
    for wheels in [50, 100, 400] {
        let mut r = Random(wheels + 3);
        let (mut text, mut inertia, mut friction, mut ratio) = (String::from("model Gears\n"), 0.0, 0.0, 1.0);
        for k in 0..wheels {
            let (g, m, b) =
                (r.between(0.8, 1.25) + 1e-16 * 271.0, r.between(0.1, 1.0) / 3.0, r.between(0.01, 0.5) / 7.0);
            match k {
                0 => _ = writeln!(text, "Se:drive(3) -> 1:w0"),
                _ => _ = writeln!(text, "w{} -> TF:g{k}({g:?}) -> 1:w{k}", k - 1),
            }
            // f_out = modulus * f_in
            ratio *= if k == 0 { 1.0 } else { g };
            let _ = writeln!(text, "w{k} -> I:J{k}({m:?})\nw{k} -> R:b{k}({b:?})");
            inertia += m * ratio * ratio;
            friction += b * ratio * ratio;
        }
        let text = Text { name: "gears.bond", text: &text, files: &NoFiles, overrides: &[] };
        let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
        let rates: Vec<_> = program.states.iter().map(|state| state.rate).collect();
        let length = program.routine(&rates).code.steps.len() as f64;
        let mut model = Model::new(program).expect("a model");
        assert_eq!(model.states(), 1);
        let (mut x, mut rate) = (vec![0.0], vec![0.0]);
        model.handle_event(0.0, &mut x).expect("a start");
        model.rates(0.0, &[0.7], &mut rate).expect("rates");
        let wanted = (3.0 - friction * 0.7) / inertia;
        assert!((rate[0] - wanted).abs() <= 1e-13 * wanted.abs(), "{wheels} wheels: {} and {wanted}", rate[0]);
        lengths.push(length / wheels as f64);
    }
    assert!(lengths[2] <= 1.05 * lengths[1] && lengths[1] <= 1.1 * lengths[0], "{lengths:?}");
}
