//! Sparse matrices against dense ones, by every implicit method, on random networks.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use crate::systems::Samples;
use halfarrow_sim::fixed_step::{FixedMethod, FixedStep};
use halfarrow_sim::{Events, Failure, Method, Options, Sparsity, System, simulate};

/// Nodes with capacitors over four decades, joined by branches whose flow is `g (e + e³)`, the first one to a source.
struct Net {
    capacities: Vec<f64>,
    branches: Vec<(usize, usize, f64)>,
    scales: Vec<f64>,
    sparsity: Sparsity,
}

impl Net {
    /// A tree of so many nodes with half as many branches more; `dense` hides its pattern.
    fn new(nodes: usize, mut seed: f64, dense: bool) -> Net {
        let mut next = || {
            seed = (seed * 16807.0) % 2147483647.0;
            seed / 2147483647.0
        };
        let mut below = |most: usize| ((next() * most as f64) as usize, 1.0 + next());
        let mut branches = Vec::new();
        for node in 1..nodes {
            let (other, g) = below(node);
            branches.push((other, node, g));
        }
        for _ in 0..nodes / 2 {
            let ((a, g), (b, _)) = (below(nodes), below(nodes));
            branches.push((a, b, g));
        }
        let capacities: Vec<f64> = (0..nodes).map(|_| 10.0_f64.powf(-4.0 * below(1).1 + 4.0)).collect();
        let mut columns: Vec<Vec<usize>> = (0..nodes).map(|node| vec![node]).collect();
        for &(a, b, _) in &branches {
            columns[a].push(b);
            columns[b].push(a);
        }
        let sparsity = if dense { Sparsity::dense(nodes) } else { Sparsity::from_columns(columns) };
        Net { scales: capacities.clone(), capacities, branches, sparsity }
    }

    /// What flows into each node by branches with these flows, and by the source.
    fn balance(&self, out: &mut [f64], source: f64, flow: impl Fn(usize, usize, f64) -> f64) {
        out.fill(0.0);
        out[0] = source;
        for &(a, b, g) in &self.branches {
            let flow = flow(a, b, g);
            out[a] -= flow;
            out[b] += flow;
        }
    }
}

impl System for Net {
    /// So that both ways are taken in these tests.
    fn compares_rates(&self) -> bool {
        true
    }
    fn states(&self) -> usize {
        self.capacities.len()
    }
    fn scales(&self) -> &[f64] {
        &self.scales
    }
    fn rates(&mut self, _: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        let effort = |node: usize| x[node] / self.capacities[node];
        self.balance(dx, 1.0 - effort(0), |a, b, g| {
            let e = effort(a) - effort(b);
            g * (e + e * e * e)
        });
        Ok(())
    }
    fn directional_derivative(&mut self, _: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        let effort = |x: &[f64], node: usize| x[node] / self.capacities[node];
        self.balance(jv, -effort(v, 0), |a, b, g| {
            let (e, de) = (effort(x, a) - effort(x, b), effort(v, a) - effort(v, b));
            g * (1.0 + 3.0 * e * e) * de
        });
        Ok(())
    }
    fn time_derivative(&mut self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        out.fill(0.0);
        Ok(())
    }
    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
}

impl Events for Net {
    fn next_time_event(&mut self, _: f64) -> Option<f64> {
        None
    }
    fn indicators(&self) -> usize {
        0
    }
    fn event_indicators(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }
    fn handle_event(&mut self, _: f64, _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }
    fn accept(&mut self, _: f64, _: &[f64]) -> Result<(), Failure> {
        Ok(())
    }
    fn observed(&self) -> usize {
        self.capacities.len()
    }
    fn observe(&mut self, _: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        (0..x.len()).for_each(|node| out[node] = x[node] / self.capacities[node]);
        Ok(())
    }
}

fn end(net: &mut Net, method: Method) -> Vec<f64> {
    let step = matches!(method, Method::Fixed(_)).then_some(0.02);
    let options = Options { method, step, every: Some(1.0), ..Options::default() };
    let (mut x, mut samples) = (vec![0.0; net.states()], Samples::default());
    simulate(net, &options, &mut x, &mut samples).unwrap_or_else(|stopped| panic!("{method:?}: {}", stopped.failure));
    samples.values.pop().expect("the end")
}

const IMPLICIT: [FixedMethod; 4] = [
    FixedMethod::ImplicitMidpoint,
    FixedMethod::LinearlyImplicitEuler,
    FixedMethod::LinearlyImplicitBdf2,
    FixedMethod::Rosenbrock,
];

#[test]
fn every_implicit_method_gives_what_it_gives_with_dense_matrices() {
    let methods = IMPLICIT.map(Method::Fixed).into_iter().chain([Method::Bdf, Method::Radau, Method::Auto]);
    for (number, method) in methods.enumerate() {
        let seed = 11.0 + number as f64;
        let (sparse, dense) = (end(&mut Net::new(80, seed, false), method), end(&mut Net::new(80, seed, true), method));
        for (a, b) in sparse.iter().zip(&dense) {
            // The same steps, but for rounding; where a Jacobian is kept its columns are not of the same age. Volts between 0 and 1.
            let close = if method == Method::Fixed(FixedMethod::LinearlyImplicitBdf2) { 1e-6 } else { 1e-9 };
            assert!((a - b).abs() < close, "{method:?}: {a} {b}");
            assert!(*a > -1e-6 && *a < 1.0 + 1e-6, "what the source gives bounds all efforts: {a}");
        }
    }
}

#[test]
fn a_sparse_implicit_step_takes_no_memory() {
    for method in IMPLICIT {
        let mut net = Net::new(200, 3.0, false);
        let (mut steps, mut x) = (FixedStep::new(method, &net.sparsity.clone()), vec![0.0; 200]);
        let taken = allocation_counter::measure(|| {
            (0..20).for_each(|k| steps.step(&mut net, 0.01 * f64::from(k), 0.01, &mut x).expect("a step"));
        });
        assert_eq!(taken.count_total, 0, "{method:?}");
    }
}
