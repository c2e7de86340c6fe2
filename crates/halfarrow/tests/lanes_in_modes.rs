//! Sets of a sweep whose runs change their modes, each where its parameters make it: on lanes they do to the last bit what
//! they do alone.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow::{FixedMethod, Method, Model, Override, Record, Reduce, Run, Sweep, Vary};

struct Case {
    text: &'static str,
    /// What varies, and what is kept.
    vary: &'static str,
    kept: &'static [&'static str],
    method: FixedMethod,
    step: f64,
    to: f64,
}

const CASES: [Case; 5] = [
    // A pendulum in x and y: every half swing another of them tells the motion.
    Case {
        text: "model PointPendulum\nparam m = 1, l = 0.5\nstate x' = u.f\nstate y' = v.f\n1:u -> I:mu(m)\n1:v -> I:mv(m)\n\
            Se:weight(-9.81*m) -> v\nguess x = 0.4, y = -0.3\nconstraint rod: x^2 + y^2 - l^2 = 0\nprefer u.f\n\
            output E = 0.5*m*(u.f^2 + v.f^2) + 9.81*m*y\n",
        vary: "l=lin(0.4,0.8,37)",
        kept: &["x", "y", "E"],
        method: FixedMethod::Rk4,
        step: 2e-3,
        to: 2.0,
    },
    // A ball that comes to rest, at another time each.
    Case {
        text: "model Ball\nparam e = 0.7, h0 = 0.3\nSe:weight(-9.81) -> 1:fall -> I:ball(1)\nstate h' = fall.f from h0\n\
            constraint floor: h >= 0 (restitution = e)\n",
        vary: "e=lin(0.2,0.75,37)",
        kept: &["h", "ball.f", "floor.e"],
        method: FixedMethod::Rk4,
        step: 3e-3,
        to: 2.5,
    },
    // A block that sticks and slips on a belt.
    Case {
        text: "model Belt\nparam mu = 4, k = 30\nSf:belt(0.4) -> 0:contact -> 1:v -> I:block(1.5)\n\
            contact -> R:pad(friction = mu, stiction = 1.6*mu)\nv -> C:spring(k = k)\n",
        vary: "k=lin(10,90,37)",
        kept: &["block.f", "spring.q"],
        method: FixedMethod::Heun,
        step: 2e-3,
        to: 4.0,
    },
    // A rectifier, whose diode opens and closes in each period.
    Case {
        text: "model Rectifier\nparam c = 1e-3, r = 40\nSe:source(10*sin(314*t)) -> 1:line -> R:wire(0.5)\n\
            line -> R:diode(0 <= f, 0 <= -e)\nline -> 0:plus -> C:buffer(c)\nplus -> R:load(r)\n",
        vary: "r=log(10,1000,37)",
        kept: &["buffer.e", "diode.f"],
        method: FixedMethod::Rk4,
        step: 1e-4,
        to: 0.1,
    },
    // Events of the text among them.
    Case {
        text: "model Jumps\nparam e = 0.8, mu = 0.3\nSe:weight(-9.81) -> 1:fall -> I:ball(1)\nstate h' = fall.f from 1\n\
            discrete n = 0\nwhen h < 0 {\n    reset ball.f = -e*ball.f\n    n = n + 1\n}\n\
            1:slide -> I:sledge(1, f0 = 2)\nslide -> R:pad(friction = mu)\nslide -> C:spring(k = 3 + n)\n",
        vary: "mu=lin(0.1,0.9,37)",
        kept: &["h", "n", "spring.q", "sledge.f"],
        method: FixedMethod::Rk4,
        step: 4e-3,
        to: 1.6,
    },
];

#[test]
fn lanes_in_different_modes_are_runs_alone() {
    for case in &CASES {
        for every in [None, Some(case.to / 11.0)] {
            compare(case, every);
        }
    }
}

fn compare(case: &Case, every: Option<f64>) {
    let Case { text, kept, to, .. } = *case;
    let method = Method::Fixed(case.method);
    let record = Record::Names(kept.iter().map(ToString::to_string).collect());
    let run = Run { to, method, step: Some(case.step), every, record, ..Run::default() };
    let parse = |name: &str, of: &str| Reduce::parse(&format!("{of}({name})")).unwrap();
    let reduce = kept.iter().flat_map(|name| [parse(name, "final"), parse(name, "max")]).collect();
    let vary = vec![Vary::parse(case.vary).unwrap()];
    let sweep = Sweep { run: run.clone(), vary, samples: None, reduce, restart: false, units: false, part: None };
    let model = Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    let swept = model.sweep_columns(&sweep, &mut |_, _| true);
    let (columns, report) = swept.unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    let mut changed = 0;
    for set in (0..report.sets).step_by(3) {
        let value = columns[1].values[set];
        let own = [Override { name: columns[1].name.clone(), value: format!("{value:?}") }];
        let alone = Model::from_text("test.bond", text, &own).unwrap();
        let done = alone.simulate(&run, &mut |_| true);
        let failed = report.failures.iter().find(|f| f.set == set + 1);
        let (done, None) = (done.unwrap_or_else(|e| panic!("{}\n{text}", e.render(false))), failed) else {
            panic!("set {set} of {}: {failed:?}", alone.name())
        };
        changed += done.report.exchanges + done.report.switches;
        for own in &done.trace.columns {
            let of = |what: &str| {
                let name = format!("{what}({})", own.name);
                columns.iter().find(|c| c.name == name).unwrap_or_else(|| panic!("{name}")).values[set].to_bits()
            };
            let greatest = own.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let last = own.values.last().expect("a sample").to_bits();
            assert_eq!(
                (of("final"), of("max")),
                (last, greatest.to_bits()),
                "{} of {}, set {set}",
                own.name,
                alone.name()
            );
        }
    }
    assert!(changed > 0, "{} changes no mode", model.name());
}
