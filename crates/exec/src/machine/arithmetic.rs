//! Numbers while a chunk is translated: Cranelift's instructions under the names of the field.

use cranelift_codegen::ir::condcodes::FloatCC;
use cranelift_codegen::ir::{AbiParam, InstBuilder, MemFlagsData, SigRef, Signature, Type, Value, types};
use cranelift_codegen::isa::CallConv;
use cranelift_frontend::FunctionBuilder;
use std::collections::{BTreeMap, BTreeSet};

/// Writes instructions of one function.
pub(super) struct Writer<'a> {
    pub builder: FunctionBuilder<'a>,
    convention: CallConv,
    constants: BTreeMap<u64, Value>,
    numbers: BTreeSet<Value>,
    signatures: BTreeMap<Vec<u8>, SigRef>,
}

impl<'a> Writer<'a> {
    pub fn new(builder: FunctionBuilder<'a>, convention: CallConv) -> Writer<'a> {
        Writer {
            builder,
            convention,
            constants: BTreeMap::new(),
            numbers: BTreeSet::new(),
            signatures: BTreeMap::new(),
        }
    }
    pub fn number(&mut self, value: f64) -> Value {
        let bits = value.to_bits();
        if let Some(&known) = self.constants.get(&bits) {
            return known;
        }
        let made = self.builder.ins().f64const(value);
        self.constants.insert(bits, made);
        self.numbers.insert(made);
        made
    }
    /// Numbers stand second where that is the same: there they need no register of their own.
    fn number_last(&self, a: Value, b: Value) -> (Value, Value) {
        let is_number = |v| self.numbers.contains(&v);
        if is_number(a) && !is_number(b) { (b, a) } else { (a, b) }
    }
    pub fn add(&mut self, a: Value, b: Value) -> Value {
        let (a, b) = self.number_last(a, b);
        self.builder.ins().fadd(a, b)
    }
    pub fn sub(&mut self, a: Value, b: Value) -> Value {
        self.builder.ins().fsub(a, b)
    }
    pub fn mul(&mut self, a: Value, b: Value) -> Value {
        let (a, b) = self.number_last(a, b);
        self.builder.ins().fmul(a, b)
    }
    pub fn div(&mut self, a: Value, b: Value) -> Value {
        self.builder.ins().fdiv(a, b)
    }
    pub fn neg(&mut self, a: Value) -> Value {
        self.builder.ins().fneg(a)
    }
    pub fn abs(&mut self, a: Value) -> Value {
        self.builder.ins().fabs(a)
    }
    /// 1 with the sign of `a`.
    pub fn sign_of(&mut self, a: Value) -> Value {
        let one = self.number(1.0);
        self.builder.ins().fcopysign(one, a)
    }
    pub fn is(&mut self, how: FloatCC, a: Value, b: Value) -> Value {
        self.builder.ins().fcmp(how, a, b)
    }
    pub fn choose(&mut self, condition: Value, a: Value, b: Value) -> Value {
        self.builder.ins().select(condition, a, b)
    }
    pub fn both(&mut self, a: Value, b: Value) -> Value {
        self.builder.ins().band(a, b)
    }
    pub fn either(&mut self, a: Value, b: Value) -> Value {
        self.builder.ins().bor(a, b)
    }
    pub fn bits(&mut self, a: Value) -> Value {
        self.builder.ins().bitcast(types::I64, MemFlagsData::new(), a)
    }
    pub fn of_bits(&mut self, a: Value) -> Value {
        self.builder.ins().bitcast(types::F64, MemFlagsData::new(), a)
    }
    pub fn integer(&mut self, value: u64) -> Value {
        self.builder.ins().iconst(types::I64, value as i64)
    }
    /// What nothing changes while the function runs: may be read whenever it is needed.
    pub fn load_fixed(&mut self, base: Value, index: u32) -> Value {
        let flags = MemFlagsData::trusted().with_readonly().with_can_move();
        self.builder.ins().load(types::F64, flags, base, (index * 8) as i32)
    }
    pub fn load(&mut self, base: Value, index: u32) -> Value {
        self.builder.ins().load(types::F64, MemFlagsData::trusted(), base, (index * 8) as i32)
    }
    pub fn store(&mut self, base: Value, index: u32, value: Value) {
        self.builder.ins().store(MemFlagsData::trusted(), value, base, (index * 8) as i32);
    }

    /// Two numbers beside each other.
    pub fn store_two(&mut self, base: Value, index: u32, a: Value, b: Value) {
        let vector = self.builder.ins().scalar_to_vector(types::F64X2, a);
        let vector = self.builder.ins().insertlane(vector, b, 1);
        // Numbers stand at multiples of 8 bytes only.
        let flags = MemFlagsData::new().with_notrap();
        self.builder.ins().store(flags, vector, base, (index * 8) as i32);
    }

    /// Calls a function of these arguments (integers are pointers or numbers) that returns a number.
    pub fn call(&mut self, function: usize, arguments: &[Value]) -> Value {
        let kinds: Vec<Type> = arguments.iter().map(|&v| self.builder.func.dfg.value_type(v)).collect();
        let key: Vec<u8> = kinds.iter().map(|&k| u8::from(k == types::I64)).collect();
        let signature = match self.signatures.get(&key) {
            Some(&known) => known,
            None => {
                let mut signature = Signature::new(self.convention);
                signature.params.extend(kinds.into_iter().map(AbiParam::new));
                signature.returns.push(AbiParam::new(types::F64));
                let made = self.builder.import_signature(signature);
                self.signatures.insert(key, made);
                made
            }
        };
        let address = self.integer(function as u64);
        let call = self.builder.ins().call_indirect(signature, address, arguments);
        self.builder.inst_results(call)[0]
    }
}

/// Sums of two numbers, as in `math`.
impl Writer<'_> {
    pub fn fast_two_sum(&mut self, a: Value, b: Value) -> (Value, Value) {
        let sum = self.add(a, b);
        let part = self.sub(sum, a);
        (sum, self.sub(b, part))
    }
    pub fn two_sum(&mut self, a: Value, b: Value) -> (Value, Value) {
        let sum = self.add(a, b);
        let part = self.sub(sum, a);
        let rest = self.sub(sum, part);
        let (left, right) = (self.sub(a, rest), self.sub(b, part));
        (sum, self.add(left, right))
    }
    /// `((c0 + c1 x) + xx (c2 + c3 x)) + xx² (c4 + c5 x)`
    pub fn polynomial_of_6(&mut self, c: &[f64; 6], x: Value, xx: Value) -> Value {
        let (low, middle, high) = (self.line(c[0], c[1], x), self.line(c[2], c[3], x), self.line(c[4], c[5], x));
        let middle = self.mul(xx, middle);
        let low = self.add(low, middle);
        let fourth = self.mul(xx, xx);
        let high = self.mul(fourth, high);
        self.add(low, high)
    }

    /// `c0 + c1 x`
    pub fn line(&mut self, c0: f64, c1: f64, x: Value) -> Value {
        let (c0, c1) = (self.number(c0), self.number(c1));
        let product = self.mul(c1, x);
        self.add(c0, product)
    }
}
