//! Symbols of the fields in the place of keywords: of set-valued laws, and of the element of a library part that makes it what
//! it is. They are lines in a box around their middle, all in one width.

use halfarrow_compiler::bond_graph::{BondGraph, Element, Kind, SetValuedLaw};

/// Half the width and height of the box, in px.
const HALF: [f64; 2] = [13.0, 9.0];

/// A symbol: open lines, and areas that are filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Symbol {
    /// What it shows, for tests and those who read the drawing by a program.
    pub name: &'static str,
    /// Lines, as the data of a path in SVG.
    pub lines: &'static str,
    /// Areas, likewise.
    pub areas: &'static str,
}

const fn symbol(name: &'static str, lines: &'static str, areas: &'static str) -> Symbol {
    Symbol { name, lines, areas }
}

const DIODE: Symbol = symbol("diode", "M-13 0H-6M7 0H13M7 -7V7", "M-6 -7L7 0L-6 7Z");
const SWITCH_OPEN: Symbol = symbol(
    "open switch",
    "M-13 2H-7L5 -7M7 2H13",
    "M-9 2a2 2 0 1 0 4 0a2 2 0 1 0 -4 0ZM5 2a2 2 0 1 0 4 0a2 2 0 1 0 -4 0Z",
);
const SWITCH_CLOSED: Symbol =
    symbol("closed switch", "M-13 2H13", "M-9 2a2 2 0 1 0 4 0a2 2 0 1 0 -4 0ZM5 2a2 2 0 1 0 4 0a2 2 0 1 0 -4 0Z");
const CHECK_VALVE: Symbol =
    symbol("check valve", "M-13 0H-5M4 0H13M2 -8L-5 0L2 8M-5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0 -9 0", "");
const RELIEF_VALVE: Symbol = symbol("relief valve", "M-8 -8H4V8H-8ZM-13 3H8M4 -4L7 -7L9 -1L12 -4", "M4 3L-1 0.5V5.5Z");
const ORIFICE: Symbol = symbol("orifice", "M-13 0H13M-7 -8C-2 -2 2 -2 7 -8M-7 8C-2 2 2 2 7 8", "");
const FRICTION: Symbol = symbol("friction", "M-7 -7H7V1H-7ZM-12 2H12M-9 7L-5 2M-3 7L1 2M3 7L7 2", "");
const STOP: Symbol = symbol("stop", "M-13 0H-5M-5 -5V5M4 -8V8M4 -3L9 -8M4 3L10 -3M4 8L10 2", "");
const CLUTCH: Symbol = symbol("clutch", "M-13 0H-2.5M2.5 0H13M-2.5 -8V8M2.5 -8V8", "");
const BRAKE: Symbol = symbol("brake", "M-13 0H0M0 -6V6M-6 -8H6M-6 8H6M-5 -8L-2 -5H2L5 -8M-5 8L-2 5H2L5 8", "");
const MOTOR: Symbol =
    symbol("motor", "M-8.5 0a8.5 8.5 0 1 0 17 0a8.5 8.5 0 1 0 -17 0M-4 4V-4L0 1L4 -4V4M-13 0H-8.5M8.5 0H13", "");
const AMPLIFIER: Symbol =
    symbol("amplifier", "M-8 -9V9L10 0ZM-13 -4H-8M-13 4H-8M10 0H13M-6 -4H-3M-6 4H-3M-4.5 2.5V5.5", "");
const CYLINDER: Symbol = symbol("cylinder", "M-12 -6H8V6H-12ZM-3 -6V6M-3 -1.5H13M-3 1.5H13", "");
const PUMP: Symbol =
    symbol("pump", "M-8.5 0a8.5 8.5 0 1 0 17 0a8.5 8.5 0 1 0 -17 0M-13 0H-8.5", "M-3.5 -3L0 -8.5L3.5 -3Z");
const TANK: Symbol = symbol("tank", "M-10 -7V7H10V-7M0 -9V1", "");
const ACCUMULATOR: Symbol = symbol("accumulator", "M-7 -2a7 7 0 0 1 14 0V2a7 7 0 0 1 -14 0ZM-7 0H7", "");

/// The parts of the library that are drawn so, each by the element whose law it is.
const PARTS: [(&str, &str, Symbol); 26] = [
    ("Diode", "junction", DIODE),
    ("LeakyDiode", "junction", DIODE),
    ("IdealDiode", "junction", DIODE),
    ("OpAmp", "stage", AMPLIFIER),
    ("DCMotor", "torque", MOTOR),
    ("Orifice", "law", ORIFICE),
    ("Valve", "law", ORIFICE),
    ("CheckValve", "law", CHECK_VALVE),
    ("IdealCheckValve", "valve", CHECK_VALVE),
    ("ReliefValve", "law", RELIEF_VALVE),
    ("Cylinder", "side_a", CYLINDER),
    ("Ram", "piston", CYLINDER),
    ("Pump", "stroke", PUMP),
    ("Accumulator", "gas", ACCUMULATOR),
    ("Tank", "fluid", TANK),
    ("Stop", "law", STOP),
    ("TorsionStop", "law", STOP),
    ("HardStop", "wall", STOP),
    ("Friction", "law", FRICTION),
    ("StribeckFriction", "law", FRICTION),
    ("DryFriction", "law", FRICTION),
    ("StribeckBearing", "law", FRICTION),
    ("Clutch", "law", CLUTCH),
    ("DryClutch", "law", CLUTCH),
    ("Brake", "law", BRAKE),
    ("DryBrake", "law", BRAKE),
];

/// The parts of the library that are drawn with a symbol: component, and the element that has it.
pub fn parts_with_symbols() -> impl Iterator<Item = (&'static str, &'static str)> {
    PARTS.iter().map(|part| (part.0, part.1))
}

impl Symbol {
    /// The room that it takes in the place of a keyword.
    pub const WIDTH: f64 = 2.0 * HALF[0];

    /// The symbol of an element, if it has one.
    pub fn of(graph: &BondGraph, element: &Element) -> Option<Symbol> {
        let own = element.name.rsplit('.').next().unwrap_or_default();
        let part = PARTS.iter().find(|(component, name, _)| **component == *element.component && *name == own);
        let law = graph.set_valued.iter().find(|law| std::ptr::eq(&graph.elements[law.element], element));
        part.map(|part| part.2).or_else(|| law.and_then(|law| Symbol::of_law(law, element)))
    }

    fn of_law(law: &SetValuedLaw, element: &Element) -> Option<Symbol> {
        match (law.word, law.branch().name) {
            _ if law.constraint.is_some() => Some(STOP),
            ("Sw", "on") => Some(SWITCH_CLOSED),
            ("Sw", _) => Some(SWITCH_OPEN),
            (_, "stick" | "forward" | "backward") => Some(FRICTION),
            _ if !matches!(element.kind, Kind::Inertance(_) | Kind::Compliance(_)) => Some(DIODE),
            _ => None,
        }
    }
}
