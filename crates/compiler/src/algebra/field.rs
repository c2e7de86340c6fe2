//! The prime field of 2^61 - 1 elements, and the circle `c² + s² = 1` in it.

/// The prime.
pub(super) const P: u64 = (1 << 61) - 1;

pub(super) fn add(a: u64, b: u64) -> u64 {
    let sum = a + b;
    if sum >= P { sum - P } else { sum }
}

pub(super) fn neg(a: u64) -> u64 {
    if a == 0 { 0 } else { P - a }
}

pub(super) fn sub(a: u64, b: u64) -> u64 {
    add(a, neg(b))
}

pub(super) fn mul(a: u64, b: u64) -> u64 {
    let wide = u128::from(a) * u128::from(b);
    add((wide as u64) & P, (wide >> 61) as u64)
}

/// `a^n` for `n` of any size.
pub(super) fn pow(mut a: u64, mut n: u64) -> u64 {
    let mut result = 1;
    while n > 0 {
        if n & 1 == 1 {
            result = mul(result, a);
        }
        a = mul(a, a);
        n >>= 1;
    }
    result
}

/// `1/a`; `None` for 0.
pub(super) fn inverse(a: u64) -> Option<u64> {
    match a {
        0 => None,
        1 => Some(1),
        _ => Some(pow(a, P - 2)),
    }
}

/// The square root that is a square itself, if `a` is a square.
pub(super) fn square_root(a: u64) -> Option<u64> {
    let root = pow(a, 1 << 59);
    (mul(root, root) == a).then_some(root)
}

/// The order of the group of squares that are also cubes, fifth and seventh powers: in it roots of the orders
/// 2, 3, 5 and 7, and their products, exist and are unique.
const ROOTED: u64 = (P - 1) / (2 * 9 * 25 * 7);
/// Any element to this power lies in that group.
pub(super) const INTO_ROOTED: u64 = 2 * 9 * 25 * 7;

/// The root of that order in the group in which it is unique, if `a` lies in it.
pub(super) fn root(a: u64, order: u64) -> Option<u64> {
    if pow(a, ROOTED) != 1 {
        return None;
    }
    inverse_modulo(order % ROOTED, ROOTED).map(|n| pow(a, n))
}

/// `1/a` modulo `m`, if they have no common factor.
pub(super) fn inverse_modulo(a: u64, m: u64) -> Option<u64> {
    let (mut r, mut next) = (i128::from(m), i128::from(a));
    let (mut t, mut t_next) = (0i128, 1i128);
    while next != 0 {
        let q = r / next;
        (r, next) = (next, r - q * next);
        (t, t_next) = (t_next, t - q * t_next);
    }
    (r == 1).then(|| t.rem_euclid(i128::from(m)) as u64)
}

/// A point of the circle: cosine and sine of an angle. The circle is a cyclic group of order 2^61.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Point {
    pub cos: u64,
    pub sin: u64,
}

impl Point {
    pub const START: Point = Point { cos: 1, sin: 0 };

    /// From the tangent of the half angle. (-1 is no square in this field, so the denominator is never 0.)
    pub fn of_half_angle(t: u64) -> Point {
        let square = mul(t, t);
        let scale = inverse(add(1, square)).unwrap_or(0);
        Point { cos: mul(sub(1, square), scale), sin: mul(add(t, t), scale) }
    }

    /// The sum of the angles.
    pub fn plus(self, other: Point) -> Point {
        Point {
            cos: sub(mul(self.cos, other.cos), mul(self.sin, other.sin)),
            sin: add(mul(self.cos, other.sin), mul(self.sin, other.cos)),
        }
    }

    /// `n` times the angle.
    pub fn times(mut self, mut n: u64) -> Point {
        let mut result = Point::START;
        while n > 0 {
            if n & 1 == 1 {
                result = result.plus(self);
            }
            self = self.plus(self);
            n >>= 1;
        }
        result
    }

    /// The angle pi/2^j, `j` up to 8.
    pub fn half_turn_over(j: u32) -> Point {
        let mut seed = 2;
        loop {
            let point = Point::of_half_angle(seed);
            if point.times(1 << 60) != Point::START {
                // A generator: of its multiples the one of order 4 is a quarter turn, forwards or backwards.
                let mut step = point.times(1 << (60 - j));
                if point.times(1 << 59) != (Point { cos: 0, sin: 1 }) {
                    step.sin = neg(step.sin);
                }
                return step;
            }
            seed += 1;
        }
    }
}
