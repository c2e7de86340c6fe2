//! The syntax tree as plain data.

use crate::span::{FileId, Span};

/// The tree of one model text.
///
/// Invariant: every span lies in `file`, and no tree is deeper than [`MAX_HEIGHT`].
#[derive(Debug, Clone, PartialEq)]
pub struct Ast {
    /// The file that the text came from.
    pub file: FileId,
    /// The line `model Name "doc"`; library files may go without.
    pub header: Option<Header>,
    /// The statements in the order of the text.
    pub statements: Vec<Statement>,
}

/// The greatest number of levels that an expression or a nest of statements has; deeper text is an error, and the part
/// too deep is left out of the tree. Recursion over a tree is safe on any usual stack.
pub const MAX_HEIGHT: usize = 640;

/// `model Name "doc"`.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// The model's name.
    pub name: Name,
    /// What the model is.
    pub doc: Option<Doc>,
}

/// A name as it stands in the text. Kinds `0` and `1`, and the label in `0 = expr`, are names too.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name {
    /// The name.
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// Quoted text that documents a declaration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Doc {
    /// The text between the quotes, escapes resolved.
    pub text: String,
    /// Where it stands, with its quotes.
    pub span: Span,
}

/// A unit as written, such as `kN/m`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnitText {
    /// The unit, to be read by [`unit`](crate::unit).
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// A statement and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// From its first to its last character.
    pub span: Span,
    /// What it says.
    pub kind: StatementKind,
}

/// What a statement says.
#[derive(Debug, Clone, PartialEq)]
pub enum StatementKind {
    /// `param a = 1 kg, b = 2 "doc"`. Without a value only where a component declares it.
    Param(Vec<Declaration>),
    /// `const g = 9.81 m/s2`.
    Const(Vec<Declaration>),
    /// `input road : m/s = 0`; the value is the default.
    Input(Vec<Declaration>),
    /// `output travel = spring.q : m`.
    Output(Vec<Declaration>),
    /// `let name = expr`.
    Let(Vec<Declaration>),
    /// `let f(x, y) = expr`.
    Function(Box<Function>),
    /// `state x' = rate from start`.
    State(Box<State>),
    /// `import "file.bond"`, `import std.electrical`.
    Import(Import),
    /// `component Name(...) { ... }`.
    Component(Box<Component>),
    /// `port frame { bond twist[6]; in R[3, 3] }`: a kind of port.
    PortKind(Box<PortKind>),
    /// `prefer w.f, spring`: what stays independent.
    Prefer(Vec<Path>),
    /// `causality m2 derivative, R1 conductive`.
    Causality(Vec<ForcedCausality>),
    /// `stroke a -> b at b`.
    Stroke(Box<ForcedStroke>),
    /// `guess th2 = 0.4 rad, spring.q = 0.1 m`: where the search of the start begins.
    Guess(Vec<Guess>),
    /// `constraint hinge: left = right`.
    Constraint(Box<Constraint>),
    /// `domain thermal pseudo { ... }`.
    Domain(Box<DomainBlock>),
    /// Nodes and the bonds between them: `Sf:ground(v) -> 0:tyre -> hub`.
    Chain(Chain),
    /// `discrete n = 0`: a value that changes at events only; given is the one at the start.
    Discrete(Vec<Declaration>),
    /// `when cond { ... }`: what happens at an event.
    When(Box<When>),
    /// `for i in 1..n { ... }`: statements repeated.
    For(Box<For>),
    /// `if i == 1 { ... } else { ... }`: statements that are there or not.
    Choice(Box<Choice>),
    /// `shape box:hull(r = car.r, R = car.R, size = [4, 1.6, 1])`: what a picture of the machine shows.
    Shape(Box<Element>),
}

/// A named value: `name : unit = value "doc"` (or the unit after the value).
#[derive(Debug, Clone, PartialEq)]
pub struct Declaration {
    /// The port in `let b.R = ...`, whose signal is given.
    pub owner: Option<Name>,
    /// What is declared.
    pub name: Name,
    /// What stands in brackets behind the name: indices, or how many elements there are.
    pub indices: Vec<Expr>,
    /// The unit after `:`; in the head of a component also the kind of a port.
    pub unit: Option<UnitText>,
    /// The expression after `=`.
    pub value: Option<Expr>,
    /// The text that follows. In a list, `a = 1, b = 2 "doc"`, the parser gives the last text to those before it that
    /// have none.
    pub doc: Option<Doc>,
    /// The whole declaration.
    pub span: Span,
}

/// `th2 = 0.4 : rad "doc"` in a list of guesses, with the unit in one of two places as in a [`Declaration`].
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// The integrated signal or stored quantity.
    pub what: Path,
    /// The unit after `:`.
    pub unit: Option<UnitText>,
    /// The expression after `=`.
    pub value: Expr,
    /// The text that follows.
    pub doc: Option<Doc>,
    /// The whole guess.
    pub span: Span,
}

/// `let f(x, y) = body : unit "doc"`.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    /// The function's name.
    pub name: Name,
    /// Names of its arguments.
    pub params: Vec<Name>,
    /// Its value.
    pub body: Expr,
    /// The unit of its value.
    pub unit: Option<UnitText>,
    /// What it is.
    pub doc: Option<Doc>,
}

/// `state x' = rate from start : unit "doc"`.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// The signal that is integrated, without the prime.
    pub name: Name,
    /// Its indices.
    pub indices: Vec<Expr>,
    /// Its derivative in time.
    pub rate: Expr,
    /// Its value at the start.
    pub start: Option<Expr>,
    /// The unit of the signal.
    pub unit: Option<UnitText>,
    /// What it is.
    pub doc: Option<Doc>,
}

/// `import "file.bond"`, or `import std.electrical`.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The path, or the name of the library, as written.
    pub path: Doc,
    /// Whether it is a library.
    pub library: bool,
}

/// `component Name(param a, b = 1; port p, q; in u; out y) "doc" { ... }`.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// Its name, used as a kind.
    pub name: Name,
    /// Its parameters, with defaults.
    pub params: Vec<Declaration>,
    /// What it is made for, with defaults: numbers and parameters that stand where it has the name.
    pub consts: Vec<Declaration>,
    /// Its ports.
    pub ports: Vec<Declaration>,
    /// The signals it reads; a value is the default.
    pub ins: Vec<Declaration>,
    /// The signals it gives.
    pub outs: Vec<Declaration>,
    /// What it is.
    pub doc: Option<Doc>,
    /// What stands between the braces.
    pub body: Vec<Statement>,
}

impl Component {
    /// All that an instance may be given.
    pub fn arguments(&self) -> impl Iterator<Item = &Declaration> {
        self.params.iter().chain(&self.consts).chain(&self.ins)
    }
}

/// `port frame { bond twist[6]; in R[3, 3]; in r[3] } "doc"`: a kind of port, of several bonds and directed signals.
#[derive(Debug, Clone, PartialEq)]
pub struct PortKind {
    /// Its name.
    pub name: Name,
    /// Its bonds, in brackets how many there are.
    pub bonds: Vec<Declaration>,
    /// The signals that go along the half arrows.
    pub signals: Vec<Declaration>,
    /// What it is.
    pub doc: Option<Doc>,
}

/// One entry of a `causality` statement.
#[derive(Debug, Clone, PartialEq)]
pub struct ForcedCausality {
    /// The element, or a port of a field.
    pub element: Path,
    /// What is forced.
    pub causality: Causality,
    /// Where the word for it stands.
    pub span: Span,
}

/// The words of a `causality` statement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// A storage gives its co-energy variable.
    Integral,
    /// A storage takes its co-energy variable.
    Derivative,
    /// Flow in, effort out.
    Resistive,
    /// Effort in, flow out.
    Conductive,
}

/// `stroke a -> b at b`, or `stroke b3 at b` for a bond with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct ForcedStroke {
    /// The bond.
    pub bond: StrokeBond,
    /// The end with the stroke: where the effort is set from the other end.
    pub at: Path,
}

/// How a `stroke` statement names its bond.
#[derive(Debug, Clone, PartialEq)]
pub enum StrokeBond {
    /// By its two ends, in the order of the half arrow.
    Between(Path, Path),
    /// By its own name.
    Named(PathPart),
}

/// What a constraint says of its two sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// `left = right`
    Equal,
    /// `left >= right`
    AtLeast,
    /// `left <= right`
    AtMost,
}

/// `constraint name: left = right "doc"`, or `left >= right (restitution = 0.8)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// Its name; `name.e` is the multiplier.
    pub name: Name,
    /// Its indices.
    pub indices: Vec<Expr>,
    /// Left of the equals sign.
    pub left: Expr,
    /// What is said of the two.
    pub sides: Sides,
    /// Right of it, mostly 0.
    pub right: Expr,
    /// What happens where sides meet that may differ.
    pub args: Vec<Arg>,
    /// What it is.
    pub doc: Option<Doc>,
}

/// `domain thermal pseudo { ... }`: the statements inside are about that domain, their names belong to the model.
#[derive(Debug, Clone, PartialEq)]
pub struct DomainBlock {
    /// Its name.
    pub name: Name,
    /// Where `pseudo` stands: effort times flow is not a power.
    pub pseudo: Option<Span>,
    /// What it is.
    pub doc: Option<Doc>,
    /// What stands between the braces.
    pub body: Vec<Statement>,
}

/// Nodes joined by bonds: `first -> to -> to ...`. Without bonds it only declares (or names) a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// The leftmost node.
    pub first: Node,
    /// The bonds from left to right; each begins at the node before it.
    pub bonds: Vec<Bond>,
}

/// `-> to as name`.
#[derive(Debug, Clone, PartialEq)]
pub struct Bond {
    /// Where the arrow stands.
    pub arrow: Span,
    /// The node that the half arrow points at.
    pub to: Node,
    /// The bond's name.
    pub name: Option<PathPart>,
    /// What it is.
    pub doc: Option<Doc>,
}

/// An end of a bond.
#[derive(Debug, Clone, PartialEq)]
pub enum Node {
    /// `Kind:name(args)`, where the node first stands.
    Declared(Box<Element>),
    /// `name`, `inst.port` or `field.port`, declared elsewhere.
    Named(Path),
    /// `[v, w]`: the bonds of several nodes side by side.
    Joined(Vec<Node>, Span),
    /// Nothing that can be read; an error has been reported here.
    Missing(Span),
}

/// `Kind:name[indices][ports](args) "doc"`.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// `0`, `1`, `Se`, ..., or the name of a component.
    pub kind: Name,
    /// The width in `I[3]:body`, the rows and columns in `TF[6,1]:axis`, the kind of port in `1[frame]:hub`.
    pub widths: Vec<Expr>,
    /// Its name.
    pub name: Name,
    /// The indices in `C:cell[i + 1](...)`, also `C:cell[i][x, y](...)`.
    pub indices: Vec<Expr>,
    /// The ports of a field, empty when none are listed. Where every index is a name, as in `C:cell[i](...)`, the indices
    /// stand here: which of the two they are, the names in reach decide.
    pub ports: Vec<Name>,
    /// What stands in the parentheses.
    pub args: Vec<Arg>,
    /// What it is.
    pub doc: Option<Doc>,
    /// The port in `Diode:d.p`, where a bond ends: an error of the parser says that it is named elsewhere.
    pub port: Option<Name>,
    /// From the kind to the closing parenthesis.
    pub span: Span,
}

/// An argument of an element, a component or a function.
#[derive(Debug, Clone, PartialEq)]
pub struct Arg {
    /// What stands before the equals sign, if one is there.
    pub label: Option<ArgLabel>,
    /// The value.
    pub value: Expr,
    /// The whole argument.
    pub span: Span,
}

/// The left side of a named argument: `k`, `e`, `0`, `f.a`, `q0.el`.
#[derive(Debug, Clone, PartialEq)]
pub struct ArgLabel {
    /// `k`, `e`, `f`, `0`, `q0`, `energy`, ...
    pub name: Name,
    /// The port in `f.a`.
    pub port: Option<Name>,
    /// The whole label.
    pub span: Span,
}

/// A name, bare or dotted: `x`, `m.e`, `gap.el.q`, `inst.sub.x.f`.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// The parts between the dots, at least one.
    pub parts: Vec<PathPart>,
    /// The whole path.
    pub span: Span,
}

/// One part of a path, or a name with indices: `cell`, `cell[i]`, `node[i, j + 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct PathPart {
    /// The name.
    pub name: Name,
    /// Its indices, mostly none.
    pub indices: Vec<Expr>,
}

/// An expression and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    /// The whole expression, without parentheses around it.
    pub span: Span,
    /// What it says.
    pub kind: ExprKind,
}

/// What an expression says.
#[derive(Debug, Clone, PartialEq)]
pub enum ExprKind {
    /// `18 kN/m`.
    Number(Number),
    /// `"file.csv"`, escapes resolved.
    Text(String),
    /// `x`, `m.e`.
    Path(Path),
    /// `x'`, a time derivative; `x''` is a rate of a rate.
    Rate(Box<Expr>),
    /// `sin(x)`, `table("f.csv", x, column = 2)`.
    Call(Call),
    /// `[a, b]`; a matrix is a list of lists.
    List(Vec<Expr>),
    /// `[10*i for i in 1..n]`.
    Repeated(Repeated),
    /// `sum(i in 1..n, m[i].f)`.
    Sum(Repeated),
    /// `-x`, `not x`.
    Unary(Unary),
    /// `a + b`.
    Binary(Binary),
    /// `if c then a else b`.
    If(If),
    /// Nothing that can be read; an error has been reported here.
    Missing,
}

/// A number as written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Number {
    /// Its exact decimal text: digits, perhaps a point with digits on both sides, perhaps an exponent.
    pub text: String,
    /// The unit that follows it.
    pub unit: Option<UnitText>,
}

/// `function(args)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Call {
    /// The function's name.
    pub function: Name,
    /// Its arguments.
    pub args: Vec<Arg>,
}

/// An expression for each value of a variable: `expr for i in from..to`.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeated {
    /// The expression.
    pub value: Box<Expr>,
    /// The variable.
    pub variable: Name,
    /// First value.
    pub from: Box<Expr>,
    /// Last value.
    pub to: Box<Expr>,
}

/// `-x` or `not x`.
#[derive(Debug, Clone, PartialEq)]
pub struct Unary {
    /// The operator.
    pub op: UnaryOp,
    /// Where the operator stands.
    pub op_span: Span,
    /// What it is applied to.
    pub operand: Box<Expr>,
}

/// Operators before one operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnaryOp {
    /// `-`
    Neg,
    /// `not`
    Not,
}

/// `left op right`.
#[derive(Debug, Clone, PartialEq)]
pub struct Binary {
    /// The operator.
    pub op: BinaryOp,
    /// Where the operator stands.
    pub op_span: Span,
    /// Left operand.
    pub left: Box<Expr>,
    /// Right operand.
    pub right: Box<Expr>,
}

/// Operators between two operands, from loose to tight: `or`, `and`, comparison, `+ -`, `* /`, `^`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BinaryOp {
    /// `or`
    Or,
    /// `and`
    And,
    /// `<`
    Lt,
    /// `<=`
    Le,
    /// `>`
    Gt,
    /// `>=`
    Ge,
    /// `==`
    Eq,
    /// `!=`
    Ne,
    /// `+`
    Add,
    /// `-`
    Sub,
    /// `*`
    Mul,
    /// `/`
    Div,
    /// `^`, to the right and tighter than a minus before its base
    Pow,
}

/// `if cond then yes else no`.
#[derive(Debug, Clone, PartialEq)]
pub struct If {
    /// The condition.
    pub cond: Box<Expr>,
    /// Its value where the condition holds.
    pub yes: Box<Expr>,
    /// Its value elsewhere.
    pub no: Box<Expr>,
}

/// `when cond { reset m.p = expr ... }` or `when every 10 ms { n = n + 1 ... }`.
#[derive(Debug, Clone, PartialEq)]
pub struct When {
    /// When it happens.
    pub trigger: Trigger,
    /// What happens then, all at once.
    pub actions: Vec<Action>,
}

/// When an event happens.
#[derive(Debug, Clone, PartialEq)]
pub enum Trigger {
    /// Where the condition becomes true.
    Becomes(Expr),
    /// At every multiple of a period.
    Every(Expr),
}

impl Trigger {
    /// The condition or the period.
    pub fn expr(&self) -> &Expr {
        let (Trigger::Becomes(e) | Trigger::Every(e)) = self;
        e
    }
}

/// `reset m.p = expr`, or `n = expr` of a discrete variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// Whether `reset` stands before it: a state is reset, else a discrete variable is set.
    pub reset: bool,
    /// What changes.
    pub target: Path,
    /// Its new value.
    pub value: Expr,
    /// From its first to its last character.
    pub span: Span,
}

/// `for i in from..to { ... }`.
#[derive(Debug, Clone, PartialEq)]
pub struct For {
    /// The loop variable.
    pub variable: Name,
    /// First value.
    pub from: Expr,
    /// Last value.
    pub to: Expr,
    /// What stands between the braces.
    pub body: Vec<Statement>,
}

/// `if cond { ... } else { ... }` around statements.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The condition.
    pub cond: Expr,
    /// The statements that are there where it holds.
    pub yes: Vec<Statement>,
    /// Those that are there elsewhere; of `else if` the one choice that follows.
    pub no: Vec<Statement>,
}
