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

/// How far a loop is from the limit of stability at a frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margin {
    /// Whether it is one of gain, in dB, where the phase is -180°; else of phase, in degrees, where the magnitude is 1.
    pub of_gain: bool,
    /// The frequency, in Hz.
    pub hertz: f64,
    /// Where the limit is: 0 dB, or an odd multiple of 180°.
    pub limit: f64,
    /// Magnitude in dB or phase in degrees there.
    pub value: f64,
}

impl Margin {
    /// The margin: positive where the closed loop has room.
    pub fn size(&self) -> f64 {
        if self.of_gain { self.limit - self.value } else { self.value - self.limit }
    }
    /// As it is told.
    pub fn text(&self) -> String {
        let size = format!("{:.1}", self.size()).replace('-', "−");
        let frequency = short_hertz(self.hertz);
        match self.of_gain {
            true => format!("gain margin {size} dB at {frequency}"),
            false => format!("phase margin {size}° at {frequency}"),
        }
    }
}

fn short_hertz(f: f64) -> String {
    let digits = (2 - libm::floor(libm::log10(f)) as i32).clamp(0, 6) as usize;
    if (1e-4..1e5).contains(&f) { format!("{f:.digits$} Hz") } else { format!("{f:.2e} Hz") }
}

impl Response {
    /// Frequencies in Hz.
    pub fn hertz(&self) -> Vec<f64> {
        self.frequencies.iter().map(|w| w / std::f64::consts::TAU).collect()
    }

    /// Magnitudes in dB: 20 times the logarithm of the magnitude.
    pub fn decibels(&self) -> Vec<f64> {
        self.magnitudes().into_iter().map(|m| if m > 0.0 { 20.0 * libm::log10(m) } else { f64::NAN }).collect()
    }

    /// The margins of this response as an open loop, closed with negative feedback: at every frequency at which the
    /// magnitude passes 1 or the phase an odd multiple of 180°, between two points along straight lines.
    pub fn margins(&self) -> Vec<Margin> {
        let (hertz, gain, phase) = (self.hertz(), self.decibels(), self.phases());
        let mut margins = Vec::new();
        for i in 1..hertz.len() {
            let at = |part: f64, of: &[f64]| of[i - 1] + part * (of[i] - of[i - 1]);
            let logs = [hertz[i - 1], hertz[i]].map(libm::log);
            let frequency = |part: f64| libm::exp(logs[0] + part * (logs[1] - logs[0]));
            let finite = [gain[i - 1], gain[i], phase[i - 1], phase[i]].iter().all(|x| x.is_finite());
            if finite && (gain[i - 1] < 0.0) != (gain[i] < 0.0) {
                let part = gain[i - 1] / (gain[i - 1] - gain[i]);
                let value = at(part, &phase);
                let limit = 360.0 * libm::ceil(value / 360.0) - 180.0;
                margins.push(Margin { of_gain: false, hertz: frequency(part), limit, value });
            }
            let turn = |phase: f64| libm::floor((phase - 180.0) / 360.0);
            if finite && turn(phase[i - 1]) != turn(phase[i]) && (phase[i] - phase[i - 1]).abs() < 90.0 {
                let limit = 360.0 * turn(phase[i - 1]).max(turn(phase[i])) + 180.0;
                let part = (limit - phase[i - 1]) / (phase[i] - phase[i - 1]);
                margins.push(Margin { of_gain: true, hertz: frequency(part), limit: 0.0, value: at(part, &gain) });
            }
        }
        margins
    }

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
