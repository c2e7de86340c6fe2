//! The units that are known. Source: [SI], [SP811].

use super::WHOLE;

/// A unit with a name of its own.
pub(super) struct Symbol {
    pub name: &'static str,
    /// Factor to SI base units: a decimal, or two with a `/` between them; the radian counts as 1.
    pub factor: &'static str,
    /// Power of pi in the factor.
    pub pi: i32,
    /// Whole exponents of m, kg, s, A, K, mol, cd and rad.
    pub powers: [i32; 8],
    /// The prefixes that it takes.
    pub prefixes: &'static str,
    /// What is added in SI units.
    pub offset: &'static str,
}

/// Prefixes and their powers of ten.
pub(super) const PREFIXES: [(&str, i32); 13] = [
    ("f", -15),
    ("p", -12),
    ("n", -9),
    ("u", -6),
    ("µ", -6),
    ("μ", -6),
    ("m", -3),
    ("c", -2),
    ("d", -1),
    ("h", 2),
    ("k", 3),
    ("M", 6),
    ("G", 9),
];

/// All usual prefixes for quantities of any size; `u` stands for the Greek letters too.
const ANY: &str = "fpnumkMG";
/// For what is never small.
const LARGE: &str = "mkMG";

const fn unit(name: &'static str, factor: &'static str, powers: [i32; 8], prefixes: &'static str) -> Symbol {
    Symbol { name, factor, pi: 0, powers, prefixes, offset: "0" }
}

/// Powers of m, kg, s, A alone.
const fn mksa(m: i32, kg: i32, s: i32, a: i32) -> [i32; 8] {
    [m, kg, s, a, 0, 0, 0, 0]
}

const NUMBER: [i32; 8] = [0; 8];
const ANGLE: [i32; 8] = [0, 0, 0, 0, 0, 0, 0, 1];
const TURNING: [i32; 8] = [0, 0, -1, 0, 0, 0, 0, 1];
const KELVIN: [i32; 8] = [0, 0, 0, 0, 1, 0, 0, 0];
const MOLE: [i32; 8] = [0, 0, 0, 0, 0, 1, 0, 0];
const CANDELA: [i32; 8] = [0, 0, 0, 0, 0, 0, 1, 0];

/// All symbols.
pub(super) const SYMBOLS: &[Symbol] = &[
    unit("m", "1", mksa(1, 0, 0, 0), "fpnumcdk"),
    unit("g", "0.001", mksa(0, 1, 0, 0), "numkM"),
    unit("s", "1", mksa(0, 0, 1, 0), "fpnumk"),
    unit("A", "1", mksa(0, 0, 0, 1), "fpnumkM"),
    unit("K", "1", KELVIN, "numkM"),
    unit("mol", "1", MOLE, "numk"),
    unit("cd", "1", CANDELA, "mk"),
    unit("N", "1", mksa(1, 1, -2, 0), "numkMG"),
    unit("J", "1", mksa(2, 1, -2, 0), ANY),
    unit("W", "1", mksa(2, 1, -3, 0), ANY),
    unit("Pa", "1", mksa(-1, 1, -2, 0), "numhkMG"),
    unit("V", "1", mksa(2, 1, -3, -1), "fpnumkM"),
    unit("ohm", "1", mksa(2, 1, -3, -2), "numkMG"),
    unit("Ohm", "1", mksa(2, 1, -3, -2), "numkMG"),
    unit("Ω", "1", mksa(2, 1, -3, -2), "numkMG"),
    unit("\u{2126}", "1", mksa(2, 1, -3, -2), "numkMG"),
    unit("S", "1", mksa(-2, -1, 3, 2), "pnumkM"),
    unit("F", "1", mksa(-2, -1, 4, 2), "fpnumk"),
    unit("H", "1", mksa(2, 1, -2, -2), "pnumk"),
    unit("C", "1", mksa(0, 0, 1, 1), "fpnumkM"),
    unit("T", "1", mksa(0, 1, -2, -1), "pnumk"),
    unit("Wb", "1", mksa(2, 1, -2, -1), "numk"),
    unit("Hz", "1", mksa(0, 0, -1, 0), LARGE),
    unit("lm", "1", CANDELA, "k"),
    unit("lx", "1", [-2, 0, 0, 0, 0, 0, 1, 0], "k"),
    unit("rad", "1", ANGLE, "num"),
    unit("sr", "1", NUMBER, ""),
    Symbol { pi: 1, ..unit("deg", "1/180", ANGLE, "m") },
    Symbol { pi: 1, ..unit("°", "1/180", ANGLE, "") },
    Symbol { pi: 1, ..unit("rev", "2", ANGLE, "") },
    Symbol { pi: 1, ..unit("rpm", "1/30", TURNING, "k") },
    Symbol { offset: "273.15", ..unit("degC", "1", KELVIN, "") },
    Symbol { offset: "273.15", ..unit("°C", "1", KELVIN, "") },
    Symbol { offset: "45967/180", ..unit("degF", "5/9", KELVIN, "") },
    Symbol { offset: "45967/180", ..unit("°F", "5/9", KELVIN, "") },
    unit("%", "0.01", NUMBER, ""),
    unit("ppm", "0.000001", NUMBER, ""),
    unit("min", "60", mksa(0, 0, 1, 0), ""),
    unit("h", "3600", mksa(0, 0, 1, 0), ""),
    unit("d", "86400", mksa(0, 0, 1, 0), ""),
    unit("L", "0.001", mksa(3, 0, 0, 0), "umcd"),
    unit("l", "0.001", mksa(3, 0, 0, 0), "umcd"),
    unit("t", "1000", mksa(0, 1, 0, 0), "k"),
    unit("bar", "100000", mksa(-1, 1, -2, 0), "mk"),
    unit("atm", "101325", mksa(-1, 1, -2, 0), ""),
    unit("psi", "8896443230521/1290320000", mksa(-1, 1, -2, 0), "k"),
    unit("Wh", "3600", mksa(2, 1, -2, 0), "mkMG"),
    unit("Ah", "3600", mksa(0, 0, 1, 1), "mk"),
    unit("eV", "1.602176634e-19", mksa(2, 1, -2, 0), "mkMG"),
    unit("cal", "4.184", mksa(2, 1, -2, 0), "k"),
    unit("P", "0.1", mksa(-1, 1, -1, 0), "mc"),
    unit("St", "0.0001", mksa(2, 0, -1, 0), "c"),
    unit("kgf", "9.80665", mksa(1, 1, -2, 0), ""),
    unit("lb", "0.45359237", mksa(0, 1, 0, 0), ""),
    unit("lbf", "4.4482216152605", mksa(1, 1, -2, 0), ""),
    unit("in", "0.0254", mksa(1, 0, 0, 0), ""),
    unit("ft", "0.3048", mksa(1, 0, 0, 0), ""),
    unit("mi", "1609.344", mksa(1, 0, 0, 0), ""),
    unit("mph", "0.44704", mksa(1, 0, -1, 0), ""),
    unit("kmh", "5/18", mksa(1, 0, -1, 0), ""),
    unit("PS", "735.49875", mksa(2, 1, -3, 0), ""),
    unit("hp", "745.69987158227022", mksa(2, 1, -3, 0), ""),
];

/// Exponents of a symbol in sixtieths: those of the dimension and that of the radian.
pub(super) fn sixtieths(symbol: &Symbol) -> ([i32; 7], i32) {
    let [m, kg, s, a, k, mol, cd, rad] = symbol.powers.map(|p| p * WHOLE);
    ([m, kg, s, a, k, mol, cd], rad)
}
