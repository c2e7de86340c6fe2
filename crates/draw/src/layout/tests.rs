use proptest::prelude::*;

use super::*;

fn node(role: Role) -> Node {
    let even = Room { west: 10.0, east: 10.0, north: 10.0, south: 10.0 };
    let wide = |room: Room| if role == Role::Centre { even } else { room };
    let [east, west] = [Room { west: 50.0, south: 22.0, ..even }, Room { east: 50.0, south: 22.0, ..even }];
    Node {
        role,
        room: [wide(east), wide(Room { north: 22.0, east: 50.0, south: 10.0, ..even }), wide(west), wide(west)],
    }
}

/// A connected graph: junctions in a random tree with further bonds (rings, parallel ones), two-ports, one-ports.
fn network(junctions: usize) -> impl Strategy<Value = Network> {
    (1..=junctions).prop_flat_map(|n| {
        let tree = proptest::collection::vec((any::<prop::sample::Index>(), any::<bool>(), any::<bool>()), n - 1);
        let rings = proptest::collection::vec((0..n, 0..n), 0..=n / 3);
        let ones = proptest::collection::vec((0..n, any::<bool>(), any::<bool>()), 0..=2 * n);
        (tree, rings, ones).prop_map(move |(tree, rings, ones)| {
            let mut net = Network { nodes: vec![node(Role::Centre); n], ..Network::default() };
            for (i, (parent, two_port, forth)) in tree.into_iter().enumerate() {
                let ends = [parent.index(i + 1), i + 1];
                let ends = if forth { ends } else { [ends[1], ends[0]] };
                if two_port {
                    net.nodes.push(node(Role::TwoPort));
                    let middle = net.nodes.len() - 1;
                    net.bonds.extend([[ends[0], middle], [middle, ends[1]]]);
                } else {
                    net.bonds.push(ends);
                }
            }
            net.bonds.extend(rings.into_iter().map(|(a, b)| [a, b]));
            for (host, source, forth) in ones {
                net.nodes.push(node(if source { Role::Source } else { Role::OnePort }));
                let one = net.nodes.len() - 1;
                net.bonds.push(if forth { [host, one] } else { [one, host] });
            }
            net
        })
    })
}

fn area(net: &Network, placed: &Placement, v: usize) -> crate::geometry::Area {
    let room = net.nodes[v].room[placed.facing[v] as usize];
    let room = if placed.mirrored[v] { room.mirrored() } else { room };
    let [x, y] = placed.anchors[v];
    crate::geometry::Area { min: [x - room.west, y - room.north], max: [x + room.east, y + room.south] }
}

fn check(net: &Network) {
    let placed = lay_out(net);
    assert_eq!(placed, lay_out(net), "the same graph gives the same picture");
    assert_eq!(placed.anchors.len(), net.nodes.len());
    let areas: Vec<_> = (0..net.nodes.len()).map(|v| area(net, &placed, v)).collect();
    for (v, a) in areas.iter().enumerate() {
        assert!(a.min.iter().all(|x| x.is_finite() && *x > -0.01), "node {v} is on the paper");
        assert!((0..2).all(|k| a.max[k] <= placed.size[k] + 0.01), "node {v} is on the paper");
    }
    if net.nodes.len() < 1000 {
        for (v, a) in areas.iter().enumerate() {
            let over = areas[..v].iter().position(|b| a.overlaps(b));
            assert_eq!(over, None, "node {v} stands on another: {placed:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn no_two_nodes_overlap(net in network(7)) {
        check(&net);
    }
    #[test]
    fn what_is_pinned_stays(net in network(6), some in proptest::collection::vec(any::<bool>(), 7)) {
        check_pinned(&net, &some);
    }
}

/// Lays a graph out around some of its nodes, which are a little off their places.
fn check_pinned(net: &Network, some: &[bool]) {
    let whole = lay_out(net);
    let off = |v: usize| [whole.anchors[v][0] + 0.5, whole.anchors[v][1] - 7.0];
    let pinned: Vec<_> = (0..net.nodes.len()).map(|v| some[v % some.len()].then(|| off(v))).collect();
    let placed = layout(net, &pinned);
    assert_eq!(placed, layout(net, &pinned), "the same graph gives the same picture");
    for (v, p) in pinned.iter().enumerate() {
        assert!(p.is_none_or(|p| placed.anchors[v] == p), "node {v} has moved");
    }
    for v in 0..net.nodes.len() {
        let (a, corner) = (area(net, &placed, v), placed.corner);
        let inside = |k: usize| a.min[k] >= corner[k] - 0.01 && a.max[k] <= corner[k] + placed.size[k] + 0.01;
        assert!(inside(0) && inside(1), "node {v} is on the paper");
    }
}

#[test]
fn new_nodes_of_a_ladder_find_places_around_the_old_ones() {
    check_pinned(&ladder(9), &[true, true, false]);
    check_pinned(&ladder(9), &[true, false, false, false, true]);
}

/// A ladder of so many sections: a chain of junctions with a one-port each.
fn ladder(sections: usize) -> Network {
    let mut net = Network::default();
    for i in 0..sections {
        net.nodes.extend([node(Role::Centre), node(Role::OnePort)]);
        net.bonds.push([2 * i, 2 * i + 1]);
        if i > 0 {
            net.bonds.push([2 * i - 2, 2 * i]);
        }
    }
    net
}

#[test]
fn a_chain_is_drawn_in_line_from_left_to_right() {
    let placed = lay_out(&ladder(12));
    let junctions: Vec<[f64; 2]> = placed.anchors.iter().step_by(2).copied().collect();
    assert!(junctions.windows(2).all(|w| w[0][0] < w[1][0] && w[0][1] == w[1][1]), "{junctions:?}");
}

#[test]
fn a_ring_is_drawn_as_a_rectangle() {
    let bonds = (0..6).map(|i| [i, (i + 1) % 6]).collect();
    let placed = lay_out(&Network { nodes: vec![node(Role::Centre); 6], bonds, alike: vec![] });
    for i in 0..6 {
        let [a, b] = [placed.anchors[i], placed.anchors[(i + 1) % 6]];
        assert!(a[0] == b[0] || a[1] == b[1], "bond {i} is oblique: {placed:?}");
    }
}

#[test]
fn odd_graphs_are_drawn_too() {
    check(&Network::default());
    check(&Network { nodes: vec![node(Role::OnePort)], bonds: vec![], alike: vec![] });
    check(&Network { nodes: vec![node(Role::OnePort); 2], bonds: vec![[0, 1]], alike: vec![] });
    check(&Network { nodes: vec![node(Role::Centre); 2], bonds: vec![[0, 0], [0, 1], [1, 0], [0, 1]], alike: vec![] });
    let star =
        Network { nodes: vec![node(Role::OnePort); 40], bonds: (1..40).map(|i| [0, i]).collect(), alike: vec![] };
    check(&star);
    let parts = Network {
        nodes: vec![node(Role::OnePort); 20],
        bonds: (0..10).map(|i| [2 * i, 2 * i + 1]).collect(),
        alike: vec![],
    };
    check(&parts);
}

#[test]
fn large_graphs_are_laid_out_in_a_moment() {
    let start = std::time::Instant::now();
    let placed = lay_out(&ladder(5000));
    assert_eq!(placed.anchors.len(), 10_000);
    assert!(placed.size[0] < 5.0 * placed.size[1], "folded into lines: {:?}", placed.size);
    assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
}

#[test]
fn equal_parts_get_equal_shapes() {
    // Five junctions in a ring with a chord, each with two one-ports of its own.
    let mut net = Network { nodes: Vec::new(), bonds: Vec::new(), alike: vec![Vec::new()] };
    for i in 0..5 {
        net.nodes.extend([node(Role::Centre), node(Role::OnePort), node(Role::OnePort)]);
        net.bonds.extend([[3 * i, 3 * i + 1], [3 * i, 3 * i + 2], [3 * i, 3 * ((i + 1) % 5)]]);
        net.alike[0].push(vec![3 * i, 3 * i + 1, 3 * i + 2]);
    }
    net.bonds.push([0, 6]);
    check(&net);
    let placed = lay_out(&net);
    let way = |a: usize, b: usize| [0, 1].map(|k| (placed.anchors[b][k] - placed.anchors[a][k]).partial_cmp(&0.0));
    let shape = |part: &Vec<usize>| [way(part[0], part[1]), way(part[0], part[2])];
    let shapes: Vec<_> = net.alike[0].iter().map(shape).collect();
    assert!(shapes.iter().all(|s| *s == shapes[0]), "{shapes:?}");
}
