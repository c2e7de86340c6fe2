//! What is looked for in whole columns, in lanes that vectors go through.

/// Samples that are gone through together.
const LANES: usize = 8;

/// The greater of two; what is not a number does not count beside one that is.
pub(crate) fn higher(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// Adds a column to a sum of such.
pub(crate) fn add(sum: &mut [f64], column: &[f64]) {
    sum.iter_mut().zip(column).for_each(|(sum, own)| *sum += own);
}

/// The greatest magnitude; what is not a number does not count.
pub(crate) fn greatest(column: &[f64]) -> f64 {
    let (chunks, rest) = column.as_chunks::<LANES>();
    let mut most = [0.0; LANES];
    for chunk in chunks {
        most.iter_mut().zip(chunk).for_each(|(most, v)| *most = higher(*most, v.abs()));
    }
    most.into_iter().chain(rest.iter().map(|v| v.abs())).fold(0.0, higher)
}

/// The greatest magnitude of what two columns make multiplied.
pub(crate) fn greatest_product(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut most = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for (most, (a, b)) in most.iter_mut().zip(a.iter().zip(b)) {
            *most = higher(*most, (a * b).abs());
        }
    }
    most.into_iter().chain(a_rest.iter().zip(b_rest).map(|(a, b)| (a * b).abs())).fold(0.0, higher)
}

/// Whether all are finite.
pub(crate) fn are_finite(column: &[f64]) -> bool {
    let (chunks, rest) = column.as_chunks::<LANES>();
    let mut nothing = [0.0; LANES];
    for chunk in chunks {
        nothing.iter_mut().zip(chunk).for_each(|(nothing, v)| *nothing += v * 0.0);
    }
    nothing.into_iter().chain(rest.iter().map(|v| v * 0.0)).all(|v| v == 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_find_what_one_after_the_other_does() {
        let a: Vec<f64> = (0..43).map(|k| f64::from((k * 29) % 43) - 30.0).collect();
        let b: Vec<f64> = (0..43).map(|k| f64::from((k * 17) % 43) - 11.0).collect();
        for count in [0, 1, 7, 8, 9, 30, 43] {
            let (a, b) = (&a[..count], &b[..count]);
            assert_eq!(greatest(a), a.iter().fold(0.0, |most: f64, v| most.max(v.abs())));
            let products = a.iter().zip(b).map(|(a, b)| (a * b).abs());
            assert_eq!(greatest_product(a, b), products.fold(0.0, f64::max));
            assert!(are_finite(a));
            for (at, odd) in (0..count).flat_map(|at| [(at, f64::NAN), (at, f64::NEG_INFINITY)]) {
                let mut a = a.to_vec();
                a[at] = odd;
                assert!(!are_finite(&a));
                assert_eq!(greatest(&a).is_infinite(), odd.is_infinite());
            }
        }
    }
}
