//! Fewer points, the same picture.

/// Splits a column into runs of finite values and keeps of each run at most four points for each of `slots` equal
/// stretches of time: first, least, greatest and last, in order. At that width the picture stays the same.
pub fn decimate(times: &[f64], values: &[f64], slots: usize) -> Vec<Vec<[f64; 2]>> {
    let points: Vec<[f64; 2]> = times.iter().zip(values).map(|(&t, &x)| [t, x]).collect();
    let [start, end] = [times.first(), times.last()].map(|t| t.copied().unwrap_or(0.0));
    let slot = |p: &[f64; 2]| (((p[0] - start) / (end - start) * slots as f64) as usize).min(slots.saturating_sub(1));
    let finite = |p: &[f64; 2]| p.iter().all(|x| x.is_finite());
    let runs = points.chunk_by(|a, b| finite(a) == finite(b)).filter(|run| finite(&run[0]));
    let thin = |run: &[[f64; 2]]| match points.len() <= 4 * slots {
        true => run.to_vec(),
        false => run.chunk_by(|a, b| slot(a) == slot(b)).flat_map(extremes).collect(),
    };
    runs.map(thin).collect()
}

/// First, least, greatest and last of some points, in order, none twice.
fn extremes(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let by_value = |a: &usize, b: &usize| points[*a][1].total_cmp(&points[*b][1]);
    let least = (0..points.len()).min_by(by_value).unwrap_or(0);
    let greatest = (0..points.len()).max_by(by_value).unwrap_or(0);
    let mut kept = vec![0, least, greatest, points.len() - 1];
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|i| points[i]).collect()
}
