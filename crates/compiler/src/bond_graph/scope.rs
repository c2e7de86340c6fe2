//! What the names of a model mean: two namespaces a scope, one for values, one for elements.

use rustc_hash::FxHashMap;

use crate::ast;
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// Words that no declaration may use: time and pi, and what a law calls its own.
const RESERVED: [&str; 2] = ["t", "pi"];

/// Functions of the language, with the numbers of arguments that they take.
pub(super) const FUNCTIONS: [(&str, usize, usize); 26] = [
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

/// The names of the model itself, or of one instance of a component.
pub(super) struct Scope<'a> {
    /// `inst.` before the names of its parts; empty for the model.
    pub prefix: String,
    /// Where names are looked up that are not found here: the scope in which the component is written.
    pub parent: Option<ScopeId>,
    /// The component and where it is used, if it is an instance.
    pub instance: Option<(&'a ast::Component, Span)>,
    /// The scope in which it is used.
    pub user: ScopeId,
    /// Number of instances around it.
    pub depth: usize,
    /// Parameters, signals and functions.
    pub values: FxHashMap<&'a str, DeclId>,
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
    /// An instance of a component: its scope.
    Instance(ScopeId),
    /// A port of the component whose scope this is: index into the joints.
    Joint(usize),
    /// A named bond: index into the drawn bonds.
    Bond(usize),
    /// A `constraint`: index into the constraints.
    Constraint(usize),
    /// Something whose declaration is at fault; said already.
    Broken,
}

/// A named value or function.
pub(super) struct Decl<'a> {
    /// Its full name.
    pub name: String,
    /// The scope that its expression reads.
    pub reads: ScopeId,
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
    /// `output`, and an `out` of a component that has its value there.
    Output(Option<&'a ast::Expr>),
    /// `state`.
    State(&'a ast::State),
    /// `let f(x) = …`.
    Function(&'a ast::Function),
}

impl<'a> Decl<'a> {
    /// The expression as written, except for states and functions.
    pub fn value(&self) -> Option<&'a ast::Expr> {
        match self.kind {
            DeclKind::Parameter { value, .. } | DeclKind::Input(value) => value,
            DeclKind::Let(value) | DeclKind::Output(value) => value,
            DeclKind::State(_) | DeclKind::Function(_) => None,
        }
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
}

impl<'a> Names<'a> {
    /// The value of that name seen from a scope.
    pub fn value(&self, from: ScopeId, name: &str) -> Option<DeclId> {
        let mut scope = Some(from);
        while let Some(s) = scope {
            if let Some(&decl) = self.scopes[s].values.get(name) {
                return Some(decl);
            }
            scope = self.scopes[s].parent;
        }
        None
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
    pub fn declare(&mut self, scope: ScopeId, name: &'a ast::Name, decl: Decl<'a>) -> Result<DeclId, Box<Diagnostic>> {
        let text = name.text.as_str();
        if RESERVED.contains(&text) {
            return Err(Box::new(reserved(name)));
        }
        if matches!(decl.kind, DeclKind::Function(_)) && FUNCTIONS.iter().any(|f| f.0 == text) {
            let d = Diagnostic::error(codes::N003, format!("`{text}` is a function already"), name.span, "here");
            return Err(Box::new(d.hint("give the function another name")));
        }
        let id = self.decls.len();
        if let Some(&first) = self.scopes[scope].values.get(text) {
            return Err(Box::new(twice(text, name.span, self.decls[first].span)));
        }
        self.scopes[scope].values.insert(text, id);
        self.decls.push(decl);
        Ok(id)
    }

    /// Adds an element, instance, port, bond or constraint under a name, unless the name is taken; says so if it is.
    pub fn place(&mut self, scope: ScopeId, name: &'a ast::Name, node: Node) -> Result<(), Box<Diagnostic>> {
        if let Some((_, first)) = self.scopes[scope].nodes.get(name.text.as_str()) {
            let hint = format!(
                "the kind stands only where the element first stands: write `{}` here, or use another name",
                name.text
            );
            return Err(Box::new(Diagnostic { hint: Some(hint), ..twice(&name.text, name.span, *first) }));
        }
        self.scopes[scope].nodes.insert(&name.text, (node, name.span));
        Ok(())
    }

    /// What a dotted name stands for as far as it names nodes, and how many of its parts that took.
    pub fn node(&self, from: ScopeId, path: &ast::Path) -> Result<(Node, usize), Box<Diagnostic>> {
        self.walk(from, path, &mut |_, _| {})
    }

    /// The same, visiting each node on the way, with the place of its name.
    pub fn walk(
        &self,
        from: ScopeId,
        path: &ast::Path,
        visit: &mut dyn FnMut(Node, Span),
    ) -> Result<(Node, usize), Box<Diagnostic>> {
        let mut scope = from;
        let mut at = 0;
        loop {
            let name = &path.parts[at].name;
            let Some(&(node, _)) = self.scopes[scope].nodes.get(name.text.as_str()) else {
                return Err(Box::new(self.unknown_node(scope, name, at > 0)));
            };
            visit(node, name.span);
            at += 1;
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

    /// What an instance has, for a hint.
    fn inner_names(&self, scope: ScopeId) -> String {
        let s = &self.scopes[scope];
        let mut names: Vec<&str> = s.nodes.keys().chain(s.values.keys()).copied().collect();
        names.sort_unstable();
        names.truncate(12);
        format!("it has: {}", names.join(", "))
    }

    /// The diagnostic for an element that nobody declared.
    fn unknown_node(&self, scope: ScopeId, name: &ast::Name, inside: bool) -> Diagnostic {
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

/// The diagnostic for a name that is declared twice.
fn twice(name: &str, second: Span, first: Span) -> Diagnostic {
    Diagnostic::error(codes::N002, format!("`{name}` is declared twice"), second, "declared again")
        .also(first, "declared first")
        .hint("give one of them another name")
}
