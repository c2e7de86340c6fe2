//! Polynomials in sines and cosines made shorter: `sin² + cos² = 1`, sums of angles.

use super::super::exprs::Exprs;
use super::super::node::{Expr, Function, Node};
use super::super::polynomial::{Generators, Monomial, Polynomial, expand, times};
use super::super::rational::Rational;

impl Exprs {
    pub(super) fn reduce_trigonometric(
        &mut self,
        mut polynomial: Polynomial,
        generators: &mut Generators,
    ) -> Polynomial {
        loop {
            if !generators.affords(0) {
                return polynomial;
            }
            let better = self.by_pythagoras(&polynomial, generators).or_else(|| self.by_sums(&polynomial, generators));
            match better {
                Some(better) => polynomial = better.tidy(self, generators),
                None => return polynomial,
            }
        }
    }

    /// With `s² = 1 - c²` or `c² = 1 - s²` for the angle for which that leaves the fewest terms, if fewer than before.
    fn by_pythagoras(&mut self, polynomial: &Polynomial, generators: &mut Generators) -> Option<Polynomial> {
        let mut best: Option<Polynomial> = None;
        for (sine, cosine) in self.angles(generators).into_iter().map(|a| (a.1, a.2)) {
            for (from, to) in [(sine, cosine), (cosine, sine)] {
                generators.work += polynomial.0.len() as u64;
                let Some(candidate) = replace_square(polynomial, from, to) else { continue };
                let candidate = candidate.tidy(self, generators);
                if candidate.0.len() < best.as_ref().unwrap_or(polynomial).0.len() {
                    best = Some(candidate);
                }
            }
        }
        best
    }

    /// With one of `cos a cos b ± sin a sin b` and `sin a cos b ± cos a sin b` replaced.
    fn by_sums(&mut self, polynomial: &Polynomial, generators: &mut Generators) -> Option<Polynomial> {
        let angles = self.angles(generators);
        let holders = Holders::of(polynomial, generators.list.len());
        generators.work += (polynomial.0.len() + angles.len() * angles.len()) as u64;
        for (i, &(a, sin_a, cos_a)) in angles.iter().enumerate() {
            for &(b, sin_b, cos_b) in &angles[i + 1..] {
                for (first, second, f) in
                    [([cos_a, cos_b], [sin_a, sin_b], Function::Cos), ([sin_a, cos_b], [cos_a, sin_b], Function::Sin)]
                {
                    if !holders.any(first) || !holders.any(second) {
                        continue;
                    }
                    let (first, second) = (unit(first), unit(second));
                    generators.work += 2 * polynomial.0.len() as u64;
                    let Some((rest, c, same)) = pair_of_terms(polynomial, &first, &second) else { continue };
                    // cos(a - b) has the sign +, sin(a - b) the sign -.
                    let minus = same == (f == Function::Cos);
                    let angle = if minus { self.sub(a, b) } else { self.add(&[a, b]) };
                    let value = self.call(f, &[angle]);
                    let mut better = polynomial.clone();
                    better.0.remove(&times(&rest, &first));
                    better.0.remove(&times(&rest, &second));
                    let value = expand(self, value, generators)?;
                    let scaled = Polynomial([(rest, c)].into_iter().collect());
                    return Some(better.plus(scaled.times(&value)?));
                }
            }
        }
        None
    }

    /// The angles of which sine or cosine occurs, with both generators.
    fn angles(&mut self, generators: &mut Generators) -> Vec<(Expr, usize, usize)> {
        let mut angles = Vec::new();
        for e in generators.list.clone() {
            if let Node::Call(Function::Sin | Function::Cos, x) = self.node(e)
                && !angles.contains(&x[0])
            {
                angles.push(x[0]);
            }
        }
        angles
            .into_iter()
            .map(|a| {
                let (s, c) = (self.call(Function::Sin, &[a]), self.call(Function::Cos, &[a]));
                (a, generators.index_of(s), generators.index_of(c))
            })
            .collect()
    }
}

/// For each generator the terms in which it stands, as bits.
struct Holders(Vec<Vec<u64>>);

impl Holders {
    fn of(polynomial: &Polynomial, generators: usize) -> Holders {
        let mut bits = vec![vec![0; polynomial.0.len().div_ceil(64)]; generators];
        for (k, monomial) in polynomial.0.keys().enumerate() {
            for (i, _) in monomial.iter().enumerate().filter(|(_, n)| **n > 0) {
                bits[i][k / 64] |= 1 << (k % 64);
            }
        }
        Holders(bits)
    }

    /// Whether both stand in one term.
    fn any(&self, pair: [usize; 2]) -> bool {
        self.0[pair[0]].iter().zip(&self.0[pair[1]]).any(|(a, b)| a & b != 0)
    }
}

/// The monomial of two different generators.
fn unit([a, b]: [usize; 2]) -> Monomial {
    let mut monomial = vec![0; a.max(b) + 1];
    monomial[a] += 1;
    monomial[b] += 1;
    monomial
}

/// Every `from²` as `1 - to²`; `None` if there is none.
fn replace_square(polynomial: &Polynomial, from: usize, to: usize) -> Option<Polynomial> {
    let mut result = Polynomial::default();
    let mut found = false;
    for (monomial, coefficient) in &polynomial.0 {
        let power = monomial.get(from).copied().unwrap_or(0);
        if power < 2 {
            result.add_term(monomial.clone(), coefficient.clone());
            continue;
        }
        found = true;
        let mut less = vec![0; from + 1];
        less[from] = -2;
        let mut square = vec![0; to + 1];
        square[to] = 2;
        let once = times(monomial, &less);
        result.add_term(times(&once, &square), -coefficient);
        result.add_term(once, coefficient.clone());
    }
    found.then_some(result)
}

/// Two terms `c r first ± c r second`: `r`, `c`, and whether the sign is +.
fn pair_of_terms(polynomial: &Polynomial, first: &[i64], second: &[i64]) -> Option<(Monomial, Rational, bool)> {
    let minus: Monomial = first.iter().map(|n| -n).collect();
    for (monomial, c) in &polynomial.0 {
        let holds = first.iter().enumerate().all(|(i, &n)| monomial.get(i).copied().unwrap_or(0) >= n);
        if !holds || c.is_zero() {
            continue;
        }
        let rest = times(monomial, &minus);
        match polynomial.0.get(&times(&rest, second)) {
            Some(other) if other == c => return Some((rest, c.clone(), true)),
            Some(other) if *other == -c => return Some((rest, c.clone(), false)),
            _ => {}
        }
    }
    None
}
