//! Named columns over time.

use halfarrow_sim::Sink;

/// Values of one recorded variable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// As the user asked for it, such as `spring.q`.
    pub name: String,
    /// Unit of the values, such as `N.s/m`; empty if none.
    pub unit: String,
    /// One value a sample.
    pub values: Vec<f64>,
}

/// What a run computed, sample by sample. It is a [`Sink`], so a run can write straight into it.
///
/// Invariant: every column has one value for each time. Times never decrease; a jump may give two samples of equal time.
///
/// ```
/// use halfarrow_sim::Sink;
/// let mut trace = halfarrow_trace::Trace::new([("spring.q", "m")]);
/// trace.sample(0.0, &[0.1744]);
/// assert_eq!(trace.column("spring.q").unwrap().values, [0.1744]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Times of the samples, in s.
    pub times: Vec<f64>,
    /// The recorded variables, in order.
    pub columns: Vec<Column>,
}

impl Trace {
    /// An empty trace of columns given by name and unit.
    pub fn new<N: Into<String>, U: Into<String>>(columns: impl IntoIterator<Item = (N, U)>) -> Trace {
        let column = |(name, unit): (N, U)| Column { name: name.into(), unit: unit.into(), values: vec![] };
        Trace { times: vec![], columns: columns.into_iter().map(column).collect() }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.times.len()
    }

    /// The column of this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }
}

impl Sink for Trace {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.times.push(t);
        self.columns.iter_mut().zip(values).for_each(|(column, value)| column.values.push(*value));
    }
}
