//! Dimensions and the domains that they tell apart.

use std::fmt;

/// Exponents of m, kg, s, A, K, mol, cd, each in sixtieths, so that usual roots stay exact. Angles have none.
///
/// ```
/// use halfarrow_compiler::unit::Dimension;
/// let force = Dimension::of(1, 1, -2, 0);
/// assert_eq!(force.times(Dimension::of(1, 0, -1, 0)), Dimension::WATT);
/// assert_eq!(force.to_string(), "N");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Dimension(pub [i32; 7]);

/// One whole exponent in a [`Dimension`].
pub const WHOLE: i32 = 60;

impl Dimension {
    /// A pure number.
    pub const NONE: Dimension = Dimension([0; 7]);
    /// Of a power, effort times flow.
    pub const WATT: Dimension = Dimension::of(2, 1, -3, 0);
    /// Of an energy.
    pub const JOULE: Dimension = Dimension::of(2, 1, -2, 0);
    /// Of a time.
    pub const SECOND: Dimension = Dimension::of(0, 0, 1, 0);

    /// Whole exponents of m, kg, s, A.
    pub const fn of(m: i32, kg: i32, s: i32, a: i32) -> Dimension {
        Dimension([m * WHOLE, kg * WHOLE, s * WHOLE, a * WHOLE, 0, 0, 0])
    }

    /// Of a product. Exponents beyond the range of `i32` stay at its end.
    pub fn times(self, other: Dimension) -> Dimension {
        let mut sum = self.0;
        sum.iter_mut().zip(other.0).for_each(|(a, b)| *a = a.saturating_add(b));
        Dimension(sum)
    }

    /// Of a quotient.
    pub fn over(self, other: Dimension) -> Dimension {
        self.times(other.inverse())
    }

    /// Of one over it.
    pub fn inverse(self) -> Dimension {
        Dimension(self.0.map(i32::saturating_neg))
    }

    /// Of a power, the exponent in sixtieths; `None` if an exponent of the result is no multiple of 1/60 or absurd.
    pub fn power(self, sixtieths: i32) -> Option<Dimension> {
        if sixtieths == WHOLE {
            return Some(self);
        }
        let mut result = [0; 7];
        for (r, a) in result.iter_mut().zip(self.0).filter(|(_, a)| *a != 0) {
            let product = i64::from(a) * i64::from(sixtieths);
            if product % i64::from(WHOLE) != 0 {
                return None;
            }
            *r = i32::try_from(product / i64::from(WHOLE)).ok()?;
        }
        Some(Dimension(result))
    }

    /// Whether it is that of a pure number or an angle.
    pub fn is_none(self) -> bool {
        self == Dimension::NONE
    }
}

/// Physical domains of bonds, told apart by the dimensions of effort and flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Domain {
    /// Force and velocity.
    Translation,
    /// Torque and angular velocity.
    Rotation,
    /// Voltage and current.
    Electricity,
    /// Magnetomotive force and rate of flux.
    Magnetism,
    /// Pressure and volume flow.
    Hydraulics,
    /// Temperature and flow of entropy.
    Heat,
    /// Chemical potential and molar flow.
    Chemistry,
}

impl Domain {
    /// All of them.
    pub const ALL: [Domain; 7] = [
        Domain::Translation,
        Domain::Rotation,
        Domain::Electricity,
        Domain::Magnetism,
        Domain::Hydraulics,
        Domain::Heat,
        Domain::Chemistry,
    ];

    /// The domain whose efforts have this dimension.
    pub fn of_effort(effort: Dimension) -> Option<Domain> {
        Domain::ALL.into_iter().find(|d| d.effort() == effort)
    }

    /// The domain whose flows have this dimension.
    pub fn of_flow(flow: Dimension) -> Option<Domain> {
        Domain::ALL.into_iter().find(|d| d.flow() == flow)
    }

    /// Dimension of its efforts.
    pub fn effort(self) -> Dimension {
        match self {
            Domain::Translation => Dimension::of(1, 1, -2, 0),
            Domain::Rotation => Dimension::JOULE,
            Domain::Electricity => Dimension::of(2, 1, -3, -1),
            Domain::Magnetism => Dimension::of(0, 0, 0, 1),
            Domain::Hydraulics => Dimension::of(-1, 1, -2, 0),
            Domain::Heat => Dimension([0, 0, 0, 0, WHOLE, 0, 0]),
            Domain::Chemistry => Dimension([2 * WHOLE, WHOLE, -2 * WHOLE, 0, 0, -WHOLE, 0]),
        }
    }

    /// Dimension of its flows.
    pub fn flow(self) -> Dimension {
        Dimension::WATT.over(self.effort())
    }

    /// Its efforts and flows, in words and units.
    pub fn words(self) -> [(&'static str, &'static str); 2] {
        match self {
            Domain::Translation => [("force", "N"), ("velocity", "m/s")],
            Domain::Rotation => [("torque", "N.m"), ("angular velocity", "rad/s")],
            Domain::Electricity => [("voltage", "V"), ("current", "A")],
            Domain::Magnetism => [("magnetomotive force", "A"), ("rate of flux", "V")],
            Domain::Hydraulics => [("pressure", "Pa"), ("volume flow", "m3/s")],
            Domain::Heat => [("temperature", "K"), ("entropy flow", "W/K")],
            Domain::Chemistry => [("chemical potential", "J/mol"), ("molar flow", "mol/s")],
        }
    }
}

impl fmt::Display for Domain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Domain::Translation => "translation",
            Domain::Rotation => "rotation",
            Domain::Electricity => "electricity",
            Domain::Magnetism => "magnetism",
            Domain::Hydraulics => "hydraulics",
            Domain::Heat => "heat",
            Domain::Chemistry => "chemistry",
        })
    }
}

/// Dimensions that people know by name, in units that say it shortest; the first one of a dimension is its name.
const NAMED: [(&str, Dimension); 45] = [
    ("1", Dimension::NONE),
    ("m", Dimension::of(1, 0, 0, 0)),
    ("kg", Dimension::of(0, 1, 0, 0)),
    ("s", Dimension::of(0, 0, 1, 0)),
    ("A", Dimension::of(0, 0, 0, 1)),
    ("m2", Dimension::of(2, 0, 0, 0)),
    ("m3", Dimension::of(3, 0, 0, 0)),
    ("1/m", Dimension::of(-1, 0, 0, 0)),
    ("1/s", Dimension::of(0, 0, -1, 0)),
    ("m/s", Dimension::of(1, 0, -1, 0)),
    ("m/s2", Dimension::of(1, 0, -2, 0)),
    ("N", Dimension::of(1, 1, -2, 0)),
    ("N.m", Dimension::of(2, 1, -2, 0)),
    ("N.s", Dimension::of(1, 1, -1, 0)),
    ("N.m.s", Dimension::of(2, 1, -1, 0)),
    ("N/m", Dimension::of(0, 1, -2, 0)),
    ("m/N", Dimension::of(0, -1, 2, 0)),
    ("N.s/m", Dimension::of(0, 1, -1, 0)),
    ("m/(N.s)", Dimension::of(0, -1, 1, 0)),
    ("N.s2/m2", Dimension::of(-1, 1, 0, 0)),
    ("N.s3/m3", Dimension::of(-2, 1, 1, 0)),
    ("1/(N.m)", Dimension::of(-2, -1, 2, 0)),
    ("1/(N.m.s)", Dimension::of(-2, -1, 1, 0)),
    ("kg.m2", Dimension::of(2, 1, 0, 0)),
    ("kg/m3", Dimension::of(-3, 1, 0, 0)),
    ("W", Dimension::of(2, 1, -3, 0)),
    ("V", Dimension::of(2, 1, -3, -1)),
    ("ohm", Dimension::of(2, 1, -3, -2)),
    ("S", Dimension::of(-2, -1, 3, 2)),
    ("F", Dimension::of(-2, -1, 4, 2)),
    ("1/F", Dimension::of(2, 1, -4, -2)),
    ("H", Dimension::of(2, 1, -2, -2)),
    ("1/H", Dimension::of(-2, -1, 2, 2)),
    ("C", Dimension::of(0, 0, 1, 1)),
    ("V.s", Dimension::of(2, 1, -2, -1)),
    ("T", Dimension::of(0, 1, -2, -1)),
    ("Pa", Dimension::of(-1, 1, -2, 0)),
    ("Pa.s", Dimension::of(-1, 1, -1, 0)),
    ("m3/s", Dimension::of(3, 0, -1, 0)),
    ("m3/Pa", Dimension::of(4, -1, 2, 0)),
    ("Pa/m3", Dimension::of(-4, 1, -2, 0)),
    ("Pa.s/m3", Dimension::of(-4, 1, -1, 0)),
    ("Pa.s2/m3", Dimension::of(-4, 1, 0, 0)),
    ("W/K", Dimension([2 * WHOLE, WHOLE, -3 * WHOLE, 0, -WHOLE, 0, 0])),
    ("J/K", Dimension([2 * WHOLE, WHOLE, -2 * WHOLE, 0, -WHOLE, 0, 0])),
];

/// The usual name, else a product of base units. What it prints can be read again.
impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match NAMED.iter().find(|(_, dimension)| dimension == self) {
            Some((name, _)) => f.write_str(name),
            None => f.write_str(&factors(self.0.iter().copied().zip(BASE))),
        }
    }
}

const BASE: [&str; 7] = ["m", "kg", "s", "A", "K", "mol", "cd"];

/// The usual name with the angle in it: `rad/s`, `N.m/rad`, `N.m.s/rad`.
pub(super) fn with_angle(dimension: Dimension, angle: i32) -> String {
    match (dimension.to_string().as_str(), angle) {
        (plain, 0) => plain.to_owned(),
        ("1", _) => factors([(angle, "rad")].into_iter()),
        (plain, WHOLE) if plain.starts_with("1/") => format!("rad{}", &plain[1..]),
        (plain, MINUS_WHOLE) if !plain.contains('/') => format!("{plain}/rad"),
        _ => {
            let base = dimension.0.iter().copied().zip(BASE);
            factors(base.chain([(angle, "rad")]))
        }
    }
}

const MINUS_WHOLE: i32 = -WHOLE;

fn factors<'a>(powers: impl Iterator<Item = (i32, &'a str)>) -> String {
    let (mut over, mut under) = (Vec::new(), Vec::new());
    for (exponent, symbol) in powers {
        let list = if exponent > 0 { &mut over } else { &mut under };
        if exponent != 0 {
            list.push(factor(symbol, exponent.unsigned_abs()));
        }
    }
    let top = if over.is_empty() { "1".to_owned() } else { over.join(".") };
    match under.len() {
        0 => top,
        1 => format!("{top}/{}", under[0]),
        _ => format!("{top}/({})", under.join(".")),
    }
}

fn factor(symbol: &str, sixtieths: u32) -> String {
    let whole = WHOLE as u32;
    match (sixtieths / whole, sixtieths % whole) {
        (1, 0) => symbol.to_owned(),
        (n, 0) => format!("{symbol}{n}"),
        _ => {
            let (mut n, mut d) = (sixtieths, whole);
            for prime in [2, 2, 3, 5] {
                if n % prime == 0 && d % prime == 0 {
                    (n, d) = (n / prime, d / prime);
                }
            }
            format!("{symbol}^({n}/{d})")
        }
    }
}
