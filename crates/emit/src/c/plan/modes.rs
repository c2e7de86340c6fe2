//! The modes that a program knows, with other branches of set-valued laws or other independent variables, and what is carried
//! from one to the next, in tables.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{Block, BlockId, Bounds, Exchanges, Op, Program, Ratios, Told, Value};

use crate::Real;

/// Bytes of stack for functions that go from one mode to the next.
const OWN_STACK: usize = 2048;

/// What all modes of a model have in common.
#[derive(Debug, Clone, Default)]
pub(in crate::c) struct Modes {
    /// How many branches each law has.
    laws: Vec<usize>,
    /// The branches of each mode; those that laws have while impulses are shared out; which are ended by conditions.
    branches: Vec<Vec<u32>>,
    free: Vec<Vec<Option<u32>>>,
    commanded: Vec<Vec<bool>>,
    /// Ends of branches, by law, branch and number.
    keys: Vec<(u32, u32, u32)>,
    /// Variables of the machine that are carried from mode to mode.
    symbols: Vec<Symbol>,
    groups: usize,
    releases: bool,
    /// Variables that may be independent; which of them are, in each mode.
    exchanged: Vec<Symbol>,
    independent: Vec<Vec<usize>>,
}

impl Modes {
    /// Of the programs of all modes, with their independent variables; the first one is that in which runs begin.
    pub fn of(modes: &[(&Program, &[Symbol])]) -> Modes {
        let programs: Vec<&Program> = modes.iter().map(|m| m.0).collect();
        let all: Vec<Bounds> = programs.iter().map(|p| p.bounds().unwrap_or_default()).collect();
        let laws = |p: &&Program| p.set_valued.iter().map(|law| law.released).collect();
        let exchanged: BTreeSet<Symbol> = programs.iter().flat_map(|p| may_be_independent(p)).collect();
        let exchanged: Vec<Symbol> = exchanged.into_iter().collect();
        let place = |symbol: &Symbol| exchanged.binary_search(symbol).ok();
        let independent = modes.iter().map(|m| m.1.iter().filter_map(place).collect()).collect();
        let commanded = |bounds: &Bounds| {
            let law = |law: usize| bounds.commands.iter().any(|(_, bound)| bound.law as usize == law);
            (0..bounds.branches.len()).map(law).collect()
        };
        let keys: BTreeSet<(u32, u32, u32)> = all.iter().flat_map(|b| &b.margins).map(|m| m.key).collect();
        let symbols: BTreeSet<Symbol> = programs.iter().flat_map(|p| carried(p)).collect();
        Modes {
            laws: programs[0].set_valued.iter().map(|law| law.branches.len()).collect(),
            branches: programs.iter().map(|p| p.set_valued.iter().map(|law| law.present).collect()).collect(),
            free: programs.iter().map(laws).collect(),
            commanded: all.iter().map(commanded).collect(),
            keys: keys.into_iter().collect(),
            symbols: symbols.into_iter().collect(),
            groups: all[0].compared.len(),
            releases: programs.iter().any(|p| p.set_valued.iter().any(|law| law.released.is_some()))
                && programs.iter().flat_map(|p| &p.clauses).flat_map(|c| &c.actions).any(|a| a.target.takes_impulse()),
            exchanged,
            independent,
        }
    }

    /// How many modes there are, and how many combinations of branches.
    pub fn counts(&self) -> (usize, usize) {
        (self.branches.len(), self.laws.iter().product())
    }

    /// Whether independent variables may change, and how many there are that may be independent.
    pub fn exchanged(&self) -> usize {
        self.exchanged.len()
    }

    /// Whether impulses may open contacts and let go what sticks.
    pub fn releases(&self) -> bool {
        self.releases
    }

    pub fn laws(&self) -> usize {
        self.laws.len()
    }

    pub fn symbols(&self) -> usize {
        self.symbols.len()
    }

    pub fn keys(&self) -> usize {
        self.keys.len()
    }

    pub fn groups(&self) -> usize {
        self.groups
    }

    fn symbol(&self, symbol: &Symbol) -> usize {
        self.symbols.binary_search(symbol).expect("it is carried")
    }

    /// The variables that a mode carries on and has a value for: their numbers and values.
    pub fn values(&self, program: &Program) -> Vec<(usize, Value)> {
        let value = |(i, symbol): (usize, &Symbol)| program.variables.get(symbol).map(|value| (i, *value));
        self.symbols.iter().enumerate().filter_map(value).collect()
    }

    /// Words of what is in common.
    pub fn words(&self) -> Vec<(&'static str, String)> {
        let (_, combinations) = self.counts();
        let places: Vec<usize> = self
            .laws
            .iter()
            .scan(1, |place, count| {
                *place *= count;
                Some(*place / count)
            })
            .collect();
        let number = |branches: &[u32]| branches.iter().zip(&places).map(|(b, p)| *b as usize * p).sum::<usize>();
        // Branches lead to the first mode that has them.
        let all = self.branches.iter().enumerate().rev();
        let of: BTreeMap<usize, usize> = all.map(|(mode, b)| (number(b), mode)).collect();
        let held =
            |set: &Vec<usize>| (0..self.exchanged.len()).map(|k| u8::from(set.contains(&k)).to_string()).collect();
        let independent: Vec<Vec<String>> = self.independent.iter().map(held).collect();
        let mode = |i: usize| of.get(&i).map_or("-1".to_string(), usize::to_string);
        let rows = |rows: Vec<Vec<String>>| {
            rows.iter().map(|row| format!("    {{{}}}", row.join(", "))).collect::<Vec<_>>().join(",\n")
        };
        let free = |branch: &Option<u32>| branch.map_or("-1".to_string(), |b| b.to_string());
        let ints = |values: &[usize]| values.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let modes: Vec<String> = (0..combinations).map(mode).collect();
        let lines: Vec<String> = modes.chunks(20).map(|row| format!("    {}", row.join(", "))).collect();
        vec![
            ("MODES", self.branches.len().to_string()),
            ("EXCHANGED", self.exchanged.len().to_string()),
            ("MODE_INDEPENDENT", rows(independent)),
            ("COMBINATIONS", combinations.to_string()),
            ("LAW_BRANCHES", ints(&self.laws)),
            ("LAW_PLACES", ints(&places)),
            ("MODE_OF", lines.join(",\n")),
            ("MODE_BRANCHES", rows(self.branches.iter().map(|b| b.iter().map(u32::to_string).collect()).collect())),
            ("MODE_FREE", rows(self.free.iter().map(|b| b.iter().map(free).collect()).collect())),
            (
                "MODE_COMMANDED",
                rows(self.commanded.iter().map(|c| c.iter().map(|c| u8::from(*c).to_string()).collect()).collect()),
            ),
        ]
    }
}

/// The variables of which a mode may choose.
fn may_be_independent(program: &Program) -> impl Iterator<Item = Symbol> + '_ {
    let Exchanges { independent, dependent } = &program.exchanges;
    independent.iter().chain(dependent).map(|e| e.symbol)
}

/// The variables that a mode begins with: states, constants, solutions of laws, what storages keep.
fn carried(program: &Program) -> impl Iterator<Item = Symbol> + '_ {
    let states = program.tracked.iter().chain(&program.replaced).copied();
    let storages = program.jumps.iter().flat_map(|jumps| jumps.storages.iter().copied());
    states.chain(storages).chain(solutions(program).map(|s| s.0))
}

/// The variables that solve blocks of laws: the block and the number of the unknown.
fn solutions(program: &Program) -> impl Iterator<Item = (Symbol, BlockId, u32)> + '_ {
    program.variables.iter().filter_map(|(symbol, value)| match program.values.op(*value) {
        Op::Solution(block, i) if matches!(program.blocks[block], Block::Newton { .. }) => Some((*symbol, block, i)),
        _ => None,
    })
}

/// The bounds of one mode.
#[derive(Debug, Clone)]
pub(in crate::c) struct ModeTables<'a> {
    pub modes: &'a Modes,
    pub bounds: Bounds,
    /// Variables that could change places.
    pub ratios: Option<Ratios>,
}

impl ModeTables<'_> {
    /// Whether there are set-valued laws.
    pub fn has_laws(&self) -> bool {
        self.modes.laws() > 0
    }

    /// States and constants that are no variables of the machine, of which these follow: the place of each in a direction, the
    /// variable, and its value.
    pub fn open(&self, program: &Program, directions: &[usize; 6]) -> Vec<(usize, usize, Value)> {
        let [_, _, conserved, states, ..] = *directions;
        let value = |symbol: &Symbol| program.variables.get(symbol).copied();
        let of_states = program.tracked.iter().enumerate().filter_map(|(k, symbol)| {
            let own = |value: &Value| program.values.op(*value) == Op::State(k as u32);
            value(symbol).filter(|v| !own(v)).map(|value| (states + k, self.modes.symbol(symbol), value))
        });
        let of_constants = program.replaced.iter().enumerate();
        let of_constants = of_constants
            .filter_map(|(k, symbol)| value(symbol).map(|value| (conserved + k, self.modes.symbol(symbol), value)));
        of_states.chain(of_constants).collect()
    }

    /// Bytes of stack for the search of a mode.
    pub fn stack(&self, program: &Program) -> usize {
        let open = self.open(program, &[0; 6]).len();
        let (n, m) = self.ratios.as_ref().map_or((0, 0), |r| (r.independent.len(), r.dependent.len()));
        let pivots = self.ratios.as_ref().map_or(0, |r| r.pivots.len());
        let laws = self.modes.laws();
        8 * (open * open + 4 * (open + 1) + n * n + 2 * n * m + 4 * (n + m) + pivots + 1 + 4 * laws) + OWN_STACK
    }

    /// Words of what could change places in a mode.
    pub fn words_of_exchanges(
        &self,
        program: &Program,
        directions: &[usize; 6],
        list: &dyn Fn(Vec<String>) -> String,
    ) -> Vec<(&'static str, String)> {
        let open = self.open(program, directions);
        let place = |symbol: &Symbol| self.modes.exchanged.binary_search(symbol).expect("it may be independent");
        let ratios = self.ratios.as_ref();
        let independent = ratios.map_or(&[][..], |r| &r.independent);
        let dependent = ratios.map_or(&[][..], |r| &r.dependent);
        let all = || independent.iter().map(|k| k.0).chain(dependent.iter().map(|o| o.0));
        let numbers = |all: &mut dyn Iterator<Item = usize>| list(all.map(|n| n.to_string()).collect());
        vec![
            ("OPEN", open.len().to_string()),
            ("OPEN_PLACES", numbers(&mut open.iter().map(|o| o.0))),
            ("OPEN_SYMBOLS", numbers(&mut open.iter().map(|o| o.1))),
            ("RATIO_SYMBOLS", numbers(&mut all().map(|e| place(&e.symbol)))),
        ]
    }

    /// Places of what is computed of margins.
    pub fn margin_values(&self) -> usize {
        self.bounds.values().len()
    }

    /// Whether sides of contacts meet with an impulse, and whether there are gaps.
    pub fn meets(&self) -> bool {
        self.bounds.margins.iter().any(|m| m.meets)
    }

    pub fn has_gaps(&self) -> bool {
        self.bounds.margins.iter().any(|m| m.bound.gap.is_some())
    }

    /// Words of a mode: `conditional` are the clauses with conditions, `newton` the place in the memory of each block that is
    /// solved by iteration.
    pub fn words(
        &self,
        program: &Program,
        conditional: &[usize],
        newton: &BTreeMap<BlockId, usize>,
        lines: &dyn Fn(Vec<String>) -> String,
        list: &dyn Fn(Vec<String>) -> String,
    ) -> Vec<(&'static str, String)> {
        let (modes, bounds) = (self.modes, &self.bounds);
        let symbols = |all: &[Symbol]| all.iter().map(|s| modes.symbol(s).to_string()).collect::<Vec<_>>();
        let rows = |rows: Vec<Vec<i64>>, columns: usize| {
            let row =
                |row: &Vec<i64>| format!("    {{{}}}", row.iter().map(i64::to_string).collect::<Vec<_>>().join(", "));
            match rows.is_empty() {
                true => row(&vec![0; columns]),
                false => rows.iter().map(row).collect::<Vec<_>>().join(",\n"),
            }
        };
        let margins = bounds.margins.iter().map(|m| {
            vec![
                m.clause as i64,
                m.place as i64,
                i64::from(m.bound.law),
                i64::from(m.bound.next),
                m.condition.map_or(-1, |c| i64::from(c.0)),
                modes.keys.binary_search(&m.key).expect("it is an end of a branch") as i64,
                m.group as i64,
                i64::from(m.bound.gap.is_some()),
                i64::from(m.meets),
            ]
        });
        let commands = bounds.commands.iter().map(|(clause, bound)| {
            let place = conditional.iter().position(|c| c == clause).expect("it has a condition");
            vec![place as i64, i64::from(bound.law), i64::from(bound.next)]
        });
        let starts = solutions(program).filter_map(|(symbol, block, i)| {
            newton.get(&block).map(|place| vec![(place + i as usize) as i64, modes.symbol(&symbol) as i64])
        });
        let starts: Vec<Vec<i64>> = starts.collect();
        let own = program.clauses.iter().filter(|c| c.bound.is_none()).count();
        let ends = program.clauses.iter().filter_map(|c| c.bound.map(|b| vec![i64::from(b.law), i64::from(b.next)]));
        let values = modes.values(program);
        let groups = bounds.compared.iter().enumerate().flat_map(|(i, group)| vec![i.to_string(); group.len()]);
        let storages = program.jumps.as_ref().map_or(&[][..], |jumps| &jumps.storages);
        vec![
            ("LAWS", modes.laws().to_string()),
            ("SYMBOLS", modes.symbols().to_string()),
            ("MOST_MARGINS", (3 * modes.keys()).to_string()),
            ("GROUPS_COMPARED", modes.groups().to_string()),
            ("MARGINS", bounds.margins.len().to_string()),
            ("MARGIN_VALUES", self.margin_values().to_string()),
            ("MARGIN_TABLE", rows(margins.collect(), 9)),
            ("COMMANDS", bounds.commands.len().to_string()),
            ("COMMAND_TABLE", rows(commands.collect(), 3).replace("    {", "        {")),
            ("TRACKED_COUNT", program.tracked.len().to_string()),
            ("TRACKED", lines(symbols(&program.tracked))),
            ("REPLACED", list(symbols(&program.replaced))),
            ("STORAGE_SYMBOLS", list(symbols(storages))),
            ("COMPARED", bounds.compared.concat().len().to_string()),
            ("COMPARED_GROUPS", list(groups.collect())),
            ("VALUES", values.len().to_string()),
            ("VALUE_SYMBOLS", list(values.iter().map(|v| v.0.to_string()).collect())),
            ("SOLUTIONS", starts.len().to_string()),
            ("SOLUTION_TABLE", rows(starts, 2).replace("    {", "            {")),
            ("OWN_CLAUSES", own.to_string()),
            ("BOUND_TABLE", rows(ends.collect(), 2)),
            ("CONDITIONS", program.conditions.len().to_string()),
        ]
    }
}

/// Words of ratios between variables that could be independent and those that are.
pub(super) fn words_of_ratios(
    ratios: Option<&Ratios>,
    directions: &[usize; 6],
    real: Real,
    list: &dyn Fn(Vec<String>) -> String,
) -> [(&'static str, String); 6] {
    let [_, _, conserved, states, ..] = *directions;
    let told = |told: Told| match told {
        Told::State(k) => states + k as usize,
        Told::Conserved(k) => conserved + k as usize,
    };
    let independent = ratios.map_or(&[][..], |r| &r.independent);
    let dependent = ratios.map_or(&[][..], |r| &r.dependent);
    let all = independent.iter().map(|k| k.0).chain(dependent.iter().map(|o| o.0));
    [
        ("INDEPENDENT", independent.len().to_string()),
        ("DEPENDENT", dependent.len().to_string()),
        ("TOLD", list(independent.iter().map(|k| told(k.2).to_string()).collect())),
        ("RATIO_WEIGHTS", list(all.map(|e| real.number(e.weighs())).collect())),
        ("PIVOTS", ratios.map_or(0, |r| r.pivots.len()).to_string()),
        ("ALWAYS", u8::from(ratios.is_some_and(|r| r.always)).to_string()),
    ]
}

/// What is zero of margins and impulses: see `halfarrow_exec::model::{margins, impulses}`.
pub(super) fn tolerances(real: Real) -> [(&'static str, String); 12] {
    [
        ("HA_ZERO", 1e-12),
        ("HA_MEETS", 1e-10),
        ("HA_STEADY", 1e-9),
        ("HA_SOON", 1e-6),
        ("HA_ROUNDING", 2.0 * f64::EPSILON),
        ("HA_SHORT", 32.0),
        ("HA_OVERLAP", 1e-9),
        ("HA_AT_REST", 1e-9),
        ("HA_NO_LEAP", 1e-7),
        ("HA_NO_FLIGHT", 1e2),
        ("HA_CLOSE", 1e-11),
        ("HA_NOTHING", 1e-4),
    ]
    .map(|(name, value)| (name, real.number(value)))
}
