//! Conditions on time alone: time events.

use crate::bytecode::{Frame, Hold};
use crate::bytecode::{Layout, Routine};
use halfarrow_compiler::program::{ConditionId, EventTrigger, Program, Value};

/// Evaluations in one search for a zero crossing; at its end the run makes a stop at which nothing changes.
const SEARCH: usize = 4000;

/// Part of a turn, in rad, by which a source that swings goes on in a step.
const SWING: f64 = std::f64::consts::FRAC_PI_4;

/// Depth beyond a border, relative to the values around it, below which it may be rounding.
const SHALLOW: f64 = 1e-9;

/// Conditions of time, in an order in which each reads those before it.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    conditions: Vec<(ConditionId, EventTrigger)>,
    /// Computes their operands.
    routine: Routine,
    /// Computes angles that turn with time.
    swings: Routine,
    time: usize,
}

impl Clock {
    /// `seen`: what time moves, rates and indicators of events.
    pub fn new(program: &Program, layout: &Layout, seen: &[Value]) -> Clock {
        let timed = program
            .conditions
            .iter()
            .filter(|(_, c)| matches!(c.trigger, EventTrigger::LinearTime | EventTrigger::CurvedTime));
        let (conditions, operands): (Vec<_>, Vec<Value>) = timed.map(|(id, c)| ((id, c.trigger), c.operand)).unzip();
        let routine = layout.routine(program, &operands);
        let swings = layout.routine(program, &program.turned_by_time(seen));
        Clock { conditions, routine, swings, time: layout.time as usize }
    }

    /// How long a step may be that shows how sources swing, in s: what they do in a longer one no error tells where nothing lets it
    /// through at its ends.
    pub fn longest_step(&self, frame: &mut Frame, t: f64) -> f64 {
        if self.swings.outputs.is_empty() {
            return f64::INFINITY;
        }
        frame.r[self.time] = t;
        frame.d[self.time] = 1.0;
        // Time alone is read.
        let _ = frame.run_along(&self.swings);
        frame.d[self.time] = 0.0;
        let rates = self.swings.outputs.iter().map(|&register| frame.d[register as usize].abs());
        SWING / rates.filter(|rate| rate.is_finite()).fold(0.0, f64::max)
    }

    pub fn routine(&self) -> &Routine {
        &self.routine
    }

    pub fn routines(&self) -> impl Iterator<Item = &Routine> {
        [&self.routine, &self.swings].into_iter()
    }

    /// The conditions, in the order of the outputs of the routine.
    pub fn conditions(&self) -> impl Iterator<Item = ConditionId> + '_ {
        self.conditions.iter().map(|c| c.0)
    }

    /// Takes all of them as they are just after `t`, and finds the next time event: when the first of them changes, in s.
    pub fn handle_time_event(&self, frame: &mut Frame, t: f64, next: &mut Option<f64>) {
        if self.conditions.is_empty() {
            // One that another mode has waited for is none of this one.
            *next = None;
            return;
        }
        frame.conditions.clock = Hold::Take;
        self.evaluate(frame, t);
        for (&(condition, _), &register) in self.conditions.iter().zip(&self.routine.outputs) {
            let operand = (frame.r[register as usize], frame.d[register as usize]);
            frame.conditions.value_after(condition, operand, t, &frame.tables);
        }
        frame.conditions.clock = Hold::Keep;
        let lines = self.next_on_linear(frame, t);
        let curves = (0..self.conditions.len()).filter(|&i| self.conditions[i].1 == EventTrigger::CurvedTime);
        let along = curves.filter_map(|i| self.next_on_curve(frame, i, t, lines));
        *next = along.chain(lines).reduce(f64::min);
        self.evaluate(frame, t);
        frame.d[self.time] = 0.0;
    }

    /// Operands and their rates at `t`; one of them may be time itself, which runs on.
    fn evaluate(&self, frame: &mut Frame, t: f64) {
        frame.r[self.time] = t;
        frame.d[self.time] = 1.0;
        // Time alone is read: no block can fail that has not failed for the parameters.
        let _ = frame.run_along(&self.routine);
    }

    /// Linear operands: where each meets the border it runs towards, computed from time zero so that the result does not
    /// depend on when it is asked for.
    fn next_on_linear(&self, frame: &mut Frame, t: f64) -> Option<f64> {
        self.evaluate(frame, 0.0);
        let mut next: Option<f64> = None;
        for (&(condition, trigger), &register) in self.conditions.iter().zip(&self.routine.outputs) {
            let (start, slope) = (frame.r[register as usize], frame.d[register as usize]);
            if trigger != EventTrigger::LinearTime || slope == 0.0 {
                continue;
            }
            let border = frame.conditions.borders(condition, &frame.tables)[usize::from(slope > 0.0)];
            let change = (border - start) / slope;
            if change.is_finite() && change > t {
                next = Some(next.map_or(change, |n| n.min(change)));
            }
        }
        next
    }

    /// How far the operand of a condition is from the nearest border, below 0 once it is beyond, and the rate of that.
    fn margin(&self, frame: &mut Frame, index: usize, t: f64) -> (f64, f64) {
        self.evaluate(frame, t);
        let register = self.routine.outputs[index] as usize;
        let (a, rate) = (frame.r[register], frame.d[register]);
        let [low, high] = frame.conditions.borders(self.conditions[index].0, &frame.tables);
        if a - low < high - a { (a - low, rate) } else { (high - a, -rate) }
    }

    /// Searches a curve with steps in which a cubic follows it, or a straight line its rate, as beside a double zero, where
    /// values are all rounding, or in which it cannot come to its border; gives the change, or where the search ended.
    ///
    /// A value beyond the border counts where the rates on the way there explain it: what they do not explain is rounding,
    /// as beside a double zero, which is no change.
    fn next_on_curve(&self, frame: &mut Frame, index: usize, from: f64, until: Option<f64>) -> Option<f64> {
        let mut t = from;
        let mut h = 1e-9 * from.abs().max(1.0);
        let mut here = self.margin(frame, index, t);
        let mut inside = LastInside { from: t, margin: here.0, fastest: here.1.abs() };
        for _ in 0..SEARCH {
            if until.is_some_and(|until| t > until) {
                return None;
            }
            let middle = self.margin(frame, index, t + 0.5 * h);
            let there = self.margin(frame, index, t + h);
            if !(middle.0.is_finite() && there.0.is_finite()) {
                return Some(t).filter(|&t| t > from);
            }
            let cubic = 0.5 * (here.0 + there.0) + 0.125 * h * (here.1 - there.1);
            let error = (middle.0 - cubic).abs();
            let size = here.0.abs().max(there.0.abs()).max(middle.0.abs());
            let allowed = 1e-3 * size;
            let fastest = here.1.abs().max(there.1.abs()).max(middle.1.abs());
            let moved = h * fastest;
            let bent = (middle.1 - 0.5 * (here.1 + there.1)).abs();
            let followed = error <= allowed || bent <= 1e-2 * fastest || moved <= 0.5 * size;
            if !followed && h > 1e-12 * t.abs().max(1e-6) {
                h *= 0.5;
                continue;
            }
            for (a, b) in [((t, here), (t + 0.5 * h, middle)), ((t + 0.5 * h, middle), (t + h, there))] {
                if let Some(change) = self.change_between(frame, index, (a, b), &mut inside) {
                    return Some(change).filter(|&c| c > from);
                }
            }
            (t, here) = (t + h, there);
            if error <= 0.1 * allowed || bent <= 1e-3 * fastest || moved <= 0.125 * size {
                h *= 2.0;
            }
        }
        Some(t)
    }

    /// The change between two points, if the second is beyond a border or the margin vanishes on the way to it.
    fn change_between(
        &self,
        frame: &mut Frame,
        index: usize,
        (a, b): (MarginAt, MarginAt),
        inside: &mut LastInside,
    ) -> Option<f64> {
        inside.fastest = inside.fastest.max(b.1.1.abs());
        if b.1.0 < 0.0 {
            let told = (b.0 - inside.from) * inside.fastest >= 0.5 * (inside.margin - b.1.0);
            return told
                .then(|| self.bisect(frame, inside.from, b.0, |this, frame, t| this.margin(frame, index, t).0 < 0.0));
        }
        *inside = LastInside { from: b.0, margin: b.1.0, fastest: b.1.1.abs() };
        if a.1.0 >= 0.0 && a.1.1 < 0.0 && b.1.1 > 0.0 {
            let lowest = self.bisect(frame, a.0, b.0, |this, frame, t| this.margin(frame, index, t).1 > 0.0);
            let depth = self.margin(frame, index, lowest).0;
            if depth < 0.0 {
                let first = self.bisect(frame, a.0, lowest, |this, frame, t| this.margin(frame, index, t).0 < 0.0);
                let deep = -depth > SHALLOW * a.1.0.max(b.1.0);
                return Some(first).filter(|_| deep || self.is_dip(frame, index, first, (lowest, depth)));
            }
        }
        None
    }

    /// Whether a curve that is shallow between `first` and its lowest point is a parabola there, and not rounding.
    fn is_dip(&self, frame: &mut Frame, index: usize, first: f64, (lowest, depth): (f64, f64)) -> bool {
        [0.25, 0.5, 0.75].iter().all(|part| {
            let margin = self.margin(frame, index, lowest + (first - lowest) * part).0;
            (margin - depth * (1.0 - part * part)).abs() <= -0.25 * depth
        })
    }

    /// The first instant, to rounding, at which `beyond` holds; it does at `high` and not at `low`.
    fn bisect(
        &self,
        frame: &mut Frame,
        mut low: f64,
        mut high: f64,
        beyond: impl Fn(&Self, &mut Frame, f64) -> bool,
    ) -> f64 {
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return high;
            }
            if beyond(self, frame, middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
    }
}

/// A time with margin and rate.
type MarginAt = (f64, (f64, f64));

/// Where a margin was last inside its border.
struct LastInside {
    /// When that was, in s.
    from: f64,
    margin: f64,
    /// The greatest rate of the margin since.
    fastest: f64,
}
