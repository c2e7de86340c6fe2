//! One chunk of a routine as a function: loads, arithmetic without branches, and stores if all went well.

use super::arithmetic::Writer;
use super::{RARE, STATUS_OF_GUARD, kernels};
use crate::bytecode::{Operation, PIVOT_BELOW, Register, Solve};
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{InstBuilder, Value, types};
use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::ids::Table;
use halfarrow_compiler::program::calculus::{Calculus, Moving};
use halfarrow_compiler::program::elimination::{Definite, Elimination};
use halfarrow_compiler::program::{Condition, ConditionId, ConditionKind, EventTrigger, Op};
use std::collections::{BTreeMap, BTreeSet};

/// What all chunks of a model share.
pub(super) struct ChunkContext<'a> {
    pub conditions: &'a Table<ConditionId, Condition>,
    /// The register of time: those below never move, constants and parameters.
    pub time: Register,
    pub states: std::ops::Range<Register>,
}

/// Where a function of rates finds time and states, and where it puts the rates.
#[derive(Debug, Clone)]
pub(super) struct Direct {
    pub time: (Register, Value),
    pub states: (std::ops::Range<Register>, Value),
    pub rates: Value,
}

/// What a chunk consists of.
#[derive(Debug, Clone, Copy)]
pub(super) enum ChunkItem<'a> {
    Op(&'a Operation),
    /// Stops if the pivot vanishes against its scale.
    Guard {
        pivot: Register,
        scale: Register,
        guard: u32,
    },
    /// A small linear block, written out.
    Solve(&'a Solve),
}

impl ChunkItem<'_> {
    /// The registers that it writes.
    pub fn written(&self) -> &[Register] {
        match self {
            ChunkItem::Op(operation) => std::slice::from_ref(&operation.out),
            ChunkItem::Guard { .. } => &[],
            ChunkItem::Solve(solve) => &solve.unknowns,
        }
    }

    /// Whether it may stop the run, or ask for the bytecode; `inline`: functions are written out.
    pub fn may_fail(&self, inline: bool) -> bool {
        match self {
            ChunkItem::Op(Operation { op, .. }) => inline && is_written_out(op),
            ChunkItem::Guard { .. } | ChunkItem::Solve(_) => true,
        }
    }
}

/// Whether a function is one of those that are written out, for usual arguments, where they are few.
pub(super) fn is_written_out(op: &Op<Register>) -> bool {
    matches!(op, Op::Call(Function::Sin | Function::Cos | Function::Exp | Function::Log, _))
}

/// Translates items, then stores the registers that are live behind them.
pub(super) struct Chunk<'a, 'b> {
    w: Writer<'a>,
    context: &'b ChunkContext<'b>,
    along: bool,
    inline: bool,
    values: Value,
    derivatives: Value,
    held: Value,
    tables: Value,
    keep: Value,
    r: BTreeMap<Register, Value>,
    d: BTreeMap<Register, Value>,
    /// Registers that are stored as soon as they are written, with the item that writes them last: nothing in the chunk can go
    /// wrong.
    at_once: BTreeMap<Register, usize>,
    /// Registers that the chunk writes: what stands in others does not change while it runs.
    written: BTreeSet<Register>,
    /// How many items there were.
    items: usize,
    /// Registers that are only read: loaded again after a call rather than saved over it.
    loaded: BTreeSet<Register>,
    /// 0, or the first thing that is wrong.
    status: Option<Value>,
    /// Whether the fast path holds.
    good: Option<Value>,
    /// Truth values that stand in registers as 0 and 1.
    truth: BTreeMap<Value, Value>,
    sines_and_cosines: BTreeMap<Value, (Value, Value)>,
    kept: [Option<Value>; 2],
    direct: Option<Direct>,
}

impl<'a, 'b> Chunk<'a, 'b> {
    /// `parameters` are those of the function, as in [`memory`](super::memory).
    pub fn new(
        w: Writer<'a>,
        parameters: [Value; 5],
        context: &'b ChunkContext<'b>,
        along: bool,
        inline: bool,
    ) -> Self {
        let [values, derivatives, held, tables, keep] = parameters;
        Chunk {
            w,
            context,
            along,
            inline,
            values,
            derivatives,
            held,
            tables,
            keep,
            r: BTreeMap::new(),
            d: BTreeMap::new(),
            at_once: BTreeMap::new(),
            written: BTreeSet::new(),
            items: 0,
            loaded: BTreeSet::new(),
            status: None,
            good: None,
            truth: BTreeMap::new(),
            sines_and_cosines: BTreeMap::new(),
            kept: [None; 2],
            direct: None,
        }
    }

    /// From now on time and states are read from the arguments.
    pub fn reads_directly(&mut self, direct: Direct) {
        self.direct = Some(direct);
    }

    /// These registers are stored as soon as the last item has written them, so that no value waits for the end.
    pub fn stores_at_once(&mut self, registers: &[Register], items: &[ChunkItem]) {
        for (at, item) in items.iter().enumerate() {
            let kept = item.written().iter().filter(|register| registers.binary_search(register).is_ok());
            self.at_once.extend(kept.map(|&register| (register, at)));
        }
    }

    pub fn items(&mut self, items: &[ChunkItem]) {
        self.written.extend(items.iter().flat_map(ChunkItem::written));
        for item in items {
            match *item {
                ChunkItem::Op(&Operation { out, op }) => self.operation(out, op),
                ChunkItem::Guard { pivot, scale, guard } => self.guard(pivot, scale, guard),
                ChunkItem::Solve(solve) => self.solve(solve),
            }
            self.items += 1;
        }
    }

    /// Stores registers that it has written unless something is wrong or unusual, and returns the status.
    pub fn end(mut self, written: &[Register]) -> Writer<'a> {
        self.stop_unless_fine();
        for register in written.iter().filter(|r| !self.at_once.contains_key(r)).copied() {
            let value = self.r[&register];
            self.w.store(self.values, register, value);
            if let Some(&slope) = self.d.get(&register).filter(|_| self.along) {
                self.w.store(self.derivatives, register, slope);
            }
        }
        self.fine()
    }

    /// The same for a function of rates.
    pub fn end_with_rates(mut self, outputs: &[Register]) -> Writer<'a> {
        let values: Vec<Value> = outputs.iter().map(|&r| self.value(r)).collect();
        self.stop_unless_fine();
        let rates = self.direct.as_ref().expect("a function of rates reads directly").rates;
        // Two at a time: whoever reads them does so too, and would wait for two stores that one read spans.
        for (i, values) in values.chunks(2).enumerate() {
            match *values {
                [a, b] => self.w.store_two(rates, 2 * i as u32, a, b),
                _ => self.w.store(rates, 2 * i as u32, values[0]),
            }
        }
        self.fine()
    }

    fn stop_unless_fine(&mut self) {
        if self.status.is_none() && self.good.is_none() {
            return;
        }
        let fine = self.w.integer(0);
        let mut status = self.status.unwrap_or(fine);
        if let Some(good) = self.good {
            let rare = self.w.integer(RARE);
            status = self.w.choose(good, status, rare);
        }
        let (store, stop) = (self.w.builder.create_block(), self.w.builder.create_block());
        self.w.builder.ins().brif(status, stop, &[], store, &[]);
        self.w.builder.set_cold_block(stop);
        self.w.builder.switch_to_block(stop);
        self.w.builder.ins().return_(&[status]);
        self.w.builder.switch_to_block(store);
    }

    fn fine(mut self) -> Writer<'a> {
        let fine = self.w.builder.ins().iconst(types::I64, 0);
        self.w.builder.ins().return_(&[fine]);
        self.w
    }

    fn value(&mut self, register: Register) -> Value {
        if let Some(&known) = self.r.get(&register) {
            return known;
        }
        let value = match &self.direct {
            Some(direct) if register == direct.time.0 => direct.time.1,
            Some(direct) if direct.states.0.contains(&register) => {
                let (base, index) = (direct.states.1, register - direct.states.0.start);
                self.w.load_fixed(base, index)
            }
            _ if !self.written.contains(&register) => self.w.load_fixed(self.values, register),
            _ => self.w.load(self.values, register),
        };
        self.r.insert(register, value);
        self.loaded.insert(register);
        value
    }

    fn derivative(&mut self, register: Register) -> Value {
        if !self.along || register < self.context.time {
            return self.w.number(0.0);
        }
        if let Some(&known) = self.d.get(&register) {
            return known;
        }
        let slope = match self.written.contains(&register) {
            false => self.w.load_fixed(self.derivatives, register),
            true => self.w.load(self.derivatives, register),
        };
        self.d.insert(register, slope);
        self.loaded.insert(register);
        slope
    }

    fn put(&mut self, register: Register, value: Value, slope: impl FnOnce(&mut Self) -> Value) {
        let slope = self.along.then(|| slope(self));
        self.loaded.remove(&register);
        self.r.insert(register, value);
        let at_once = self.at_once.get(&register) == Some(&self.items);
        if at_once {
            self.w.store(self.values, register, value);
        }
        if let Some(slope) = slope {
            self.d.insert(register, slope);
            if at_once {
                self.w.store(self.derivatives, register, slope);
            }
        }
    }

    fn call_kernel(&mut self, function: usize, arguments: &[Value]) -> Value {
        let result = self.w.call(function, arguments);
        for register in std::mem::take(&mut self.loaded) {
            self.r.remove(&register);
            self.d.remove(&register);
        }
        result
    }

    fn zero(&mut self) -> Value {
        self.w.number(0.0)
    }

    /// Truth as a number.
    fn truth(&mut self, condition: Value) -> Value {
        let (one, zero) = (self.w.number(1.0), self.zero());
        let value = self.w.choose(condition, one, zero);
        self.truth.insert(value, condition);
        value
    }

    /// Whether a number is not 0.
    fn holds(&mut self, value: Value) -> Value {
        if let Some(&known) = self.truth.get(&value) {
            return known;
        }
        let zero = self.zero();
        self.w.is(FloatCC::NotEqual, value, zero)
    }

    fn guard(&mut self, pivot: Register, scale: Register, guard: u32) {
        let (pivot, scale) = (self.value(pivot), self.value(scale));
        let (factor, zero) = (self.w.number(PIVOT_BELOW), self.zero());
        let least = self.w.mul(factor, scale);
        let size = self.w.abs(pivot);
        let above = self.w.is(FloatCC::GreaterThan, size, least);
        let some = self.w.is(FloatCC::NotEqual, pivot, zero);
        let stands = self.w.both(above, some);
        self.stop_unless(stands, STATUS_OF_GUARD + u64::from(guard));
    }

    /// One operation: its value, and by the rules of the table its slope.
    #[allow(unused_variables, reason = "each rule reads what it needs")]
    fn operation(&mut self, out: Register, op: Op<Register>) {
        macro_rules! lower {
            (($k:ident $value:ident)
             given { $($(#[$given_doc:meta])* $given:ident $(($($given_part:ident: $given_kind:ty),*))?;)* }
             plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
                cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
             })* }
             held $held:tt) => {
                match op {
                    $(Op::$plain($($part,)* $($a),*) => {
                        $(let $da = if self.along { Some(self.derivative($a)) } else { None };)*
                        $(let $a = self.value($a);)*
                        let $value = self.lowered(Op::$plain($($part,)* $($a),*));
                        self.put(out, $value, |$k| {
                            let slope = $derivative;
                            slope.unwrap_or_else(|| $k.zero())
                        });
                    })*
                    Op::Sign(condition, a) | Op::Floor(condition, a) => {
                        let va = self.value(a);
                        let value = self.condition(condition, va);
                        self.put(out, value, |this| this.zero());
                    }
                    Op::Table(table, piece, a) => self.look_up(out, a, (table, 0), piece),
                    Op::TableSlope(table, piece, a) => self.look_up(out, a, (table, 1), piece),
                    Op::TableCurvature(table, piece, a) => self.look_up(out, a, (table, 2), piece),
                    $(Op::$given { .. })|* => unreachable!("given before the routine runs"),
                }
            };
        }
        for_each_op!(lower);
    }

    /// The value of a plain operation: what the processor does itself, else a call of what it means.
    fn lowered(&mut self, op: Op<Value>) -> Value {
        match op {
            Op::Add(a, b) => self.w.add(a, b),
            Op::Sub(a, b) => self.w.sub(a, b),
            Op::Mul(a, b) => self.w.mul(a, b),
            Op::Div(a, b) => self.w.div(a, b),
            Op::Neg(a) => self.w.neg(a),
            Op::Powi(n, a) => self.power(a, n),
            Op::Call(f, a) => self.call_one(f, a),
            Op::Positive(a) => {
                let zero = self.zero();
                let above = self.w.is(FloatCC::GreaterThan, a, zero);
                self.truth(above)
            }
            Op::And(a, b) => {
                let (a, b) = (self.holds(a), self.holds(b));
                let both = self.w.both(a, b);
                self.truth(both)
            }
            Op::Or(a, b) => {
                let (a, b) = (self.holds(a), self.holds(b));
                let either = self.w.either(a, b);
                self.truth(either)
            }
            Op::Not(a) => {
                let zero = self.zero();
                let fails = self.w.is(FloatCC::Equal, a, zero);
                self.truth(fails)
            }
            Op::Select(c, a, b) => self.select(c, a, b),
            other => {
                let mut operands = Vec::with_capacity(3);
                other.for_each_operand(|a| operands.push(a));
                let kernel = kernels::of(other).expect("what is fixed in an operation is lowered above");
                self.call_kernel(kernel, &operands)
            }
        }
    }

    /// `a^n` by repeated squaring, as `math::powi` does it.
    fn power(&mut self, a: Value, n: u32) -> Value {
        let (mut result, mut square, mut left) = (None, a, n);
        while left > 0 {
            if left & 1 == 1 {
                result = Some(match result {
                    Some(result) => self.w.mul(result, square),
                    None => square,
                });
            }
            left >>= 1;
            if left > 0 {
                square = self.w.mul(square, square);
            }
        }
        result.unwrap_or_else(|| self.w.number(1.0))
    }

    fn call_one(&mut self, f: Function, a: Value) -> Value {
        match f {
            Function::Sqrt => self.w.builder.ins().sqrt(a),
            Function::Abs => self.w.abs(a),
            Function::Sin if self.inline => self.turn(a).0,
            Function::Cos if self.inline => self.turn(a).1,
            Function::Exp if self.inline => {
                let (value, good) = self.w.exponential(a);
                self.usual(good);
                value
            }
            Function::Log if self.inline => {
                let (value, good) = self.w.logarithm(a);
                self.usual(good);
                value
            }
            _ => self.call_kernel(kernels::one(f), &[a]),
        }
    }

    /// Sine and cosine, shared by both.
    fn turn(&mut self, a: Value) -> (Value, Value) {
        if let Some(&known) = self.sines_and_cosines.get(&a) {
            return known;
        }
        let (sine, cosine, good) = self.w.sine_cosine(a);
        self.usual(good);
        self.sines_and_cosines.insert(a, (sine, cosine));
        (sine, cosine)
    }

    fn usual(&mut self, good: Value) {
        self.good = Some(match self.good {
            Some(all) => self.w.both(all, good),
            None => good,
        });
    }

    fn stop_unless(&mut self, stands: Value, status: u64) {
        let (fine, wrong) = (self.w.integer(0), self.w.integer(status));
        let mine = self.w.choose(stands, fine, wrong);
        self.status = Some(match self.status {
            None => mine,
            Some(before) => {
                let none = self.w.builder.ins().icmp_imm_s(IntCC::Equal, before, 0);
                self.w.choose(none, mine, before)
            }
        });
    }

    fn condition(&mut self, condition: ConditionId, operand: Value) -> Value {
        let Condition { kind, trigger, .. } = self.context.conditions[condition];
        let follow = match kind {
            ConditionKind::Sign => {
                let (one, zero) = (self.w.number(1.0), self.zero());
                let above = self.w.is(FloatCC::GreaterThan, operand, zero);
                let value = self.w.choose(above, one, zero);
                if trigger == EventTrigger::RecordedOnly {
                    self.truth.insert(value, above);
                }
                value
            }
            ConditionKind::Floor => self.call_kernel(kernels::one(Function::Floor), &[operand]),
            ConditionKind::Piece(table) => {
                let table = self.w.integer(u64::from(table));
                self.call_kernel(kernels::piece(), &[self.tables, table, operand])
            }
        };
        let Some(kept) = self.kept(trigger) else { return follow };
        let held = self.w.load(self.held, condition.0);
        self.w.choose(kept, held, follow)
    }

    /// Whether conditions of this trigger are kept; `None` if they always follow.
    fn kept(&mut self, trigger: EventTrigger) -> Option<Value> {
        let place = match trigger {
            EventTrigger::LinearTime | EventTrigger::CurvedTime => 0,
            EventTrigger::State => 1,
            EventTrigger::RecordedOnly => return None,
        };
        if self.kept[place].is_none() {
            let bit = self.w.builder.ins().band_imm_s(self.keep, 1 << place);
            self.kept[place] = Some(self.w.builder.ins().icmp_imm_s(IntCC::NotEqual, bit, 0));
        }
        self.kept[place]
    }

    fn look_up(&mut self, out: Register, a: Register, (table, order): (u32, u64), piece: Option<ConditionId>) {
        let va = self.value(a);
        let da = if self.along { Some(self.derivative(a)) } else { None };
        let piece = match piece {
            Some(condition) => self.condition(condition, va),
            None => self.w.number(-1.0),
        };
        let index = self.w.integer(u64::from(table));
        let at = |this: &mut Self, order: u64| {
            let order = this.w.integer(order);
            this.call_kernel(kernels::table(), &[this.tables, index, order, piece, va])
        };
        let value = at(self, order);
        let slope = da.map(|da| self.along(|this| at(this, order + 1), da));
        self.put(out, value, |_| slope.unwrap_or(value));
    }
}

/// Values of the function that is written, as numbers of the rules of derivatives.
impl Calculus for Chunk<'_, '_> {
    type Number = Value;
    fn number(&mut self, value: f64) -> Value {
        self.w.number(value)
    }
    fn neg(&mut self, a: Value) -> Value {
        self.w.neg(a)
    }
    fn add(&mut self, a: Value, b: Value) -> Value {
        self.w.add(a, b)
    }
    fn sub(&mut self, a: Value, b: Value) -> Value {
        self.w.sub(a, b)
    }
    fn mul(&mut self, a: Value, b: Value) -> Value {
        self.w.mul(a, b)
    }
    fn div(&mut self, a: Value, b: Value) -> Value {
        self.w.div(a, b)
    }
    fn powi(&mut self, a: Value, n: u32) -> Value {
        self.power(a, n)
    }
    fn call(&mut self, f: Function, a: Value) -> Value {
        self.call_one(f, a)
    }
    fn select(&mut self, c: Value, a: Value, b: Value) -> Value {
        let holds = self.holds(c);
        self.w.choose(holds, a, b)
    }
    fn along(&mut self, slope: impl FnOnce(&mut Self) -> Value, rate: Value) -> Value {
        let zero = self.zero();
        if rate == zero {
            return zero;
        }
        let slope = slope(self);
        let product = self.w.mul(slope, rate);
        let rests = self.w.is(FloatCC::Equal, rate, zero);
        self.w.choose(rests, zero, product)
    }
    fn along_power(&mut self, value: Value, (a, da): Moving<Self>, (b, db): Moving<Self>) -> Option<Value> {
        let zero = self.zero();
        let (da, db) = (da.unwrap_or(zero), db.unwrap_or(zero));
        Some(self.call_kernel(kernels::slope_of_pow(), &[value, a, da, b, db]))
    }
    fn table(&mut self, _: (u32, Option<ConditionId>), _: u32, _: Value) -> Value {
        unreachable!("tables are looked up with their derivative")
    }
}

/// Small linear blocks, as `Lu` solves them where no pivot is sought.
impl Chunk<'_, '_> {
    fn solve(&mut self, solve: &Solve) {
        let n = solve.right.len();
        let mut right: Vec<Value> = solve.right.iter().map(|&r| self.value(r)).collect();
        if n == 1 {
            let pivot = self.value(solve.matrix[0]);
            self.single_pivot(pivot);
            right[0] = self.w.div(right[0], pivot);
        } else {
            let entries: Vec<Value> = solve.matrix.iter().map(|&entry| self.value(entry)).collect();
            let factors = Definite::factor(self, (&solve.pattern, &entries), f64::EPSILON * n as f64);
            factors.solve(self, &mut right);
        }
        for (&out, value) in solve.unknowns.iter().zip(right) {
            self.put(out, value, |_| unreachable!("blocks are written out for values only"));
        }
    }

    /// The pivot against itself: neither 0 nor infinite.
    fn single_pivot(&mut self, pivot: Value) {
        let (size, least) = (self.w.abs(pivot), self.w.number(f64::MIN_POSITIVE));
        let above = self.w.is(FloatCC::GreaterThan, size, least);
        let scale = self.w.choose(above, size, least);
        let weight = self.w.div(size, scale);
        let (low, high) = (self.w.number(f64::EPSILON), self.w.number(f64::INFINITY));
        let (some, finite) = (self.w.is(FloatCC::GreaterThan, weight, low), self.w.is(FloatCC::LessThan, weight, high));
        let good = self.w.both(some, finite);
        self.usual(good);
    }
}

impl Elimination for Chunk<'_, '_> {
    fn sign_of(&mut self, a: Value) -> Value {
        self.w.sign_of(a)
    }
    fn require(&mut self, pivot: Value, least: Value) {
        let (zero, high) = (self.zero(), self.w.number(f64::INFINITY));
        for (how, bound) in [(FloatCC::GreaterThan, zero), (FloatCC::GreaterThan, least), (FloatCC::LessThan, high)] {
            let good = self.w.is(how, pivot, bound);
            self.usual(good);
        }
    }
}
