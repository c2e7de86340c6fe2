//! Which samples of a trace are shown, and tables of how things move, each motion once.

use std::collections::BTreeMap;

use super::FRAMES_PER_SECOND;

/// The samples that are shown: the first and the last, and between them no two nearer than a frame.
pub(super) fn thinned(times: &[f64]) -> Vec<usize> {
    let least = (1.0 - 1e-6) / FRAMES_PER_SECOND;
    let mut kept: Vec<usize> = Vec::new();
    for (row, &t) in times.iter().enumerate() {
        if kept.last().is_none_or(|&last| t - times[last] >= least) {
            kept.push(row);
        }
    }
    let Some(last) = times.len().checked_sub(1) else { return kept };
    if kept.len() > 1 && times[last] - times[kept[kept.len() - 1]] < least {
        kept.pop();
    }
    if kept.last() != Some(&last) {
        kept.push(last);
    }
    kept
}

/// Motions of one kind, `N` numbers a frame; what stands still has one frame.
#[derive(Default)]
pub(super) struct Motions<const N: usize> {
    pub all: Vec<Vec<[f32; N]>>,
    known: BTreeMap<Vec<u32>, usize>,
}

impl<const N: usize> Motions<N> {
    /// The number of a motion in the table.
    pub fn add(&mut self, mut motion: Vec<[f32; N]>) -> usize {
        if motion.iter().all(|frame| *frame == motion[0]) {
            motion.truncate(1);
        }
        let key = motion.iter().flatten().map(|x| x.to_bits()).collect();
        let next = self.all.len();
        let number = *self.known.entry(key).or_insert(next);
        if number == next {
            self.all.push(motion);
        }
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_most_sixty_frames_in_a_second() {
        let times: Vec<f64> = (0..=3000).map(|i| f64::from(i) / 1000.0).collect();
        let kept = thinned(&times);
        assert_eq!((kept[0], *kept.last().expect("the end")), (0, 3000));
        assert!(kept.len() <= 181 && kept.len() > 170, "{}", kept.len());
        let ticks: Vec<f64> = (0..=180).map(|i| f64::from(i) / 60.0).collect();
        assert_eq!(thinned(&ticks).len(), 181);
        assert_eq!(thinned(&[0.0]), [0]);
        assert_eq!(thinned(&[0.0, 1e-3]), [0, 1]);
        assert!(thinned(&[]).is_empty());
    }

    #[test]
    fn each_motion_stands_once() {
        let mut motions = Motions::<3>::default();
        assert_eq!(motions.add(vec![[0.0; 3]; 9]), 0);
        assert_eq!(motions.add(vec![[0.0; 3], [1.0; 3]]), 1);
        assert_eq!(motions.add(vec![[0.0; 3]]), 0);
        assert_eq!(motions.all, [vec![[0.0; 3]], vec![[0.0; 3], [1.0; 3]]]);
    }
}
