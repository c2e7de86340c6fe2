use super::axis::Axis;
use super::decimate::decimate;
use super::*;

fn trace(columns: &[(&str, &str, &[f64])]) -> Trace {
    let columns = columns.iter().map(|c| Column { name: c.0.into(), unit: c.1.into(), values: c.2.to_vec() });
    let columns: Vec<Column> = columns.collect();
    let samples = columns.first().map_or(0, |c| c.values.len());
    Trace { times: (0..samples).map(|i| 0.5 * i as f64).collect(), columns }
}

fn labels(values: &[f64]) -> (Vec<String>, String) {
    let axis = Axis::new(values.iter().copied(), 160.0, true);
    (axis.ticks.iter().map(|t| t.label.clone()).collect(), axis.unit("m"))
}

#[test]
fn ticks_are_round_and_large_or_small_numbers_share_a_power_of_ten() {
    assert_eq!(labels(&[-1.0, 1.0]), (["−1.0", "−0.5", "0", "0.5", "1.0"].map(String::from).to_vec(), " in m".into()));
    assert_eq!(labels(&[0.0, 1e-5]), (["0", "0.5", "1.0"].map(String::from).to_vec(), " in 10⁻⁵ m".into()));
    assert_eq!(labels(&[0.0, 3e6]).1, " in 10⁶ m");
    assert_eq!(labels(&[7.0, 7.0]).0, ["6.8", "7.0", "7.2"]);
}

#[test]
fn odd_values_give_a_plot_of_finite_numbers() {
    let odd: [&[f64]; 7] = [
        &[],
        &[1.0],
        &[f64::NAN, f64::INFINITY],
        &[0.0, f64::NAN, 1.0],
        &[f64::MAX, f64::MIN],
        &[5e-324, 0.0],
        &[1.0, 1.0 + 1e-15],
    ];
    for values in odd {
        let svg = plot(&trace(&[("a.e", "N", values)]), "odd");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{values:?}: {svg}");
        assert!(svg.ends_with("</svg>\n"));
    }
    assert!(plot(&Trace::default(), "nothing").contains("nothing was recorded"));
}

#[test]
fn one_panel_a_unit_and_one_curve_a_column() {
    let svg = plot(&trace(&[("a.e", "N", &[0.0, 1.0]), ("b.f", "m/s", &[1.0, 2.0]), ("c.e", "N", &[2.0, 1.0])]), "T");
    assert_eq!(svg.matches("class=\"panel\"").count(), 2);
    assert_eq!(svg.matches("class=\"curve\"").count(), 3);
    assert!(svg.contains("a.e, c.e in N") && svg.contains("b.f in m/s") && svg.contains("t in s"));
}

#[test]
fn events_are_marked_where_a_time_is_given_twice() {
    let mut jumping = trace(&[("a.e", "N", &[0.0, 1.0, 2.0, 3.0])]);
    assert!(!plot(&jumping, "T").contains("class=\"events\""));
    jumping.times = vec![0.0, 1.0, 1.0, 2.0];
    assert!(plot(&jumping, "T").contains("<path class=\"events\" d=\"M320 0v5\""));
}

#[test]
fn names_cannot_break_the_markup() {
    let svg = plot(&trace(&[("a<b>&\"", "1", &[0.0, 1.0])]), "<script>");
    assert!(!svg.contains("<script>") && svg.contains("a&lt;b&gt;&amp;&quot;"));
}

#[test]
fn extremes_survive_decimation() {
    let times: Vec<f64> = (0..100_000).map(f64::from).collect();
    let mut values = vec![0.0; 100_000];
    values[43_210] = 7.0;
    values[43_211] = -3.0;
    let runs = decimate(&times, &values, 640);
    assert!(runs.len() == 1 && runs[0].len() <= 4 * 640, "{} runs", runs.len());
    assert!(runs[0].contains(&[43_210.0, 7.0]) && runs[0].contains(&[43_211.0, -3.0]));
    assert_eq!((runs[0][0], *runs[0].last().unwrap()), ([0.0, 0.0], [99_999.0, 0.0]));
}

#[test]
fn what_is_not_finite_leaves_a_gap() {
    let runs = decimate(&[0.0, 1.0, 2.0, 3.0], &[1.0, f64::NAN, 2.0, 3.0], 640);
    assert_eq!(runs, [vec![[0.0, 1.0]], vec![[2.0, 2.0], [3.0, 3.0]]]);
}
