//! Points, lines and boxes. All in px, y downwards.

/// A point or vector.
pub type Point = [f64; 2];

/// `a + k b`.
pub fn add(a: Point, k: f64, b: Point) -> Point {
    [a[0] + k * b[0], a[1] + k * b[1]]
}

/// From `a` to `b`.
pub fn step(a: Point, b: Point) -> Point {
    [b[0] - a[0], b[1] - a[1]]
}

/// Length of a vector.
pub fn length(v: Point) -> f64 {
    (v[0] * v[0] + v[1] * v[1]).sqrt()
}

/// The vector with length 1; to the right if it has none.
pub fn unit(v: Point) -> Point {
    let l = length(v);
    if l > 1e-9 { [v[0] / l, v[1] / l] } else { [1.0, 0.0] }
}

/// The normal on which the half arrow and the flow are noted: below a bond, to the right of an upright one.
pub fn flow_side(direction: Point) -> Point {
    let n = [-direction[1], direction[0]];
    let upright = direction[0].abs() < 1e-3 * direction[1].abs();
    let turned = if upright { n[0] < 0.0 } else { n[1] < 0.0 };
    if turned { [-n[0], -n[1]] } else { n }
}

/// Where a ray from the centre of a box with these half sizes leaves it.
pub fn leave_box(centre: Point, half: Point, start: Point, direction: Point) -> Point {
    let reach = |k: usize| {
        if direction[k].abs() < 1e-9 {
            return f64::INFINITY;
        }
        (centre[k] + half[k] * direction[k].signum() - start[k]) / direction[k]
    };
    add(start, reach(0).min(reach(1)).max(0.0), direction)
}

/// A box by its corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Upper left.
    pub min: Point,
    /// Lower right.
    pub max: Point,
}

impl Area {
    /// The box with this centre and size.
    pub fn around(centre: Point, size: Point) -> Area {
        Area { min: add(centre, -0.5, size), max: add(centre, 0.5, size) }
    }
    /// The box with this much more on every side.
    pub fn grown(&self, by: f64) -> Area {
        Area { min: [self.min[0] - by, self.min[1] - by], max: [self.max[0] + by, self.max[1] + by] }
    }
    /// Its corners, in turn.
    pub fn corners(&self) -> [Point; 4] {
        [self.min, [self.max[0], self.min[1]], self.max, [self.min[0], self.max[1]]]
    }
    /// Whether a point lies inside.
    pub fn holds(&self, p: Point) -> bool {
        (0..2).all(|k| self.min[k] < p[k] && p[k] < self.max[k])
    }
    /// Whether two boxes share more than an edge.
    pub fn overlaps(&self, other: &Area) -> bool {
        (0..2).all(|k| self.min[k] < other.max[k] && other.min[k] < self.max[k])
    }
    /// Whether a straight line meets the box.
    pub fn meets(&self, from: Point, to: Point) -> bool {
        let [mut enter, mut exit] = [0.0_f64, 1.0_f64];
        for k in 0..2 {
            let d = to[k] - from[k];
            if d.abs() < 1e-12 {
                if from[k] <= self.min[k] || from[k] >= self.max[k] {
                    return false;
                }
                continue;
            }
            let [a, b] = [(self.min[k] - from[k]) / d, (self.max[k] - from[k]) / d];
            enter = enter.max(a.min(b));
            exit = exit.min(a.max(b));
        }
        enter < exit
    }
}

/// Whether two lines cross at a point inside both.
pub fn cross(a: Point, b: Point, c: Point, d: Point) -> bool {
    let turn = |p: Point, q: Point, r: Point| {
        let [u, v] = [step(p, q), step(p, r)];
        u[0] * v[1] - u[1] * v[0]
    };
    turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
}
