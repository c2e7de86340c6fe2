//! Frequency response.

use nalgebra::{Complex as C, DMatrix};

use super::LinearizeReport;
use crate::linear_algebra::Complex;

/// Frequencies in a response.
const POINTS: usize = 600;
/// Decades shown below the slowest and above the fastest pole or zero.
const RIM: f64 = 1.3;

/// Response of an output to an input, over angular frequencies in rad/s.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Name of the input.
    pub input: String,
    /// Name of the output.
    pub output: String,
    /// Angular frequencies, in rad/s.
    pub frequencies: Vec<f64>,
    /// Values of the transfer function there.
    pub values: Vec<Complex>,
}

impl LinearizeReport {
    /// The responses of all outputs to all inputs over the frequencies that the model knows.
    pub fn responses(&self) -> Vec<Response> {
        let frequencies = self.frequencies();
        let mut responses: Vec<Response> = Vec::new();
        for input in &self.inputs {
            for output in &self.outputs {
                let (input, output) = (input.name.clone(), output.name.clone());
                responses.push(Response { input, output, frequencies: frequencies.clone(), values: Vec::new() });
            }
        }
        let p = self.outputs.len();
        for &frequency in &frequencies {
            let values = self.transfer([0.0, frequency]);
            for (at, response) in responses.iter_mut().enumerate() {
                let value = values.as_ref().map_or([f64::NAN; 2], |v| v[at % p.max(1)][at / p.max(1)]);
                response.values.push(value);
            }
        }
        responses
    }

    /// The transfer matrix `C (s - A)^-1 B + D` at `s`, a row for each output; `None` at a pole.
    pub fn transfer(&self, s: Complex) -> Option<Vec<Vec<Complex>>> {
        let (n, m) = (self.a.len(), self.inputs.len());
        let s = C::new(s[0], s[1]);
        let matrix = DMatrix::from_fn(n, n, |i, j| if i == j { s - self.a[i][j] } else { C::new(-self.a[i][j], 0.0) });
        let right = DMatrix::from_fn(n, m, |i, j| C::new(self.b[i][j], 0.0));
        let moved = if n == 0 { right } else { matrix.lu().solve(&right)? };
        let entry = |i: usize, j: usize| {
            let sum: C<f64> = (0..n).map(|k| moved[(k, j)] * self.c[i][k]).sum();
            let value = sum + self.d[i][j];
            [value.re, value.im]
        };
        Some((0..self.outputs.len()).map(|i| (0..m).map(|j| entry(i, j)).collect()).collect())
    }

    /// From below the slowest to above the fastest pole or zero, equal ratios apart.
    fn frequencies(&self) -> Vec<f64> {
        let known = self.poles.iter().chain(self.zeros.iter().flatten());
        let sizes: Vec<f64> = known.map(|z| libm::hypot(z[0], z[1])).filter(|size| *size > 0.0).collect();
        let most = sizes.iter().copied().fold(0.0f64, f64::max);
        let least = sizes.into_iter().filter(|size| *size > 1e-8 * most).fold(f64::INFINITY, f64::min);
        let (low, high) = if most > 0.0 { (libm::log10(least), libm::log10(most)) } else { (0.0, 0.0) };
        let (low, high) = (low - RIM, high + RIM);
        let step = (high - low) / (POINTS - 1) as f64;
        let mut all: Vec<f64> = (0..POINTS).map(|k| libm::exp10(low + step * k as f64)).collect();
        // Sharp resonances are met, not missed.
        let peaks = self.poles.iter().filter(|p| p[1] > 0.0);
        let around = [-3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0];
        let beside = peaks.flat_map(|p| around.map(|k| p[1] + k * p[0].abs().max(1e-4 * p[1])));
        all.extend(beside.filter(|w| *w > 0.0));
        all.sort_by(f64::total_cmp);
        all
    }
}

impl Response {
    /// Magnitudes.
    pub fn magnitudes(&self) -> Vec<f64> {
        self.values.iter().map(|v| libm::hypot(v[0], v[1])).collect()
    }

    /// Phases in degrees, without leaps of a whole turn.
    pub fn phases(&self) -> Vec<f64> {
        let mut turns = 0.0;
        let mut last: Option<f64> = None;
        let unwrapped = self.values.iter().map(|v| {
            if !(v[0].is_finite() && v[1].is_finite()) || *v == [0.0, 0.0] {
                return f64::NAN;
            }
            let phase = libm::atan2(v[1], v[0]).to_degrees();
            if let Some(last) = last {
                turns += 360.0 * libm::round((last - (phase + turns)) / 360.0);
            }
            last = Some(phase + turns);
            phase + turns
        });
        unwrapped.collect()
    }
}
