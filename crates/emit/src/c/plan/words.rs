//! What stands in the place of words in the parts that do not depend on the model: sizes, tables, lists.

use std::collections::BTreeMap;

use halfarrow_compiler::algebra::{Outside, math};
use halfarrow_compiler::program::{BlockId, ConditionId, ConditionKind, EventTrigger};

use super::super::patterns::FULL_AT_MOST;
use super::super::start::Group;
use super::super::template::Words;
use super::super::written::{Needed, Notes, Part, Written, written};
use super::{Ahead, Beside, Plan};
use crate::{Method, Real};

impl Plan<'_> {
    /// Each word with its text.
    pub(super) fn words(&self) -> Words {
        let program = self.program;
        let join = |values: Vec<String>| if values.is_empty() { "0".to_string() } else { values.join(", ") };
        let lines = |values: Vec<String>| match values.is_empty() {
            true => "    0".to_string(),
            false => values.chunks(20).map(|row| format!("    {}", row.join(", "))).collect::<Vec<_>>().join(",\n"),
        };
        let kind = |k: ConditionKind| match k {
            ConditionKind::Sign => 0,
            ConditionKind::Floor => 1,
            ConditionKind::Piece(table) => table + 2,
        };
        let mut room = vec![0];
        self.delays.iter().for_each(|(_, points)| room.push(room[room.len() - 1] + points));
        let numbers_of = |ids: &[ConditionId]| ids.iter().map(|c| c.0.to_string()).collect::<Vec<_>>();
        let block_numbers = |blocks: &[BlockId]| -> Vec<String> {
            let place = |b: &BlockId| self.newton.iter().position(|n| n == b).unwrap_or(0).to_string();
            blocks.iter().map(place).collect()
        };
        let distances: Vec<f64> =
            std::iter::once(0.0).chain((-240..=240).map(|k| math::pow(10.0, f64::from(k) / 20.0))).collect();
        let beside = self.beside.as_ref();
        let groups = self.column_groups();
        let lengths = |lists: &[Vec<usize>]| {
            let mut starts = vec![0];
            lists.iter().for_each(|list| starts.push(starts[starts.len() - 1] + list.len()));
            starts.iter().map(usize::to_string).collect::<Vec<_>>()
        };
        let part_number = |part: &Option<usize>| part.map_or("-1".to_string(), |part| part.to_string());
        let flat = |lists: &[Vec<usize>]| lists.iter().flatten().map(usize::to_string).collect::<Vec<_>>();
        let columns = self.columns();
        let real = self.export.real;
        let (nodes, weights) = tableau(self.export.method, real);
        let constants = program.parameters.iter().map(|p| u8::from(p.constant).to_string()).collect();
        let most =
            |of: &dyn Fn(&Group) -> usize| self.groups.iter().filter(|g| g.together).map(of).max().unwrap_or(1).max(1);
        let [_, held, conserved, states, positions, direction] = self.sizes.directions.map(|place| place.to_string());
        let (sought, memory): (Vec<String>, Vec<String>) =
            self.sought_positions().into_iter().map(|(k, place)| (k.to_string(), place.to_string())).unzip();
        let mut words: Vec<(&str, String)> = vec![
            ("KINDS", lines(self.kinds().map(|k| kind(k).to_string()).collect())),
            ("CLOCK_CONDITIONS", lines(numbers_of(&self.clocks))),
            (
                "CLOCK_LINES",
                lines(
                    self.clocks
                        .iter()
                        .map(|&c| u8::from(program.conditions[c].trigger == EventTrigger::LinearTime).to_string())
                        .collect(),
                ),
            ),
            ("CLOCKS", self.clocks.len().to_string()),
            ("SWITCH_CONDITIONS", join(numbers_of(&self.switches))),
            ("SWITCHES", self.switches.len().to_string()),
            ("DELAYS", self.delays.len().to_string()),
            ("DELAY_PLACES", join(self.delays.iter().map(|d| d.0.to_string()).collect())),
            ("DELAY_ROOM", lines(room.iter().map(usize::to_string).collect())),
            ("SAMPLES", self.samples.len().to_string()),
            ("SAMPLE_PLACES", join(self.samples.iter().map(usize::to_string).collect())),
            ("BLOCKS", self.newton.len().to_string()),
            ("PATTERNS", self.patterns.tables()),
            ("SPARSE_FULL_AT_MOST", FULL_AT_MOST.to_string()),
            ("RATES_BLOCKS", join(block_numbers(&self.rates_blocks))),
            ("SOLUTIONS_OF_RATES", self.solutions.to_string()),
            ("RATES_BLOCK_COUNT", self.rates_blocks.len().to_string()),
            ("SHOWN_BLOCKS", join(block_numbers(&self.shown_blocks))),
            ("SHOWN_BLOCK_COUNT", self.shown_blocks.len().to_string()),
            ("MOTION_BLOCKS", join(block_numbers(&self.motion_blocks))),
            ("MOTION_BLOCK_COUNT", self.motion_blocks.len().to_string()),
            ("MOTION_ORIGINS", join(self.motion_blocks.iter().map(|b| b.0.to_string()).collect())),
            ("MOTION_OF_RATES", self.motion_of_rates.to_string()),
            ("MOTION_COUNT", self.motion_sizes()[0].to_string()),
            ("SHOWN_MOTION_COUNT", self.motion_sizes()[1].to_string()),
            ("DISTANCES", real.numbers(&distances)),
            ("DOMAINS", program.domains.len().to_string()),
            ("MEMORY", self.sizes.memory.to_string()),
            ("FACTORED", self.sizes.factored.to_string()),
            ("GROUP_STARTS", lines(lengths(&groups))),
            ("GROUP_COLUMNS", lines(flat(&groups))),
            ("GROUPS", groups.len().to_string()),
            ("AHEAD", self.ahead.as_ref().map_or(0, Ahead::size).to_string()),
            ("AHEAD_SHOWN", self.ahead.as_ref().map_or(0, Ahead::shown_from).to_string()),
            ("AHEAD_BLOCKS", join(block_numbers(self.ahead.as_ref().map_or(&[][..], |ahead| &ahead.blocks)))),
            ("AHEAD_BLOCK_COUNT", self.ahead.as_ref().map_or(0, |ahead| ahead.blocks.len()).to_string()),
            ("GROUP_PARTS", lines(beside.map_or_else(Vec::new, |b| b.parts.iter().map(part_number).collect()))),
            ("COMMON", beside.map_or(0, Beside::size).to_string()),
            ("COMMON_BLOCKS", join(block_numbers(beside.map_or(&[][..], |b| &b.blocks)))),
            ("COMMON_BLOCK_COUNT", beside.map_or(0, |b| b.blocks.len()).to_string()),
            ("STEPS_TO_FIND", self.steps_to_find().unwrap_or(1).to_string()),
            ("NONZEROS", columns.iter().map(Vec::len).sum::<usize>().to_string()),
            ("COLUMN_STARTS", lines(lengths(&columns))),
            ("COLUMN_ROWS", lines(flat(&columns))),
            ("SCALES", real.numbers(&self.export.start.scales)),
            ("NODES", nodes),
            ("WEIGHTS", weights),
            ("STAGES", self.export.method.stages().to_string()),
            ("STEP_LENGTH", Real::Double.number(self.export.step)),
            ("START_STATES", real.numbers(&self.export.start.states)),
            ("START_CONSERVED", real.numbers(&self.export.start.conserved)),
            ("START_POSITIONS", real.numbers(&self.export.start.positions)),
            ("SOUGHT_COUNT", sought.len().to_string()),
            ("SOUGHT", sought.join(", ")),
            ("SOUGHT_PLACES", memory.join(", ")),
            ("CONSTANT_PARAMETERS", lines(constants)),
            ("START_CONDITIONS", program.start.len().to_string()),
            ("START_GROUPS", self.groups.len().to_string()),
            ("GUESSES", program.guesses.len().to_string()),
            ("PASSES", self.passes.len().to_string()),
            ("MOST_AT_ONCE", self.passes.iter().map(|p| p.unknowns.len()).max().unwrap_or(1).to_string()),
            ("MOST_ROWS", most(&|g| g.conditions.len()).to_string()),
            ("MOST_COLUMNS", most(&|g| g.unknowns.len()).to_string()),
            ("LAYOUT_DIRECTION", direction),
            ("LAYOUT_HELD", held),
            ("LAYOUT_CONSERVED", conserved),
            ("LAYOUT_STATES", states),
            ("LAYOUT_POSITIONS", positions),
            ("COUNT_HELD", program.held.len().to_string()),
            ("COUNT_CONSERVED", program.conserved.len().to_string()),
            ("COUNT_POSITIONS", program.positions.len().to_string()),
            ("COUNT_INDICATORS", self.sizes.indicators.to_string()),
            ("DISCRETES", self.discretes.len().to_string()),
            ("DISCRETE_PLACES", join(self.discretes.iter().map(usize::to_string).collect())),
        ];
        words.extend(self.relation_sizes().map(|(word, number)| (word, number.to_string())));
        words.extend(self.relation_words().map(|(word, numbers)| (word, lines(numbers))));
        let events = self.events.words(program, &lines, &join);
        let ints = |values: Vec<u32>| lines(values.iter().map(u32::to_string).collect());
        let order = self.step_order.iter().flat_map(|order| {
            let places = ("STEP_PLACES", order.places(&columns));
            order.tables().into_iter().chain([places]).map(|(word, values)| (word, ints(values)))
        });
        let places: BTreeMap<BlockId, usize> = self.newton.iter().copied().zip(self.memory_places()).collect();
        let bounds = self.mode.iter().flat_map(|bounds| {
            let own = bounds.words(program, &self.events.conditional, &places, &lines, &join);
            let exchanges = bounds.words_of_exchanges(program, &self.sizes.directions, &join);
            own.into_iter().chain(exchanges).chain(bounds.modes.words()).chain(super::modes::tolerances(real))
        });
        let more = linearly_implicit(self.export.method, real);
        let ratios = super::modes::words_of_ratios(self.ratios(), &self.sizes.directions, real, &join);
        let tables = [
            ("TABLES", Written::of(self.tables())),
            ("BLOCK_TABLE", self.block_table()),
            ("START_TABLES", self.start_tables()),
            ("CLAUSE_CASES", super::events::cases(program)),
            ("PART_CASES", beside.map_or_else(|| Written::of(""), Beside::cases)),
        ];
        words
            .into_iter()
            .chain(events)
            .chain(order)
            .chain(bounds)
            .chain(ratios)
            .chain(more)
            .chain(tolerances(real))
            .map(|(word, text)| (word, Written::of(text)))
            .chain(tables)
            .collect()
    }

    fn tables(&self) -> String {
        let real = self.export.real;
        let mut text = String::new();
        let mut list = String::from("static const ha_table ha_tables[] = {\n");
        for (i, table) in self.program.tables.iter().enumerate() {
            let pieces: Vec<String> =
                table.pieces().iter().map(|c| format!("    {{{}}}", c.map(|v| real.number(v)).join(", "))).collect();
            text += &format!("static const double ha_table_{i}_x[] = {{\n{}\n}};\n", Real::Double.numbers(table.x()));
            text += &format!("static const {} ha_table_{i}_y[] = {{\n{}\n}};\n", real.kind(), real.numbers(table.y()));
            text +=
                &format!("static const {} ha_table_{i}_pieces[][4] = {{\n{}\n}};\n", real.kind(), pieces.join(",\n"));
            let outside = match table.outside() {
                Outside::Error => 0,
                Outside::Clamp => 1,
                Outside::Extrapolate => 2,
            };
            list += &format!(
                "    {{{}, {outside}, ha_table_{i}_x, ha_table_{i}_y, ha_table_{i}_pieces}},\n",
                table.x().len()
            );
        }
        text + &list + "};"
    }

    /// Where the memory of the model has that of each block that is solved by iteration.
    fn memory_places(&self) -> Vec<usize> {
        self.memory_sizes().scan(0, |next, size| Some(std::mem::replace(next, *next + size))).collect()
    }

    /// How much memory that takes: the solution, what the block read and its Jacobian, followed and found last; rates of
    /// positions.
    pub(super) fn memory_sizes(&self) -> impl Iterator<Item = usize> + '_ {
        self.newton.iter().zip(&self.reads).map(|(&id, reads)| {
            let block = &self.program.blocks[id];
            let rates = if self.has_positions(id) { 2 * block.size() } else { 0 };
            2 * (block.size() + reads + block.matrix().values.pattern().len()) + rates
        })
    }

    /// How many rates of positions are computed for rates, and for outputs alone.
    pub(in crate::c) fn motion_sizes(&self) -> [usize; 2] {
        let (of_rates, of_shown) = self.motion_blocks.split_at(self.motion_of_rates);
        [of_rates, of_shown].map(|blocks| blocks.iter().map(|&b| self.program.blocks[b].size()).sum())
    }

    /// Whether the unknowns of a block are positions that constraints determine.
    fn has_positions(&self, block: BlockId) -> bool {
        self.program.positions.iter().any(|p| p.block == block)
    }

    /// The positions that are sought while running, by number, and where the memory of the model has their last values.
    pub(in crate::c) fn sought_positions(&self) -> Vec<(usize, usize)> {
        let first: BTreeMap<BlockId, usize> = self.newton.iter().copied().zip(self.memory_places()).collect();
        let positions = self.program.positions.iter().enumerate();
        positions.filter_map(|(k, p)| Some((k, first.get(&p.block)? + p.unknown as usize))).collect()
    }

    fn block_table(&self) -> Written {
        let mut notes = Notes::default();
        let mut text = String::new();
        let mut list = String::from("static const ha_block ha_blocks[] = {\n");
        let sought = !self.sought_positions().is_empty();
        let memory = self.memory_places();
        for (i, (block, reads)) in self.newton.iter().zip(&self.reads).enumerate() {
            text += &super::shapes::block_declarations(i, self.export.real);
            let (pattern, _) = self.patterns.of_block(self.program, *block);
            let [code, terms, along] = ["", "_terms", "_along"].map(|k| Needed(format!("ha_block_{i}{k}").into()));
            let position = match self.has_positions(*block) {
                _ if !sought => "",
                true => "1, ",
                false => "0, ",
            };
            let (place, conditions) = (memory[i], usize::from(self.conditional[i]));
            let row = written!(
                "    {{{}, {}, {}, {}, {}{}, {}, {}}},\n",
                pattern,
                reads,
                place,
                conditions,
                position,
                code,
                terms,
                along
            );
            row.note(&mut notes);
            list += &row.text;
        }
        Written { notes, ..Written::of(text + "\n" + &list + "};") }
    }

    /// Where the search of the start begins, and for which unknowns; nothing without guesses.
    fn guess_tables(&self, notes: &mut Notes) -> String {
        let program = self.program;
        if program.guesses.is_empty() {
            return String::new();
        }
        let guessed = |u: usize| program.guesses.iter().any(|g| g.unknown as usize == u);
        let guessed = (0..program.start_unknowns()).map(|u| u8::from(guessed(u)).to_string());
        let mut text = "static const ha_guess ha_guesses[] = {\n".to_string();
        for (i, guess) in program.guesses.iter().enumerate() {
            let row = written!("    {{{}, {}}},\n", guess.unknown, Needed(format!("ha_start_guess_{i}").into()));
            row.note(notes);
            text += &row.text;
        }
        text += "};\n";
        if self.groups.iter().any(|g| g.together) {
            let guessed: Vec<String> = guessed.collect();
            text += &format!("static const unsigned char ha_guessed[] = {{{}}};\n", guessed.join(", "));
        }
        text
    }

    fn start_tables(&self) -> Written {
        let mut notes = Notes::default();
        let mut text = String::new();
        let ints = |values: Vec<String>| if values.is_empty() { "0".to_string() } else { values.join(", ") };
        let mut list = String::from("static const ha_pass ha_passes[] = {\n");
        for (i, pass) in self.passes.iter().enumerate() {
            let unknowns = ints(pass.unknowns.iter().map(u32::to_string).collect());
            let conditions = ints(pass.conditions.iter().map(usize::to_string).collect());
            text += &format!("static const int ha_pass_{i}_unknowns[] = {{{unknowns}}};\n");
            text += &format!("static const int ha_pass_{i}_conditions[] = {{{conditions}}};\n");
            let (count, code) = (pass.unknowns.len(), Needed(format!("ha_start_pass_{i}").into()));
            let row = written!("    {{{}, ha_pass_{1}_unknowns, ha_pass_{1}_conditions, {2}}},\n", count, i, code);
            row.note(&mut notes);
            list += &row.text;
        }
        if self.passes.is_empty() {
            list += "    {0, NULL, NULL, NULL}\n";
        }
        let mut groups = String::from("static const ha_group ha_groups[] = {\n");
        for (i, group) in self.groups.iter().enumerate() {
            let unknowns = ints(group.unknowns.iter().map(u32::to_string).collect());
            let conditions = ints(group.conditions.iter().map(usize::to_string).collect());
            text += &format!("static const int ha_group_{i}_unknowns[] = {{{unknowns}}};\n");
            text += &format!("static const int ha_group_{i}_conditions[] = {{{conditions}}};\n");
            let code = match group.together {
                true => written!("{}", Needed(format!("ha_start_group_{i}").into())),
                false => Written::of("NULL"),
            };
            code.note(&mut notes);
            groups += &format!(
                "    {{{}, {}, ha_group_{i}_conditions, ha_group_{i}_unknowns, {code}, {}}},\n",
                group.conditions.len(),
                group.unknowns.len(),
                group.given
            );
        }
        if self.groups.is_empty() {
            groups += "    {0, 0, NULL, NULL, NULL, 0}\n";
        }
        let guesses = self.guess_tables(&mut notes);
        let text = text + &list + "};\n" + &groups + "};\n" + &guesses;
        Written { notes, ..Written::of(text.trim_end()) }
    }
}

/// What counts as rounding: after a few operations, beside other entries of a column, beside the greatest singular value, of
/// residuals in units of their own; how far beside a point is another one, of which rates are compared, and along the rates in
/// steps; the least damping of Newton's method at a start; and
/// what a solution in a fixed order may leave of an equation; how near to a singular position rates are rounding.
fn tolerances(real: Real) -> [(&'static str, String); 10] {
    let words = [
        "CLOSE_TO_ROUNDING",
        "ROUNDING_OF_ENTRIES",
        "ROUNDING_OF_RANK",
        "BORROWED_ROUNDING",
        "BESIDE",
        "PART_BESIDE",
        "PART_ALONG",
        "LEAST_DAMPING",
        "LEFT_OVER",
        "CLOSE_TO_SINGULAR",
    ];
    // Below it what damping asks of a correction would be rounding.
    let values = match real {
        Real::Double => [1e-9, 1e-14, 1e-11, 1e6, 1e-8, 1.0 / (1 << 12) as f64, 1e-2, 1e-12, 1e-10, 1e-7],
        Real::Float => [3e-5, 5e-6, 2e-5, 30.0, 3e-4, 3e-4, 0.3, 1e-6, 1e-4, 3e-4],
    };
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|i| (words[i], real.number(values[i])))
}

/// Nodes, and the weights of each stage and of the step.
fn tableau(method: Method, real: Real) -> (String, String) {
    let (nodes, weights): (&[f64], Vec<Vec<f64>>) = match method {
        Method::Euler | Method::ImplicitMidpoint | Method::LinearlyImplicitEuler | Method::LinearlyImplicitBdf2 => {
            (&[0.0], vec![vec![0.0], vec![1.0]])
        }
        Method::Heun => (&[0.0, 1.0], vec![vec![0.0; 2], vec![1.0, 0.0], vec![0.5, 0.5]]),
        Method::Rk4 => (
            &[0.0, 0.5, 0.5, 1.0],
            vec![
                vec![0.0; 4],
                vec![0.5, 0.0, 0.0, 0.0],
                vec![0.0, 0.5, 0.0, 0.0],
                vec![0.0, 0.0, 1.0, 0.0],
                vec![1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
            ],
        ),
        Method::Rosenbrock => (
            &[0.0, 0.0, 1.0, 1.0],
            vec![
                vec![0.0; 4],
                vec![0.0; 4],
                vec![2.0, 0.0, 0.0, 0.0],
                vec![2.0, 0.0, 1.0, 0.0],
                vec![2.0, 0.0, 1.0, 1.0],
            ],
        ),
    };
    (list(nodes, real), rows(&weights, real))
}

/// What linearly implicit methods have besides: γ, parts of the derivative by time, weights of earlier stages on the right
/// side of each, and which stages stand where the one before does.
fn linearly_implicit(method: Method, real: Real) -> [(&'static str, String); 4] {
    let (gamma, time_weights, right, repeats): (f64, &[f64], Vec<Vec<f64>>, &[bool]) = match method {
        Method::Rosenbrock => (
            0.5,
            &[0.5, 1.5, 0.0, 0.0],
            vec![vec![0.0; 4], vec![4.0, 0.0, 0.0, 0.0], vec![1.0, -1.0, 0.0, 0.0], vec![1.0, -1.0, -8.0 / 3.0, 0.0]],
            &[false, true, false, false],
        ),
        _ => (1.0, &[1.0], vec![vec![0.0]], &[false]),
    };
    let repeats: Vec<&str> = repeats.iter().map(|&repeats| if repeats { "1" } else { "0" }).collect();
    [
        ("GAMMA", real.number(gamma)),
        ("TIME_WEIGHTS", list(time_weights, real)),
        ("RIGHT_WEIGHTS", rows(&right, real)),
        ("REPEATS", repeats.join(", ")),
    ]
}

fn list(values: &[f64], real: Real) -> String {
    values.iter().map(|&v| real.number(v)).collect::<Vec<_>>().join(", ")
}

fn rows(all: &[Vec<f64>], real: Real) -> String {
    all.iter().map(|row| format!("{{{}}}", list(row, real))).collect::<Vec<_>>().join(", ")
}
