//! Bonds side by side drawn as one, between junctions and elements that are drawn once.

use std::collections::BTreeMap;

use halfarrow_compiler::bond_graph::BondGraph;

use crate::figure::{Figure, Glyph, Line, Loop};

/// The figure with one sign for all strands of a multibond, and one thick bond where several lead from one sign to another of
/// which one at least is wide.
pub fn joined(figure: Figure, graph: &BondGraph) -> Figure {
    let mut place: Vec<usize> = Vec::with_capacity(figure.glyphs.len());
    let mut glyphs: Vec<Glyph> = Vec::new();
    let mut wide: Vec<bool> = Vec::new();
    for (glyph, element) in figure.glyphs.into_iter().zip(graph.elements.values()) {
        match element.strand {
            Some((at, _)) if at > 0 && !glyphs.is_empty() => {
                // A storage does not have strands; a junction is kept if one of its strands is.
                let whole = glyphs.len() - 1;
                glyphs[whole].kept |= glyph.kept;
            }
            strand => {
                wide.push(strand.is_some() || element.ports.iter().any(|p| is_strand(&p.name)));
                let name = strand.map_or(glyph.name.clone(), |_| whole_name(&glyph.name));
                glyphs.push(Glyph { name, ..glyph });
            }
        }
        place.push(glyphs.len() - 1);
    }
    let mut bonds: Vec<Line> = Vec::new();
    let mut known: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    let mut bond_at = Vec::with_capacity(figure.bonds.len());
    for bond in figure.bonds {
        let ends = bond.ends.map(|end| place[end]);
        let several = ends.iter().any(|end| wide[*end]);
        let line = match known.get(&ends).filter(|_| several) {
            Some(&line) => {
                bonds[line].take(&bond);
                line
            }
            None => {
                known.insert(ends, bonds.len());
                let ports = if several { Default::default() } else { bond.ports.clone() };
                bonds.push(Line { ends, ports, ..bond });
                bonds.len() - 1
            }
        };
        bond_at.push(line);
    }
    let along = |l: Loop| {
        let mut bonds: Vec<usize> = l.bonds.iter().map(|b| bond_at[*b]).collect();
        bonds.dedup();
        Loop { bonds, ..l }
    };
    let loops = figure.loops.into_iter().map(along).collect();
    Figure { glyphs, bonds, loops, ..figure }
}

impl Line {
    /// Another bond side by side with it.
    fn take(&mut self, other: &Line) {
        self.width += 1;
        self.mixed |= self.stroke != other.stroke;
    }
}

/// Whether a port is one of several side by side.
fn is_strand(port: &str) -> bool {
    let own = port.rsplit('.').next().unwrap_or(port);
    matches!(own, "x" | "y" | "z") || own.ends_with(']')
}

/// The name of a multibond without that of the strand.
fn whole_name(name: &str) -> String {
    let end = if name.ends_with(']') { name.rfind('[') } else { name.rfind('.') };
    name[..end.unwrap_or(name.len())].to_string()
}
