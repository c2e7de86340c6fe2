//! Values recognised by what they are at a few points.
//!
//! A machine of rigid bodies multiplies orientations, and what comes about is full of values that are equal without a rule that
//! leads from one to the other: `Rᵀ R` is 1, whatever way it is written, a mass is the same along all axes, a sum of products
//! cancels. At a point where every given has a value of its own such values are equal, and others are not.
//!
//! Two things would deceive. A function may hardly move at a point, as `tanh(1000 a)` does not, and it may lie on one side of a
//! corner: what it gives counts as a given, but for sine and cosine, which lie on their circle at an angle of their own. And a
//! term may be small beside others though it counts where these are small, as `1e-3 b` in `1e15 a + 1e-3 b`: a sum is
//! recognised only where the least of its terms would be seen.

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::Value;
use super::op::Op;
use super::values::Reads;
use crate::algebra::{Function, math, mix};
use crate::ids::Id;

/// Points at which givens have values of their own.
const POINTS: usize = 3;
/// The same with one more: there guesses of Newton blocks are others than at the first, and nothing else is given otherwise.
const ALL: usize = POINTS + 1;
/// Values are equal that differ by no more than this part of the magnitudes that they add up, and of them,
const ROUNDING: f64 = 1e-13;
const CLOSE: f64 = 1e-12;
/// if none of their terms is smaller than this part of them.
const SEEN: f64 = 1e-10;
/// Values of which more is lost by terms that cancel have no digits to be recognised by.
const CANCELLED: f64 = 1e6;
/// Bits of a value that are not looked up: more than rounding takes.
const NOT_LOOKED_UP: u32 = 24;
/// A constant has its digits from what it is computed of; one that is this near to a binary fraction is meant to be it.
const FRACTION: f64 = 1_048_576.0;

/// What a value is at the points.
#[derive(Debug, Clone, Copy)]
struct Sample {
    at: [f64; ALL],
    /// The magnitudes that it adds up, at the first points.
    size: [f64; POINTS],
    /// How much of it the least of its terms is, terms of terms included, at the first points.
    seen: [f64; POINTS],
    /// Whether its last operation is a sum, in which terms may cancel.
    sum: bool,
}

/// What a new value turned out to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Recognised {
    /// A number.
    Number(f64),
    /// One that is known.
    Known(Value),
    /// The opposite of one that is known.
    Opposite(Value),
}

/// The values of a program so far, as they are at the points.
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    of: Vec<Sample>,
    /// Values by what they are at the first point.
    known: FxHashMap<u64, SmallVec<[Value; 1]>>,
}

impl Sample {
    /// One of which nothing is known but its number, and whether guesses move it.
    fn given(number: usize, guessed: bool) -> Sample {
        Sample::of(own(number, guessed))
    }

    fn of(at: [f64; ALL]) -> Sample {
        Sample { at, size: std::array::from_fn(|point| at[point].abs()), seen: [1.0; POINTS], sum: false }
    }

    fn sum(a: &Sample, b: &Sample, sign: f64) -> Sample {
        let seen = |p: usize| match (a.at[p].abs(), b.at[p].abs()) {
            (0.0, _) => b.seen[p],
            (_, 0.0) => a.seen[p],
            (size_a, size_b) => (a.seen[p] * size_a).min(b.seen[p] * size_b) / size_a.max(size_b),
        };
        Sample {
            at: std::array::from_fn(|p| a.at[p] + sign * b.at[p]),
            size: std::array::from_fn(|p| a.size[p] + b.size[p]),
            seen: std::array::from_fn(seen),
            sum: true,
        }
    }

    fn product(a: &Sample, b: &Sample) -> Sample {
        Sample {
            at: std::array::from_fn(|p| a.at[p] * b.at[p]),
            size: std::array::from_fn(|p| a.size[p] * b.size[p]),
            seen: std::array::from_fn(|p| a.seen[p].min(b.seen[p])),
            sum: false,
        }
    }

    fn reciprocal(&self) -> Sample {
        let size = |p: usize| self.size[p] / self.at[p] / self.at[p];
        Sample { at: self.at.map(|value| 1.0 / value), size: std::array::from_fn(size), seen: self.seen, sum: false }
    }

    fn power(&self, n: u32) -> Sample {
        let power = |of: f64| math::powi(of, n);
        Sample { at: self.at.map(power), size: self.size.map(power), seen: self.seen, sum: false }
    }

    /// Whether all its terms are seen in it, at one point at least.
    fn tells(&self) -> bool {
        let numbers = self.size.iter().all(|size| size.is_normal()) && self.at.iter().all(|v| v.is_finite());
        numbers && self.seen.iter().any(|&seen| seen >= SEEN)
    }

    fn has_digits(&self) -> bool {
        (0..POINTS).all(|p| self.size[p] <= CANCELLED * self.at[p].abs())
    }

    /// The number that it is at all points.
    fn constant(&self) -> Option<f64> {
        let first = self.at[0];
        let same = |p: usize| (self.at[p] - first).abs() <= (ROUNDING * self.size[p % POINTS]).min(CLOSE * first.abs());
        (0..ALL).all(same).then(|| {
            let fraction = (first * FRACTION).round() / FRACTION;
            if (fraction - first).abs() <= ROUNDING * first.abs() { fraction } else { first }
        })
    }

    /// Whether it vanishes, be it that its terms cancel. `terms`: what it adds.
    fn vanishes(&self, terms: [&Sample; 2]) -> bool {
        (0..POINTS).all(|p| {
            let [a, b] = terms.map(|term| term.at[p].abs());
            self.at[p].abs() <= (ROUNDING * self.size[p]).min(CLOSE * (a + b))
        })
    }

    /// Whether the guesses of a Newton block move it.
    fn is_guessed(&self) -> bool {
        (self.at[ALL - 1] - self.at[0]).abs() > ROUNDING * self.size[0]
    }

    fn is(&self, other: &Sample, sign: f64) -> bool {
        let same = |p: usize| {
            let size = self.size[p % POINTS] + other.size[p % POINTS];
            (self.at[p] - sign * other.at[p]).abs() <= (ROUNDING * size).min(CLOSE * self.at[p].abs())
        };
        (0..ALL).all(same)
    }
}

impl Samples {
    /// What the next value is, if it is recognised, the values before it having been added. `reads`: on what it depends;
    /// `reads_of`: on what others do.
    pub fn recognise(&self, op: Op, reads: Reads, reads_of: impl Fn(Value) -> Reads) -> Option<Recognised> {
        if is_given(op) || matches!(op, Op::Neg(_)) {
            return None;
        }
        if let Some(simple) = self.without_zeros(op) {
            return Some(simple);
        }
        let sample = self.sample(op);
        if !sample.tells() {
            return None;
        }
        if let Op::Add(a, b) | Op::Sub(a, b) = op
            && sample.vanishes([a, b].map(|term| &self.of[term.index()]))
        {
            return Some(Recognised::Number(0.0));
        }
        if !sample.has_digits() {
            return None;
        }
        if let Some(number) = sample.constant() {
            return Some(Recognised::Number(number));
        }
        let near = looked_up(&sample);
        let near = [near, near.wrapping_sub(1), near + 1];
        near.iter().filter_map(|key| self.known.get(key)).flatten().find_map(|&value| {
            let known = &self.of[value.index()];
            let theirs = reads_of(value);
            // What depends on less serves: it may be computed before a run, and outside of a Newton block.
            let serves = reads.with(theirs) == reads && (!theirs.includes(Reads::GUESS) || known.is_guessed());
            // A product has all digits where those of a sum may cancel.
            match () {
                () if !serves || known.sum && !sample.sum => None,
                () if sample.is(known, 1.0) => Some(Recognised::Known(value)),
                () if sample.is(known, -1.0) => Some(Recognised::Opposite(value)),
                () => None,
            }
        })
    }

    /// What an operation is that reads a 0.
    fn without_zeros(&self, op: Op) -> Option<Recognised> {
        let zero = |value: Value| self.of[value.index()].at == [0.0; ALL];
        match op {
            Op::Add(a, b) if zero(a) => Some(Recognised::Known(b)),
            Op::Add(a, b) | Op::Sub(a, b) if zero(b) => Some(Recognised::Known(a)),
            Op::Sub(a, b) if zero(a) => Some(Recognised::Opposite(b)),
            Op::Mul(a, b) if zero(a) || zero(b) => Some(Recognised::Number(0.0)),
            Op::Div(a, _) if zero(a) => Some(Recognised::Number(0.0)),
            _ => None,
        }
    }

    /// Adds the next value.
    pub fn add(&mut self, op: Op) {
        let sample = self.sample(op);
        let value = Value::new(self.of.len());
        self.of.push(sample);
        if sample.tells() && sample.has_digits() && !matches!(op, Op::Neg(_)) {
            self.known.entry(looked_up(&sample)).or_default().push(value);
        }
    }

    fn sample(&self, op: Op) -> Sample {
        let of = |value: Value| &self.of[value.index()];
        match op {
            Op::Constant(bits) => Sample::of([bits.number(); ALL]),
            Op::Neg(a) => Sample::product(&Sample::of([-1.0; ALL]), of(a)),
            Op::Add(a, b) => Sample::sum(of(a), of(b), 1.0),
            Op::Sub(a, b) => Sample::sum(of(a), of(b), -1.0),
            Op::Mul(a, b) => Sample::product(of(a), of(b)),
            Op::Div(a, b) => Sample::product(of(a), &of(b).reciprocal()),
            Op::Powi(n, a) => of(a).power(n),
            Op::Call(Function::Sin, a) => Sample::of(own(a.index(), of(a).is_guessed()).map(math::sin)),
            Op::Call(Function::Cos, a) => Sample::of(own(a.index(), of(a).is_guessed()).map(math::cos)),
            _ => {
                let mut guessed = matches!(op, Op::Guess(..));
                op.for_each_operand(|value| guessed |= of(value).is_guessed());
                Sample::given(self.of.len(), guessed)
            }
        }
    }
}

/// Whether nothing is known of its value.
fn is_given(op: Op) -> bool {
    !matches!(op, Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::Div(..) | Op::Powi(..) | Op::Neg(_))
}

fn looked_up(sample: &Sample) -> u64 {
    sample.at[0].abs().to_bits() >> NOT_LOOKED_UP
}

/// The values that a given of this number has for itself, others at the last point if guesses move it.
fn own(number: usize, guessed: bool) -> [f64; ALL] {
    std::array::from_fn(|point| mixed(if point == POINTS && !guessed { 0 } else { point }, number))
}

/// A number between 1 and 2 or between -2 and -1 that no other given has at this point, nor do sums or products of others.
fn mixed(point: usize, number: usize) -> f64 {
    let bits = mix(0x5a3d + point as u64, number as u64);
    let size = f64::from_bits(1.0f64.to_bits() | bits >> 12);
    if bits & 1 == 0 { size } else { -size }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::op::Bits;
    use crate::program::{BlockId, Values};

    struct Made(Values);

    impl Made {
        fn op(&mut self, op: Op) -> Value {
            self.0.add(op, Reads::PARAMETERS)
        }
        fn state(&mut self, index: u32) -> Value {
            self.0.add(Op::State(index), Reads::STATE)
        }
        fn number(&mut self, number: f64) -> Value {
            self.op(Op::Constant(Bits::of(number)))
        }
        fn sum(&mut self, terms: &[Value]) -> Value {
            terms.iter().copied().reduce(|a, b| self.op(Op::Add(a, b))).expect("a term")
        }
        fn product(&mut self, factors: &[Value]) -> Value {
            factors.iter().copied().reduce(|a, b| self.op(Op::Mul(a, b))).expect("a factor")
        }
        /// `1 + sin U + (1 - cos) U²`, row by row.
        fn turned(&mut self, axis: [f64; 3], angle: Value) -> [[Value; 3]; 3] {
            let (sine, cosine) = (self.op(Op::Call(Function::Sin, angle)), self.op(Op::Call(Function::Cos, angle)));
            let one = self.number(1.0);
            let versine = self.op(Op::Sub(one, cosine));
            let [x, y, z] = axis;
            let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let square: f64 = (0..3).map(|k| skew[i][k] * skew[k][j]).sum();
                    let terms = [(f64::from(u8::from(i == j)), one), (skew[i][j], sine), (square, versine)];
                    let terms = terms.map(|(number, of)| {
                        let number = self.number(number);
                        self.op(Op::Mul(number, of))
                    });
                    self.sum(&terms)
                })
            })
        }
    }

    /// An axis that is rounded, and two turns one after the other: a mass is the same along all axes, and does not couple them.
    #[test]
    fn masses_are_the_same_along_all_axes() {
        let mut made = Made(Values::default());
        let [mass, first, second] = [0, 1, 2].map(|k| if k == 0 { made.op(Op::Parameter(0)) } else { made.state(k) });
        let length = (0.1f64 * 0.1 + 0.7 * 0.7 + 1.3 * 1.3).sqrt();
        let outer = made.turned([0.1 / length, 0.7 / length, 1.3 / length], first);
        let inner = made.turned([0.0, 0.6, 0.8], second);
        let turned: [[Value; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let terms = [0, 1, 2].map(|k| made.product(&[outer[i][k], inner[k][j]]));
                made.sum(&terms)
            })
        });
        let zero = made.number(0.0);
        for i in 0..3 {
            for j in 0..3 {
                let terms = [0, 1, 2].map(|k| made.product(&[mass, turned[k][i], turned[k][j]]));
                assert_eq!(made.sum(&terms), if i == j { mass } else { zero }, "{i} {j}");
            }
        }
    }

    /// A product written otherwise is the same value, or its opposite.
    #[test]
    fn values_are_recognised() {
        let mut made = Made(Values::default());
        let [a, b, c] = [0, 1, 2].map(|k| made.state(k));
        let inside = made.op(Op::Sub(b, c));
        let whole = made.product(&[a, inside]);
        let parts = [made.product(&[a, b]), made.product(&[a, c])];
        assert_ne!(parts[0], parts[1]);
        let difference = made.op(Op::Sub(parts[0], parts[1]));
        assert_eq!(difference, whole);
        let other = made.op(Op::Sub(parts[1], parts[0]));
        assert_eq!(made.0.op(other), Op::Neg(whole));
        // A product has digits that a sum may lose.
        let [d, e] = [3, 4].map(|k| made.state(k));
        let parts = [made.product(&[a, d]), made.product(&[a, e])];
        let sum = made.sum(&parts);
        let inside = made.op(Op::Add(d, e));
        assert_ne!(made.product(&[a, inside]), sum);
    }

    /// What hardly moves, lies on one side of a corner or is small beside others is not taken for something else.
    #[test]
    fn points_do_not_deceive() {
        let mut made = Made(Values::default());
        let [a, b] = [0, 1].map(|k| made.state(k));
        let one = made.number(1.0);
        let square = made.product(&[a, a]);
        let great = made.number(1e15);
        let little = made.number(1e-3);
        let steep = made.product(&[great, square]);
        let saturated = made.op(Op::Call(Function::Tanh, steep));
        assert_ne!(made.product(&[saturated, b]), b);
        assert_ne!(made.op(Op::Mul(saturated, saturated)), one);
        let length = made.op(Op::Call(Function::Sqrt, square));
        assert_ne!(made.op(Op::Mul(length, b)), made.op(Op::Mul(a, b)));
        // 1e15 a² + 1e-3 b - 1e15 a² is no 0, nor is the sum what it is without b.
        let small = made.product(&[little, b]);
        let sum = made.op(Op::Add(steep, small));
        assert_ne!(sum, steep);
        let left = made.op(Op::Sub(sum, steep));
        assert!(made.0.constant(left).is_none());
    }

    /// Nor is a high power of a difference that is small at the points, whatever it is elsewhere.
    #[test]
    fn high_powers_are_terms() {
        for k in 0..200 {
            let mut made = Made(Values::default());
            let states: Vec<Value> = (0..=k).map(|k| made.state(k)).collect();
            let [a, b] = [states[k as usize], made.state(k + 1)];
            let difference = made.op(Op::Sub(a, b));
            let mut power = made.product(&[difference; 3]);
            power = made.product(&[power; 3]);
            let sum = made.op(Op::Add(b, power));
            assert!(sum != b && sum != a && made.0.constant(sum).is_none(), "{k}");
        }
    }

    /// What a guess does not move is no value of its block.
    #[test]
    fn guesses_stay_in_their_blocks() {
        let mut made = Made(Values::default());
        let guess = made.0.add(Op::Guess(BlockId(0), 0), Reads::GUESS);
        let [a, b] = [0, 1].map(|k| made.state(k));
        let (with, by) = (made.product(&[guess, a]), made.product(&[a, b]));
        let more = made.op(Op::Add(with, by));
        let back = made.op(Op::Sub(more, with));
        assert_eq!(back, by);
        let [sine, cosine] = [Function::Sin, Function::Cos].map(|f| made.op(Op::Call(f, guess)));
        let squares = [made.product(&[sine, sine]), made.product(&[cosine, cosine])];
        let sum = made.sum(&squares);
        assert_eq!(made.0.constant(sum), Some(1.0));
        let own = made.product(&[guess, guess, a]);
        let again = made.product(&[guess, with]);
        assert_eq!(own, again);
    }
}
