//! The clock of a run in real time, which the caller has.

/// A clock in s, whose zero is anywhere.
pub trait Clock {
    /// The time.
    fn now(&mut self) -> f64;
    /// Returns at that time, or at once if it is over.
    fn wait(&mut self, until: f64);
    /// The same; while the clock would only spin, it offers the time that is left, in s, again and again.
    fn wait_busily(&mut self, until: f64, offer: &mut dyn FnMut(f64)) {
        let _ = offer;
        self.wait(until);
    }
}
