//! Code that computes of what values are the sums, in magnitude, and code with less in it.

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::program::{Arg, Code, Op, Step};
use rustc_hash::FxHashMap;

/// The code of a Newton block that computes of what its first `n` outputs are the sums, in magnitude.
pub(super) fn terms_of(code: &Code, n: usize) -> Code {
    let values = code.values.clone();
    let mut terms = Terms { code: Code { values, ..Code::default() }, of: FxHashMap::default() };
    for step in &code.steps {
        terms.code.steps.push(step.clone());
        let Step::Op { out, op } = step else { continue };
        let sum = match *op {
            Op::Neg(a) => terms.of(a),
            Op::Add(a, b) | Op::Sub(a, b) => terms.both(Op::Add, a, b),
            Op::Mul(a, b) => terms.both(Op::Mul, a, b),
            Op::Div(a, b) => {
                let (over, under) = (terms.of(a), terms.code.push(Op::Call(Function::Abs, b), None));
                terms.code.push(Op::Div(over, under), None)
            }
            _ => continue,
        };
        terms.of.insert(Arg::Local(*out), sum);
    }
    let outputs = code.outputs[..n].iter().map(|&a| terms.of(a)).collect();
    terms.code.outputs = outputs;
    without_the_unread(terms.code)
}

struct Terms {
    code: Code,
    /// What values are the sums of.
    of: FxHashMap<Arg, Arg>,
}

impl Terms {
    fn of(&mut self, a: Arg) -> Arg {
        if let Some(&known) = self.of.get(&a) {
            return known;
        }
        let size = self.code.push(Op::Call(Function::Abs, a), None);
        self.of.insert(a, size);
        size
    }

    fn both(&mut self, op: fn(Arg, Arg) -> Op<Arg>, a: Arg, b: Arg) -> Arg {
        let (a, b) = (self.of(a), self.of(b));
        self.code.push(op(a, b), None)
    }
}

/// Code without operations that nothing reads.
pub(super) fn without_the_unread(mut code: Code) -> Code {
    let mut read = vec![false; code.values.len()];
    let mark = |read: &mut Vec<bool>, a: Arg| {
        if let Arg::Local(i) = a {
            read[i.0 as usize] = true;
        }
    };
    code.outputs.iter().for_each(|&a| mark(&mut read, a));
    let mut kept = Vec::with_capacity(code.steps.len());
    for step in code.steps.into_iter().rev() {
        let stays = matches!(step, Step::Guard { .. } | Step::Solve(_));
        if stays || step.defines().iter().any(|out| read[out.0 as usize]) {
            step.for_each_read(|a| mark(&mut read, a));
            kept.push(step);
        }
    }
    kept.reverse();
    code.steps = kept;
    code
}
