//! Linear equations that become singular between two points of a run: their determinant changes its sign and an unknown
//! leaps over a pole. Behind it the trajectory has no meaning.

use super::frame::Frame;

/// An unknown leaps if it changes its sign and is at least this part of its greatest magnitude so far on one side. Where
/// numerator and determinant vanish together unknowns stay as they are, and one that passes through 0 is small there.
const LEAPS: f64 = 0.5;

/// The determinant of a linear block, and its unknowns, where they were looked at last.
#[derive(Debug, Clone)]
pub(crate) struct Orientation {
    /// Whether the determinant is above zero; none where nothing is known since the last event.
    positive: Option<bool>,
    unknowns: Vec<f64>,
    /// Greatest magnitudes of the unknowns.
    most: Vec<f64>,
    /// Whether the matrix has been factored since.
    pub fresh: bool,
}

impl Orientation {
    /// Room for so many unknowns.
    pub fn new(size: usize) -> Orientation {
        Orientation { positive: None, unknowns: vec![0.0; size], most: vec![0.0; size], fresh: false }
    }

    /// Takes up a determinant and unknowns; whether a pole lies between them and those before.
    fn leaps(&mut self, positive: bool, unknowns: &[f64]) -> bool {
        let turned = self.positive.replace(positive) == Some(!positive);
        let mut leaps = false;
        for ((before, most), &now) in self.unknowns.iter_mut().zip(&mut self.most).zip(unknowns) {
            leaps |= *before * now < 0.0 && before.abs().max(now.abs()) >= LEAPS * *most;
            (*before, *most) = (now, most.max(now.abs()));
        }
        turned && leaps
    }
}

impl Frame {
    /// The first linear block of which a pole has been passed since this was asked last.
    pub fn passed_pole(&mut self) -> Option<u32> {
        let mut passed = None;
        for (block, solver) in self.solvers.iter_mut().enumerate() {
            if std::mem::take(&mut solver.orientation.fresh)
                && solver.orientation.leaps(solver.factors.is_positive(), &solver.x)
            {
                passed = passed.or(Some(block as u32));
            }
        }
        passed
    }

    /// After an event determinants may have any sign.
    pub fn forget_orientations(&mut self) {
        self.solvers
            .iter_mut()
            .for_each(|solver| (solver.orientation.positive, solver.orientation.fresh) = (None, false));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pole_is_told_from_what_passes_through_zero() {
        let mut pole = Orientation::new(2);
        assert!(!pole.leaps(true, &[5.0, 1.0]) && !pole.leaps(true, &[50.0, 1.0]));
        assert!(pole.leaps(false, &[-40.0, 1.0]));
        // A dead centre: the determinant turns, unknowns go on, one of them through 0.
        let mut dead_centre = Orientation::new(2);
        assert!(!dead_centre.leaps(true, &[1.0, 3.0]) && !dead_centre.leaps(true, &[0.05, 3.0]));
        assert!(!dead_centre.leaps(false, &[-0.05, 3.0]));
        // Unknowns that change their sign while the determinant does not.
        let mut swings = Orientation::new(1);
        assert!(!swings.leaps(true, &[1.0]) && !swings.leaps(true, &[-1.0]));
    }
}
