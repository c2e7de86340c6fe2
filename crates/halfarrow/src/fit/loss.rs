//! What large residuals count. Source: [SciPy], `least_squares`.

/// What is made least of the squares of residuals: their sum, or less of large ones, which may be blunders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Loss {
    /// The squares themselves.
    #[default]
    Linear,
    /// `2 (√(1 + z) - 1)`: like magnitudes where they are large.
    SoftL1,
    /// The square up to the scale, from there on like a magnitude.
    Huber,
    /// `ln(1 + z)`.
    Cauchy,
    /// `arctan z`: no residual counts more than a bound.
    Arctan,
}

impl Loss {
    /// What a square `z` of a residual in scales counts, with its first and second derivative.
    fn of(self, z: f64) -> [f64; 3] {
        match self {
            Loss::Linear => [z, 1.0, 0.0],
            Loss::SoftL1 => {
                let root = (1.0 + z).sqrt();
                // Without the difference of what is nearly alike.
                [2.0 * z / (root + 1.0), 1.0 / root, -0.5 / (root * (1.0 + z))]
            }
            Loss::Huber if z <= 1.0 => [z, 1.0, 0.0],
            Loss::Huber => {
                let root = z.sqrt();
                [2.0 * root - 1.0, 1.0 / root, -0.5 / (root * z)]
            }
            Loss::Cauchy => [libm::log1p(z), 1.0 / (1.0 + z), -1.0 / ((1.0 + z) * (1.0 + z))],
            Loss::Arctan => {
                let square = 1.0 + z * z;
                [libm::atan(z), 1.0 / square, -2.0 * z / (square * square)]
            }
        }
    }

    /// A residual whose square is what this one counts, and its derivative.
    pub(super) fn bent(self, residual: f64, scale: f64) -> (f64, f64) {
        if self == Loss::Linear || residual == 0.0 {
            return (residual, 1.0);
        }
        let part = residual / scale;
        let [counts, slope, _] = self.of(part * part);
        let bent = scale * counts.sqrt().copysign(residual);
        (bent, slope * residual / bent)
    }

    /// By what the derivatives of a residual are multiplied so that their squares are the curvature of what is made least.
    pub(super) fn weight(self, residual: f64, scale: f64) -> f64 {
        let part = residual / scale;
        let [_, slope, bend] = self.of(part * part);
        (slope + 2.0 * bend * part * part).max(f64::EPSILON).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Loss; 5] = [Loss::Linear, Loss::SoftL1, Loss::Huber, Loss::Cauchy, Loss::Arctan];

    #[test]
    fn small_residuals_count_as_squares_and_slopes_are_those_of_the_curves() {
        for loss in ALL {
            assert!((loss.bent(1e-5, 1.0).0 - 1e-5).abs() < 1e-14, "{loss:?}");
            for residual in [-3.0, -0.7, 0.2, 0.9, 1.7, 40.0] {
                let (bent, slope) = loss.bent(residual, 2.0);
                let h = 1e-5;
                let difference = (loss.bent(residual + h, 2.0).0 - loss.bent(residual - h, 2.0).0) / (2.0 * h);
                assert!((slope - difference).abs() < 1e-8, "{loss:?} at {residual}: {slope} for {difference}");
                assert!(bent.abs() <= residual.abs() && bent * residual > 0.0);
                let cost = |r: f64| 0.5 * loss.bent(r, 2.0).0 * loss.bent(r, 2.0).0;
                let (h, least) = (1e-3, f64::EPSILON.sqrt());
                let curve = (cost(residual + h) - 2.0 * cost(residual) + cost(residual - h)) / (h * h);
                let weight = loss.weight(residual, 2.0);
                assert!(
                    (weight - curve.max(least * least).sqrt()).abs() < 1e-3,
                    "{loss:?} at {residual}: {weight} {curve}"
                );
            }
        }
    }
}
