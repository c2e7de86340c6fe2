//! The form a textbook would print.

use super::exprs::Exprs;
use super::node::{Expr, Function, Node};
use super::polynomial::{Generators, Monomial, Polynomial, expand, monomial_expr, times};
use super::rational::Rational;
use super::short_forms::Way;
use rustc_hash::FxHashMap;
use smallvec::smallvec;

/// Expressions that are written longer than this are left as they are; their parts are not.
const LONGEST: u64 = 600;

impl Exprs {
    /// The shortest of the forms in which the expression can be written: multiplied out, common factors taken out,
    /// over one denominator, with `sin² + cos² = 1` and the sums of angles used. The value and where it has one never
    /// change: `q/q` stays unless `q` is known to be nonzero.
    pub fn simplify(&mut self, e: Expr) -> Expr {
        self.simplify_all(&[e])[0]
    }

    /// The expressions, each in its shortest form; what they share is looked at once.
    pub fn simplify_all(&mut self, roots: &[Expr]) -> Vec<Expr> {
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        let order = self.below(roots, &|_| true);
        self.spend(order.len() as u64);
        for part in order {
            let rebuilt = self.rebuild(part, &|c| new[&c]);
            let short = self.shortest_form(rebuilt);
            new.insert(part, short);
        }
        roots.iter().map(|r| new[r]).collect()
    }

    /// The expression multiplied out; itself if that takes too many terms.
    pub fn expand(&mut self, e: Expr) -> Expr {
        let mut generators = Generators::default();
        match expand(self, e, &mut generators) {
            Some(polynomial) => polynomial.tidy(self, &generators).to_expr(self, &generators),
            None => e,
        }
    }

    /// How long the expression is written: symbols, numbers, operators and functions, shared parts each time.
    pub fn written_length(&self, e: Expr) -> u64 {
        let mut lengths: FxHashMap<Expr, u64> = FxHashMap::default();
        for part in self.below(&[e], &|_| true) {
            let mut length: u64 = match self.node(part) {
                Node::Number(value) if value.is_one() || value == &Rational::from(-1) => 1,
                Node::Number(_) | Node::Pi | Node::Symbol(_) => 2,
                Node::Add(terms) => terms.len() as u64,
                Node::Mul(factors) => factors.len() as u64 - 1,
                // A fraction within a fraction reads badly.
                Node::Pow(base, n) if *n == super::MINUS_ONE => 2 + 4 * u64::from(self.holds_fraction(*base)),
                // An exponent is short however it is written, and a square is shorter than a product.
                Node::Pow(_, n) if self.is_number(*n).is_some_and(|n| n.is_integer()) => 0,
                Node::Pow(..) => 1,
                _ => 2,
            };
            self.node(part).for_each_child(|c| length = length.saturating_add(lengths[&c]));
            lengths.insert(part, length);
        }
        lengths[&e]
    }

    /// Whether a term of the sum has a denominator.
    fn holds_fraction(&self, sum: Expr) -> bool {
        let divides =
            |e: &Expr| matches!(self.node(*e), Node::Pow(_, n) if self.is_number(*n).is_some_and(|n| n.signum() < 0));
        let Node::Add(terms) = self.node(sum) else { return false };
        terms.iter().any(|t| match self.node(*t) {
            Node::Mul(factors) => factors.iter().any(divides),
            _ => divides(t),
        })
    }

    fn shortest_form(&mut self, e: Expr) -> Expr {
        if !self.has_other_forms(e) || u64::from(self.entry(e).size) > LONGEST || self.written_length(e) > LONGEST {
            return e;
        }
        self.short_form(e, Way::Factored, |x| x.shortest_of_forms(e))
    }

    /// The shortest form, and how many terms were formed on the way.
    fn shortest_of_forms(&mut self, e: Expr) -> (Expr, u64) {
        let mut best = (self.written_length(e), e);
        let mut forms = Vec::new();
        let mut work = u64::from(self.entry(e).size);
        self.expanded_forms(e, &mut forms, &mut work);
        forms.extend(self.over_one_denominator(e, &mut work));
        forms.extend(self.turned_fraction(e, &mut work));
        for form in forms {
            let length = self.written_length(form);
            if length < best.0 {
                best = (length, form);
            }
        }
        (best.1, work)
    }

    /// Whether there is anything to multiply out, take out or bring over one denominator.
    fn has_other_forms(&self, e: Expr) -> bool {
        let is_sum = |e: Expr| match *self.node(e) {
            Node::Add(_) => true,
            Node::Pow(base, _) => matches!(self.node(base), Node::Add(_)),
            _ => false,
        };
        match self.node(e) {
            Node::Add(terms) => terms.iter().any(|&t| {
                let monomial = self.entry(t).monomial;
                matches!(self.node(monomial), Node::Mul(_) | Node::Pow(..))
            }),
            Node::Mul(factors) => factors.iter().any(|&f| is_sum(f)),
            _ => is_sum(e),
        }
    }

    /// Multiplied out, and with common factors taken out of that.
    fn expanded_forms(&mut self, e: Expr, forms: &mut Vec<Expr>, work: &mut u64) {
        let mut generators = Generators::within(self.search_left());
        if let Some(polynomial) = expand(self, e, &mut generators) {
            let polynomial = polynomial.tidy(self, &generators);
            let polynomial = self.reduce_trigonometric(polynomial, &mut generators);
            forms.push(polynomial.to_expr(self, &generators));
            forms.push(self.factored(&polynomial, &generators));
            forms.extend(self.grouped(&polynomial, &mut generators));
        }
        *work += generators.work;
    }

    /// Common factors in front of the sum.
    fn factored(&mut self, polynomial: &Polynomial, generators: &Generators) -> Expr {
        let content = polynomial.content();
        let inner = polynomial.divided_by_monomial(&content).to_expr(self, generators);
        let outer = monomial_expr(self, generators, &content, &Rational::from(1));
        self.mul(&[outer, inner])
    }

    /// The sum split by whether a generator stands in the term, and common factors taken out of both halves: for the
    /// generator for which that is shortest.
    fn grouped(&mut self, polynomial: &Polynomial, generators: &mut Generators) -> Option<Expr> {
        if polynomial.0.len() < 3 || polynomial.0.len() > 24 {
            return None;
        }
        let mut best: Option<(u64, Expr)> = None;
        for i in 0..generators.list.len() {
            generators.work += 4 * polynomial.0.len() as u64;
            let holds = |m: &Monomial| m.get(i).is_some_and(|&n| n != 0);
            let (with, without): (Vec<_>, Vec<_>) = polynomial.0.clone().into_iter().partition(|(m, _)| holds(m));
            if with.len() < 2 || without.is_empty() {
                continue;
            }
            let halves = [with, without].map(|half| Polynomial(half.into_iter().collect()));
            let parts = [self.factored(&halves[0], generators), self.factored(&halves[1], generators)];
            let sum = self.add(&parts);
            let length = self.written_length(sum);
            if best.is_none_or(|b| length < b.0) {
                best = Some((length, sum));
            }
        }
        best.map(|b| b.1)
    }

    /// All terms over one denominator, cancelled where the divisor is known to be nonzero.
    fn over_one_denominator(&mut self, e: Expr, work: &mut u64) -> Option<Expr> {
        let (above, below) = self.fraction(e, work)?;
        let below: Vec<Expr> = below.into_iter().map(|(b, n)| self.powi(b, n)).collect();
        let below = self.mul(&below);
        Some(self.div(above, below))
    }

    /// `1/(a/b + c)` as `b/(a + b c)`, where `b` is nonzero.
    fn turned_fraction(&mut self, e: Expr, work: &mut u64) -> Option<Expr> {
        let factors = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let mut changed = false;
        let mut parts = Vec::new();
        for factor in factors {
            let turned = match *self.node(factor) {
                Node::Pow(base, n) if matches!(self.node(base), Node::Add(_)) => self.turned_power(base, n, work),
                _ => None,
            };
            changed |= turned.is_some();
            parts.push(turned.unwrap_or(factor));
        }
        changed.then(|| {
            let product = self.mul(&parts);
            self.over_one_denominator(product, work).unwrap_or(product)
        })
    }

    fn turned_power(&mut self, base: Expr, n: Expr, work: &mut u64) -> Option<Expr> {
        let n = self.is_number(n)?.as_integer().filter(|&n| n < 0)?;
        let (above, below) = self.fraction(base, work)?;
        if !below.iter().all(|&(b, _)| self.nonzero(b)) {
            return None;
        }
        let below: Vec<Expr> = below.into_iter().map(|(b, power)| self.powi(b, power)).collect();
        let below = self.mul(&below);
        let (above, below) = (self.powi(above, n), self.powi(below, -n));
        Some(self.mul(&[above, below]))
    }

    /// A sum or product as a polynomial above and powers below.
    fn fraction(&mut self, e: Expr, work: &mut u64) -> Option<(Expr, Vec<(Expr, i64)>)> {
        let mut generators = Generators::within(self.search_left());
        let fraction = self.fraction_in(e, &mut generators);
        *work += generators.work;
        fraction
    }

    fn fraction_in(&mut self, e: Expr, generators: &mut Generators) -> Option<(Expr, Vec<(Expr, i64)>)> {
        let terms = match self.node(e) {
            Node::Add(terms) => terms.clone(),
            _ => smallvec![e],
        };
        let split: Vec<(Expr, Vec<(Expr, i64)>)> = terms.iter().map(|&t| self.split_fraction(t)).collect();
        let mut below: Vec<(Expr, i64)> = Vec::new();
        for &(base, n) in split.iter().flat_map(|s| &s.1) {
            match below.iter_mut().find(|b| b.0 == base) {
                Some(known) => known.1 = known.1.max(n),
                None => below.push((base, n)),
            }
        }
        if below.is_empty() {
            return None;
        }
        let mut above = Polynomial::default();
        for (numerator, own) in &split {
            let mut product = expand(self, *numerator, generators)?;
            for &(base, n) in &below {
                let has = own.iter().find(|b| b.0 == base).map_or(0, |b| b.1);
                let power = self.powi(base, n - has);
                let power = expand(self, power, generators)?;
                product = generators.product(&product, &power)?;
            }
            above = above.plus(&product);
        }
        let mut above = above.tidy(self, generators);
        above = self.reduce_trigonometric(above, generators);
        for (base, n) in &mut below {
            above = self.cancel(above, *base, n, generators);
        }
        below.retain(|b| b.1 > 0);
        Some((self.factored(&above, generators), below))
    }

    fn cancel(&self, mut above: Polynomial, base: Expr, n: &mut i64, generators: &mut Generators) -> Polynomial {
        if !self.nonzero(base) {
            return above;
        }
        let Some(divisor) = expand(self, base, generators) else { return above };
        let whole = |p: &Polynomial| p.0.keys().flatten().all(|&n| n >= 0);
        while *n > 0 && whole(&above) && whole(&divisor) {
            generators.work += (above.0.len() * divisor.0.len()) as u64;
            let Some(quotient) = above.divided_by(&divisor) else { break };
            above = quotient;
            *n -= 1;
        }
        above
    }

    /// A product as what stands above and below the bar.
    fn split_fraction(&mut self, e: Expr) -> (Expr, Vec<(Expr, i64)>) {
        let factors = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let (mut above, mut below) = (Vec::new(), Vec::new());
        for factor in factors {
            match *self.node(factor) {
                Node::Pow(base, n) => match self.is_number(n).and_then(|n| n.as_integer()) {
                    Some(n) if n < 0 => below.push((base, -n)),
                    _ => above.push(factor),
                },
                _ => above.push(factor),
            }
        }
        (self.mul(&above), below)
    }

    fn reduce_trigonometric(&mut self, mut polynomial: Polynomial, generators: &mut Generators) -> Polynomial {
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
                    return Some(better.plus(&scaled.times(&value)?));
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
