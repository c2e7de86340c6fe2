//! The same steps in another order: each as late as what reads it first allows.

use super::op::Op;
use super::routine::{Arg, Code, Local, Step};

impl Code {
    /// Code of plain operations, what each output needs just before it, outputs taken in this order: so what is computed is
    /// read soon. What no output needs is left out.
    pub fn near(&self, outputs: impl IntoIterator<Item = usize>) -> Code {
        let mut near = Nearness { from: self, to: Code::default(), local: vec![None; self.values.len()] };
        outputs.into_iter().for_each(|output| near.reach(self.outputs[output]));
        near.to.outputs = self.outputs.iter().map(|&a| near.arg(a)).collect();
        near.to
    }
}

struct Nearness<'a> {
    from: &'a Code,
    to: Code,
    /// What the locals have become.
    local: Vec<Option<Local>>,
}

impl Nearness<'_> {
    fn arg(&self, a: Arg) -> Arg {
        match a {
            Arg::Local(local) => Arg::Local(self.local[local.0 as usize].expect("it has been reached")),
            other => other,
        }
    }

    /// The operation that defines a local: plain code defines one with each step.
    fn operation(&self, local: Local) -> Op<Arg> {
        match &self.from.steps[local.0 as usize] {
            Step::Op { out, op } if *out == local => *op,
            _ => panic!("plain code"),
        }
    }

    fn reach(&mut self, wanted: Arg) {
        let Arg::Local(wanted) = wanted else { return };
        let mut open = vec![wanted];
        while let Some(&local) = open.last() {
            if self.local[local.0 as usize].is_some() {
                open.pop();
                continue;
            }
            let (op, before) = (self.operation(local), open.len());
            op.for_each_operand(|a| match a {
                Arg::Local(read) if self.local[read.0 as usize].is_none() => open.push(read),
                _ => {}
            });
            if open.len() == before {
                let op = op.map_operands(|a| self.arg(a));
                let Arg::Local(new) = self.to.push(op, self.from.values[local.0 as usize]) else {
                    unreachable!("an operation defines a local")
                };
                self.local[local.0 as usize] = Some(new);
                open.pop();
            } else {
                // The first operand first.
                open[before..].reverse();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Value;

    fn given(i: u32) -> Arg {
        Arg::Given(Value(i))
    }

    #[test]
    fn what_an_output_needs_stands_before_it() {
        let mut code = Code::default();
        let squares: Vec<Arg> = (0..3).map(|i| code.push(Op::Mul(given(i), given(i)), None)).collect();
        let sums: Vec<Arg> = (0..3).map(|i| code.push(Op::Add(squares[i], squares[(i + 1) % 3]), None)).collect();
        code.push(Op::Neg(sums[0]), None);
        code.outputs = vec![sums[2], sums[0], sums[1]];
        let near = code.near([1, 2, 0]);
        assert_eq!(near.verify(), Ok(()));
        let ops: Vec<Op<Arg>> =
            near.steps.iter().map(|step| if let Step::Op { op, .. } = step { *op } else { panic!() }).collect();
        let local = |i| Arg::Local(Local(i));
        let square = |i| Op::Mul(given(i), given(i));
        let expected = [square(0), square(1), Op::Add(local(0), local(1)), square(2)];
        assert_eq!(ops[..4], expected);
        assert_eq!(ops[4..], [Op::Add(local(1), local(3)), Op::Add(local(3), local(0))]);
        assert_eq!(near.outputs, [local(5), local(2), local(4)]);
    }
}
