//! Parts of a graph that are made alike: instances of one component. They are drawn alike, too.

use std::collections::{BTreeMap, BTreeSet};

use crate::figure::{Figure, Form};
use crate::layout::parts;

/// What an instance is made of: its nodes (name within it, sign, form, number of bonds that leave the instance at it)
/// and the bonds between them.
type Make<'f> = (Vec<(&'f str, &'f str, Form, usize)>, BTreeSet<[usize; 2]>);

/// Groups of equal parts of two and more nodes, the largest ones: for each group its instances, for each instance its
/// nodes in the same order. Parts of a component are called `instance.part`.
pub fn alike(figure: &Figure) -> Vec<Vec<Vec<usize>>> {
    let names: BTreeSet<&str> = figure.glyphs.iter().map(|g| g.name.as_str()).collect();
    let mut instances: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (v, glyph) in figure.glyphs.iter().enumerate() {
        let dots = glyph.name.match_indices('.').map(|(at, _)| &glyph.name[..at]);
        dots.filter(|prefix| !names.contains(prefix)).for_each(|prefix| instances.entry(prefix).or_default().push(v));
    }
    let mut kinds: BTreeMap<(usize, Make), Vec<Vec<usize>>> = BTreeMap::new();
    for (prefix, mut nodes) in instances {
        nodes.sort_by_key(|&v| &figure.glyphs[v].name);
        if let Some(make) = make(figure, prefix, &nodes) {
            kinds.entry((prefix.matches('.').count(), make)).or_default().push(nodes);
        }
    }
    let mut taken: BTreeSet<usize> = BTreeSet::new();
    let mut groups = Vec::new();
    for mut equal in kinds.into_values() {
        equal.retain(|nodes| !nodes.iter().any(|v| taken.contains(v)));
        if equal.len() > 1 {
            taken.extend(equal.iter().flatten());
            groups.push(equal);
        }
    }
    groups
}

/// What an instance is made of; `None` if it is a single node or does not hold together.
fn make<'f>(figure: &'f Figure, prefix: &str, nodes: &[usize]) -> Option<Make<'f>> {
    let index: BTreeMap<usize, usize> = nodes.iter().enumerate().map(|(i, &v)| (v, i)).collect();
    let mut leaving = vec![0; nodes.len()];
    let mut inner: BTreeSet<[usize; 2]> = BTreeSet::new();
    for bond in &figure.bonds {
        match bond.ends.map(|v| index.get(&v).copied()) {
            [Some(a), Some(b)] => _ = inner.insert([a, b]),
            ends => ends.into_iter().flatten().for_each(|i| leaving[i] += 1),
        }
    }
    let bonds: Vec<[usize; 2]> = inner.iter().copied().collect();
    if nodes.len() < 2 || parts(nodes.len(), &bonds).len() > 1 {
        return None;
    }
    let node = |(i, &v): (usize, &usize)| {
        let glyph = &figure.glyphs[v];
        (&glyph.name[prefix.len() + 1..], glyph.kind.as_str(), glyph.form, leaving[i])
    };
    Some((nodes.iter().enumerate().map(node).collect(), inner))
}
