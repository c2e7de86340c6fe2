//! Magnitudes of states of which nothing is known but the system itself: most machines start at rest.

use crate::jacobian::Jacobian;
use crate::{Failure, HybridSystem, System};

/// Times the system is looked at: at the start, then where the states known so far will have moved.
const LOOKS: usize = 4;

/// Part of the shortest time of the system from one look to the next: sources may start from 0 themselves.
const PART: f64 = 0.1;

/// Part of what moves a state below which its magnitude is what rounding left of it: a machine at rest in equilibrium.
const NOISE: f64 = 1e-12;

/// Part of what a state would hold with the energy of those that it exchanges energy with that is always believed of it: what is
/// less is a ripple, and the first of what reaches it comes as one.
const RIPPLE: f64 = 1e-4;

/// Strength of an exchange relative to the strongest of the same state below which it may be what rounding left.
const WEAK: f64 = 1e-6;

/// Couplings over which what is not known of a state is passed on.
const PASSED_ON: usize = 8;

/// Steps of the growth of a matrix's powers, of which the last half is believed.
const POWERS: usize = 16;

/// A nonzero of the Jacobian: row, column and absolute value, in 1/s once row and column are measured alike.
type Nonzero = (usize, usize, f64);

/// Magnitudes of the states of a system that starts at `(t, x)`, `span` s before the end of its run: what it tells, what is
/// there, and what its motion makes of the others. 0 where nothing is known.
///
/// # Errors
/// What the system reports at `(t, x)`.
pub fn magnitudes(system: &mut dyn HybridSystem, (t, x): (f64, &[f64]), span: f64) -> Result<Vec<f64>, Failure> {
    let interval = system.next_time_event(t).map_or(span, |event| span.min(event - t));
    let mut magnitudes: Vec<f64> = x.iter().zip(system.scales()).map(|(x, scale)| scale.max(x.abs())).collect();
    let before = magnitudes.clone();
    guess_magnitudes(system, (t, x), interval, &mut magnitudes)?;
    let least = surroundings(system, (t, x), interval).map(|couplings| couplings.least(&magnitudes));
    let floors = [before, least.unwrap_or_default()];
    for floor in floors {
        magnitudes.iter_mut().zip(floor).for_each(|(magnitude, floor)| *magnitude = magnitude.max(floor));
    }
    Ok(magnitudes)
}

/// Guesses the magnitudes that are 0 or mere noise in `magnitudes`, where the system stands at `(t, x)`, `interval` s before the next
/// jump. A state that nothing can move keeps 0. A low guess costs steps, a high one accuracy.
///
/// A state that moves at once gets what its rate makes of it in the shortest time that the system knows. From there
/// magnitudes spread along the Jacobian, from states that have one to those that have none, as energy does: where two
/// states act on each other, as the momentum and the displacement of a wave do, they hold the same energy, so that
/// `|J_ij| m_j² = |J_ji| m_i²`. Damping bounds what reaches a state. Every bound carries its unit, so that states of
/// 1e-13 and of 1e5 may stand side by side.
///
/// # Errors
/// What the system reports at `(t, x)`.
pub(super) fn guess_magnitudes(
    system: &mut dyn System,
    (t, x): (f64, &[f64]),
    interval: f64,
    magnitudes: &mut [f64],
) -> Result<(), Failure> {
    let mut jacobian = Jacobian::new(system.sparsity());
    let (mut looked_at, mut rates) = (x.to_vec(), vec![0.0; x.len()]);
    let mut later = t;
    for look in 0..LOOKS {
        let entries = match entries(system, &mut jacobian, later, &looked_at, &mut rates) {
            Ok(entries) => entries,
            Err(failure) if look == 0 => return Err(failure),
            Err(_) => return Ok(()), // the system need not exist there
        };
        let couplings = Couplings::new(entries, interval, x.len());
        let known = magnitudes.iter().filter(|&&magnitude| magnitude > 0.0).count();
        if look == 0 {
            couplings.silence(magnitudes);
        }
        couplings.seed(&rates, magnitudes);
        couplings.spread(magnitudes);
        let now_known = magnitudes.iter().filter(|&&magnitude| magnitude > 0.0).count();
        // What acts by its square is seen only where it has moved: the first look alone proves nothing.
        if now_known == x.len() || (look > 0 && now_known == known && now_known > 0) {
            return Ok(());
        }
        later += PART * couplings.shortest;
        for (i, looked_at) in looked_at.iter_mut().enumerate() {
            let moved = couplings.shortest * rates[i];
            *looked_at = x[i] + if moved == 0.0 { magnitudes[i] } else { moved };
        }
    }
    Ok(())
}

/// How the states act on each other where the system stands at `(t, x)`, `interval` s before the next jump. `None` where there are
/// no rates.
pub(super) fn surroundings(system: &mut dyn System, (t, x): (f64, &[f64]), interval: f64) -> Option<Couplings> {
    let mut jacobian = Jacobian::new(system.sparsity());
    let entries = entries(system, &mut jacobian, t, x, &mut vec![0.0; x.len()]).ok()?;
    Some(Couplings::new(entries, interval, x.len()))
}

/// Absolute values of the Jacobian that are not 0; writes the rates.
fn entries(
    system: &mut dyn System,
    jacobian: &mut Jacobian,
    t: f64,
    x: &[f64],
    rates: &mut [f64],
) -> Result<Vec<Nonzero>, Failure> {
    let mut entries = vec![];
    system.rates(t, x, rates)?;
    jacobian.visit(system, t, x, |row, column, _, value| {
        if value != 0.0 && value.is_finite() {
            entries.push((row, column, value.abs()));
        }
    })?;
    Ok(entries)
}

/// How the states act on each other.
pub(super) struct Couplings {
    /// Sorted by column.
    entries: Vec<Nonzero>,
    /// First entry of each column, and the end of the last.
    starts: Vec<usize>,
    /// Nonzeros beside the diagonal, row by row.
    neighbours: Vec<usize>,
    /// Rate at which each state decays or grows by itself, in 1/s.
    own: Vec<f64>,
    /// The shortest time that the system knows, in s; at most the way to the next jump.
    pub(super) shortest: f64,
    interval: f64,
}

impl Couplings {
    fn new(mut entries: Vec<Nonzero>, interval: f64, states: usize) -> Couplings {
        entries.sort_unstable_by_key(|&(row, column, _)| (column, row));
        let starts = (0..=states).map(|column| entries.partition_point(|entry| entry.1 < column)).collect();
        let (mut neighbours, mut own) = (vec![0; states], vec![0.0; states]);
        for &(row, column, value) in &entries {
            if row == column { own[row] = value } else { neighbours[row] += 1 }
        }
        let shortest = shortest_time(&entries, states).min(interval);
        Couplings { entries, starts, neighbours, own, shortest, interval }
    }

    /// The least magnitude that each state is to have beside the others.
    pub(super) fn least(&self, magnitudes: &[f64]) -> Vec<f64> {
        self.exchanged(magnitudes).iter().map(|magnitude| RIPPLE * magnitude).collect()
    }

    /// Raises what is not known of each state to what the others make of it in a time of at most `reach`: a displacement is no
    /// better known than its speed.
    pub(super) fn pass_on(&self, reach: f64, unknown: &mut [f64]) {
        for _ in 0..PASSED_ON {
            let before = unknown.to_vec();
            for &(on, by, action) in self.entries.iter().filter(|(on, by, _)| on != by) {
                let reached = action * self.time(on, by, action).min(reach) * before[by];
                if reached.is_finite() {
                    unknown[on] = unknown[on].max(reached);
                }
            }
            if *unknown == before[..] {
                return;
            }
        }
    }

    fn column(&self, column: usize) -> &[Nonzero] {
        &self.entries[self.starts[column]..self.starts[column + 1]]
    }

    /// How strongly state `by` acts on `on`; 0 if it does not.
    fn action(&self, on: usize, by: usize) -> f64 {
        let column = self.column(by);
        column.binary_search_by_key(&on, |entry| entry.0).map_or(0.0, |place| column[place].2)
    }

    /// What the magnitudes, by themselves, make of each state in the shortest time.
    fn moved(&self, magnitudes: &[f64]) -> Vec<f64> {
        let mut moved = vec![0.0; magnitudes.len()];
        self.entries
            .iter()
            .filter(|(row, column, _)| row != column)
            .for_each(|&(row, column, value)| moved[row] += self.shortest * value * magnitudes[column]);
        moved
    }

    /// Forgets magnitudes that are noise.
    fn silence(&self, magnitudes: &mut [f64]) {
        let moved = self.moved(magnitudes);
        magnitudes
            .iter_mut()
            .zip(moved)
            .filter(|(known, moved)| **known < NOISE * moved)
            .for_each(|(known, _)| *known = 0.0);
    }

    /// Magnitudes of states that move at once.
    fn seed(&self, rates: &[f64], magnitudes: &mut [f64]) {
        let moved = self.moved(magnitudes);
        for ((magnitude, moved), rate) in magnitudes.iter_mut().zip(moved).zip(rates) {
            let moved = moved + self.shortest * rate.abs();
            if *magnitude == 0.0 && moved.is_finite() {
                *magnitude = moved;
            }
        }
    }

    /// Spreads magnitudes, one coupling further at a time.
    fn spread(&self, magnitudes: &mut [f64]) {
        let mut front: Vec<usize> = (0..magnitudes.len()).filter(|&i| magnitudes[i] > 0.0).collect();
        while !front.is_empty() {
            let mut reached: Vec<(usize, f64)> = vec![];
            for &by in &front {
                let free = self.column(by).iter().filter(|entry| magnitudes[entry.0] == 0.0);
                reached.extend(free.map(|&(on, _, action)| (on, action * self.time(on, by, action) * magnitudes[by])));
            }
            front = reached.iter().map(|&(on, _)| on).collect();
            front.sort_unstable();
            front.dedup();
            reached.iter().for_each(|&(on, magnitude)| magnitudes[on] = magnitudes[on].max(magnitude));
            front.retain(|&on| magnitudes[on] > 0.0);
        }
    }

    /// What each state has or would have with the energy of those that it exchanges energy with, directly or through others:
    /// along a tree of the strongest exchanges, as a weak one may be rounding.
    fn exchanged(&self, magnitudes: &[f64]) -> Vec<f64> {
        let tree = self.strongest();
        let mut sizes = magnitudes.to_vec();
        // On a tree every way is gone once, and back again nothing is won.
        for _ in 0..sizes.len() {
            let mut grew = false;
            for &(a, b) in &tree {
                for (on, by) in [(a, b), (b, a)] {
                    let action = self.action(on, by);
                    let reached = action * self.time(on, by, action) * sizes[by];
                    if reached > 1.01 * sizes[on] && reached.is_finite() {
                        (sizes[on], grew) = (reached, true);
                    }
                }
            }
            if !grew {
                break;
            }
        }
        sizes
    }

    /// Pairs of states that act on each other, the strongest first, as long as they close no ring.
    fn strongest(&self) -> Vec<(usize, usize)> {
        let strength = |&(a, b, action): &Nonzero| (a > b).then(|| (a, b, (action * self.action(b, a)).sqrt()));
        let mut pairs: Vec<Nonzero> = self.entries.iter().filter_map(strength).filter(|pair| pair.2 > 0.0).collect();
        pairs.sort_by(|a, b| b.2.total_cmp(&a.2).then((a.0, a.1).cmp(&(b.0, b.1))));
        let mut greatest = vec![0.0_f64; self.own.len()];
        for &(a, b, strength) in &pairs {
            greatest[a] = greatest[a].max(strength);
            greatest[b] = greatest[b].max(strength);
        }
        let mut group: Vec<usize> = (0..self.own.len()).collect();
        let mut tree = vec![];
        for (a, b, _) in pairs.into_iter().filter(|&(a, b, s)| s > WEAK * greatest[a].max(greatest[b])) {
            let (a_group, b_group) = (root(&mut group, a), root(&mut group, b));
            if a_group != b_group {
                group[a_group] = b_group;
                tree.push((a, b));
            }
        }
        tree
    }

    /// How long `by` acts on `on` until that acts back or is held by its own damping, which it shares with what else acts
    /// on it.
    fn time(&self, on: usize, by: usize, action: f64) -> f64 {
        let back = self.action(by, on);
        let damping = self.own[on] / self.neighbours[on].max(1) as f64;
        match back > 0.0 {
            true => (action * back).sqrt().max(damping).recip().min(self.interval),
            false => self.shortest,
        }
    }
}

/// The state that stands for all in the group of this one.
fn root(group: &mut [usize], mut state: usize) -> usize {
    while group[state] != state {
        group[state] = group[group[state]];
        state = group[state];
    }
    state
}

/// The reciprocal of the spectral radius of a matrix of absolute values, by the growth of its powers.
fn shortest_time(entries: &[Nonzero], states: usize) -> f64 {
    let mut powers = vec![1.0; states];
    let mut growth = 0.0;
    for iteration in 0..POWERS {
        let mut next = vec![0.0; states];
        entries.iter().for_each(|&(row, column, value)| next[row] += value * powers[column]);
        let most = next.iter().fold(0.0, |most: f64, value| most.max(*value));
        if most == 0.0 || !most.is_finite() {
            return f64::INFINITY;
        }
        powers = next.iter().map(|value| value / most).collect();
        growth += if 2 * iteration >= POWERS { 2.0 * libm::log(most) / POWERS as f64 } else { 0.0 };
    }
    libm::exp(-growth)
}
