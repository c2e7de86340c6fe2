//! The sets of parameters of a sweep.

use std::path::{Path, PathBuf};

use halfarrow_compiler::algebra::math;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec as exec;

use super::{CHUNK, Part, Sweep, known_parameter};
use crate::error::Problem;
use crate::quantity::number_and_unit;

/// More sets than this are a mistake.
const MOST_SETS: u64 = 1 << 40;

/// Values of one parameter, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Vary {
    /// The parameter.
    pub name: String,
    /// Its values.
    pub values: Vec<f64>,
}

impl Vary {
    /// Reads `k=lin(1,10,100)` (from, to, number), `k=log(1,1000,4)` or `k=list(1,2,5)`. Numbers may have units:
    /// `k=lin(1 kN/m, 20 kN/m, 5)`.
    ///
    /// ```
    /// use halfarrow::Vary;
    /// assert_eq!(Vary::parse("k=lin(1,2,3)").unwrap().values, [1.0, 1.5, 2.0]);
    /// assert_eq!(Vary::parse("l=list(5 mm, 1)").unwrap().values, [0.005, 1.0]);
    /// assert!(Vary::parse("k=log(0,1,3)").is_err());
    /// ```
    ///
    /// # Errors
    /// The text is none of these.
    pub fn parse(text: &str) -> Result<Vary, Problem> {
        let bad = |why: &str| {
            let reason = format!("`{text}`: {why}; write `k=lin(1,10,100)`, `k=log(1,1000,4)` or `k=list(1,2,5)`");
            Problem::BadOption { reason }
        };
        let (name, rest) = text.split_once('=').ok_or_else(|| bad("no `=`"))?;
        let (kind, rest) = rest.trim().split_once('(').ok_or_else(|| bad("no `(`"))?;
        let inner = rest.trim_end().strip_suffix(')').ok_or_else(|| bad("no `)`"))?;
        let numbers: Option<Vec<f64>> = inner.split(',').map(number).collect();
        let numbers = numbers.ok_or_else(|| bad("a number cannot be read"))?;
        let values = match (kind.trim(), &numbers[..]) {
            ("list", values) if !values.is_empty() => values.to_vec(),
            ("lin" | "log", &[from, to, n]) => {
                if n.fract() != 0.0 || !(1.0..=1e9).contains(&n) {
                    return Err(bad("the number of values has to be whole and at least 1"));
                }
                let parts = (n - 1.0).max(1.0);
                let at = |i: usize| i as f64 / parts;
                let all = 0..n as usize;
                if kind.trim() == "lin" {
                    all.map(|i| if i as f64 == parts { to } else { from + at(i) * (to - from) }).collect()
                } else if from * to > 0.0 {
                    let ratio = to / from;
                    all.map(|i| if i as f64 == parts { to } else { from * math::pow(ratio, at(i)) }).collect()
                } else {
                    return Err(bad("both ends of `log` have to be above 0, or both below"));
                }
            }
            ("lin" | "log", _) => return Err(bad("three numbers are needed: from, to, how many")),
            _ => return Err(bad("the values are not given by lin, log or list")),
        };
        if let Some(value) = values.iter().find(|v: &&f64| !v.is_finite()) {
            return Err(bad(&format!("{value} is not finite")));
        }
        Ok(Vary { name: name.trim().to_string(), values })
    }
}

/// A number, perhaps with a unit.
fn number(text: &str) -> Option<f64> {
    let (number, unit) = number_and_unit(text)?;
    Some(unit.map_or(number, |unit| unit.to_si_f64(number)))
}

/// Sets of parameters from a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// The parameters.
    pub names: Vec<String>,
    /// Their values in SI units, row by row.
    pub rows: Vec<Vec<f64>>,
}

/// Faults reported of one file; more say nothing new.
const MOST_FAULTS: usize = 10;

impl Samples {
    /// Reads a CSV file whose header names parameters; a row is a set.
    ///
    /// # Errors
    /// The file cannot be read, or a field is no finite number.
    pub fn read(path: &Path) -> Result<Samples, Problem> {
        let bad = |faults: Vec<String>| Problem::BadInput { path: PathBuf::from(path), faults };
        let opened = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path);
        let mut reader = opened.map_err(|why| bad(vec![why.to_string()]))?;
        let header = reader.headers().map_err(|why| bad(vec![why.to_string()]))?;
        let names: Vec<String> = header.iter().map(str::to_string).collect();
        let (mut rows, mut faults) = (Vec::new(), Vec::new());
        for (i, record) in reader.records().enumerate() {
            let record = record.map_err(|why| bad(vec![why.to_string()]))?;
            let fields: Vec<Option<f64>> =
                record.iter().map(|field| number(field).filter(|value| value.is_finite())).collect();
            if let Some(at) = fields.iter().position(Option::is_none) {
                faults.push(format!("line {}: `{}` is no number for {}", i + 2, &record[at], names[at]));
            }
            rows.push(fields.into_iter().map(|field| field.unwrap_or(f64::NAN)).collect());
        }
        let more = faults.len().saturating_sub(MOST_FAULTS);
        faults.truncate(MOST_FAULTS);
        faults.extend((more > 0).then(|| format!("and {more} more lines")));
        match (faults.is_empty(), rows.is_empty()) {
            (true, false) => Ok(Samples { names, rows }),
            (true, true) => Err(bad(vec!["there are no rows".into()])),
            (false, _) => Err(bad(faults)),
        }
    }
}

/// All sets, by number.
#[derive(Debug)]
pub struct Plan {
    names: Vec<String>,
    units: Vec<Option<Unit>>,
    rows: Vec<Vec<f64>>,
    vary: Vec<Vec<f64>>,
    /// Where the sets stand in a larger sweep.
    part: Option<Part>,
}

impl Plan {
    pub fn new(sweep: &Sweep, system: &exec::Model) -> Result<Plan, Problem> {
        let bad = |reason: &str| Problem::BadOption { reason: reason.into() };
        let samples = sweep.samples.as_ref();
        let mut names: Vec<String> = samples.map(|s| s.names.clone()).unwrap_or_default();
        names.extend(sweep.vary.iter().map(|v| v.name.clone()));
        for (i, name) in names.iter().enumerate() {
            known_parameter(system, name)?;
            if names[..i].contains(name) {
                return Err(bad(&format!("`{name}` is varied twice")));
            }
        }
        if names.is_empty() {
            return Err(bad("nothing varies: give --vary or --samples"));
        }
        let unit = |name: &String| {
            let parameter = system.program().parameters.iter().find(|p| p.name == *name);
            parameter.and_then(|p| p.unit.as_ref().map(Unit::to_si_unit))
        };
        let plan = Plan {
            units: names.iter().map(unit).collect(),
            names,
            rows: samples.map_or(vec![Vec::new()], |s| s.rows.clone()),
            vary: sweep.vary.iter().map(|v| v.values.clone()).collect(),
            part: sweep.part,
        };
        let sets = plan.vary.iter().try_fold(plan.rows.len(), |n, values| n.checked_mul(values.len()));
        match sets {
            Some(sets)
                if plan.part.is_some_and(|part| part.first.checked_add(sets).is_none_or(|end| end > part.of)) =>
            {
                Err(bad("a part of a sweep does not lie within it"))
            }
            Some(sets) if sets as u64 <= MOST_SETS => Ok(plan),
            _ => Err(bad("there are more sets than can be counted")),
        }
    }

    pub fn sets(&self) -> usize {
        self.vary.iter().map(Vec::len).product::<usize>() * self.rows.len()
    }

    /// The number of a set as it is told, from 1: that in the whole sweep.
    pub fn number(&self, set: usize) -> usize {
        self.part.map_or(0, |part| part.first) + set + 1
    }

    /// Those of so many sets spread evenly over the whole sweep that are here, the first and the last included.
    pub fn sample(&self, most: usize) -> Vec<usize> {
        let Part { first, of } = self.part.unwrap_or(Part { first: 0, of: self.sets() });
        let count = of.min(most);
        let all = (0..count).map(|i| if count > 1 { i * (of - 1) / (count - 1) } else { 0 });
        all.filter(|set| (first..first + self.sets()).contains(set)).map(|set| set - first).collect()
    }

    /// Numbers of the chunks that the sets are computed in.
    pub fn chunks(&self) -> std::ops::Range<usize> {
        0..self.sets().div_ceil(CHUNK)
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn units(&self) -> &[Option<Unit>] {
        &self.units
    }

    /// The values of a set, in the order of the names.
    pub fn values(&self, set: usize) -> Vec<f64> {
        let mut rest = set;
        let mut varied: Vec<f64> = Vec::with_capacity(self.vary.len());
        for values in self.vary.iter().rev() {
            varied.push(values[rest % values.len()]);
            rest /= values.len();
        }
        let mut all = self.rows[rest].clone();
        all.extend(varied.into_iter().rev());
        all
    }
}
