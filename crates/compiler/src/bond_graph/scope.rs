//! What the names of a model mean: two namespaces a scope, one for values, one for elements.

use rustc_hash::FxHashMap;

use super::families::{Families, FamilyId, Indices, spelled};
use super::multibonds::strand_of;
use super::repeat::Repeats;
use super::uses::Used;
use super::value::Reading;
use crate::ast;
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// Words that no declaration may use: time and pi, and what a law calls its own.
const RESERVED: [&str; 2] = ["t", "pi"];

/// Functions of the language, with the numbers of arguments that they take.
pub(super) const FUNCTIONS: [(&str, usize, usize); 27] = [
    ("sin", 1, 1),
    ("cos", 1, 1),
    ("tan", 1, 1),
    ("asin", 1, 1),
    ("acos", 1, 1),
    ("atan", 1, 1),
    ("atan2", 2, 2),
    ("exp", 1, 1),
    ("log", 1, 1),
    ("log10", 1, 1),
    ("sqrt", 1, 1),
    ("abs", 1, 1),
    ("sign", 1, 1),
    ("min", 2, 64),
    ("max", 2, 64),
    ("sinh", 1, 1),
    ("cosh", 1, 1),
    ("tanh", 1, 1),
    ("floor", 1, 1),
    ("mod", 2, 2),
    ("table", 2, 2),
    ("number", 2, 2),
    ("pid", 4, 4),
    ("tf", 3, 3),
    ("delay", 2, 2),
    ("sample", 2, 2),
    ("ln", 1, 1),
];

/// Index of a [`Scope`].
pub(super) type ScopeId = usize;
/// Index of a [`Decl`].
pub(super) type DeclId = usize;
/// Index of a component as it is written in a scope.
pub(super) type ComponentId = usize;
/// Index of a turn of a repetition.
pub(super) type TurnId = usize;

/// Where names are looked up: a scope, and the turn of the repetition in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Here {
    /// The scope.
    pub scope: ScopeId,
    /// The turn; 0 outside of repetitions.
    pub turn: TurnId,
}

impl Here {
    /// A scope, outside of its repetitions.
    pub fn of(scope: ScopeId) -> Here {
        Here { scope, turn: 0 }
    }
}

/// What a name of the first namespace stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Valued {
    /// A value or function.
    One(DeclId),
    /// Values with indices.
    Family(FamilyId),
}

/// The names of the model itself, or of one instance of a component.
pub(super) struct Scope<'a> {
    /// `inst.` before the names of its parts; empty for the model.
    pub prefix: String,
    /// Where names are looked up that are not found here: the scope in which the component is written.
    pub parent: Option<ScopeId>,
    /// The component and where it is used, if it is an instance.
    pub instance: Option<(&'a ast::Component, Span)>,
    /// Where it is used.
    pub user: Here,
    /// Number of instances around it.
    pub depth: usize,
    /// Parameters, signals and functions.
    pub values: FxHashMap<&'a str, Valued>,
    /// Elements, instances, ports, named bonds and constraints.
    pub nodes: FxHashMap<&'a str, (Node, Span)>,
    /// Components written here.
    pub components: FxHashMap<&'a str, ComponentId>,
}

/// What a name of the second namespace stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Node {
    /// An element or junction: index into the parts.
    Part(usize),
    /// A bond of a wide element: index into the parts, and the place of its port.
    Port(usize, usize),
    /// An instance of a component: its scope.
    Instance(ScopeId),
    /// A port of the component whose scope this is: index into the joints.
    Joint(usize),
    /// A named bond: index into the drawn bonds.
    Bond(usize),
    /// A `constraint`: index into the constraints.
    Constraint(usize),
    /// Several with indices.
    Family(FamilyId),
    /// Something whose declaration is at fault; said already.
    Broken,
}

/// A named value or function.
pub(super) struct Decl<'a> {
    /// Its full name.
    pub name: String,
    /// Its name as it is written, and the scope that it belongs to.
    pub own: &'a str,
    pub scope: ScopeId,
    /// Where its expression reads.
    pub reads: Here,
    /// Which element it is, if its expression is for all elements of an array.
    pub item: Indices,
    /// The array.
    pub array: Option<FamilyId>,
    /// Whether it has a value of its own in an array.
    pub alone: bool,
    /// What it is.
    pub kind: DeclKind<'a>,
    /// Unit after `:`, if written.
    pub unit: Option<&'a ast::UnitText>,
    /// The unit of the value that an override replaces.
    pub replaced_unit: Option<&'a ast::UnitText>,
    /// Documentation.
    pub doc: &'a str,
    /// Where its name stands.
    pub span: Span,
}

/// Kinds of declarations.
#[derive(Clone, Copy)]
pub(super) enum DeclKind<'a> {
    /// `param` and `const`.
    Parameter {
        /// The value as written.
        value: Option<&'a ast::Expr>,
        /// Whether it cannot be changed.
        constant: bool,
    },
    /// `input`.
    Input(Option<&'a ast::Expr>),
    /// `let` and what is joined to an `in` of an instance.
    Let(Option<&'a ast::Expr>),
    /// What is given for a `const` of a component: as `let`, but of numbers and parameters alone.
    MadeFor(Option<&'a ast::Expr>),
    /// `output`, and an `out` of a component that has its value there.
    Output(Option<&'a ast::Expr>),
    /// `state`.
    State(&'a ast::State),
    /// `discrete`, with its value at the start.
    Discrete(Option<&'a ast::Expr>),
    /// A signal that comes along half arrows: the scope of the port or junction that gives it. `None` where nothing does.
    Joined(Option<ScopeId>),
    /// `let f(x) = …`.
    Function(&'a ast::Function),
}

impl<'a> DeclKind<'a> {
    /// The expression as written, except for states and functions.
    pub fn value(&self) -> Option<&'a ast::Expr> {
        match *self {
            DeclKind::Parameter { value, .. } | DeclKind::Input(value) => value,
            DeclKind::Let(value) | DeclKind::MadeFor(value) | DeclKind::Output(value) | DeclKind::Discrete(value) => {
                value
            }
            DeclKind::State(_) | DeclKind::Function(_) | DeclKind::Joined(_) => None,
        }
    }

    /// Whether it has its symbol before anything is read.
    pub fn is_known_before(&self) -> bool {
        matches!(self, DeclKind::State(_) | DeclKind::Input(_) | DeclKind::Discrete(_))
    }
}

impl Decl<'_> {
    /// How its expression is read.
    pub fn reading(&self) -> Reading<'_> {
        Reading { item: &self.item, array: self.array, ..Reading::of(self.reads, &self.name) }
    }
}

/// All scopes and declarations of a model.
#[derive(Default)]
pub(super) struct Names<'a> {
    /// The scopes; the first is the model itself.
    pub scopes: Vec<Scope<'a>>,
    /// The declarations, in the order in which they stand.
    pub decls: Vec<Decl<'a>>,
    /// The components, each with the scope that it is written in.
    pub components: Vec<(ScopeId, &'a ast::Component)>,
    /// Values with indices.
    pub value_families: Families<DeclId>,
    /// Elements, instances and the like with indices, each with its place.
    pub node_families: Families<(Node, Span)>,
    /// New values of parameters, by full name.
    pub overrides: FxHashMap<&'a str, &'a ast::Expr>,
    /// Kinds of ports, by name.
    pub port_kinds: FxHashMap<&'a str, &'a ast::PortKind>,
    /// Values that are declared further down, by scope and name.
    pub ahead: FxHashMap<(ScopeId, &'a str), &'a ast::Declaration>,
}

impl<'a> Names<'a> {
    /// The value of that name seen from a scope.
    pub fn value(&self, from: ScopeId, name: &str) -> Option<Valued> {
        self.around(from).find_map(|s| self.scopes[s].values.get(name).copied())
    }

    /// The turn of a repetition that something stands in, perhaps that of an instance around it; 0 if it stands in none.
    pub fn turn_around(&self, mut here: Here) -> TurnId {
        while here.turn == 0 && here.scope != 0 {
            here = self.scopes[here.scope].user;
        }
        here.turn
    }

    /// Where the outermost instance stands in which a scope lies; nothing for that of the model.
    pub fn outermost(&self, mut scope: ScopeId) -> Option<Span> {
        let mut found = None;
        while let Some((_, span)) = self.scopes[scope].instance {
            (found, scope) = (Some(span), self.scopes[scope].user.scope);
        }
        found
    }

    /// A scope and those in which its component is written, from within.
    pub fn around(&self, from: ScopeId) -> impl Iterator<Item = ScopeId> + '_ {
        std::iter::successors(Some(from), |s| self.scopes[*s].parent)
    }

    /// The component of that name seen from a scope.
    pub fn component(&self, from: ScopeId, name: &str) -> Option<ComponentId> {
        let mut scope = Some(from);
        while let Some(s) = scope {
            if let Some(&component) = self.scopes[s].components.get(name) {
                return Some(component);
            }
            scope = self.scopes[s].parent;
        }
        None
    }

    /// All value names seen from a scope.
    pub fn visible_values(&self, from: ScopeId) -> impl Iterator<Item = &'a str> + '_ {
        let chain = std::iter::successors(Some(from), |s| self.scopes[*s].parent);
        chain.flat_map(|s| self.scopes[s].values.keys().copied())
    }

    /// All component names seen from a scope.
    pub fn visible_components(&self, from: ScopeId) -> impl Iterator<Item = &'a str> + '_ {
        let chain = std::iter::successors(Some(from), |s| self.scopes[*s].parent);
        chain.flat_map(|s| self.scopes[s].components.keys().copied())
    }

    /// Adds a declaration under a name, unless the name is taken; says so if it is.
    pub fn declare(
        &mut self,
        scope: ScopeId,
        name: &'a ast::Name,
        indices: &[i64],
        decl: Decl<'a>,
    ) -> Result<DeclId, Box<Diagnostic>> {
        let text = name.text.as_str();
        if RESERVED.contains(&text) {
            return Err(Box::new(reserved(name)));
        }
        if matches!(decl.kind, DeclKind::Function(_)) && FUNCTIONS.iter().any(|f| f.0 == text) {
            let d = Diagnostic::error(codes::N003, format!("`{text}` is a function already"), name.span, "here");
            return Err(Box::new(d.hint("give the function another name")));
        }
        let id = self.decls.len();
        let first = match self.scopes[scope].values.get(text).copied() {
            None if indices.is_empty() => {
                self.scopes[scope].values.insert(text, Valued::One(id));
                None
            }
            None => {
                let family = self.value_families.open(indices.len(), name.span);
                self.scopes[scope].values.insert(text, Valued::Family(family));
                self.value_families.add(family, indices, id)
            }
            Some(Valued::Family(family)) if self.value_families[family].takes(indices) => {
                self.value_families.add(family, indices, id)
            }
            Some(other) => return Err(Box::new(twice(&spelled(text, indices), name.span, self.span_of(other)))),
        };
        if let Some(first) = first {
            return Err(Box::new(twice(&spelled(text, indices), name.span, self.decls[first].span)));
        }
        self.decls.push(decl);
        Ok(id)
    }

    /// The declaration that a name with its indices stands for. Without indices, in an expression for all elements of an
    /// array, it is the element `item`.
    pub fn decl_of(
        &self,
        repeats: &mut Repeats<'a>,
        here: Here,
        value: Valued,
        part: &'a ast::PathPart,
        item: &[i64],
    ) -> Result<DeclId, Box<Diagnostic>> {
        match (value, part.indices.first()) {
            (Valued::One(decl), None) => Ok(decl),
            (Valued::One(_), Some(index)) => Err(Box::new(no_indices(&part.name, index.span))),
            (Valued::Family(family), None) => self.value_families.get(family, &part.name, item).copied(),
            (Valued::Family(family), Some(_)) => {
                let indices = repeats.indices(self, here, &part.indices)?;
                self.value_families.get(family, &part.name, &indices).copied()
            }
        }
    }

    /// What a use of a declaration is one of: of its own name, or of that of an array.
    pub fn used(&self, decl: DeclId) -> Option<Used> {
        let d = &self.decls[decl];
        self.scopes[d.scope].values.get(d.own).map(|value| Used::of(*value))
    }

    /// Where a value is declared, or the first of several.
    pub fn span_of(&self, value: Valued) -> Span {
        match value {
            Valued::One(decl) => self.decls[decl].span,
            Valued::Family(family) => self.value_families[family].span,
        }
    }

    /// Makes a name stand for values with indices, of which there may be none.
    pub fn array(&mut self, scope: ScopeId, name: &'a ast::Name, indices: usize) {
        if !self.scopes[scope].values.contains_key(name.text.as_str()) {
            let family = self.value_families.open(indices, name.span);
            self.scopes[scope].values.insert(&name.text, Valued::Family(family));
        }
    }

    /// Adds an element, instance, port, bond or constraint under a name, unless the name is taken; says so if it is.
    pub fn place(
        &mut self,
        scope: ScopeId,
        name: &'a ast::Name,
        indices: &[i64],
        node: Node,
    ) -> Result<(), Box<Diagnostic>> {
        let text = name.text.as_str();
        let entry = (node, name.span);
        let mut named_otherwise = false;
        let first = match self.scopes[scope].nodes.get(text).copied() {
            None if indices.is_empty() => {
                self.scopes[scope].nodes.insert(text, entry);
                None
            }
            None => {
                let family = self.node_families.open(indices.len(), name.span);
                self.scopes[scope].nodes.insert(text, (Node::Family(family), name.span));
                self.node_families.add(family, indices, entry)
            }
            Some((Node::Family(family), _)) if self.node_families[family].takes(indices) => {
                self.node_families.add(family, indices, entry)
            }
            Some(other) => {
                named_otherwise = !indices.is_empty() || matches!(other.0, Node::Family(_));
                Some(other)
            }
        };
        let Some((_, first)) = first else { return Ok(()) };
        let full = spelled(text, indices);
        let hint = if named_otherwise {
            "one name has the same number of indices everywhere".to_string()
        } else if first == name.span {
            format!("give it indices that differ from turn to turn, such as `{text}[i]`")
        } else {
            format!("the kind stands only where the element first stands: write `{full}` here, or use another name")
        };
        Err(Box::new(Diagnostic { hint: Some(hint), ..twice(&full, name.span, first) }))
    }

    /// What a dotted name stands for as far as it names nodes, and how many of its parts that took.
    pub fn node(
        &self,
        repeats: &mut Repeats<'a>,
        from: Here,
        path: &'a ast::Path,
    ) -> Result<(Node, usize), Box<Diagnostic>> {
        self.walk(repeats, from, path, &mut |_, _| {})
    }

    /// The same, visiting each node on the way, with the place of its name.
    pub fn walk(
        &self,
        repeats: &mut Repeats<'a>,
        from: Here,
        path: &'a ast::Path,
        visit: &mut dyn FnMut(Node, Span),
    ) -> Result<(Node, usize), Box<Diagnostic>> {
        let (node, used) = self.walk_wide(repeats, from, path, visit)?;
        match node {
            Node::Family(_) => Ok((self.with_indices(repeats, from, node, &path.parts[used - 1])?, used)),
            node => Ok((node, used)),
        }
    }

    /// The same, where several nodes side by side have one name.
    pub fn walk_wide(
        &self,
        repeats: &mut Repeats<'a>,
        from: Here,
        path: &'a ast::Path,
        visit: &mut dyn FnMut(Node, Span),
    ) -> Result<(Node, usize), Box<Diagnostic>> {
        let mut scope = from.scope;
        let mut at = 0;
        loop {
            let part = &path.parts[at];
            let Some(&(named, _)) = self.scopes[scope].nodes.get(part.name.text.as_str()) else {
                return Err(Box::new(self.unknown_node(scope, &part.name, at > 0)));
            };
            visit(named, part.name.span);
            at += 1;
            let node = match named {
                Node::Family(family) if part.indices.is_empty() => match self.strand(family, path.parts.get(at)) {
                    Some(strand) => {
                        at += 1;
                        strand
                    }
                    None => return Ok((named, at)),
                },
                _ => self.with_indices(repeats, from, named, part)?,
            };
            match node {
                Node::Instance(inner) if at < path.parts.len() => {
                    let next = path.parts[at].name.text.as_str();
                    if !self.scopes[inner].nodes.contains_key(next) && self.scopes[inner].values.contains_key(next) {
                        return Ok((node, at));
                    }
                    scope = inner;
                }
                node => return Ok((node, at)),
            }
        }
    }

    /// The node that `x`, `y` or `z` behind the name of several side by side stands for.
    fn strand(&self, family: FamilyId, next: Option<&ast::PathPart>) -> Option<Node> {
        let next = next.filter(|next| next.indices.is_empty())?;
        let at = strand_of(&next.name.text)?;
        let family = &self.node_families[family];
        family.is_row(at + 1).then(|| family.element(&[at as i64 + 1]).map(|(node, _)| *node))?
    }

    /// The node that a name with its indices stands for.
    pub fn with_indices(
        &self,
        repeats: &mut Repeats<'a>,
        from: Here,
        named: Node,
        part: &'a ast::PathPart,
    ) -> Result<Node, Box<Diagnostic>> {
        let Node::Family(family) = named else {
            return match part.indices.first() {
                Some(index) if named != Node::Broken => Err(Box::new(no_indices(&part.name, index.span))),
                _ => Ok(named),
            };
        };
        let indices = repeats.indices(self, from, &part.indices)?;
        self.node_families.get(family, &part.name, &indices).map(|(node, _)| *node)
    }

    /// What an instance has, for a hint.
    fn inner_names(&self, scope: ScopeId) -> String {
        let s = &self.scopes[scope];
        let mut names: Vec<&str> = s.nodes.keys().chain(s.values.keys()).copied().collect();
        names.sort_unstable();
        names.truncate(12);
        format!("it has: {}", names.join(", "))
    }

    /// The diagnostic for an element that nobody declared.
    pub fn unknown_node(&self, scope: ScopeId, name: &ast::Name, inside: bool) -> Diagnostic {
        let owner = self.scopes[scope].prefix.trim_end_matches('.');
        let whose = if inside { format!("`{owner}` has no part") } else { "there is no element".to_string() };
        let title = format!("{whose} `{}`", name.text);
        let d = Diagnostic::error(codes::N001, title, name.span, "not declared");
        let known = self.scopes[scope].nodes.keys().copied();
        let d = match nearest(&name.text, known) {
            Some(near) => d.hint(format!("did you mean `{near}`?")),
            None if !inside && self.value(scope, &name.text).is_some() => d
                .note(format!("`{}` is a parameter or signal; a dotted name belongs to an element", name.text))
                .hint("use the bare name"),
            None if inside => d.hint(self.inner_names(scope)),
            None => d.hint("write `Kind:name` where it first stands, such as `1:hub` or `R:damper(10)`"),
        };
        match self.scopes[scope].nodes.get(near_key(&d).as_str()) {
            Some((_, span)) => d.also(*span, "this one?"),
            None => d,
        }
    }
}

/// The name that a "did you mean" hint offers.
fn near_key(d: &Diagnostic) -> String {
    let hint = d.hint.as_deref().unwrap_or("");
    hint.strip_prefix("did you mean `").and_then(|h| h.strip_suffix("`?")).unwrap_or("").to_string()
}

/// The diagnostic for a name that the language keeps for itself.
fn reserved(name: &ast::Name) -> Diagnostic {
    let meaning = if name.text == "t" { "time" } else { "the number pi" };
    let title = format!("`{}` is {meaning} and cannot be declared", name.text);
    Diagnostic::error(codes::N003, title, name.span, "here").hint("use another name")
}

/// The diagnostic for indices behind a name that has none.
pub(super) fn no_indices(name: &ast::Name, span: Span) -> Diagnostic {
    let title = format!("`{}` has no indices", name.text);
    Diagnostic::error(codes::N021, title, span, "an index").hint(format!("write `{}`", name.text))
}

/// The diagnostic for a name that is declared twice.
fn twice(name: &str, second: Span, first: Span) -> Diagnostic {
    Diagnostic::error(codes::N002, format!("`{name}` is declared twice"), second, "declared again")
        .also(first, "declared first")
        .hint("give one of them another name")
}
