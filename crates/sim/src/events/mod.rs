//! Switching functions: which side they are on, and where they change it.

mod chatter;
mod locate;

pub(crate) use chatter::Chatter;
pub(crate) use locate::first_crossing;

use crate::Failure;
use crate::scene::Scene;

/// The side of each switching function during the present mode.
pub(crate) struct Sides {
    held: Vec<bool>,
    values: Vec<f64>,
}

impl Sides {
    pub(crate) fn new(switches: usize) -> Sides {
        Sides { held: vec![false; switches], values: vec![0.0; switches] }
    }

    /// Whether there is nothing to watch.
    pub(crate) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Values of the switching functions where they were asked for last.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Takes the sides at `(t, x)`, as the system does in `cross_jump`.
    pub(crate) fn take(&mut self, scene: &mut dyn Scene, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.is_empty() {
            return Ok(());
        }
        scene.switch_values(t, x, &mut self.values)?;
        self.held.iter_mut().zip(&self.values).for_each(|(held, value)| *held = *value > 0.0);
        Ok(())
    }

    /// The first switching function that at `(t, x)` is on another side than that held; `None` if all keep theirs.
    pub(crate) fn crossed(&mut self, scene: &mut dyn Scene, t: f64, x: &[f64]) -> Result<Option<usize>, Failure> {
        if self.is_empty() {
            return Ok(None);
        }
        scene.switch_values(t, x, &mut self.values)?;
        if let Some(switch) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: t, what: scene.switch_name(switch) });
        }
        Ok(self.held.iter().zip(&self.values).position(|(&held, &value)| held != (value > 0.0)))
    }
}
