//! Energy that appears or vanishes at once.
//!
//! Errors of steps add up: over a whole run as much may be missed as the tolerance grants for all of its steps, and what the
//! samples leave open of integrals adds up as well. Neither excuses energy that is gone within few of them. What storages
//! hold by their laws is known at every sample without an integral; it changes by no more than the other ports can pass
//! meanwhile, at the greatest power that they have around.

use crate::lanes::add;
use crate::scales::{Quantity, Term};
use crate::worst::Raw;

/// So many steps one after the other are looked at together.
pub(crate) const STRETCHES: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Power between two samples may be greater than at both by this factor.
const BETWEEN: f64 = 2.0;

/// What storages hold at each sample, and what passes the other ports.
pub(crate) struct AtOnce {
    stored: Vec<f64>,
    passed: Vec<f64>,
}

impl AtOnce {
    pub fn new(samples: usize) -> AtOnce {
        AtOnce { stored: vec![0.0; samples], passed: vec![0.0; samples] }
    }

    /// A storage holds this energy, but for what impulses have given.
    pub fn stores(&mut self, energy: &[f64]) {
        add(&mut self.stored, energy);
    }

    /// Another port passes this power.
    pub fn passes(&mut self, power: &[f64]) {
        self.passed.iter_mut().zip(power).for_each(|(sum, own)| *sum += own.abs());
    }

    /// What these storages hold and others, and what passes all ports.
    pub fn with(mut self, more: AtOnce) -> AtOnce {
        add(&mut self.stored, &more.stored);
        add(&mut self.passed, &more.passed);
        self
    }

    /// Where so many steps gain or lose most, beyond what can have passed.
    pub fn worst(&self, times: &[f64], steps: usize) -> Option<Raw> {
        let beyond = |&(change, passed, _): &(f64, f64, usize)| change - passed;
        let all = (steps..times.len()).map(|k| {
            let (change, passed) = self.between(times, k - steps, k);
            (change, passed, k)
        });
        let (miss, resolution, k) = all.max_by(|a, b| beyond(a).total_cmp(&beyond(b)))?;
        let place = "the whole model: energy that it gains or loses at once".to_string();
        Some(Raw { miss, resolution, time: times[k], place, terms: vec![Term::of(Quantity::Energy, 1.0)] })
    }

    /// By how much what is held changes between two samples, and how much can have passed.
    fn between(&self, times: &[f64], from: usize, to: usize) -> (f64, f64) {
        let around = from.saturating_sub(1)..(to + 2).min(times.len());
        let power = self.passed[around].iter().fold(0.0f64, |most, p| most.max(*p));
        ((self.stored[to] - self.stored[from]).abs(), BETWEEN * power * (times[to] - times[from]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_passes_is_no_loss_and_what_vanishes_at_once_is() {
        let times: Vec<f64> = (0..=20).map(|k| 0.1 * f64::from(k)).collect();
        let mut held = AtOnce::new(times.len());
        // A resistor takes 2 W.
        held.stores(&times.iter().map(|t| 10.0 - 2.0 * t).collect::<Vec<_>>());
        held.passes(&vec![2.0; times.len()]);
        for steps in [1, 4, 16] {
            let worst = held.worst(&times, steps).expect("there are as many");
            assert!(worst.miss < worst.resolution, "{steps}");
        }
        assert!(held.worst(&times, 32).is_none());
        // At once 3 J are gone.
        held.stored[12..].iter_mut().for_each(|e| *e -= 3.0);
        let worst = held.worst(&times, 1).expect("there are as many");
        assert!((worst.miss - 3.2).abs() < 1e-12 && worst.resolution < 0.5 && worst.time == times[12]);
    }
}
