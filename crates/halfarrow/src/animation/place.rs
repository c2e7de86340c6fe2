//! Orientations as quaternions, and the sizes that masses and inertias tell.

use nalgebra::{Matrix3, SymmetricEigen};

/// The turn about z by an angle, as a quaternion `[w, x, y, z]`.
pub(super) fn about_z(angle: f64) -> [f64; 4] {
    [libm::cos(angle / 2.0), 0.0, 0.0, libm::sin(angle / 2.0)]
}

/// The quaternion of a rotation matrix, given row by row. Source: [Shepperd].
pub(super) fn quaternion(r: &[f64; 9]) -> [f64; 4] {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *r;
    let trace = xx + yy + zz;
    let q = if trace >= xx.max(yy).max(zz) {
        [1.0 + trace, zy - yz, xz - zx, yx - xy]
    } else if xx >= yy && xx >= zz {
        [zy - yz, 1.0 + xx - yy - zz, yx + xy, xz + zx]
    } else if yy >= zz {
        [xz - zx, yx + xy, 1.0 - xx + yy - zz, zy + yz]
    } else {
        [yx - xy, xz + zx, zy + yz, 1.0 - xx - yy + zz]
    };
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

/// Of the two quaternions of each turn the one that is nearer to that before it, so that what lies between is the short way.
pub(super) fn continued(mut turns: Vec<[f64; 4]>) -> Vec<[f64; 4]> {
    for i in 1..turns.len() {
        let along: f64 = turns[i - 1].iter().zip(&turns[i]).map(|(a, b)| a * b).sum();
        if along < 0.0 {
            turns[i] = turns[i].map(|x| -x);
        }
    }
    turns
}

/// The box of even density that has a mass and an inertia: its sides, and how it is turned. A side that no body can have,
/// since one moment of inertia is greater than the others together, is 0.
pub(super) fn equivalent_box(mass: f64, inertia: &[f64; 9]) -> ([f64; 3], [f64; 4]) {
    let straight = [1, 2, 3, 5, 6, 7].iter().all(|&i| inertia[i] == 0.0);
    let ([a, b, c], turned) = match straight {
        true => ([inertia[0], inertia[4], inertia[8]], [1.0, 0.0, 0.0, 0.0]),
        false => principal(inertia),
    };
    let side = |across: f64, other: f64, own: f64| {
        if mass > 0.0 { (6.0 * (across + other - own) / mass).max(0.0).sqrt() } else { 0.0 }
    };
    ([side(b, c, a), side(c, a, b), side(a, b, c)], turned)
}

/// Principal moments of inertia, and the turn to their axes.
fn principal(inertia: &[f64; 9]) -> ([f64; 3], [f64; 4]) {
    let found = SymmetricEigen::new(Matrix3::from_row_slice(inertia));
    let mut axes = found.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let rows: [f64; 9] = std::array::from_fn(|i| axes[(i / 3, i % 3)]);
    (std::array::from_fn(|i| found.eigenvalues[i]), quaternion(&rows))
}

/// Radius and length of the cylinder of even density that has a mass and moments of inertia about its axis and across; a
/// length that no body can have is 0.
pub(super) fn equivalent_cylinder(mass: f64, about: f64, across: Option<f64>) -> (f64, Option<f64>) {
    if mass <= 0.0 {
        return (0.0, Some(0.0));
    }
    let radius = (2.0 * about / mass).max(0.0).sqrt();
    let length = across.map(|across| (12.0 * across / mass - 3.0 * radius * radius).max(0.0).sqrt());
    (radius, length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: &[f64], b: &[f64]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
    }

    /// The matrix of a quaternion, row by row.
    fn matrix([w, x, y, z]: [f64; 4]) -> [f64; 9] {
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ]
    }

    #[test]
    fn quaternions_are_those_of_their_matrices() {
        let all = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.5, -0.5, 0.5, 0.5]];
        for q in all.into_iter().chain([[0.1, 0.7, -0.1, 0.7], [0.1, 0.1, 0.7, 0.7], about_z(2.0)]) {
            near(&matrix(quaternion(&matrix(q))), &matrix(q));
        }
    }

    #[test]
    fn a_box_is_found_back_from_its_inertia() {
        let (m, [x, y, z]) = (3.0, [0.2, 0.4, 0.6]);
        let moment = |a: f64, b: f64| m * (a * a + b * b) / 12.0;
        let own = [moment(y, z), 0.0, 0.0, 0.0, moment(z, x), 0.0, 0.0, 0.0, moment(x, y)];
        near(&equivalent_box(m, &own).0, &[x, y, z]);
        // The same box turned: the axes that are found have the same sides along them.
        let q = quaternion(&matrix([0.9, 0.1, -0.3, 0.2]));
        let r = Matrix3::from_row_slice(&matrix(q));
        let turned = r * Matrix3::from_row_slice(&own) * r.transpose();
        let rows: [f64; 9] = std::array::from_fn(|i| turned[(i / 3, i % 3)]);
        let (sides, axes) = equivalent_box(m, &rows);
        let mut sorted = sides;
        sorted.sort_by(f64::total_cmp);
        near(&sorted, &[x, y, z]);
        let back = Matrix3::from_row_slice(&matrix(axes));
        let of = |side: f64| m * (x * x + y * y + z * z - side * side) / 12.0;
        let again = back * Matrix3::from_diagonal(&nalgebra::Vector3::from(sides.map(of))) * back.transpose();
        near(again.as_slice(), turned.as_slice());
    }

    #[test]
    fn a_cylinder_is_found_back_from_its_inertia() {
        let (m, radius, length) = (2.0, 0.3, 0.5);
        let (about, across) = (m * radius * radius / 2.0, m * (3.0 * radius * radius + length * length) / 12.0);
        let (r, l) = equivalent_cylinder(m, about, Some(across));
        near(&[r, l.expect("a length")], &[radius, length]);
        assert_eq!(equivalent_cylinder(0.0, 1.0, None), (0.0, Some(0.0)));
    }
}
