//! Conditions: held, followed, or taken anew.

use halfarrow_compiler::algebra::{Outside, Table1d};
use halfarrow_compiler::program::{Condition, ConditionId, ConditionKind, EventTrigger};

/// What a routine does with conditions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hold {
    /// They follow their operands.
    Follow,
    /// They stay as they are.
    Keep,
    /// They are taken from their operands and stay.
    Take,
}

/// The conditions of a program with their held values.
#[derive(Debug, Clone)]
pub(crate) struct Conditions {
    kinds: Vec<ConditionKind>,
    triggers: Vec<EventTrigger>,
    pub held: Vec<f64>,
    /// What to do with those that time alone moves.
    pub clock: Hold,
    /// What to do with those that the state moves.
    pub state: Hold,
}

/// What conditions remember of a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HeldConditions {
    held: Vec<f64>,
    clock: Hold,
    state: Hold,
}

/// How far from a border rounding may carry an operand that reaches it, in units of the terms it is made of.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Conditions {
    pub fn new<'a>(conditions: impl Iterator<Item = &'a Condition>) -> Conditions {
        let (kinds, triggers): (Vec<_>, Vec<_>) = conditions.map(|c| (c.kind, c.trigger)).unzip();
        let held = vec![0.0; kinds.len()];
        Conditions { kinds, triggers, held, clock: Hold::Follow, state: Hold::Follow }
    }

    /// What they remember of the run.
    pub fn held(&self) -> HeldConditions {
        HeldConditions { held: self.held.clone(), clock: self.clock, state: self.state }
    }

    /// Holds them as they were.
    pub fn hold_again(&mut self, from: &HeldConditions) {
        self.held.copy_from_slice(&from.held);
        (self.clock, self.state) = (from.clock, from.state);
    }

    fn hold(&self, condition: ConditionId) -> Hold {
        match self.triggers[condition.0 as usize] {
            EventTrigger::LinearTime | EventTrigger::CurvedTime => self.clock,
            EventTrigger::State => self.state,
            EventTrigger::RecordedOnly => Hold::Follow,
        }
    }

    /// The value of a condition at an operand.
    pub fn value(&mut self, condition: ConditionId, operand: f64, tables: &[Table1d]) -> f64 {
        match self.hold(condition) {
            Hold::Keep => self.held[condition.0 as usize],
            hold => {
                let value = follow(self.kinds[condition.0 as usize], operand, tables);
                if hold == Hold::Take {
                    self.held[condition.0 as usize] = value;
                }
                value
            }
        }
    }

    /// The same where the operand is known with its rate by time: a border that is just reached counts as crossed.
    pub fn value_after(&mut self, condition: ConditionId, (a, rate): (f64, f64), t: f64, tables: &[Table1d]) -> f64 {
        if self.hold(condition) != Hold::Take {
            return self.value(condition, a, tables);
        }
        let kind = self.kinds[condition.0 as usize];
        let reach = ROUNDING * (rate * t).abs();
        let at = |border: f64| (a - border).abs() <= reach + ROUNDING * border.abs();
        let value = match kind {
            ConditionKind::Sign if at(0.0) && rate != 0.0 => f64::from(rate > 0.0),
            ConditionKind::Floor if at(a.round()) && rate != 0.0 => a.round() - f64::from(rate < 0.0),
            ConditionKind::Piece(table) => match tables[table as usize].x().iter().position(|&x| at(x)) {
                Some(knot) if rate != 0.0 => knot as f64 + f64::from(rate > 0.0),
                _ => follow(kind, a, tables),
            },
            _ => follow(kind, a, tables),
        };
        self.held[condition.0 as usize] = value;
        value
    }

    /// Whether an operand has left the side that is held.
    pub fn has_left(&self, condition: ConditionId, operand: f64, tables: &[Table1d]) -> bool {
        follow(self.kinds[condition.0 as usize], operand, tables) != self.held[condition.0 as usize]
    }

    /// Holds this value from now on.
    pub fn take(&mut self, condition: ConditionId, value: f64) {
        self.held[condition.0 as usize] = value;
    }

    /// How far the operand is beyond the borders that end the held value: two numbers, above 0 beyond, the second minus
    /// infinity where there is one border only. For a sign the first is the operand itself.
    pub fn beyond(&self, condition: ConditionId, operand: f64, tables: &[Table1d]) -> [f64; 2] {
        let held = self.held[condition.0 as usize];
        match self.kinds[condition.0 as usize] {
            ConditionKind::Sign => [operand, f64::NEG_INFINITY],
            _ => {
                let [low, high] = self.borders(condition, tables);
                debug_assert!(!held.is_nan());
                [low - operand, operand - high]
            }
        }
    }

    /// Where sides have just been taken, an operand that rounding puts on the other one is on the side taken.
    pub fn confirm(&self, condition: ConditionId, beyond: &mut [f64; 2]) {
        if self.kinds[condition.0 as usize] == ConditionKind::Sign {
            let held = self.held[condition.0 as usize] != 0.0;
            beyond[0] = if held { beyond[0].abs().max(f64::MIN_POSITIVE) } else { -beyond[0].abs() };
        }
    }

    /// The lower and upper border of the held value.
    pub fn borders(&self, condition: ConditionId, tables: &[Table1d]) -> [f64; 2] {
        let held = self.held[condition.0 as usize];
        match self.kinds[condition.0 as usize] {
            ConditionKind::Sign if held != 0.0 => [0.0, f64::INFINITY],
            ConditionKind::Sign => [f64::NEG_INFINITY, 0.0],
            ConditionKind::Floor => [held, held + 1.0],
            ConditionKind::Piece(table) => {
                let (x, k) = (tables[table as usize].x(), held as usize);
                let low = if k == 0 { f64::NEG_INFINITY } else { x[k - 1] };
                [low, x.get(k).copied().unwrap_or(f64::INFINITY)]
            }
        }
    }
}

fn follow(kind: ConditionKind, operand: f64, tables: &[Table1d]) -> f64 {
    match kind {
        ConditionKind::Sign => f64::from(operand > 0.0),
        ConditionKind::Floor => operand.floor(),
        ConditionKind::Piece(table) => piece_of(&tables[table as usize], operand) as f64,
    }
}

/// The piece of a table that `x` is in: number of points not above it.
pub(crate) fn piece_of(table: &Table1d, x: f64) -> usize {
    table.x().partition_point(|&p| p <= x)
}

/// Value and three derivatives of a table on a piece of it.
pub(crate) fn table_on(table: &Table1d, piece: usize, x: f64) -> [f64; 4] {
    let (points, n) = (table.x(), table.x().len());
    let end = match piece {
        0 => Some(0),
        p if p >= n => Some(n - 1),
        _ => None,
    };
    if let Some(end) = end {
        let beyond = if end == 0 && piece == 0 { x < points[0] } else { x > points[n - 1] };
        match table.outside() {
            Outside::Clamp => return [table.y()[end], 0.0, 0.0, 0.0],
            Outside::Error if beyond => return [f64::NAN; 4],
            _ => {}
        }
    }
    let start = piece.saturating_sub(1).min(n - 1);
    let (d, [c0, c1, c2, c3]) = (x - points[start], table.pieces()[start]);
    [((c3 * d + c2) * d + c1) * d + c0, (3.0 * c3 * d + 2.0 * c2) * d + c1, 6.0 * c3 * d + 2.0 * c2, 6.0 * c3]
}
