//! Axes with round ticks.

/// An axis: a range of values spread over a length.
pub struct Axis {
    low: f64,
    high: f64,
    length: f64,
    /// Values are written in units of ten to this power.
    exponent: i32,
    /// Equal ratios have equal lengths.
    log: bool,
    /// Round values in the range.
    pub ticks: Vec<Tick>,
    /// Places of values between the ticks that have a fine line but no label, in px.
    pub between: Vec<f64>,
}

/// A marked value.
pub struct Tick {
    /// Where, from the low end, in px.
    pub place: f64,
    /// What is written there.
    pub label: String,
}

impl Axis {
    /// An axis for these values over `length` px, with a little air at both ends if `air`. Values that are not finite
    /// do not count; without any the axis runs from 0 to 1.
    pub fn new(values: impl Iterator<Item = f64>, length: f64, air: bool) -> Axis {
        let range = values.filter(|x| x.is_finite()).fold(None, |range: Option<[f64; 2]>, x| {
            Some(range.map_or([x, x], |[low, high]| [low.min(x), high.max(x)]))
        });
        let [mut low, mut high] = range.unwrap_or([0.0, 1.0]).map(|x| x.clamp(-1e300, 1e300));
        let greatest = low.abs().max(high.abs());
        if high - low <= (1e-9 * greatest).max(1e-290) {
            let half = if greatest > 1e-280 { 0.05 * greatest } else { 1.0 };
            (low, high) = (low - half, high + half);
        } else if air {
            let rim = 0.05 * (high - low);
            (low, high) = (low - rim, high + rim);
        }
        let mut axis = Axis { low, high, length, exponent: 0, log: false, ticks: Vec::new(), between: Vec::new() };
        axis.mark();
        axis
    }
    /// A logarithmic axis for these values over `length` px. Values that are not finite and above zero do not count;
    /// without any the axis runs from 1 to 10.
    pub fn logarithmic(values: impl Iterator<Item = f64>, length: f64, air: bool) -> Axis {
        let range = values.filter(|x| x.is_finite() && *x > 0.0).fold(None, |range: Option<[f64; 2]>, x| {
            Some(range.map_or([x, x], |[low, high]| [low.min(x), high.max(x)]))
        });
        let [mut low, mut high] = range.unwrap_or([1.0, 10.0]).map(libm::log10);
        if high - low < 0.3 {
            (low, high) = (low - 0.5, high + 0.5);
        } else if air {
            let rim = 0.05 * (high - low);
            (low, high) = (low - rim, high + rim);
        }
        let mut axis = Axis { low, high, length, exponent: 0, log: true, ticks: Vec::new(), between: Vec::new() };
        axis.mark_decades();
        axis
    }
    /// An axis for angles in degrees over `length` px, with ticks at round parts of a turn.
    pub fn angles(values: impl Iterator<Item = f64>, length: f64) -> Axis {
        let (low, high) = values
            .filter(|x| x.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (low, high) = if low <= high { (low, high) } else { (-90.0, 90.0) };
        let steps = [15.0, 30.0, 45.0, 90.0, 180.0, 360.0, 720.0, 3600.0];
        let step = steps.into_iter().find(|s| (high - low) / s <= 6.0).unwrap_or(36_000.0);
        let [first, last] = [(low / step - 1e-9).floor(), (high / step + 1e-9).ceil()];
        let last = if last > first { last } else { first + 1.0 };
        let rim = 0.04 * (last - first) * step;
        let [low, high] = [first * step - rim, last * step + rim];
        let mut axis = Axis { low, high, length, exponent: 0, log: false, ticks: Vec::new(), between: Vec::new() };
        for k in 0..=((last - first) as usize) {
            let value = (first + k as f64) * step;
            axis.ticks.push(Tick { place: axis.place(value), label: format!("{value:.0}").replace('-', "−") });
        }
        axis
    }
    /// Widens the axis about its middle by a factor of at least 1.
    pub fn widened(mut self, factor: f64) -> Axis {
        let (middle, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low) * factor.max(1.0));
        (self.low, self.high) = (middle - half, middle + half);
        self.ticks.clear();
        self.mark();
        self
    }
    /// From the low to the high end.
    pub fn span(&self) -> f64 {
        self.high - self.low
    }
    /// Where a value stands, from the low end, in px.
    pub fn place(&self, x: f64) -> f64 {
        let x = if self.log { libm::log10(x.max(f64::MIN_POSITIVE)) } else { x };
        self.length * ((x - self.low) / (self.high - self.low)).clamp(-1.0, 2.0)
    }
    /// What is written behind the name: ` in N`, ` in 10⁻⁶ m`, ` / 10⁶` without a unit, nothing.
    pub fn unit(&self, unit: &str) -> String {
        let power = format!("10{}", raised(self.exponent));
        match (self.exponent, unit) {
            (0, "") => String::new(),
            (0, unit) => format!(" in {unit}"),
            (_, "") => format!(" / {power}"),
            (_, unit) => format!(" in {power} {unit}"),
        }
    }
    /// Decades with labels, as many as there is room for, and fine lines between them; over less than a decade 1, 2, 5.
    fn mark_decades(&mut self) {
        let decades = self.high - self.low;
        let [first, last] = [(self.low - 1e-9).ceil() as i32, (self.high + 1e-9).floor() as i32];
        let every = (decades * 34.0 / self.length).ceil().max(1.0) as i32;
        for power in first - 1..=last {
            for digit in 1..=9 {
                let log = f64::from(power) + libm::log10(f64::from(digit));
                if log < self.low - 1e-9 || log > self.high + 1e-9 {
                    continue;
                }
                let place = self.length * (log - self.low) / decades;
                let few = last - first < 2 && matches!(digit, 2 | 5);
                if digit == 1 && power.rem_euclid(every) == 0 || few {
                    let label = match (digit, power) {
                        (_, -2..=3) => format!("{}", f64::from(digit) * ten_to(power)),
                        (1, _) => format!("10{}", raised(power)),
                        _ => format!("{digit}·10{}", raised(power)),
                    };
                    self.ticks.push(Tick { place, label });
                } else if digit == 1 || every == 1 && decades < 7.0 {
                    self.between.push(place);
                }
            }
        }
    }
    fn mark(&mut self) {
        let (step, power) = round_step((self.high - self.low) * 70.0_f64.min(self.length / 5.0) / self.length);
        let greatest = decade(self.low.abs().max(self.high.abs()));
        self.exponent = if (-2..=4).contains(&greatest) { 0 } else { greatest };
        let decimals = (self.exponent - power).max(0) as usize;
        let unit = ten_to(self.exponent);
        let first = (self.low / step).ceil();
        let count = ((self.high / step).floor() - first).clamp(0.0, 50.0) as usize;
        for k in 0..=count {
            let value = (first + k as f64) * step;
            let label = format!("{:.decimals$}", value / unit).replace('-', "−");
            let zero = label.chars().all(|c| matches!(c, '0' | '.' | '−'));
            let label = if zero { "0".to_string() } else { label };
            self.ticks.push(Tick { place: self.place(value), label });
        }
    }
}

/// The least of 1, 2, 5 times a power of ten that is not below `least`, and that power.
fn round_step(least: f64) -> (f64, i32) {
    let power = decade(least);
    let choices = [(1.0, power), (2.0, power), (5.0, power), (1.0, power + 1)];
    let step = |(digit, power): (f64, i32)| (digit * ten_to(power), power);
    choices.map(step).into_iter().find(|s| s.0 >= least * (1.0 - 1e-12)).unwrap_or((least, power))
}

/// The power of ten at or below a positive number; 0 for 0. Read from its decimal text, exact on every machine.
fn decade(x: f64) -> i32 {
    let text = format!("{x:e}");
    text.split_once('e').and_then(|(_, power)| power.parse().ok()).filter(|_| x > 0.0).unwrap_or(0)
}

/// Ten to a power, correctly rounded.
fn ten_to(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(f64::INFINITY)
}

fn raised(power: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    power.to_string().chars().map(digit).collect()
}
