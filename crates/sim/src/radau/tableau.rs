//! The numbers of the method. Source: [HW], IV.5 and IV.8.

/// Stages: the unknowns at each of them, one after the other.
pub(super) const STAGES: usize = 3;

/// √6.
const ROOT_6: f64 = 2.449_489_742_783_178;

/// Where in the step each stage stands.
pub(super) const NODES: [f64; STAGES] = [(4.0 - ROOT_6) / 10.0, (4.0 + ROOT_6) / 10.0, 1.0];

/// `T`, which makes the inverse of the matrix of the method block diagonal: `T⁻¹ A⁻¹ T` is [`REAL`] beside
/// `[ALPHA, -BETA; BETA, ALPHA]`.
pub(super) const TRANSFORM: [[f64; STAGES]; STAGES] = [
    [9.123_239_487_089_294e-2, -1.412_552_950_209_542e-1, -3.002_919_410_514_742_4e-2],
    [2.417_179_327_071_07e-1, 2.041_293_522_937_999_3e-1, 3.829_421_127_572_619e-1],
    [9.660_481_826_150_93e-1, 1.0, 0.0],
];

/// `T⁻¹`.
pub(super) const BACK: [[f64; STAGES]; STAGES] = [
    [4.325_579_890_063_155, 3.391_992_518_158_098_4e-1, 5.417_705_399_358_749e-1],
    [-4.178_718_591_551_905, -3.276_828_207_610_623_7e-1, 4.766_235_545_005_504_4e-1],
    [-5.028_726_349_457_868e-1, 2.571_926_949_855_605, -5.960_392_048_282_249e-1],
];

/// The real eigenvalue of `A⁻¹`.
pub(super) const REAL: f64 = 3.637_834_252_744_496;

/// Real part of its complex eigenvalues.
pub(super) const ALPHA: f64 = 2.681_082_873_627_752;

/// Imaginary part of its complex eigenvalues.
pub(super) const BETA: f64 = 3.050_430_199_247_41;

/// Weights of the increments in the negative rate at the start of the step that the embedded formula of order 3 implies.
pub(super) const ERROR: [f64; STAGES] = [-(13.0 + 7.0 * ROOT_6) / 3.0, (-13.0 + 7.0 * ROOT_6) / 3.0, -1.0 / 3.0];

/// Weights of the increments of the stages in the increment at the part `at` of the step: the polynomial through the
/// start of the step and all stages.
pub(super) fn increment_weights(at: f64) -> [f64; STAGES] {
    std::array::from_fn(|i| {
        let others = (0..STAGES).filter(|&j| j != i);
        others.fold(at / NODES[i], |product, j| product * (at - NODES[j]) / (NODES[i] - NODES[j]))
    })
}

/// Weights of the increments of the stages in the rate at the part `at` of the step, times its length.
pub(super) fn rate_weights(at: f64) -> [f64; STAGES] {
    std::array::from_fn(|i| {
        let (a, b) = (NODES[(i + 1) % STAGES], NODES[(i + 2) % STAGES]);
        let slope = (at - a) * (at - b) + at * (at - b) + at * (at - a);
        slope / (NODES[i] * (NODES[i] - a) * (NODES[i] - b))
    })
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "values to compare with")]
mod tests {
    use super::*;

    type Matrix = [[f64; STAGES]; STAGES];

    fn product(a: &Matrix, b: &Matrix) -> Matrix {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..STAGES).map(|k| a[i][k] * b[k][j]).sum()))
    }

    fn assert_near(a: &Matrix, b: &Matrix) {
        let distance = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(distance < 2e-14, "{distance:e}: {a:?} {b:?}");
    }

    #[test]
    fn the_transformation_separates_one_real_from_two_complex_equations() {
        let blocks = [[REAL, 0.0, 0.0], [0.0, ALPHA, -BETA], [0.0, BETA, ALPHA]];
        let inverse: Matrix = NODES.map(rate_weights);
        assert_near(&product(&BACK, &product(&inverse, &TRANSFORM)), &blocks);
        assert_near(&product(&BACK, &TRANSFORM), &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let cube = 3.0_f64.powf(2.0 / 3.0); // 9^(1/3)
        assert!((REAL * (6.0 + cube * (cube - 1.0)) / 30.0 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_polynomial_meets_cubes() {
        for at in [0.0, 0.3, 1.0, 1.7] {
            let cube = NODES.map(|c| c * (1.0 + c * (c - 2.0)));
            let sum = |weights: [f64; STAGES]| (0..STAGES).map(|i| weights[i] * cube[i]).sum::<f64>();
            assert!((sum(increment_weights(at)) - at * (1.0 + at * (at - 2.0))).abs() < 1e-14);
            assert!((sum(rate_weights(at)) - (1.0 - 4.0 * at + 3.0 * at * at)).abs() < 1e-13);
        }
    }

    #[test]
    fn the_embedded_formula_has_order_3() {
        // The rate at the start of the step is met for polynomials of degree 3, missed for degree 4.
        let rate = |power: i32| -(0..STAGES).map(|i| ERROR[i] * NODES[i].powi(power)).sum::<f64>();
        assert!((rate(1) - 1.0).abs() < 1e-14 && rate(2).abs() < 1e-14 && rate(3).abs() < 1e-14);
        assert!((rate(4) - 0.1).abs() < 1e-14, "{}", rate(4));
    }
}
