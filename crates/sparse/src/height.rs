//! Orders of elimination whose steps wait less for each other.
//!
//! An order of a chain of unknowns from one end to the other makes each step wait for the one before. From both ends to the
//! middle it fills in the same places, and two steps are under way at a time. In general: the cliques of the filled graph
//! make a tree, every root of which gives an order of the same fill (Blair and Peyton, "An introduction to chordal graphs
//! and clique trees", 1993); the one in the middle of the longest way gives the lowest.

/// A clique of the filled graph.
struct Clique {
    /// The unknowns that it eliminates, first ones first.
    own: Vec<usize>,
    /// The clique that is eliminated next of those that it shares unknowns with.
    next: Option<usize>,
}

/// An order in which fewer steps wait for each other: places of the present order in that in which they are to be
/// eliminated. `upper`: of each place those behind it that it is joined to, ascending, filled. `None` if the present order
/// is good.
pub(super) fn lower(upper: &[Vec<usize>]) -> Option<Vec<usize>> {
    let mut cliques = cliques(upper);
    let before = heights(&cliques).into_iter().max()?;
    // Where many wait for others anyway, an order that keeps neighbours together is the better one.
    if 2 * before < upper.len() {
        return None;
    }
    let root = middle(&cliques);
    turn(&mut cliques, root, upper);
    let height = heights(&cliques);
    if 4 * height.iter().max()? > 3 * before {
        return None;
    }
    // Each unknown with the number of those that it waits for.
    let mut steps: Vec<(usize, usize)> = Vec::with_capacity(upper.len());
    for (clique, &height) in cliques.iter().zip(&height) {
        steps.extend(clique.own.iter().rev().enumerate().map(|(i, &place)| (height - i, place)));
    }
    steps.sort_unstable();
    Some(steps.into_iter().map(|step| step.1).collect())
}

/// The maximal cliques: each place with its neighbours behind it, where no place before it has these and itself too.
fn cliques(upper: &[Vec<usize>]) -> Vec<Clique> {
    let n = upper.len();
    let mut of = vec![usize::MAX; n];
    let mut cliques: Vec<Clique> = Vec::new();
    for place in 0..n {
        let clique = match of[place] {
            usize::MAX => {
                cliques.push(Clique { own: Vec::new(), next: None });
                cliques.len() - 1
            }
            clique => clique,
        };
        of[place] = clique;
        cliques[clique].own.push(place);
        let Some(&next) = upper[place].first() else { continue };
        if of[next] == usize::MAX && upper[next].len() + 1 == upper[place].len() {
            of[next] = clique;
        }
    }
    for (number, clique) in cliques.iter_mut().enumerate() {
        let last = *clique.own.last().expect("a clique has unknowns of its own");
        clique.next = upper[last].first().map(|&next| of[next]).filter(|&next| next != number);
    }
    cliques
}

/// For each clique how many steps there are from the first one that it waits for to the last of its own.
fn heights(cliques: &[Clique]) -> Vec<usize> {
    let mut height = vec![0; cliques.len()];
    for clique in from_leaves(cliques) {
        height[clique] += cliques[clique].own.len();
        if let Some(next) = cliques[clique].next {
            height[next] = height[next].max(height[clique]);
        }
    }
    height
}

/// Cliques, those first that others wait for.
fn from_leaves(cliques: &[Clique]) -> Vec<usize> {
    let mut waits = vec![0; cliques.len()];
    cliques.iter().filter_map(|clique| clique.next).for_each(|next| waits[next] += 1);
    let mut order: Vec<usize> = (0..cliques.len()).filter(|&clique| waits[clique] == 0).collect();
    let mut at = 0;
    while at < order.len() {
        if let Some(next) = cliques[order[at]].next {
            waits[next] -= 1;
            if waits[next] == 0 {
                order.push(next);
            }
        }
        at += 1;
    }
    order
}

/// The clique in the middle of the longest way through the tree with the highest root.
fn middle(cliques: &[Clique]) -> usize {
    let height = heights(cliques);
    let top = (0..cliques.len()).filter(|&c| cliques[c].next.is_none()).max_by_key(|&c| height[c]).expect("a root");
    let mut below = vec![Vec::new(); cliques.len()];
    (0..cliques.len()).for_each(|c| cliques[c].next.into_iter().for_each(|next| below[next].push(c)));
    // Down the highest branch, as long as that is higher than all that stands above.
    let (mut at, mut above) = (top, 0);
    loop {
        let mut branches: Vec<usize> = below[at].clone();
        branches.sort_by_key(|&c| std::cmp::Reverse(height[c]));
        let Some(&branch) = branches.first() else { return at };
        let beside = branches.get(1).map_or(0, |&c| height[c]).max(above) + cliques[at].own.len();
        if height[branch] <= beside {
            return at;
        }
        (at, above) = (branch, beside);
    }
}

/// Makes a clique the last one of its tree: on the way from it each clique waits for the one behind it.
fn turn(cliques: &mut [Clique], root: usize, upper: &[Vec<usize>]) {
    let (mut at, mut from) = (root, None);
    // What the clique before on the way shares with the one at hand, and eliminates itself from now on.
    let mut taken: Vec<usize> = Vec::new();
    loop {
        let last = *cliques[at].own.last().expect("a clique has unknowns of its own");
        let shared = upper[last].clone();
        let next = std::mem::replace(&mut cliques[at].next, from);
        let mut own: Vec<usize> = cliques[at].own.iter().chain(&shared).copied().collect();
        own.retain(|place| !taken.contains(place));
        cliques[at].own = own;
        let Some(next) = next else { return };
        taken = shared;
        (from, at) = (Some(at), next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_is_eliminated_from_both_ends() {
        let n = 9;
        let chain: Vec<Vec<usize>> = (0..n).map(|i| if i + 1 < n { vec![i + 1] } else { Vec::new() }).collect();
        let order = lower(&chain).expect("a lower order");
        assert_eq!(order[..6], [0, 8, 1, 7, 2, 6]);
        assert_eq!(lower(&[vec![3], vec![3], vec![3], Vec::new()]), None);
    }
}
