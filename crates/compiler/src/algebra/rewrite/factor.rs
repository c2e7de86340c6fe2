//! Polynomials as products of sums and a rest: weak division, by what makes the text shortest.

use super::super::polynomial::{Monomial, Polynomial, quotient_of, times};
use super::super::rational::Rational;
use std::collections::BTreeMap;

/// Sums of more terms are left as they are.
const MOST_TERMS: usize = 40;

/// `factors.0 · factors.1 + rest`.
#[derive(Debug, Clone)]
pub(super) struct Split {
    pub factors: (Polynomial, Polynomial),
    pub rest: Polynomial,
}

/// The split that saves most, if any saves. `lengths`: of each generator in print; `varies`: whether it is no parameter:
/// among equals those are taken out.
pub(super) fn best_split(polynomial: &Polynomial, lengths: &[u64], varies: &[bool]) -> Option<Split> {
    let count = polynomial.0.len();
    if !(2..=MOST_TERMS).contains(&count) || polynomial.has_zeros() {
        return None;
    }
    let whole = length(polynomial, lengths);
    let mut best: Option<((u64, bool), Split)> = None;
    let squares = squares(polynomial).into_iter();
    let quotients = divisors(polynomial).into_iter().filter_map(|d| divided(polynomial, d));
    for split in squares.chain(quotients) {
        let (q, d) = &split.factors;
        let brackets = u64::from(q.0.len() > 1) + u64::from(d.0.len() > 1);
        let own = if q == d { length(d, lengths) } else { length(q, lengths) + length(d, lengths) + 1 };
        let rest = if split.rest.0.is_empty() { 0 } else { 1 + length(&split.rest, lengths) };
        let saved = whole.saturating_sub(own + brackets + rest);
        // A product of parameters and a rest: `a b + a c + b c` had better stay.
        let all = |p: &Polynomial| p.0.keys().flat_map(|m| m.iter().zip(varies)).all(|(&n, &v)| n == 0 || !v);
        let saved = if all(polynomial) && !split.rest.0.is_empty() && q != d { saved.saturating_sub(2) } else { saved };
        let moves = |p: &Polynomial| p.0.keys().flat_map(|m| m.iter().zip(varies)).any(|(&n, &v)| n != 0 && v);
        let key = (saved, moves(q) != moves(d));
        if saved > 0 && best.as_ref().is_none_or(|b| key > b.0) {
            best = Some((key, split));
        }
    }
    best.map(|b| b.1)
}

/// How many terms the search for a split looks at, about.
pub(super) fn work_of_split(polynomial: &Polynomial) -> u64 {
    let count = polynomial.0.len() as u64;
    if count > MOST_TERMS as u64 { count } else { count * count * count }
}

/// The polynomial as a sum of products: of parameters alone, and of what varies. Equal factors of parameters are one.
pub(super) fn collected(polynomial: &Polynomial, varies: &[bool]) -> Vec<(Polynomial, Polynomial)> {
    let mut by_variable: BTreeMap<Monomial, Polynomial> = BTreeMap::new();
    for (monomial, c) in &polynomial.0 {
        let part = |of: bool| {
            let kept: Monomial = monomial.iter().zip(varies).map(|(&n, &v)| if v == of { n } else { 0 }).collect();
            times(&kept, &[])
        };
        by_variable.entry(part(true)).or_default().add_term(part(false), c.clone());
    }
    let mut products: Vec<(Polynomial, Polynomial)> = Vec::new();
    for (variable, factor) in by_variable {
        let Some(lead) = factor.0.values().next().cloned() else { continue };
        let Some(inverse) = lead.recip() else { continue };
        let unit = Polynomial(factor.0.into_iter().map(|(m, c)| (m, &c * &inverse)).collect());
        match products.iter_mut().find(|p| p.0 == unit) {
            Some(product) => product.1.add_term(variable, lead),
            None => products.push((unit, Polynomial(BTreeMap::from([(variable, lead)])))),
        }
    }
    products
}

/// How long a polynomial is in print, brackets around it left out.
fn length(polynomial: &Polynomial, lengths: &[u64]) -> u64 {
    let term = |(m, c): (&Monomial, &Rational)| {
        let factors = m.iter().filter(|&&n| n != 0).count() as u64;
        let number = u64::from(!c.abs().is_one() || factors == 0);
        let own: u64 = m.iter().zip(lengths).filter(|(n, _)| **n != 0).map(|(_, &l)| l).sum();
        own + 2 * number + (factors + number).saturating_sub(1)
    };
    polynomial.0.iter().map(term).sum::<u64>() + (polynomial.0.len() as u64).saturating_sub(1)
}

/// What may be taken out: single generators, sums of two terms.
fn divisors(polynomial: &Polynomial) -> Vec<Polynomial> {
    let terms: Vec<(&Monomial, &Rational)> = polynomial.0.iter().collect();
    let mut found: Vec<Polynomial> = Vec::new();
    let mut note = |divisor: Polynomial| {
        if !found.contains(&divisor) {
            found.push(divisor);
        }
    };
    let width = terms.iter().map(|t| t.0.len()).max().unwrap_or(0);
    for i in 0..width {
        if terms.iter().filter(|t| t.0.get(i).is_some_and(|&n| n > 0)).count() > 1 {
            note(Polynomial::generator(i, 1));
        }
    }
    for (k, &(a, p)) in terms.iter().enumerate() {
        for &(b, q) in &terms[k + 1..] {
            two_terms(a, p, b, q).into_iter().for_each(&mut note);
        }
    }
    found
}

/// The sum of two terms without what they have in common; the first has the factor 1, unless it has cancelled.
fn two_terms(a: &Monomial, p: &Rational, b: &Monomial, q: &Rational) -> Option<Polynomial> {
    let at = |m: &Monomial, i: usize| m.get(i).copied().unwrap_or(0);
    let common: Monomial = (0..a.len().max(b.len())).map(|i| -at(a, i).min(at(b, i))).collect();
    let mut sum = Polynomial::default();
    sum.add_term(times(a, &common), Rational::from(1));
    sum.add_term(times(b, &common), q.over(p)?);
    Some(sum)
}

/// `a² ± 2 a b + b²` as squares of sums.
fn squares(polynomial: &Polynomial) -> Vec<Split> {
    let root = |(m, c): (&Monomial, &Rational)| {
        let half = m.iter().all(|n| n % 2 == 0).then(|| m.iter().map(|n| n / 2).collect::<Monomial>())?;
        Some((half, (c.signum() > 0).then(|| c.root(2)).flatten()?))
    };
    let roots: Vec<_> = polynomial.0.iter().filter_map(root).collect();
    let mut found = Vec::new();
    for (k, (a, p)) in roots.iter().enumerate() {
        for (b, q) in &roots[k + 1..] {
            let Some(mixed) = polynomial.0.get(&times(a, b)) else { continue };
            let sign = Rational::from(i64::from(mixed.signum()));
            let mut sum = Polynomial::default();
            sum.add_term(a.clone(), p.clone());
            sum.add_term(b.clone(), q * &sign);
            let Some(square) = sum.times(&sum) else { continue };
            if square.0.iter().all(|(m, c)| polynomial.0.get(m) == Some(c)) {
                let mut rest = polynomial.clone();
                rest.0.retain(|m, _| !square.0.contains_key(m));
                found.push(Split { factors: (sum.clone(), sum), rest });
            }
        }
    }
    found
}

/// The greatest quotient by this divisor, then the greatest divisor for this quotient, and what is left.
fn divided(polynomial: &Polynomial, divisor: Polynomial) -> Option<Split> {
    let quotient = weak_quotient(polynomial, &divisor);
    if quotient.0.is_empty() {
        return None;
    }
    let wider = weak_quotient(polynomial, &quotient);
    let (quotient, divisor) =
        if wider.0.len() > divisor.0.len() { (weak_quotient(polynomial, &wider), wider) } else { (quotient, divisor) };
    if quotient.0.len() < 2 && divisor.0.len() < 2 {
        return None;
    }
    let mut rest = polynomial.clone();
    for (m, c) in &quotient.0 {
        for (n, d) in &divisor.0 {
            rest.add_term(times(m, n), -&(c * d));
        }
    }
    rest.0.retain(|_, c| !c.is_zero());
    // A product whose terms are not all there makes the rest longer; taking out a power leaves other powers.
    (rest.0.len() < polynomial.0.len()).then_some(Split { factors: (quotient, divisor), rest })
}

/// The terms `t` for which all terms of `t · divisor` stand in the polynomial, each used once.
fn weak_quotient(polynomial: &Polynomial, divisor: &Polynomial) -> Polynomial {
    let mut left = polynomial.clone();
    let mut quotient = Polynomial::default();
    let Some((lead, inverse)) = divisor.0.first_key_value().and_then(|(m, c)| Some((m, c.recip()?))) else {
        return quotient;
    };
    for (monomial, coefficient) in &polynomial.0 {
        let Some(t) = quotient_of(monomial, lead) else { continue };
        let c = coefficient * &inverse;
        let product = |(m, d): (&Monomial, &Rational)| (times(&t, m), &c * d);
        if divisor.0.iter().map(product).all(|(m, value)| left.0.get(&m) == Some(&value)) {
            for (m, _) in divisor.0.iter().map(product) {
                left.0.remove(&m);
            }
            quotient.add_term(t, c);
        }
    }
    quotient
}
