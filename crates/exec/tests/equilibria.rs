//! Equilibria of many states: sparse equations, and what counts as rest where small states are joined to great ones.

use crate::common::Sketch;
use halfarrow_exec::{EquilibriumError, Model};

/// Tanks in a row with pipes between them: `level' = (a before - a) + (after - a)`, with this in place of the level before
/// the first; the last one ends the row.
fn row(s: &mut Sketch, names: &str, count: usize, before: Option<f64>) {
    let levels: Vec<_> = (0..count).map(|i| s.state(&format!("{names}{i}"))).collect();
    for i in 0..count {
        let source = before.filter(|_| i == 0).map(|value| s.number(value));
        let left = if i == 0 { source } else { Some(levels[i - 1]) };
        let beside = left.into_iter().chain(levels.get(i + 1).copied());
        let flows: Vec<_> = beside.map(|other| s.x.sub(other, levels[i])).collect();
        let rate = s.x.add(&flows);
        s.rate(&format!("{names}{i}"), rate);
    }
}

fn tanks(count: usize, before: Option<f64>) -> Model {
    let mut s = Sketch::default();
    row(&mut s, "a", count, before);
    s.model()
}

/// All levels are that of the source. Differences of neighbours are exact to rounding; what they add up to over `n` tanks
/// is uncertain by `n^2` times that at worst.
#[test]
fn a_long_row_rests_at_the_level_of_its_source() {
    for (count, allowed) in [(60, 1e-14), (1_000, 1e-12), (100_000, 1e-7)] {
        let rest = tanks(count, Some(2.0)).equilibrium(0.0, &vec![0.0; count]).expect("it rests");
        let worst = rest.x.iter().fold(0.0f64, |most, x| most.max((x - 2.0).abs()));
        assert!(worst < allowed && rest.free == 0, "{count}: {worst:e}, {} free", rest.free);
    }
}

/// Without a source the sum of the levels is open, and the nearest state of rest keeps it.
#[test]
fn of_many_equilibria_of_many_states_the_nearest_is_taken() {
    let mut s = Sketch::default();
    row(&mut s, "a", 70, None);
    row(&mut s, "b", 30, None);
    row(&mut s, "c", 20, Some(5.0));
    let start: Vec<f64> = (0..120).map(|i| f64::from(i % 7)).collect();
    let rest = s.model().equilibrium(0.0, &start).expect("it rests");
    assert_eq!(rest.free, 2);
    let mean = |from: usize, to: usize| start[from..to].iter().sum::<f64>() / (to - from) as f64;
    for (from, to, level) in [(0, 70, mean(0, 70)), (70, 100, mean(70, 100)), (100, 120, 5.0)] {
        rest.x[from..to].iter().for_each(|x| assert!((x - level).abs() < 1e-13, "{x} is not {level}"));
    }
}

/// A net of a hundred tanks at rest, and a state beside them that moves for ever, slowly.
#[test]
fn what_moves_slowly_beside_a_net_at_rest_is_found() {
    for slow in [0.25, 1e-20] {
        let mut s = Sketch::default();
        row(&mut s, "a", 100, Some(2.0));
        let _ = s.state("clock");
        let rate = s.number(slow);
        s.rate("clock", rate);
        let refused = s.model().equilibrium(0.0, &[0.0; 101]);
        assert_eq!(refused, Err(EquilibriumError::None(vec![("clock".into(), slow)])));
    }
}

/// Every tank leaks into the next but one tenth: levels fall by decades, to far below the last digit of the first, and each
/// is right to its own digits.
#[test]
fn levels_over_many_decades_rest() {
    let count = 200;
    let mut s = Sketch::default();
    let levels: Vec<_> = (0..count).map(|i| s.state(&format!("a{i}"))).collect();
    for i in 0..count {
        let (leak, source) = (s.number(-10.0), s.number(1.0));
        let lost = s.x.mul(&[leak, levels[i]]);
        let rate = s.x.add(&[if i == 0 { source } else { levels[i - 1] }, lost]);
        s.rate(&format!("a{i}"), rate);
    }
    let rest = s.model().equilibrium(0.0, &vec![0.0; count]).expect("it rests");
    let mut level = 1.0;
    for (i, x) in rest.x.iter().enumerate() {
        level /= 10.0;
        assert!((x - level).abs() <= 1e-12 * level, "{i}: {x:e}");
    }
}
