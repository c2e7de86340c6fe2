use super::super::*;

#[test]
fn decimals_are_exact() {
    let decimal = |t| Rational::from_decimal(t);
    assert_eq!(decimal("9.81"), Some(Rational::new(981, 100)));
    assert_eq!(decimal("1.5e3"), Some(Rational::from(1500)));
    assert_eq!(decimal("1.4e-13").unwrap().to_f64(), 1.4e-13);
    assert_eq!(decimal(".5"), Some(Rational::new(1, 2)));
    for wrong in ["", ".", "1e", "1.2.3", "e5", "0x1", "1e99999"] {
        assert_eq!(decimal(wrong), None, "{wrong}");
    }
}

#[test]
fn big_numbers_come_back_small() {
    let big = Rational::from(i64::MAX);
    let square = &big * &big;
    assert!(square.small().is_none());
    assert_eq!(square.over(&big), Some(big));
    let least = Rational::from(i64::MIN);
    assert_eq!(&(&least + &Rational::from(1)) - &Rational::from(1), least);
    assert_eq!(-&-&least, least);
    assert_eq!(Rational::new(i64::MIN, i64::MIN), Rational::from(1));
}

#[test]
fn nothing_is_divided_by_zero() {
    let zero = Rational::from(0);
    assert_eq!(Rational::from(3).over(&zero), None);
    assert_eq!(zero.over(&zero), None);
    assert_eq!(zero.recip(), None);
    assert_eq!(Rational::new(3, 4).over(&Rational::new(-3, 2)), Some(Rational::new(-1, 2)));
}

#[test]
fn floats_round_to_nearest() {
    for value in [0.1, 1.0 / 3.0, 1e300, 5e-324, -2.5, 1e22] {
        assert_eq!(Rational::from_f64(value).unwrap().to_f64(), value);
    }
    let tenth = Rational::new(1, 10);
    assert_eq!(tenth.to_f64(), 0.1);
    assert_eq!((&tenth + &Rational::new(2, 10)).to_f64(), 0.3);
}

#[test]
fn roots_are_exact_or_none() {
    assert_eq!(Rational::new(9, 4).root(2), Some(Rational::new(3, 2)));
    assert_eq!(Rational::from(2).root(2), None);
    assert_eq!(Rational::from(-8).root(3), None);
}

#[test]
fn tables() {
    let x = vec![0.0, 1.0, 2.0, 4.0];
    let y = vec![0.0, 1.0, 4.0, 4.5];
    let linear = Table1d::new(x.clone(), y.clone(), Interpolation::Linear, Outside::Extrapolate).unwrap();
    assert_eq!((linear.value(3.0), linear.value(6.0), linear.value(-1.0)), (4.25, 5.0, -1.0));
    let inverse = linear.inverse().unwrap();
    for at in [-2.0, 0.5, 3.0, 7.0] {
        assert!((inverse.value(linear.value(at)) - at).abs() < 1e-14);
    }
    let cubic = Table1d::new(x.clone(), y.clone(), Interpolation::Cubic, Outside::Error).unwrap();
    let values: Vec<f64> = (0..=400).map(|i| cubic.value(f64::from(i) * 0.01)).collect();
    assert!(values.windows(2).all(|w| w[0] < w[1]), "no overshoot");
    assert!(cubic.value(4.01).is_nan() && cubic.slope(-0.1).is_nan());
    for knot in [1.0, 2.0] {
        assert!((cubic.slope(knot - 1e-9) - cubic.slope(knot)).abs() < 1e-7);
        assert!((cubic.value(knot - 1e-12) - cubic.value(knot)).abs() < 1e-10);
    }
    let step = Table1d::new(x, y, Interpolation::Step, Outside::Clamp).unwrap();
    assert_eq!((step.value(1.99), step.value(2.0), step.value(9.0), step.slope(1.5)), (1.0, 4.0, 4.5, 0.0));
    let wrong = |x: &[f64], y: &[f64]| Table1d::new(x.into(), y.into(), Interpolation::Linear, Outside::Clamp);
    assert_eq!(wrong(&[0.0, 0.0], &[1.0, 2.0]), Err(TableError::NotIncreasing(1)));
    assert_eq!(wrong(&[0.0], &[1.0]), Err(TableError::TooShort));
    assert_eq!(wrong(&[0.0, f64::NAN], &[1.0, 1.0]), Err(TableError::NotFinite(1)));
}
