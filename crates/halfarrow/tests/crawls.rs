//! Runs that come to positions at which their variables tell nothing: what loses or gains energy there is refused, whatever
//! tolerance was asked for, and what is right is not.

use halfarrow::{Error, Form, Method, Model, Record, Run, Verdict};

/// A pendulum told by its height alone, which tells nothing where it hangs.
const BY_HEIGHT: &str = "model ByHeight
param m = 1, l = 0.5
state x' = u.f
state y' = v.f
1:u -> I:mu(m)
1:v -> I:mv(m)
Se:weight(-9.81*m) -> v
guess x = 0.4, y = -0.3
constraint rod: x^2 + y^2 - l^2 = 0
prefer v.f
output kinetic = 0.5*m*(u.f^2 + v.f^2)
output E = kinetic + 9.81*m*(y + l)
";

/// A crank told by the angle of its rocker, which tells nothing where that turns back.
const BY_ROCKER: &str = "model ByRocker
1:crank -> I:one(1, f0 = 10)
1:coupler -> I:two(0.05)
1:rocker -> I:three(0.7)
state th1' = crank.f from 0.6
state th2' = coupler.f
state th3' = rocker.f
prefer rocker.f
constraint along: 0.2*cos(th1) + 0.5*cos(th2) = 0.5 + 0.4*cos(th3)
constraint across: 0.2*sin(th1) + 0.5*sin(th2) = 0.4*sin(th3)
guess th2 = 0.5, th3 = 1.5
output E = (one.p*one.f + two.p*two.f + three.p*three.f)/2
";

/// A parallelogram whose bar stays level: what turns it is rounding.
const LEVEL: &str = "model Level
param a = 0.2, d = 0.5
state th1' = c1.f from 0.7 rad
state th2' = c2.f
state ph' = bar.f
1:c1 -> I:I1(0.01 kg.m2, f0 = 3)
1:c2 -> I:I2(0.01 kg.m2)
1:bar -> I:Ib(0.02 kg.m2)
constraint x: a*cos(th1) + d*cos(ph) = d + a*cos(th2)
constraint y: a*sin(th1) + d*sin(ph) = a*sin(th2)
guess th2 = 0.7 rad
output E = 0.005*c1.f^2 + 0.005*c2.f^2 + 0.01*bar.f^2
";

/// A rod as long as its crank, which is loaded: another motion leads through its folded position.
fn folded(load: f64) -> String {
    format!(
        "model Folded\n1:crank -> I:wheel(0.01, f0 = 10)\n1:rod -> I:bar(0.005)\n1:piston -> I:mass(0.7)\nSe:pull(-{load}) -> piston\n\
         state th' = crank.f from 0.6\nstate ph' = rod.f\nstate x' = piston.f\n\
         constraint along: 0.2*cos(th) + 0.2*cos(ph) = x\nconstraint across: 0.2*sin(th) = 0.2*sin(ph)\n\
         guess ph = 0.6, x = 0.3\noutput E = (wheel.p*wheel.f + bar.p*bar.f + mass.p*mass.f)/2 + {load}*x\n"
    )
}

/// How far the energy has come from what it was at most, relative to the greatest; `None` where the run is refused or stops.
fn strayed(text: &str, run: &Run) -> Option<f64> {
    let run = Run { record: Record::Names(vec!["E".into()]), ..run.clone() };
    let model = Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    match model.simulate(&run, &mut |_| true) {
        Ok(done) => {
            assert_ne!(done.report.audit.verdict, Verdict::Refused);
            let energy = &done.trace.columns[0].values;
            let most = energy.iter().fold(0.0f64, |most, e| most.max(e.abs()));
            Some(energy.iter().fold(0.0f64, |off, e| off.max((e - energy[0]).abs())) / most)
        }
        Err(Error::Run(_)) => None,
        Err(error) => panic!("{}", error.render(false)),
    }
}

#[test]
fn energy_that_is_lost_where_variables_tell_nothing_is_refused() {
    for text in [BY_HEIGHT, BY_ROCKER] {
        for method in [Method::Auto, Method::Explicit, Method::Radau] {
            for rtol in [1e-3, 3e-4, 1e-4, 1e-6, 1e-8] {
                let run = Run { to: 6.0, method, rtol, form: Form::Kane, ..Run::default() };
                let off = strayed(text, &run);
                assert!(off.is_none_or(|off| off < 0.01), "{method:?} {rtol:e}: {off:?}");
                // The minimal form goes on in other variables.
                let off = strayed(text, &Run { form: Form::Minimal, ..run });
                assert!(off.is_some_and(|off| off < 300.0 * rtol), "{method:?} {rtol:e}: {off:?}");
            }
        }
    }
}

#[test]
fn a_bar_that_stays_level_is_right() {
    for form in [Form::Minimal, Form::Kane] {
        for method in [Method::Auto, Method::Radau, Method::Bdf] {
            for rtol in [1e-3, 1e-6, 1e-9] {
                let off = strayed(LEVEL, &Run { to: 10.0, method, rtol, form, ..Run::default() });
                assert!(off.is_some_and(|off| off < 1e-9), "{form:?} {method:?} {rtol:e}: {off:?}");
            }
        }
    }
}

#[test]
fn no_energy_comes_from_a_fold_by_bdf() {
    for load in [1.0, 2.0, 3.0, 5.0] {
        for rtol in [1e-8, 1e-9, 1e-10, 1e-11, 1e-12] {
            let off = strayed(&folded(load), &Run { to: 10.0, method: Method::Bdf, rtol, ..Run::default() });
            assert!(off.is_none_or(|off| off < 1e-4), "{load} {rtol:e}: {off:?}");
        }
    }
}
