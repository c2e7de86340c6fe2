//! Random models as statements: what a user may write and a generator of plain elements does not. Fields of two ports,
//! laws of zero and of infinite slope, laws that cannot be inverted, constraints of flows and of displacements, moduli
//! of time and of displacements, sources that jump.

use std::fmt::Write;

/// A small generator of random numbers (splitmix64): the same models on every machine.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0xd134_2543_de82_ef95) ^ 0x2545_f491_4f6c_dd1d)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `n`, which is not 0.
    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// True in so many of a hundred cases.
    fn percent(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    /// A number between 0.3 and 3 with three digits, or 1 or 2 itself.
    fn size(&mut self) -> String {
        if self.percent(25) {
            return self.of(&["1", "2", "0.5"]).to_string();
        }
        format!("{:.3}", 0.3 * 10f64.powf((self.below(1001) as f64) / 1000.0))
    }

    fn signed(&mut self) -> String {
        let size = self.size();
        if self.percent(25) { format!("-{size}") } else { size }
    }
}

/// A model as statements, each on a line of its own, so that it can be made smaller by leaving lines out.
#[derive(Clone)]
pub struct Wild {
    pub lines: Vec<String>,
}

impl Wild {
    pub fn text(&self) -> String {
        let mut text = "model Wild\n".to_string();
        for line in &self.lines {
            let _ = writeln!(text, "{line}");
        }
        text
    }

    /// A random model; the same seed gives the same.
    pub fn new(seed: u64) -> Wild {
        let mut make =
            Maker { dice: Random::new(seed), lines: Vec::new(), zeros: 0, ones: 0, parts: 0, angles: Vec::new() };
        make.junctions();
        make.elements();
        make.constraints();
        make.sources_at_least_one_storage();
        Wild { lines: make.lines }
    }
}

struct Maker {
    dice: Random,
    lines: Vec<String>,
    zeros: usize,
    ones: usize,
    parts: usize,
    /// Integrated flows of 1-junctions that exist.
    angles: Vec<usize>,
}

impl Maker {
    fn say(&mut self, line: String) {
        self.lines.push(line);
    }

    fn part(&mut self) -> usize {
        self.parts += 1;
        self.parts
    }

    /// A junction by its number among all.
    fn name(&self, junction: usize) -> String {
        if junction < self.zeros { format!("z{junction}") } else { format!("o{}", junction - self.zeros) }
    }

    fn any(&mut self) -> String {
        let junction = self.dice.below(self.zeros + self.ones);
        self.name(junction)
    }

    /// A tree of junctions, and some bonds that close rings.
    fn junctions(&mut self) {
        (self.zeros, self.ones) = (self.dice.below(4), 1 + self.dice.below(4));
        for i in 0..self.zeros {
            self.say(format!("0:z{i}"));
        }
        for i in 0..self.ones {
            self.say(format!("1:o{i}"));
        }
        let all = self.zeros + self.ones;
        for i in 1..all {
            let other = self.dice.below(i);
            self.join(i, other);
        }
        while all > 2 && self.dice.percent(35) {
            let (a, b) = (self.dice.below(all), self.dice.below(all));
            if a != b {
                self.join(a, b);
            }
        }
    }

    /// A bond, transformer or gyrator between two junctions.
    fn join(&mut self, a: usize, b: usize) {
        let (mut from, mut to) = (self.name(a), self.name(b));
        if self.dice.percent(50) {
            std::mem::swap(&mut from, &mut to);
        }
        let n = self.part();
        let line = match self.dice.below(10) {
            0..=4 => format!("{from} -> {to} as b{n}"),
            5..=7 => {
                let m = self.modulus();
                format!("{from} -> TF:t{n}({m}) -> {to}")
            }
            _ => {
                let m = self.modulus();
                format!("{from} -> GY:g{n}({m}) -> {to}")
            }
        };
        self.say(line);
    }

    fn modulus(&mut self) -> String {
        let a = self.dice.signed();
        match self.dice.below(10) {
            0 => format!("{a} + 0.2*sin(t)"),
            1 | 2 => {
                let j = self.dice.below(self.ones);
                if !self.angles.contains(&j) {
                    self.angles.push(j);
                    let from = self.dice.signed();
                    self.say(format!("state phi{j}' = o{j}.f from {from}"));
                }
                let f = self.dice.of(&["cos", "sin", "tanh"]);
                format!("{a} + 0.2*{f}(phi{j})")
            }
            _ => a,
        }
    }

    fn elements(&mut self) {
        let count = 2 + self.dice.below(6);
        for _ in 0..count {
            let (at, n) = (self.any(), self.part());
            let line = match self.dice.below(14) {
                0..=3 => format!("{at} -> I:m{n}({})", self.inertance()),
                4..=6 => format!("{at} -> C:c{n}({})", self.compliance()),
                7..=10 => format!("{at} -> R:r{n}({})", self.resistor()),
                _ => {
                    self.field(n);
                    continue;
                }
            };
            self.say(line);
        }
    }

    fn start(&mut self, letter: char) -> String {
        match self.dice.below(3) {
            0 => format!(", {letter}0 = {}", self.dice.signed()),
            _ => String::new(),
        }
    }

    fn inertance(&mut self) -> String {
        let (a, b) = (self.dice.size(), self.dice.size());
        let start = self.start('p');
        let law = match self.dice.below(8) {
            0 => format!("f = {a}*tanh({b}*p)"),
            1 => format!("f = {a}*p + {b}*p^3"),
            2 => format!("f = {a}*p/sqrt(1 + p^2)"),
            3 => format!("f = {a}*(exp(p) - 1)"),
            _ => a,
        };
        format!("{law}{start}")
    }

    fn compliance(&mut self) -> String {
        let (a, b) = (self.dice.size(), self.dice.size());
        let start = self.start('q');
        let law = match self.dice.below(8) {
            0 => format!("e = {a}*q^3"),
            1 => format!("e = {a}*sinh({b}*q)"),
            2 => format!("e = {a}*q*abs(q)"),
            3 => format!("e = {a}*tanh({b}*q)"),
            _ => format!("k = {a}"),
        };
        format!("{law}{start}")
    }

    fn resistor(&mut self) -> String {
        let (a, b) = (self.dice.size(), self.dice.size());
        match self.dice.below(12) {
            0 => format!("e = {a}*f*abs(f)"),
            1 => format!("f = {a}*sign(e)*sqrt(abs(e))"),
            2 => format!("0 = e - {a}*f - {b}*f^3"),
            3 => format!("e = {a}*tanh({b}*f) + 0.2*f"),
            4 => format!("e = {a}*f^3"),
            5 => format!("f = {a}*(exp(e/{b}) - 1) + 0.1*e"),
            6 => format!("f = {a}*e^3"),
            7 => format!("g = {a}"),
            _ => a,
        }
    }

    /// A field of two ports.
    fn field(&mut self, n: usize) {
        let (a, b, c) = (self.dice.size(), self.dice.size(), self.dice.size());
        let declared = match self.dice.below(6) {
            0 => format!("C:f{n}[a, b](k = [[{a} + {c}, -{c}], [-{c}, {b} + {c}]])"),
            1 => format!("C:f{n}[a, b](energy = {a}*q.a^2/2 + {b}*q.b^2/2 + {c}*q.a^2*q.b^2/4)"),
            2 => format!("I:f{n}[a, b](m = [[{a} + {c}, {c}], [{c}, {b} + {c}]])"),
            3 => format!("R:f{n}[a, b](r = [[{a} + {c}, {c}], [{c}, {b} + {c}]])"),
            4 => format!("R:f{n}[a, b](f.a = {a}*(e.a - e.b) + {c}*e.a, f.b = -{a}*(e.a - e.b) + {b}*e.b)"),
            _ => format!("R:f{n}[a, b](f.a = {a}*sinh(e.a - e.b) + {c}*e.a, f.b = -{a}*sinh(e.a - e.b) + {b}*e.b)"),
        };
        self.say(declared);
        for port in ["a", "b"] {
            let at = self.any();
            self.say(format!("{at} -> f{n}.{port}"));
        }
    }

    fn constraints(&mut self) {
        if self.ones < 2 || !self.dice.percent(25) {
            return;
        }
        let (a, b) = (self.dice.below(self.ones), self.dice.below(self.ones));
        if a == b {
            return;
        }
        let (k, n) = (self.dice.signed(), self.part());
        if self.dice.percent(60) {
            return self.say(format!("constraint k{n}: o{a}.f - {k}*o{b}.f = 0"));
        }
        let from = self.dice.of(&["0.3", "0.7", "-0.4"]);
        self.say(format!("state x{n}' = o{a}.f"));
        self.say(format!("state y{n}' = o{b}.f from {from}"));
        self.say(format!("constraint k{n}: x{n} - {k}*sin(y{n}) = 0"));
    }

    fn sources_at_least_one_storage(&mut self) {
        for _ in 0..self.dice.below(3) {
            let (at, n, a) = (self.any(), self.part(), self.dice.signed());
            let value = match self.dice.below(4) {
                0 => a,
                1 => format!("{a}*sin(3*t)"),
                2 => format!("if t < 0.21 then {a} else -{a}"),
                _ => format!("{a} + 0.5*cos(t)"),
            };
            let kind = if self.dice.percent(70) { "Se" } else { "Sf" };
            self.say(format!("{kind}:s{n}({value}) -> {at}"));
        }
        let (at, n) = (self.any(), self.part());
        self.say(format!("{at} -> I:m{n}(1, p0 = 0.5)"));
    }
}
