//! Connected parts.

/// The connected parts of a graph, in the order of their first nodes; the nodes of each in order.
pub fn parts(nodes: usize, bonds: &[[usize; 2]]) -> Vec<Vec<usize>> {
    let mut leader: Vec<usize> = (0..nodes).collect();
    for &[a, b] in bonds {
        let [a, b] = [find(&mut leader, a), find(&mut leader, b)];
        leader[a.max(b)] = a.min(b);
    }
    let mut index = vec![usize::MAX; nodes];
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for v in 0..nodes {
        let root = find(&mut leader, v);
        if index[root] == usize::MAX {
            index[root] = parts.len();
            parts.push(Vec::new());
        }
        parts[index[root]].push(v);
    }
    parts
}

/// The first node of the part of `v`, with path halving.
fn find(leader: &mut [usize], mut v: usize) -> usize {
    while leader[v] != v {
        leader[v] = leader[leader[v]];
        v = leader[v];
    }
    v
}
