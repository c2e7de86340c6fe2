//! The usual ways of `sin`, `cos`, `exp` and `log`, written out: the same operations as in `math`, in the same order.
//! What needs another way says so, and the chunk is run by the bytecode instead.

use super::arithmetic::Writer;
use crate::math::constants as k;
use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{InstBuilder, MemFlagsData, Value, types};

const ROUNDER: f64 = 6755399441055744.0;
const BIAS: u64 = 1023 << 52;
const SIGN: u64 = 1 << 63;

impl Writer<'_> {
    /// Sine and cosine, and whether they hold.
    pub fn sine_cosine(&mut self, x: Value) -> (Value, Value, Value) {
        let (rounder, turns) = (self.number(ROUNDER), self.number(k::TWO_OVER_PI));
        let scaled = self.mul(x, turns);
        let rounded = self.add(scaled, rounder);
        let n = self.sub(rounded, rounder);
        let [short, middle, rest] = [k::PIO2_SHORT, k::PIO2_MIDDLE, k::PIO2_REST].map(|c| self.number(c));
        let (near, next, last) = (self.mul(n, short), self.mul(n, middle), self.mul(n, rest));
        let t = self.sub(x, near);
        let next = self.neg(next);
        let (a, lost) = self.two_sum(t, next);
        let b = self.sub(lost, last);
        let z = self.mul(a, a);
        let zz = self.mul(z, z);
        let (one, half) = (self.number(1.0), self.number(0.5));
        let half_z = self.mul(half, z);
        let w = self.sub(one, half_z);
        let sine = {
            let p = self.polynomial_of_6(&k::SINE, z, zz);
            let (left, az) = (self.mul(b, w), self.mul(a, z));
            let right = self.mul(az, p);
            let rest = self.sub(left, right);
            self.add(a, rest)
        };
        let cosine = {
            let p = self.polynomial_of_6(&k::COSINE, z, zz);
            let lost = self.sub(one, w);
            let lost = self.sub(lost, half_z);
            let (high, ab) = (self.mul(zz, p), self.mul(a, b));
            let high = self.sub(high, ab);
            let rest = self.add(lost, high);
            self.add(w, rest)
        };
        let sign = self.integer(SIGN);
        let sign = self.of_bits(sign);
        let sign_of_a = self.both(a, sign);
        let sine = self.either(sine, sign_of_a);
        let quarters = self.bits(rounded);
        let more = self.builder.ins().iadd_imm_s(quarters, 1);
        let values = (self.turned(sine, cosine, quarters), self.turned(sine, cosine, more));
        let (size, most) = (self.abs(x), self.number(1e5));
        let good = self.is(FloatCC::LessThanOrEqual, size, most);
        (values.0, values.1, good)
    }

    fn turned(&mut self, sine: Value, cosine: Value, quarters: Value) -> Value {
        let odd = self.builder.ins().band_imm_s(quarters, 1);
        let odd = self.builder.ins().ineg(odd);
        let odd = self.of_bits(odd);
        let cosine = self.both(cosine, odd);
        let sine = self.builder.ins().band_not(sine, odd);
        let value = self.either(sine, cosine);
        let half = self.builder.ins().band_imm_s(quarters, 2);
        let sign = self.builder.ins().ishl_imm_s(half, 62);
        let sign = self.of_bits(sign);
        self.builder.ins().bxor(value, sign)
    }

    /// Exponential, and whether it holds.
    pub fn exponential(&mut self, x: Value) -> (Value, Value) {
        let [steps, rounder, short, rest] =
            [k::STEPS_PER_E, ROUNDER, k::STEP_SHORT, k::STEP_REST].map(|c| self.number(c));
        let scaled = self.mul(x, steps);
        let rounded = self.add(scaled, rounder);
        let n = self.sub(rounded, rounder);
        let (near, last) = (self.mul(n, short), self.mul(n, rest));
        let r = self.sub(x, near);
        let r = self.sub(r, last);
        let zero = self.number(0.0);
        let r = self.add(r, zero);
        let bits = self.bits(rounded);
        let row = self.builder.ins().band_imm_s(bits, 63);
        let [t, lack] = self.row(k::POWERS.as_ptr() as usize, row);
        let rr = self.mul(r, r);
        let c = &k::EXPONENTIAL;
        let (low, high) = (self.line(c[0], c[1], r), self.line(c[2], c[3], r));
        let high = self.mul(rr, high);
        let q = self.add(low, high);
        let q = self.mul(rr, q);
        let p = self.add(r, q);
        let tp = self.mul(t, p);
        let tail = self.add(lack, tp);
        let power = self.builder.ins().ushr_imm_s(bits, 6);
        let power = self.builder.ins().ishl_imm_s(power, 52);
        let bias = self.integer(BIAS);
        let scale = self.builder.ins().iadd(power, bias);
        let scale = self.of_bits(scale);
        let sum = self.add(t, tail);
        let value = self.mul(scale, sum);
        let (size, most) = (self.abs(x), self.number(708.0));
        let good = self.is(FloatCC::LessThanOrEqual, size, most);
        (value, good)
    }

    /// Natural logarithm, and whether it holds.
    pub fn logarithm(&mut self, x: Value) -> (Value, Value) {
        let bits = self.bits(x);
        let place = self.builder.ins().iadd_imm_s(bits, BIAS.wrapping_sub(k::BINS_START) as i64);
        let power = self.builder.ins().ushr_imm_s(place, 52);
        let integers = self.integer(0x4330_0000_0000_0000);
        let n = self.builder.ins().bor(power, integers);
        let n = self.of_bits(n);
        let (offset, zero) = (self.number(4503599627371519.0), self.number(0.0));
        let n = self.sub(n, offset);
        let n = self.sub(n, zero);
        let up = self.builder.ins().ishl_imm_s(power, 52);
        let m = self.builder.ins().isub(bits, up);
        let bias = self.integer(BIAS);
        let m = self.builder.ins().iadd(m, bias);
        let row = self.builder.ins().ushr_imm_s(place, 45);
        let row = self.builder.ins().band_imm_s(row, 127);
        let [c, log, log_rest] = self.row(k::LOGARITHMS.as_ptr() as usize, row);
        let head = self.builder.ins().band_imm_s(m, !((1i64 << 27) - 1));
        let (head, m) = (self.of_bits(head), self.of_bits(m));
        let one = self.number(1.0);
        let (near, low) = (self.mul(head, c), self.sub(m, head));
        let (near, low) = (self.sub(near, one), self.mul(low, c));
        let (r, r_rest) = self.fast_two_sum(near, low);
        let short = self.bits(r);
        let short = self.builder.ins().band_imm_s(short, !((1i64 << 27) - 1));
        let short = self.of_bits(short);
        let tail = self.sub(r, short);
        let half = self.number(0.5);
        let square = self.mul(short, short);
        let square = self.mul(half, square);
        let half_tail = self.mul(half, tail);
        let whole = self.add(short, half_tail);
        let square_rest = self.mul(tail, whole);
        let (ln2, ln2_rest) = (self.number(k::LN2_SHORT), self.number(k::LN2_REST));
        let (kl, kr) = (self.mul(n, ln2), self.mul(n, ln2_rest));
        let start = self.add(kl, log);
        let (s, lost) = self.fast_two_sum(start, r);
        let square = self.neg(square);
        let (s, more) = self.fast_two_sum(s, square);
        let rr = self.mul(r, r);
        let p = &k::LOGARITHM;
        let (low, middle) = (self.line(p[0], p[1], r), self.line(p[2], p[3], r));
        let high = self.line(p[4], p[5], r);
        let last = self.number(p[6]);
        let last = self.mul(rr, last);
        let high = self.add(high, last);
        let high = self.mul(rr, high);
        let high = self.add(middle, high);
        let cube = self.mul(r, rr);
        let high = self.mul(rr, high);
        let sum = self.add(low, high);
        let cube = self.mul(cube, sum);
        let left = self.add(kr, log_rest);
        let product = self.mul(r, r_rest);
        let right = self.sub(r_rest, product);
        let left = self.add(left, right);
        let right = self.add(lost, more);
        let rests = self.add(left, right);
        let end = self.sub(cube, square_rest);
        let rests = self.add(rests, end);
        let value = self.add(s, rests);
        let least = self.builder.ins().iadd_imm_s(bits, -(1i64 << 52));
        let good = self.builder.ins().icmp_imm_s(IntCC::UnsignedLessThan, least, 0x7fe << 52);
        (value, good)
    }

    /// A row of a table of constants.
    fn row<const N: usize>(&mut self, table: usize, row: Value) -> [Value; N] {
        let base = self.integer(table as u64);
        let offset = self.builder.ins().imul_imm_s(row, 8 * N as i64);
        let place = self.builder.ins().iadd(base, offset);
        let flags = MemFlagsData::trusted().with_readonly().with_can_move();
        std::array::from_fn(|i| self.builder.ins().load(types::F64, flags, place, 8 * i as i32))
    }
}
