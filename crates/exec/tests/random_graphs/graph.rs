//! Random bond graphs as plain descriptions, and as model text.

use std::fmt::Write;

/// A small generator of random numbers (splitmix64): the same graphs on every machine.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// True in so many of a hundred cases.
    pub fn percent(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    /// One of these.
    pub fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    /// Between -1 and 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A rational number, and whether the model declares it as a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number {
    pub top: i64,
    pub bottom: i64,
    pub declared: bool,
}

impl Number {
    pub fn value(self) -> f64 {
        self.top as f64 / self.bottom as f64
    }
}

/// What a modulus reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// The stored quantity of this node.
    Stored(usize),
    /// The integral of the flow of this 1-junction (a state of its own).
    Integral(usize),
}

/// A modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Modulus {
    Constant(Number),
    /// `a + b x`, or `a + b sin(x)`.
    Varying {
        a: Number,
        b: Number,
        of: Reading,
        sine: bool,
    },
}

/// The value of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Signal {
    /// `a + b sin(t)`.
    Waving(Number, Number),
    /// An input, constant while it is looked at.
    Input(Number),
    /// `a + b y`, where `y` is the common variable of this junction.
    Sensed(Number, Number, usize),
}

/// The law of a storage, `z = a X + b X^3`; the first number is `1/a` for an I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Storing {
    pub size: Number,
    pub cubic: Option<Number>,
}

/// The law of a resistor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Resisting {
    /// `e = r f`.
    Resistance(Number),
    /// `f = g e`.
    Conductance(Number),
    /// `e = a f + b f^3`.
    CubicEffort(Number, Number),
    /// `f = a e + b e^3`.
    CubicFlow(Number, Number),
}

/// An element or junction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    Zero,
    One,
    Transformer(Modulus),
    Gyrator(Modulus),
    Effort(Signal),
    Flow(Signal),
    Held,
    Inertance(Storing),
    Compliance(Storing),
    Resistor(Resisting),
}

/// A node of the graph. Removed nodes keep their place, so that names stay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    pub kind: Kind,
    /// Start value of the stored quantity.
    pub start: Option<Number>,
}

/// A bond from one node to another; a two-port has one in and one out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bond {
    pub from: usize,
    pub to: usize,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Graph {
    pub nodes: Vec<Node>,
    pub bonds: Vec<Bond>,
    /// Storages and 1-junctions whose variable is preferred to be independent.
    pub preferred: Vec<usize>,
}

impl Graph {
    fn add(&mut self, kind: Kind) -> usize {
        self.nodes.push(Node { kind, start: None });
        self.nodes.len() - 1
    }

    fn bond(&mut self, from: usize, to: usize) {
        self.bonds.push(Bond { from, to });
    }

    fn junctions(&self) -> Vec<usize> {
        let junction = |&n: &usize| matches!(self.nodes[n].kind, Kind::Zero | Kind::One);
        (0..self.nodes.len()).filter(junction).collect()
    }

    /// Adds another graph; by how much the numbers of its nodes are greater here.
    fn append(&mut self, other: Graph) -> usize {
        let by = self.nodes.len();
        let modulus = |m: &mut Modulus| {
            if let Modulus::Varying { of: Reading::Stored(n) | Reading::Integral(n), .. } = m {
                *n += by;
            }
        };
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            match &mut node.kind {
                Kind::Transformer(m) | Kind::Gyrator(m) => modulus(m),
                Kind::Effort(Signal::Sensed(_, _, n)) | Kind::Flow(Signal::Sensed(_, _, n)) => *n += by,
                _ => {}
            }
            node
        }));
        self.bonds.extend(other.bonds.iter().map(|b| Bond { from: b.from + by, to: b.to + by }));
        self.preferred.extend(other.preferred.iter().map(|n| n + by));
        by
    }

    /// Whether every node with a bond is joined to every other.
    fn is_connected(&self) -> bool {
        let mut reached = vec![false; self.nodes.len()];
        let mut open = vec![self.bonds[0].from];
        while let Some(node) = open.pop() {
            if !std::mem::replace(&mut reached[node], true) {
                let at = self.bonds.iter().filter(|b| b.from == node || b.to == node);
                open.extend(at.map(|b| b.from + b.to - node));
            }
        }
        (0..self.nodes.len()).all(|n| reached[n] || !self.is_used(n))
    }

    pub fn is_used(&self, node: usize) -> bool {
        self.bonds.iter().any(|b| b.from == node || b.to == node)
    }

    /// The bond at a one-port.
    pub fn bond_of(&self, node: usize) -> Option<usize> {
        self.bonds.iter().position(|b| b.from == node || b.to == node)
    }

    /// Bonds at a node, with whether their half arrows point at it.
    pub fn bonds_at(&self, node: usize) -> Vec<(usize, bool)> {
        let ends = self.bonds.iter().enumerate();
        ends.flat_map(|(i, b)| [(b.to == node).then_some((i, true)), (b.from == node).then_some((i, false))])
            .flatten()
            .collect()
    }

    /// Used storages, in order.
    pub fn storages(&self) -> Vec<usize> {
        let storage = |&n: &usize| matches!(self.nodes[n].kind, Kind::Inertance(_) | Kind::Compliance(_));
        (0..self.nodes.len()).filter(storage).filter(|&n| self.is_used(n)).collect()
    }

    /// Used inputs, in order.
    pub fn inputs(&self) -> Vec<usize> {
        let input =
            |&n: &usize| matches!(self.nodes[n].kind, Kind::Effort(Signal::Input(_)) | Kind::Flow(Signal::Input(_)));
        (0..self.nodes.len()).filter(input).filter(|&n| self.is_used(n)).collect()
    }

    /// 1-junctions whose flow is integrated.
    pub fn integrals(&self) -> Vec<usize> {
        let mut found = Vec::new();
        for (n, node) in self.nodes.iter().enumerate() {
            if let Kind::Transformer(Modulus::Varying { of: Reading::Integral(j), .. })
            | Kind::Gyrator(Modulus::Varying { of: Reading::Integral(j), .. }) = node.kind
                && self.is_used(n)
                && !found.contains(&j)
            {
                found.push(j);
            }
        }
        found
    }

    /// Whether all laws are linear and all moduli constant.
    pub fn is_linear(&self) -> bool {
        let constant = |m: &Modulus| matches!(m, Modulus::Constant(_));
        self.nodes.iter().enumerate().filter(|(n, _)| self.is_used(*n)).all(|(_, node)| match &node.kind {
            Kind::Transformer(m) | Kind::Gyrator(m) => constant(m),
            Kind::Inertance(s) | Kind::Compliance(s) => s.cubic.is_none(),
            Kind::Resistor(r) => matches!(r, Resisting::Resistance(_) | Resisting::Conductance(_)),
            _ => true,
        })
    }

    /// Whether all moduli are constant.
    pub fn has_constant_structure(&self) -> bool {
        let constant = |m: &Modulus| matches!(m, Modulus::Constant(_));
        self.nodes.iter().enumerate().filter(|(n, _)| self.is_used(*n)).all(|(_, node)| match &node.kind {
            Kind::Transformer(m) | Kind::Gyrator(m) => constant(m),
            _ => true,
        })
    }

    /// What is left when these bonds are taken away: two-ports that have lost a bond go too, with their other one.
    pub fn without(&self, mut gone: Vec<usize>) -> Graph {
        loop {
            let left = |b: &usize| !gone.contains(b);
            let mut more = Vec::new();
            for (n, node) in self.nodes.iter().enumerate() {
                if matches!(node.kind, Kind::Transformer(_) | Kind::Gyrator(_)) {
                    let at: Vec<usize> = self.bonds_at(n).into_iter().map(|b| b.0).collect();
                    if at.iter().any(|b| !left(b)) {
                        more.extend(at.into_iter().filter(left));
                    }
                }
            }
            if more.is_empty() {
                break;
            }
            gone.extend(more);
        }
        let bonds = self.bonds.iter().enumerate().filter(|(i, _)| !gone.contains(i)).map(|(_, b)| *b).collect();
        let mut graph = Graph { nodes: self.nodes.clone(), bonds, preferred: Vec::new() };
        graph.preferred = self.preferred.iter().copied().filter(|&n| graph.is_used(n)).collect();
        graph
    }

    /// Whether every modulus and source still has what it reads.
    pub fn is_whole(&self) -> bool {
        let reads = |m: &Modulus| match m {
            Modulus::Varying { of: Reading::Stored(n) | Reading::Integral(n), .. } => self.is_used(*n),
            Modulus::Constant(_) => true,
        };
        !self.bonds.is_empty()
            && self.nodes.iter().enumerate().filter(|(n, _)| self.is_used(*n)).all(|(_, node)| match &node.kind {
                Kind::Transformer(m) | Kind::Gyrator(m) => reads(m),
                Kind::Effort(Signal::Sensed(_, _, n)) | Kind::Flow(Signal::Sensed(_, _, n)) => self.is_used(*n),
                _ => true,
            })
    }

    /// Whether a source reads a junction.
    pub fn senses(&self) -> bool {
        let sensed = |k: &Kind| matches!(k, Kind::Effort(Signal::Sensed(..)) | Kind::Flow(Signal::Sensed(..)));
        self.nodes.iter().enumerate().any(|(n, node)| self.is_used(n) && sensed(&node.kind))
    }

    pub fn name(&self, node: usize) -> String {
        let kind = match self.nodes[node].kind {
            Kind::Zero | Kind::One => "j",
            Kind::Transformer(_) => "TF",
            Kind::Gyrator(_) => "GY",
            Kind::Effort(_) => "Se",
            Kind::Flow(_) => "Sf",
            Kind::Held => "ZC",
            Kind::Inertance(_) => "I",
            Kind::Compliance(_) => "C",
            Kind::Resistor(_) => "R",
        };
        format!("{kind}{node}")
    }

    /// The name of the stored quantity of a node.
    pub fn stored_name(&self, node: usize) -> String {
        let quantity = if matches!(self.nodes[node].kind, Kind::Inertance(_)) { "p" } else { "q" };
        format!("{}.{quantity}", self.name(node))
    }

    /// The graph as a model.
    pub fn text(&self) -> String {
        let mut text = Text { params: String::new(), count: 0 };
        let mut body = String::new();
        for node in 0..self.nodes.len() {
            if self.is_used(node) {
                let declared = self.declaration(node, &mut text);
                let _ = writeln!(body, "{declared}");
            }
        }
        for (i, bond) in self.bonds.iter().enumerate() {
            let _ = writeln!(body, "{} -> {} as b{i}", self.name(bond.from), self.name(bond.to));
        }
        for j in self.integrals() {
            let _ = writeln!(body, "state phi{j}' = {}.f from 1/2", self.name(j));
        }
        for &n in &self.preferred {
            let _ = writeln!(body, "prefer {}", self.name(n));
        }
        format!("model Random\n{}{body}", text.params)
    }

    fn declaration(&self, node: usize, text: &mut Text) -> String {
        let name = self.name(node);
        let start = |quantity: &str| match self.nodes[node].start {
            Some(start) => format!(", {quantity} = {}/{}", start.top, start.bottom),
            None => String::new(),
        };
        match self.nodes[node].kind {
            Kind::Zero => format!("0:{name}"),
            Kind::One => format!("1:{name}"),
            Kind::Transformer(m) => format!("TF:{name}({})", self.modulus(m, text)),
            Kind::Gyrator(m) => format!("GY:{name}({})", self.modulus(m, text)),
            Kind::Effort(s) => format!("Se:{name}({})", text.signal(s, node, &self.nodes)),
            Kind::Flow(s) => format!("Sf:{name}({})", text.signal(s, node, &self.nodes)),
            Kind::Held => format!("ZC:{name}"),
            Kind::Inertance(s) => {
                let size = text.number(s.size);
                let law = s.cubic.map_or(size.clone(), |c| format!("f = p/({size}) + {}*p^3", text.number(c)));
                format!("I:{name}({law}{})", start("p0"))
            }
            Kind::Compliance(s) => {
                let size = text.number(s.size);
                let law = s.cubic.map_or(format!("k = {size}"), |c| format!("e = {size}*q + {}*q^3", text.number(c)));
                format!("C:{name}({law}{})", start("q0"))
            }
            Kind::Resistor(r) => {
                let law = match r {
                    Resisting::Resistance(r) => text.number(r),
                    Resisting::Conductance(g) => format!("g = {}", text.number(g)),
                    Resisting::CubicEffort(a, b) => format!("e = {}*f + {}*f^3", text.number(a), text.number(b)),
                    Resisting::CubicFlow(a, b) => format!("f = {}*e + {}*e^3", text.number(a), text.number(b)),
                };
                format!("R:{name}({law})")
            }
        }
    }

    fn modulus(&self, modulus: Modulus, text: &mut Text) -> String {
        match modulus {
            Modulus::Constant(number) => text.number(number),
            Modulus::Varying { a, b, of, sine } => {
                let read = match of {
                    Reading::Stored(n) => self.stored_name(n),
                    Reading::Integral(n) => format!("phi{n}"),
                };
                let read = if sine { format!("sin({read})") } else { read };
                format!("{} + {}*{read}", text.number(a), text.number(b))
            }
        }
    }
}

struct Text {
    params: String,
    count: usize,
}

impl Text {
    fn number(&mut self, number: Number) -> String {
        let plain = match number.bottom {
            1 => format!("{}", number.top),
            bottom => format!("{}/{bottom}", number.top),
        };
        if number.declared {
            self.count += 1;
            let _ = writeln!(self.params, "param a{} = {plain}", self.count);
            return format!("a{}", self.count);
        }
        if plain.starts_with('-') || plain.contains('/') { format!("({plain})") } else { plain }
    }

    fn signal(&mut self, signal: Signal, node: usize, nodes: &[Node]) -> String {
        match signal {
            Signal::Waving(a, b) if b.top == 0 => self.number(a),
            Signal::Waving(a, b) => format!("{} + {}*sin(t)", self.number(a), self.number(b)),
            Signal::Sensed(a, b, junction) => {
                let read = if matches!(nodes[junction].kind, Kind::Zero) { "e" } else { "f" };
                format!("{} + {}*j{junction}.{read}", self.number(a), self.number(b))
            }
            Signal::Input(default) => {
                let default = self.number(default);
                let _ = writeln!(self.params, "input u{node} = {default}");
                format!("u{node}")
            }
        }
    }
}

/// What kinds of graphs are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Family {
    /// Linear laws, constant moduli.
    Linear,
    /// Cubic laws in a part of the storages and resistors, constant moduli.
    Nonlinear,
    /// The same, with moduli that read states.
    Varying,
    /// Linear, with sources that read the variables of junctions.
    Sensing,
}

/// A random graph.
pub fn random_graph(random: &mut Random, family: Family) -> Graph {
    let mut graph = Graph::default();
    let dense = random.percent(20);
    let junctions = if dense { 4 + random.below(5) } else { random.of(&[1, 2, 2, 3, 3, 4, 4, 5, 6]) };
    for _ in 0..junctions {
        let kind = random.of(&[Kind::Zero, Kind::One]);
        graph.add(kind);
    }
    for j in 1..junctions {
        let other = random.below(j);
        if !random.percent(3) {
            link(random, &mut graph, j, other);
        }
    }
    let rings = if dense { 2 + random.below(4) } else { random.of(&[0, 0, 1, 1, 2, 3]) };
    for _ in 0..rings {
        let (a, b) = (random.below(junctions), random.below(junctions));
        if a != b || random.percent(10) {
            link(random, &mut graph, a, b);
        }
    }
    for j in 0..junctions {
        for _ in 0..if dense { random.below(3) } else { random.of(&[0, 1, 1, 2, 2, 3]) } {
            leaf(random, &mut graph, j, family);
        }
    }
    if random.percent(5) {
        pair(random, &mut graph);
    }
    if graph.bonds.is_empty() {
        leaf(random, &mut graph, 0, family);
    }
    match family {
        Family::Varying => vary(random, &mut graph),
        Family::Sensing => sense(random, &mut graph),
        Family::Linear | Family::Nonlinear => {}
    }
    if random.percent(15) {
        let storages = graph.storages();
        if !storages.is_empty() {
            graph.preferred.push(random.of(&storages));
        }
    }
    if random.percent(40) {
        for n in graph.storages() {
            if random.percent(40) {
                graph.nodes[n].start = Some(Number { top: random.below(7) as i64 - 3, bottom: 4, declared: false });
            }
        }
    }
    graph
}

/// A connected graph of more than so many nodes: pairs of random graphs that are linked stiffly and are `sound` then, in a
/// row with storages between one and the next.
pub fn composed(random: &mut Random, families: &[Family], nodes: usize, sound: impl Fn(&Graph) -> bool) -> Graph {
    let mut whole = Graph::default();
    let mut last = None;
    while whole.nodes.len() <= nodes {
        let [mut pair, other] = std::array::from_fn(|_| {
            let family = random.of(families);
            random_graph(random, family)
        });
        let (before, after) = (random.of(&pair.junctions()), random.of(&other.junctions()));
        let offset = pair.append(other);
        link(random, &mut pair, before, after + offset);
        if !(pair.is_connected() && sound(&pair)) {
            continue;
        }
        let (first, next) = (random.of(&pair.junctions()), random.of(&pair.junctions()));
        let offset = whole.append(pair);
        if let Some(last) = last {
            couple(random, &mut whole, last, first + offset);
        }
        last = Some(next + offset);
    }
    whole
}

/// Two junctions moved by one inertance, a 1-junction by way of a compliance: that holds whatever each of them is given.
fn couple(random: &mut Random, graph: &mut Graph, a: usize, b: usize) {
    let mut storing = || Storing { size: positive(random), cubic: None };
    let [a, b] = [a, b].map(|junction| match graph.nodes[junction].kind {
        Kind::Zero => junction,
        _ => {
            let between = graph.add(Kind::Zero);
            let compliance = graph.add(Kind::Compliance(storing()));
            graph.bond(junction, between);
            graph.bond(between, compliance);
            between
        }
    });
    let (between, inertance) = (graph.add(Kind::One), graph.add(Kind::Inertance(storing())));
    graph.bond(a, between);
    graph.bond(between, b);
    graph.bond(between, inertance);
}

fn positive(random: &mut Random) -> Number {
    let (top, bottom) = random.of(&[(1, 1), (1, 1), (2, 1), (1, 2), (3, 1), (3, 2), (2, 3), (5, 4), (7, 5), (4, 1)]);
    Number { top, bottom, declared: random.percent(30) }
}

fn any(random: &mut Random) -> Number {
    let (top, bottom) = random.of(&[(1, 1), (1, 1), (1, 1), (-1, 1), (2, 1), (1, 2), (-2, 1), (3, 2), (-1, 3), (5, 1)]);
    Number { top, bottom, declared: random.percent(30) }
}

fn link(random: &mut Random, graph: &mut Graph, a: usize, b: usize) {
    let (a, b) = if random.percent(50) { (a, b) } else { (b, a) };
    let through = if a == b { random.of(&[70, 90]) } else { random.below(100) };
    match through {
        0..60 => graph.bond(a, b),
        _ => {
            let middle = two_port(random, graph);
            graph.bond(a, middle);
            if random.percent(8) {
                let second = two_port(random, graph);
                graph.bond(middle, second);
                graph.bond(second, b);
            } else {
                graph.bond(middle, b);
            }
        }
    }
}

fn two_port(random: &mut Random, graph: &mut Graph) -> usize {
    let modulus = Modulus::Constant(any(random));
    let kind = if random.percent(60) { Kind::Transformer(modulus) } else { Kind::Gyrator(modulus) };
    graph.add(kind)
}

fn leaf(random: &mut Random, graph: &mut Graph, junction: usize, family: Family) {
    let bends = matches!(family, Family::Nonlinear | Family::Varying);
    let storing = |random: &mut Random| Storing {
        size: positive(random),
        cubic: (bends && random.percent(30)).then(|| positive(random)),
    };
    let kind = match random.below(100) {
        0..28 => Kind::Inertance(storing(random)),
        28..54 => Kind::Compliance(storing(random)),
        54..79 => Kind::Resistor(match random.below(if bends { 6 } else { 4 }) {
            0 | 1 => Resisting::Resistance(positive(random)),
            2 | 3 => Resisting::Conductance(positive(random)),
            4 => Resisting::CubicEffort(positive(random), positive(random)),
            _ => Resisting::CubicFlow(positive(random), positive(random)),
        }),
        79..88 => Kind::Effort(signal(random)),
        88..96 => Kind::Flow(signal(random)),
        _ => Kind::Held,
    };
    let source = matches!(kind, Kind::Effort(_) | Kind::Flow(_) | Kind::Held);
    let node = graph.add(kind);
    let inner = if random.percent(12) {
        let middle = two_port(random, graph);
        if source && random.percent(70) {
            graph.bond(middle, junction)
        } else {
            graph.bond(junction, middle)
        }
        middle
    } else {
        junction
    };
    let inward_only = inner != junction && graph.bonds.last().is_some_and(|b| b.to == inner);
    let outward = match inner == junction {
        true => source && random.percent(70),
        false => !inward_only,
    };
    if outward { graph.bond(node, inner) } else { graph.bond(inner, node) }
}

/// A source that acts on an element without a junction.
fn pair(random: &mut Random, graph: &mut Graph) {
    let signal = signal(random);
    let source = random.of(&[Kind::Effort(signal), Kind::Flow(signal)]);
    let size = positive(random);
    let storing = Storing { size, cubic: None };
    let taker =
        random.of(&[Kind::Inertance(storing), Kind::Compliance(storing), Kind::Resistor(Resisting::Resistance(size))]);
    let (source, taker) = (graph.add(source), graph.add(taker));
    if random.percent(30) {
        let middle = two_port(random, graph);
        graph.bond(source, middle);
        graph.bond(middle, taker);
    } else {
        graph.bond(source, taker);
    }
}

fn signal(random: &mut Random) -> Signal {
    let zero = Number { top: 0, bottom: 1, declared: false };
    match random.below(10) {
        0 => Signal::Input(any(random)),
        1 | 2 => Signal::Waving(any(random), any(random)),
        3 => Signal::Waving(zero, zero),
        _ => Signal::Waving(any(random), zero),
    }
}

/// Makes some sources read junctions.
fn sense(random: &mut Random, graph: &mut Graph) {
    let junction = |&n: &usize| matches!(graph.nodes[n].kind, Kind::Zero | Kind::One) && graph.is_used(n);
    let junctions: Vec<usize> = (0..graph.nodes.len()).filter(junction).collect();
    for node in &mut graph.nodes {
        if let Kind::Effort(s) | Kind::Flow(s) = &mut node.kind
            && !junctions.is_empty()
            && random.percent(70)
        {
            *s = Signal::Sensed(any(random), any(random), random.of(&junctions));
        }
    }
}

/// Makes some moduli read states.
fn vary(random: &mut Random, graph: &mut Graph) {
    let storages = graph.storages();
    let flows: Vec<usize> =
        (0..graph.nodes.len()).filter(|&n| matches!(graph.nodes[n].kind, Kind::One) && graph.is_used(n)).collect();
    for n in 0..graph.nodes.len() {
        let of = match (storages.is_empty(), flows.is_empty()) {
            (false, false) if random.percent(30) => Reading::Integral(random.of(&flows)),
            (false, _) => Reading::Stored(random.of(&storages)),
            (true, false) => Reading::Integral(random.of(&flows)),
            (true, true) => return,
        };
        let (a, b) = (any(random), any(random));
        // An angle may stand in a sine, a momentum may not.
        let angle = !matches!(of, Reading::Stored(n) if matches!(graph.nodes[n].kind, Kind::Inertance(_)));
        let sine = angle && random.percent(50);
        let varied = Modulus::Varying { a, b, of, sine };
        if random.percent(50) {
            match &mut graph.nodes[n].kind {
                Kind::Transformer(m) | Kind::Gyrator(m) => *m = varied,
                _ => {}
            }
        }
    }
}
