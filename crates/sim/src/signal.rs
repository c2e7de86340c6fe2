//! Signals given as samples over time.

use std::fmt;

/// A signal given by samples: straight between them, constant before the first and after the last. Two samples at the
/// same time make a jump.
///
/// Inside one [`piece`](Signal::piece) the signal is a straight line. A [`System`](crate::System) announces every
/// [`next_corner`](Signal::next_corner) as a jump and keeps the piece of its current interval, so that a step which ends
/// at a jump sees the value before it and the step that starts there the one after it.
///
/// ```
/// let step = halfarrow_sim::Signal::new(vec![0.0, 1.0, 1.0, 3.0], vec![0.0, 2.0, 5.0, 6.0])?;
/// let (before, after) = (step.piece(0.0), step.piece(1.0));
/// assert_eq!((step.value(before, 1.0), step.value(after, 1.0), step.value(after, 2.0)), (2.0, 5.0, 5.5));
/// assert_eq!((step.next_corner(0.0), step.next_corner(3.0)), (Some(1.0), None));
/// # Ok::<(), halfarrow_sim::SignalError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    times: Vec<f64>,
    values: Vec<f64>,
}

/// Why samples make no signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SignalError {
    /// There is no sample, or not one value for each time.
    Length {
        /// Number of times.
        times: usize,
        /// Number of values.
        values: usize,
    },
    /// A time or value is NaN or infinite.
    NotFinite {
        /// Which sample, from 0.
        sample: usize,
    },
    /// A time is before that of the sample before it.
    Backwards {
        /// Which sample, from 0.
        sample: usize,
    },
    /// More than two samples stand at the same time.
    Crowded {
        /// Which sample, from 0: the third.
        sample: usize,
    },
}

impl Signal {
    /// The signal through these samples, times in s.
    ///
    /// # Errors
    /// See [`SignalError`].
    pub fn new(times: Vec<f64>, values: Vec<f64>) -> Result<Signal, SignalError> {
        if times.is_empty() || times.len() != values.len() {
            return Err(SignalError::Length { times: times.len(), values: values.len() });
        }
        if let Some(sample) = times.iter().zip(&values).position(|(t, value)| !(t.is_finite() && value.is_finite())) {
            return Err(SignalError::NotFinite { sample });
        }
        if let Some(before) = times.windows(2).position(|pair| pair[1] < pair[0]) {
            return Err(SignalError::Backwards { sample: before + 1 });
        }
        if let Some(first) = times.windows(3).position(|triple| triple[0] == triple[2]) {
            return Err(SignalError::Crowded { sample: first + 2 });
        }
        Ok(Signal { times, values })
    }

    /// Values of the samples.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Times of the samples in s, ascending.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The piece that holds from `t` on.
    pub fn piece(&self, t: f64) -> usize {
        self.times.partition_point(|&time| time <= t)
    }

    /// Value of a piece at `t`; beyond its ends its line goes on.
    pub fn value(&self, piece: usize, t: f64) -> f64 {
        match piece {
            0 => self.values[0],
            _ if piece >= self.times.len() => self.values[self.times.len() - 1],
            _ => {
                let part = (t - self.times[piece - 1]) / (self.times[piece] - self.times[piece - 1]);
                (1.0 - part) * self.values[piece - 1] + part * self.values[piece]
            }
        }
    }

    /// Derivative of a piece by time, per s.
    pub fn slope(&self, piece: usize) -> f64 {
        if piece == 0 || piece >= self.times.len() {
            return 0.0;
        }
        (self.values[piece] - self.values[piece - 1]) / (self.times[piece] - self.times[piece - 1])
    }

    /// The first sample after `t`, where the slope or the value may jump.
    pub fn next_corner(&self, t: f64) -> Option<f64> {
        self.times.get(self.piece(t)).copied()
    }
}

impl fmt::Display for SignalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SignalError::Length { times, values } => write!(f, "{times} times and {values} values make no signal"),
            SignalError::NotFinite { sample } => write!(f, "sample {} is not a finite number", sample + 1),
            SignalError::Backwards { sample } => write!(f, "sample {} is before the one before it", sample + 1),
            SignalError::Crowded { sample } => {
                write!(f, "sample {} is the third at the same time; a jump takes two", sample + 1)
            }
        }
    }
}

impl std::error::Error for SignalError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_constant_beyond_its_ends() {
        let signal = Signal::new(vec![1.0, 2.0], vec![3.0, 7.0]).unwrap();
        let at = |t: f64| (signal.value(signal.piece(t), t), signal.slope(signal.piece(t)));
        assert_eq!(
            [at(0.0), at(1.0), at(1.25), at(2.0), at(9.0)],
            [(3.0, 0.0), (3.0, 4.0), (4.0, 4.0), (7.0, 0.0), (7.0, 0.0)]
        );
        assert_eq!(
            [signal.next_corner(0.0), signal.next_corner(1.0), signal.next_corner(2.0)],
            [Some(1.0), Some(2.0), None]
        );
    }

    #[test]
    fn refuses_what_is_no_signal() {
        let error = |times: &[f64]| Signal::new(times.to_vec(), vec![0.0; times.len()]).unwrap_err();
        assert_eq!(error(&[]), SignalError::Length { times: 0, values: 0 });
        assert_eq!(error(&[0.0, f64::NAN]), SignalError::NotFinite { sample: 1 });
        assert_eq!(error(&[0.0, 2.0, 1.0]), SignalError::Backwards { sample: 2 });
        assert_eq!(error(&[0.0, 1.0, 1.0, 1.0]), SignalError::Crowded { sample: 3 });
    }
}
