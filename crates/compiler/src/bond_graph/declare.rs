//! Values and nodes under their names: one, or all elements of an array.

use super::arrays::{self, Extents};
use super::counted::Reads;
use super::decls::unit_of_literal;
use super::families::Indices;
use super::flatten::{Flat, full_name};
use super::repeat::MAX_TURNS;
use super::scope::{Decl, DeclId, DeclKind, Here, Node, ScopeId, Valued};
use super::uses::Used;
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};

impl<'a> Flat<'a> {
    /// Parameters, also whole arrays of them.
    pub fn parameters(&mut self, here: Here, list: &'a [ast::Declaration], constant: bool) {
        for d in list {
            self.declare_whole(here, here, d, DeclKind::Parameter { value: d.value.as_ref(), constant });
        }
    }

    /// Named values, each with the indices that it has.
    pub fn lets(
        &mut self,
        here: Here,
        list: &'a [ast::Declaration],
        kind: impl Fn(Option<&'a ast::Expr>) -> DeclKind<'a>,
    ) {
        for d in list {
            if let Some(owner) = &d.owner {
                self.give_signal(here, owner, d);
            } else if let Some(indices) = self.indices(here, &d.indices) {
                let (unit, doc) = (d.unit.as_ref(), d.doc.as_ref());
                self.declare(here, here, (&d.name, &indices), kind(d.value.as_ref()), unit, doc);
            }
        }
    }

    /// Declares a value, or all elements of an array: brackets that read a loop variable are the indices of one element,
    /// others tell how many elements there are.
    pub fn declare_whole(&mut self, here: Here, reads: Here, d: &'a ast::Declaration, kind: DeclKind<'a>) {
        if let Some(owner) = &d.owner {
            let title = format!("`{}.{}` cannot be declared here", owner.text, d.name.text);
            let fault = Diagnostic::error(codes::N014, title, owner.span, "a name without a dot is needed");
            self.faults.push(fault.hint("signals of ports are given by `let`"));
            return;
        }
        let (unit, doc) = (d.unit.as_ref(), d.doc.as_ref());
        let one = d.indices.iter().any(|e| arrays::reads_variable(&self.repeats, here.turn, e));
        let indices = if one { self.indices(here, &d.indices) } else { self.sizes(here, &d.indices) };
        let Some(indices) = indices else { return };
        if one || indices.is_empty() {
            self.declare(here, reads, (&d.name, &indices), kind, unit, doc);
            return;
        }
        let Some(extents) =
            Extents::of(&indices).filter(|e| e.count() + self.names.decls.len() <= self.repeats.most(MAX_TURNS))
        else {
            self.too_large(d.span);
            return;
        };
        if let Some((value, reads)) = self.value_of_all(here.scope, reads, d, kind) {
            let fault = arrays::misshapen(value, &indices, &mut |r| self.repeats.length(&self.names, reads, r));
            self.faults.maybe(fault);
        }
        self.names.array(here.scope, &d.name, indices.len());
        let array = match self.names.scopes[here.scope].values.get(d.name.text.as_str()) {
            Some(Valued::Family(family)) => Some(*family),
            _ => None,
        };
        for item in extents {
            if let Some(decl) = self.declare(here, reads, (&d.name, &item), kind, unit, doc) {
                let decl = &mut self.names.decls[decl];
                if !decl.alone {
                    (decl.item, decl.array) = (item, array);
                }
            } else {
                break;
            }
        }
    }

    /// The value of all elements of an array, which may be a new one, and where it reads.
    fn value_of_all(
        &self,
        scope: ScopeId,
        reads: Here,
        d: &'a ast::Declaration,
        kind: DeclKind<'a>,
    ) -> Option<(&'a ast::Expr, Here)> {
        let full = || [self.names.scopes[scope].prefix.as_str(), &d.name.text].concat();
        let given = (!self.names.overrides.is_empty()).then(|| self.names.overrides.get(full().as_str())).flatten();
        match kind {
            DeclKind::Parameter { constant: false, .. } if given.is_some() => Some((given?, Here::of(0))),
            _ => Some((kind.value()?, reads)),
        }
    }

    /// Declares a value under a name with its indices, with the new value of a parameter that is overridden.
    pub fn declare(
        &mut self,
        here: Here,
        reads: Here,
        (name, indices): (&'a ast::Name, &[i64]),
        kind: DeclKind<'a>,
        unit: Option<&'a ast::UnitText>,
        doc: Option<&'a ast::Doc>,
    ) -> Option<DeclId> {
        let doc = doc.map_or("", |d| &d.text);
        let prefix = &self.names.scopes[here.scope].prefix;
        let full = full_name(prefix, &name.text, indices);
        let (item, array, replaced_unit, alone) = (Indices::default(), None, None, false);
        let (own, scope) = (name.text.as_str(), here.scope);
        let mut decl =
            Decl { name: full, own, scope, reads, item, array, alone, kind, unit, replaced_unit, doc, span: name.span };
        self.override_value(&mut decl, here.scope, name, indices);
        match self.names.declare(here.scope, name, indices, decl) {
            Ok(decl) => {
                if let Some(&value @ Valued::Family(family)) =
                    self.names.scopes[here.scope].values.get(name.text.as_str())
                    && self.names.value_families[family].span != name.span
                {
                    self.uses.add(Used::of(value), name.span);
                }
                Some(decl)
            }
            Err(fault) => {
                self.faults.push(*fault);
                None
            }
        }
    }

    /// Puts a new value in the place of that of a parameter: its own, or that of the array it belongs to.
    fn override_value(&self, decl: &mut Decl<'a>, scope: ScopeId, name: &ast::Name, indices: &[i64]) {
        let DeclKind::Parameter { value, constant: false } = decl.kind else { return };
        if self.names.overrides.is_empty() {
            return;
        }
        let own = self.names.overrides.get(decl.name.as_str());
        let whole =
            || self.names.overrides.get([self.names.scopes[scope].prefix.as_str(), &name.text].concat().as_str());
        let Some(new) = own.copied().or_else(|| whole().copied()) else { return };
        decl.alone = own.is_some();
        decl.replaced_unit = value.and_then(|value| unit_of_literal(value, indices));
        decl.kind = DeclKind::Parameter { value: Some(new), constant: false };
        decl.reads = Here::of(0);
    }

    /// Gives a node its name; false if the name is taken, which is said.
    pub fn place(&mut self, scope: ScopeId, name: &'a ast::Name, indices: &[i64], node: Node) -> bool {
        match self.names.place(scope, name, indices, node) {
            Ok(()) => {
                if let Some(&(Node::Family(family), first)) = self.names.scopes[scope].nodes.get(name.text.as_str())
                    && first != name.span
                {
                    self.uses.add(Used::Node(Node::Family(family)), name.span);
                }
                true
            }
            Err(fault) => {
                self.faults.push(*fault);
                false
            }
        }
    }

    /// A whole number that tells how many there are of something; says so if it is none.
    pub fn whole(&mut self, here: Here, e: &'a ast::Expr, what: &str) -> Option<i64> {
        let found = self.repeats.whole(&self.names, here, e, what);
        self.or_lost(found)
    }

    /// The same of an end of a repetition, and what it follows from.
    pub fn repetition_end(&mut self, here: Here, e: &'a ast::Expr, what: &str) -> Option<(i64, Reads)> {
        let found = self.repeats.place(&self.names, here, e, what);
        self.or_lost(found)
    }

    /// An index; says so if it is none.
    pub fn index(&mut self, here: Here, e: &'a ast::Expr) -> Option<i64> {
        let found = self.repeats.place(&self.names, here, e, "an index");
        self.or_lost(found).map(|(index, _)| index)
    }

    fn or_lost<T>(&mut self, found: Result<T, Option<Box<Diagnostic>>>) -> Option<T> {
        found
            .map_err(|fault| {
                self.faults.maybe(fault.map(|f| *f));
                self.lost = true;
            })
            .ok()
    }

    /// The indices of what is declared; says so if they are none.
    pub fn indices(&mut self, here: Here, list: &'a [ast::Expr]) -> Option<Indices> {
        list.iter().map(|e| self.index(here, e)).collect()
    }

    /// How many elements an array has in each direction.
    pub fn sizes(&mut self, here: Here, list: &'a [ast::Expr]) -> Option<Indices> {
        list.iter().map(|e| self.whole(here, e, "an index")).collect()
    }
}
