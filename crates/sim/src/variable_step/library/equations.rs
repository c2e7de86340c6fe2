//! `x' = f(t, x)` as the library wants it.

use std::cell::RefCell;

use diffsol::matrix::sparsity::MatrixSparsity;
use diffsol::{
    ConstantOp, LinearOp, Matrix, NonLinearOp, NonLinearOpJacobian, OdeEquations, OdeEquationsRef, Op, ParameterisedOp,
    UnitCallable, Vector, VectorIndex,
};

use crate::jacobian::Jacobian;
use crate::shared::Shared;
use crate::{Affected, Failure, System};

/// `x' = f(t, x)` as the library wants it, with matrices of type `M`.
pub(super) struct Equations<'s, M: Matrix> {
    shared: &'s Shared<'s>,
    states: usize,
    context: M::C,
    /// `None` for explicit methods.
    newton: Option<Newton<M>>,
}

/// What Newton needs of the Jacobian.
struct Newton<M: Matrix> {
    jacobian: RefCell<Jacobian>,
    pattern: Vec<(usize, usize)>,
    values: RefCell<M::V>,
    /// Where each nonzero stands in the values and in the matrix.
    from: <M::V as Vector>::Index,
    to: <M::V as Vector>::Index,
}

impl<M: Matrix<T = f64>> Newton<M> {
    /// For errors that are allowed, relative and absolute of each state.
    fn new(system: &dyn System, (relative, absolute): (f64, Vec<f64>), context: &M::C) -> Newton<M> {
        let (sparsity, states) = (system.sparsity(), system.states());
        let count = sparsity.nonzeros();
        let dense = || sparsity.entries().map(|(row, column)| row + column * states).collect();
        let to = if M::is_sparse() { (0..count).collect() } else { dense() };
        Newton {
            jacobian: RefCell::new(Jacobian::new(sparsity).within(relative, absolute)),
            pattern: sparsity.entries().collect(),
            values: RefCell::new(M::V::zeros(count, context.clone())),
            from: VectorIndex::from_vec((0..count).collect(), context.clone()),
            to: VectorIndex::from_vec(to, context.clone()),
        }
    }
}

impl<'s, M: Matrix<T = f64>> Equations<'s, M> {
    /// Implicit methods, which ask for the Jacobian, tell which errors they allow, relative and absolute of each state.
    pub(super) fn new(shared: &'s Shared<'s>, implicit: Option<(f64, Vec<f64>)>) -> Equations<'s, M> {
        let context = M::C::default();
        let system = shared.system();
        Equations {
            shared,
            states: system.states(),
            newton: implicit.map(|allowed| Newton::new(&*system, allowed, &context)),
            context,
        }
    }

    pub(super) fn shared(&self) -> &'s Shared<'s> {
        self.shared
    }

    /// Evaluates; a failure is kept and told to the library as not-a-number, on which it shortens its step.
    fn guard(
        &self,
        t: f64,
        x: &[f64],
        out: &mut [f64],
        call: impl FnOnce(&mut dyn System, &mut [f64]) -> Result<(), Failure>,
    ) {
        let system = &mut *self.shared.system();
        let bad = |values: &[f64]| values.iter().position(|value| !value.is_finite());
        if !t.is_finite() || bad(x).is_some() {
            return out.fill(f64::NAN); // follows from an earlier failure
        }
        let called = call(system, out).and_then(|()| match bad(out) {
            Some(state) => Err(Failure::NotFinite { time: t, what: Affected::Rate(system.state_name(state)) }),
            None => Ok(()),
        });
        if let Err(failure) = called {
            self.shared.keep(failure);
            out.fill(f64::NAN);
        }
    }
}

impl<M: Matrix<T = f64>> Op for Equations<'_, M> {
    type T = f64;
    type V = M::V;
    type M = M;
    type C = M::C;

    fn context(&self) -> &M::C {
        &self.context
    }
    fn nstates(&self) -> usize {
        self.states
    }
    fn nout(&self) -> usize {
        self.states
    }
    fn nparams(&self) -> usize {
        0
    }
}

impl<M: Matrix<T = f64>> NonLinearOp for Equations<'_, M> {
    fn call_inplace(&self, x: &M::V, t: f64, y: &mut M::V) {
        y.for_each_batch_host([x], |dx, [x], _| self.guard(t, x, dx, |system, dx| system.rates(t, x, dx)));
    }
}

impl<M: Matrix<T = f64>> NonLinearOpJacobian for Equations<'_, M> {
    fn jac_mul_inplace(&self, x: &M::V, t: f64, v: &M::V, y: &mut M::V) {
        y.for_each_batch_host([x, v], |jv, [x, v], _| {
            self.guard(t, x, jv, |system, jv| system.directional_derivative(t, x, v, jv));
        });
    }

    fn jacobian_sparsity(&self) -> Option<M::Sparsity> {
        let newton = self.newton.as_ref().filter(|_| M::is_sparse())?;
        M::Sparsity::try_from_indices(self.states, self.states, newton.pattern.clone()).ok()
    }

    /// A Jacobian that cannot be had is told as 0: Newton then fails without harm to the factorisation.
    fn jacobian_inplace(&self, x: &M::V, t: f64, y: &mut M) {
        let Some(newton) = &self.newton else { return };
        let mut values = newton.values.borrow_mut();
        values.for_each_batch_host([x], |values, [x], _| {
            let write = |_, _, place: usize, value| values[place] = value;
            let visited = newton.jacobian.borrow_mut().visit(&mut *self.shared.system(), t, x, write);
            let finite = visited.and_then(|()| match values.iter().all(|value| value.is_finite()) {
                true => Ok(()),
                false => Err(Failure::NotFinite { time: t, what: "a derivative of the rates".into() }),
            });
            if let Err(failure) = finite {
                self.shared.keep(failure);
                values.fill(0.0);
            }
        });
        y.set_data_with_indices(&newton.to, &newton.from, &values);
    }
}

impl<M: Matrix<T = f64>> ConstantOp for Equations<'_, M> {
    fn call_inplace(&self, _: f64, y: &mut M::V) {
        y.fill(0.0);
    }
}

/// Ones where a state has a rate, zeros where it has none.
pub(super) struct Mass<'a, M: Matrix> {
    differential: &'a [bool],
    context: M::C,
}

impl<M: Matrix<T = f64>> Op for Mass<'_, M> {
    type T = f64;
    type V = M::V;
    type M = M;
    type C = M::C;

    fn context(&self) -> &M::C {
        &self.context
    }
    fn nstates(&self) -> usize {
        self.differential.len()
    }
    fn nout(&self) -> usize {
        self.differential.len()
    }
    fn nparams(&self) -> usize {
        0
    }
}

impl<M: Matrix<T = f64>> LinearOp for Mass<'_, M> {
    fn gemv_inplace(&self, x: &M::V, _: f64, beta: f64, y: &mut M::V) {
        y.for_each_batch_host([x], |y, [x], _| {
            for ((y, x), differential) in y.iter_mut().zip(x).zip(self.differential) {
                *y = beta * *y + if *differential { *x } else { 0.0 };
            }
        });
    }

    /// The whole diagonal: its zeros tell the library which states are algebraic.
    fn sparsity(&self) -> Option<M::Sparsity> {
        let size = self.differential.len();
        let diagonal = (0..size).map(|i| (i, i)).collect();
        M::is_sparse().then(|| M::Sparsity::try_from_indices(size, size, diagonal).ok()).flatten()
    }

    fn matrix_inplace(&self, _: f64, y: &mut M) {
        let size = self.differential.len();
        let places = (0..size).map(|i| if M::is_sparse() { i } else { i * (size + 1) }).collect();
        let ones = self.differential.iter().map(|differential| f64::from(u8::from(*differential))).collect();
        let from = <M::V as Vector>::Index::from_vec((0..size).collect(), self.context.clone());
        let to = <M::V as Vector>::Index::from_vec(places, self.context.clone());
        y.set_data_with_indices(&to, &from, &M::V::from_vec(ones, self.context.clone()));
    }
}

impl<'a, M: Matrix<T = f64>> OdeEquationsRef<'a> for Equations<'_, M> {
    type Rhs = &'a Self;
    type Init = &'a Self;
    type Mass = Mass<'a, M>;
    type Root = ParameterisedOp<'a, UnitCallable<M>>;
    type Out = ParameterisedOp<'a, UnitCallable<M>>;
    type Reset = ParameterisedOp<'a, UnitCallable<M>>;
}

impl<M: Matrix<T = f64>> OdeEquations for Equations<'_, M> {
    fn rhs(&self) -> &Self {
        self
    }
    fn init(&self) -> &Self {
        self
    }
    fn mass(&self) -> Option<Mass<'_, M>> {
        let differential = self.shared.differential()?;
        Some(Mass { differential, context: self.context.clone() })
    }
    fn set_params(&mut self, _: &M::V) {}
    fn get_params(&self, _: &mut M::V) {}
}
