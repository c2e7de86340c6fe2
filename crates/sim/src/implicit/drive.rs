//! From jump to jump.

use std::cell::RefCell;

use super::tolerances::Tolerances;
use crate::Failure;
use crate::events::{Chatter, first_crossing};
use crate::radau::Radau;
use crate::scene::{Implicit, Scene as _, halves, halves_mut};
use crate::simulate::Run;
use crate::variable_step::{MARGINS, is_at};

/// Part of the time in which the unknowns would change altogether that the first step takes.
const CAREFUL: f64 = 0.01;

/// Part of the way to the stop that the first step takes where nothing moves yet.
const UNKNOWN: f64 = 1e-6;

/// Integrates to the end. The point holds all unknowns, then all their rates.
pub(super) fn run(run: &mut Run<'_>, shared: &RefCell<Implicit<'_>>, point: &mut [f64]) -> Result<(), Failure> {
    run.start(point)?;
    let tolerances = Tolerances::new(run.options, &mut *shared.borrow_mut().0)?;
    let radau = Radau::new(&*shared.borrow().0, tolerances.relative(), tolerances.absolute());
    let chatter = Chatter::new(run.options.to - run.options.from);
    let inside = point.to_vec();
    let mut drive = Drive { run, shared, radau, tolerances, chatter, inside, resume: None };
    let end = drive.pieces(point);
    drive.radau.work().add_to(&mut drive.run.counts);
    drive.run.counts.rates += drive.radau.work().residuals;
    end
}

/// The method at work on a run.
struct Drive<'r, 'a, 's, 'b> {
    run: &'r mut Run<'a>,
    shared: &'s RefCell<Implicit<'b>>,
    radau: Radau,
    tolerances: Tolerances,
    chatter: Chatter,
    /// A point inside the last step.
    inside: Vec<f64>,
    /// Step to go on with, where the run stands at a mere corner.
    resume: Option<f64>,
}

impl Drive<'_, '_, '_, '_> {
    fn pieces(&mut self, point: &mut [f64]) -> Result<(), Failure> {
        while self.run.time < self.run.options.to {
            let to = self.run.options.to;
            let jump = self.run.scene().next_jump(self.run.time).filter(|&jump| jump <= to);
            self.piece(jump.unwrap_or(to), jump.is_some(), point)?;
        }
        Ok(())
    }

    /// From here to `stop`, where there may be a jump, or to a crossing before it.
    fn piece(&mut self, stop: f64, jump: bool, point: &mut [f64]) -> Result<(), Failure> {
        if is_at(self.run.time, stop, self.run.time) {
            self.run.reach(stop, point)?;
            if jump {
                self.run.meet(stop);
            }
            return if jump { self.run.settle_at_jump(point) } else { self.run.settle(point) };
        }
        self.set_off(stop, point)?;
        let mut longest: f64 = 0.0;
        while self.run.time < stop {
            let stop_now = self.run.options.step.map_or(stop, |longest| stop.min(self.run.time + longest));
            self.radau.step(&mut *self.shared.borrow_mut().0, stop_now)?;
            self.run.counts.steps += 1;
            let reached = self.radau.time();
            let end = if is_at(reached, stop, self.radau.start()) { stop } else { reached };
            let (end, crossing) = self.exact_crossing(end)?;
            if let Some((time, switch)) = crossing {
                return self.cross(time, switch, point);
            }
            longest = longest.max(end - self.run.time);
            self.write_end(point);
            self.run.reach(end, point)?;
            self.samples_before(end)?;
            if jump && end == stop {
                self.run.meet(stop);
                self.run.settle_at_jump(point)?;
                self.resume = self.is_corner(point).then(|| longest.max(self.radau.next_step()));
            } else {
                self.run.settle(point)?;
            }
            if self.tolerances.watch(self.radau.state()) {
                self.take_tolerances();
            }
        }
        Ok(())
    }

    /// Starts the method where the run stands, or goes on with it over a corner.
    fn set_off(&mut self, stop: f64, point: &[f64]) -> Result<(), Failure> {
        let (time, (y, yp)) = (self.run.time, halves(point));
        let longest = (stop - time).min(self.run.options.step.unwrap_or(f64::INFINITY));
        if let Some(step) = self.resume.take() {
            self.radau.resume(time, y, yp, step.min(longest));
            return Ok(());
        }
        self.tolerances.guess(&mut *self.shared.borrow_mut().0, time, (y, yp), stop - time)?;
        self.take_tolerances();
        let moved = self.radau.rates_alone(&mut *self.shared.borrow_mut().0, time, y, yp)?;
        let (size, speed) = (self.tolerances.norm(y, y), self.tolerances.norm(&moved, y));
        let step = if size < 1e-5 || speed < 1e-5 { UNKNOWN * longest } else { CAREFUL * size / speed };
        self.radau.restart(time, y, yp, step.min(longest));
        Ok(())
    }

    /// Makes the method follow the tolerances, and says what they are.
    fn take_tolerances(&mut self) {
        self.radau.set_tolerances(self.tolerances.relative(), self.tolerances.absolute());
        self.run.tell_tolerances(self.tolerances.magnitudes(), self.tolerances.absolute());
    }

    /// Whether the jump left the unknowns alone and the step that ended there would not have told their rates from its own.
    fn is_corner(&self, point: &[f64]) -> bool {
        let (y, yp) = halves(point);
        let mut jump: Vec<f64> = yp.iter().zip(self.radau.rates()).map(|(after, before)| after - before).collect();
        self.radau.forget_algebraic(&mut jump);
        let length = self.radau.time() - self.radau.start();
        y == self.radau.state() && self.tolerances.norm(&jump, y) * length <= 1.0
    }

    /// Writes the end of the last step.
    fn write_end(&self, point: &mut [f64]) {
        let (y, yp) = halves_mut(point);
        y.copy_from_slice(self.radau.state());
        yp.copy_from_slice(self.radau.rates());
    }

    /// The first crossing of a switching function in the step that ends at `end`, which it is, and where the step ends now:
    /// it is made again to just beyond the crossing.
    fn exact_crossing(&mut self, mut end: f64) -> Result<(f64, Option<(f64, usize)>), Failure> {
        let mut crossing = self.crossing(end)?;
        for margin in MARGINS {
            let Some((time, _)) = crossing else { break };
            let beyond = time + margin * (time - self.run.time);
            if beyond >= end || !self.radau.shorten(&mut *self.shared.borrow_mut().0, beyond) {
                break;
            }
            end = beyond;
            crossing = self.crossing(end)?;
        }
        Ok((end, crossing))
    }

    /// The first crossing of a switching function in the step that ends at `end`, by its polynomial.
    fn crossing(&mut self, end: f64) -> Result<Option<(f64, usize)>, Failure> {
        let (shared, radau, point) = (self.shared, &self.radau, &mut self.inside);
        first_crossing(&mut self.run.sides, self.run.time, end, |sides, t| {
            let (y, yp) = halves_mut(point);
            radau.between(t, y);
            radau.rates_between(t, yp);
            sides.crossed(&mut *shared.borrow_mut(), t, point)
        })
    }

    /// Goes back to a crossing inside the last step and over it.
    fn cross(&mut self, time: f64, switch: usize, point: &mut [f64]) -> Result<(), Failure> {
        if self.chatter.is_one(time) {
            return Err(Failure::Chattering { time, what: self.shared.borrow().switch_name(switch) });
        }
        self.write_inside(time);
        point.copy_from_slice(&self.inside);
        self.run.reach(time, point)?;
        self.samples_before(time)?;
        self.run.counts.switches += 1;
        self.run.settle_at_jump(point)
    }

    /// Samples of the grid inside the last step, before `end`.
    fn samples_before(&mut self, end: f64) -> Result<(), Failure> {
        while let Some(t) = self.run.sample_before(end) {
            self.write_inside(t);
            self.run.record(t, t, &self.inside)?;
        }
        Ok(())
    }

    /// Writes the point at a time inside the last step: that of a step to there, or by the polynomial if there is none.
    fn write_inside(&mut self, t: f64) {
        let (y, yp) = halves_mut(&mut self.inside);
        if !self.radau.visit(&mut *self.shared.borrow_mut().0, t, y, yp) {
            self.radau.between(t, y);
            self.radau.rates_between(t, yp);
        }
    }
}
