//! Bond graphs as parts.

use std::sync::Arc;

use super::parts::gathered;
use super::rule::Rule;
use super::tree::{At, Kept, Part, Tree, constants, kept, others, parts, row};
use crate::algebra::{
    Comparison, Expr, Exprs, Facts, Function, ListedAssumptions, ListedPool, ListedSymbol, Node, Parts, Rational,
    SymbolKind, Table1d,
};
use crate::bond_graph::*;

// Numbers are the same in all turns and at all sizes: what follows from one that grows may grow otherwise where it is greater.
constants!(Comparison, Function, Table1d, HeldKind, ParameterKind, PortCausality, Rational, ShapeKind, ShapeArgument,);
others!(SetValuedLaw);

parts! {
    halves BondGraph {
        exprs;
        name, doc, variables, elements, bonds, common, parameters, inputs, signals, held, clauses, lets, outputs,
        point, preferences, forced_causality, forced_strokes, guesses, constraints, set_valued, shapes, time, repetitions,
        cells,
    }
    structure Repetition { variable, within, span }
    structure Cell { repetition, value, outer }
    structure Variable { meaning, unit }
    choice Meaning {
        Time, Parameter(id), Input(id), Signal(id), Held(id), Effort(bond), Flow(bond), Stored(port), Rate(of),
    }
    structure PortRef { element, port }
    structure Port { name, bond, inward }
    choice Kind {
        Zero, One, EffortSource { value }, FlowSource { value }, ZeroCompliance { flow }, ResidualEffort { residual },
        ResidualFlow { residual }, EffortDetector, FlowDetector, Inertance(storage), Compliance(storage), Resistor(laws),
        Transformer { modulus }, Gyrator { modulus }, MatrixTransformer(matrix), MatrixGyrator(matrix), SkewGyrator(laws),
    }
    structure Matrix { rows, columns, entries }
    structure Storage { laws, stored, initial, energy }
    choice StorageLaw { Integral(e), Derivative(e), Implicit(e), Known { displacement, law } }
    choice ResistorLaw { Resistive(e), Conductive(e), Implicit(e) }
    structure Initial { symbol, value, span }
    structure Bond { from, to, name, effort, flow, pseudo, span }
    structure Parameter { name, symbol, value, constant, shapes, kind, unit, doc, span }
    structure Input { name, symbol, default, unit, doc, span }
    structure IntegratedSignal { name, symbol, rate, initial, unit, span }
    structure HeldSignal { name, symbol, source, time, kind, unit, span }
    structure Clause { name, trigger, actions, bound, span }
    choice Trigger { Becomes(e), Every(e) }
    structure Action { name, target, value, impulse, span }
    structure Named { name, value, unit, unit_is_written, doc, span }
    structure Preference { name, symbol, span }
    structure ForcedCausality { port, causality, span }
    structure ForcedStroke { bond, at_to, span }
    structure Guess { what, value, span }
    structure Constraint { name, expr, holonomic, drawn, element, multiplier, span }
    structure Shape { name, kind, file, arguments, span }
    structure Facts { nonzero, positive, given }
    choice SymbolKind {
        Own, Twin(of), Reaction(of), Rate(of), Momentum(of), Spring(of), Gain { of, by }, LoopGain { of, by }, Bias(of),
    }
    structure ListedAssumptions { divisors, defined, decided }
    choice Node {
        Number(value), Pi, Symbol(symbol), Add(parts), Mul(parts), Pow(base, exponent), Call(f, parts), Compare(c, a, b),
        And(a, b), Or(a, b), Not(a), Select(c, a, b), Table(table, a), TableSlope(table, a), Whole(e),
    }
}

/// Label and component are one text for all elements of a statement.
impl Part for Element {
    fn tree(&self, kept: &mut Kept) -> Tree {
        let Element { name, kind, ports, span, label, cell, component, strand, carries } = self;
        let texts = [kept.keep(label), kept.keep(component)];
        let rest = [
            name.tree(kept),
            kind.tree(kept),
            ports.tree(kept),
            span.tree(kept),
            cell.tree(kept),
            strand.tree(kept),
            carries.tree(kept),
        ];
        Tree::Group(0, texts.into_iter().chain(rest).collect())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let (_, [label, component, name, kind, ports, span, cell, strand, carries]) = rule.group()? else {
            return None;
        };
        Some(Element {
            name: Part::made(name, at)?,
            kind: Part::made(kind, at)?,
            ports: Part::made(ports, at)?,
            span: Part::made(span, at)?,
            label: kept::<Arc<str>>(label, at)?,
            cell: Part::made(cell, at)?,
            component: kept::<Arc<str>>(component, at)?,
            strand: Part::made(strand, at)?,
            carries: Part::made(carries, at)?,
        })
    }
}

impl Part for Expr {
    fn tree(&self, _: &mut Kept) -> Tree {
        Tree::Whole(i64::from(self.0))
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        Some(Expr(rule.whole(at)?.try_into().ok()?))
    }
}

impl Part for Parts {
    fn tree(&self, kept: &mut Kept) -> Tree {
        row(self, kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let mut all = Parts::new();
        rule.for_each_entry(at, |rule, at| {
            all.push(Expr::made(rule, at)?);
            Some(())
        })?;
        Some(all)
    }
}

impl Part for Exprs {
    fn tree(&self, kept: &mut Kept) -> Tree {
        let symbols = self.listed_symbols().map(|symbol| symbol_tree(&symbol, kept)).collect();
        let parts = vec![
            row(self.listed_tables(), kept),
            Tree::Row(symbols),
            row(self.listed_nodes(), kept),
            self.listed_assumptions().tree(kept),
        ];
        Tree::Group(0, parts)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let (_, [tables, symbols, nodes, assumed]) = rule.group()? else { return None };
        let mut pool = ListedPool::new(gathered(tables, at)?, symbols.length(at)?);
        let (mut label, mut name) = (String::new(), String::new());
        symbols.for_each_entry(at, |rule, at| {
            let (_, [label_rule, name_rule, kind, facts]) = rule.group()? else { return None };
            label.clear();
            name.clear();
            label_rule.write(&mut label, at)?;
            let own = match name_rule {
                Rule::Few(none) if none.is_empty() => &label,
                Rule::Few(one) => {
                    one.first()?.write(&mut name, at)?;
                    &name
                }
                _ => return None,
            };
            pool.add_symbol(&label, own, Part::made(kind, at)?, Part::made(facts, at)?)
        })?;
        nodes.for_each_entry(at, |rule, at| pool.add_node(Part::made(rule, at)?))?;
        pool.finish(&Part::made(assumed, at)?)
    }
}

/// A symbol whose name is mostly its label.
fn symbol_tree(symbol: &ListedSymbol<'_>, kept: &mut Kept) -> Tree {
    let ListedSymbol { label, name, kind, facts } = symbol;
    let text = |text: &str| Tree::Text(text.into());
    let name = Tree::Row((label != name).then(|| text(name)).into_iter().collect());
    Tree::Group(0, vec![text(label), name, kind.tree(kept), facts.tree(kept)])
}
