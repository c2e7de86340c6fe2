use super::*;
use proptest::prelude::*;

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap_or_else(|e| panic!("{text}: {e:?}"))
}

fn exact(n: i64, d: i64) -> RBig {
    RBig::from_parts(n.into(), u64::try_from(d).expect("above zero").into())
}

/// `a` has the dimension of `b` and is `n/d` of it.
#[track_caller]
fn is(a: &str, n: i64, d: i64, b: &str) {
    let (a, b) = (unit(a), unit(b));
    assert_eq!((a.dimension, a.angle, a.pi), (b.dimension, b.angle, b.pi), "{a} and {b}");
    assert_eq!(a.rational, &b.rational * exact(n, d), "{a}");
}

#[test]
fn factors_are_exact() {
    is("kN/m", 1000, 1, "N/m");
    is("km/h", 5, 18, "m/s");
    is("kWh", 3_600_000, 1, "J");
    is("L/min", 1, 60_000, "m3/s");
    is("mm2", 1, 1_000_000, "m2");
    is("uF", 1, 1_000_000, "F");
    is("µF", 1, 1, "uF");
    is("μH", 1, 1, "uH");
    is("kΩ", 1, 1, "kohm");
    is("MPa", 10, 1, "bar");
    is("rev", 360, 1, "deg");
    is("rev/min", 1, 1, "rpm");
    is("%", 1, 100, "1");
    is("psi", 1, 1, "lbf/in2");
    is("hp", 550, 1, "ft.lbf/s");
    is("PS", 75, 1, "kgf.m/s");
    is("mph", 1, 1, "mi/h");
    is("degF", 5, 9, "K");
}

#[test]
fn the_grammar_has_one_reading() {
    is("N.s3/m3", 1, 1, "kg.s/m2");
    is("kg*m^2/s", 1, 1, "N.m.s");
    is("m/s/s", 1, 1, "m/s2");
    is("m·s⁻²", 1, 1, "m/s2");
    is("J/(kg.K)", 1, 1, "m2/s2/K");
    is("1/s", 1, 1, "Hz");
    is("m^(1/2)", 1, 1, "m^0.5");
    is("m^-1", 1, 1, "1/m");
    is("N.m.s/rad", 1, 1, "kg.m2/s/rad");
    assert!(matches!(Unit::parse("J/kg.K"), Err(UnitError::Ambiguous { at }) if at == (4..6)));
    assert!(matches!(Unit::parse("mm^0.5"), Err(UnitError::Root { .. })));
    for text in ["m^", "m^x", "m^0.001", "m^999", "m999999999999", "m^(1/0)", "m^(1/2"] {
        assert!(Unit::parse(text).is_err(), "{text}");
    }
    for text in ["", "/s", "m/", "m..s", "m s", "2m", "m-2", "(m", "((m))", "1.m", "m)"] {
        assert!(matches!(Unit::parse(text), Err(UnitError::Unreadable { .. })), "{text}");
    }
}

#[test]
fn torque_times_angular_velocity_is_a_power() {
    let (torque, speed, damping) = (unit("N.m"), unit("rad/s"), unit("N.m.s/rad"));
    assert_eq!(torque.dimension.times(speed.dimension), Dimension::WATT);
    assert_eq!(damping.dimension.times(speed.dimension), torque.dimension);
    assert_eq!((damping.angle + speed.angle, torque.angle), (0, 0));
}

#[test]
fn temperatures_alone_have_an_offset() {
    assert_eq!(unit("degC").to_si_f64(20.0), 293.15);
    assert_eq!(unit("°F").to_si_f64(212.0), 373.15);
    assert_eq!(unit("W/degC").to_si_f64(2.0), 2.0);
    assert!((unit("degC").from_si_f64(293.15) - 20.0).abs() < 1e-13);
    assert_eq!(unit("deg").to_si_f64(180.0), std::f64::consts::PI);
}

#[test]
fn unknown_units_are_told_with_a_guess() {
    let guess = |text: &str| match Unit::parse(text) {
        Err(UnitError::Unknown { nearest, .. }) => nearest,
        other => panic!("{text}: {other:?}"),
    };
    assert_eq!(guess("Nm").as_deref(), Some("N.m"));
    assert_eq!(guess("kNm/rad").as_deref(), Some("kN.m"));
    assert_eq!(guess("sec").as_deref(), Some("s"));
    assert_eq!(guess("kPA").as_deref(), Some("kPa"));
    assert_eq!(guess("n").as_deref(), Some("N"));
    assert_eq!(guess("frobs"), None);
    assert_eq!(guess("kbolt"), None);
}

#[test]
fn units_that_take_no_prefix_get_none() {
    for text in ["kmin", "Mrpm", "mdegC", "k%", "hm", "kkg"] {
        assert!(Unit::parse(text).is_err(), "{text}");
    }
}

#[test]
fn what_is_printed_reads_the_same() {
    for text in ["N", "N.s/m", "kg.m2", "rad/s", "rpm", "N.m/rad", "N.m.s/rad", "m^0.5", "cd.mol2/A3", "V", "W/K", "1"]
    {
        let si = unit(text).to_si_unit();
        assert!(si.is_si());
        let again = unit(&si.to_string());
        assert_eq!((again.dimension, again.angle), (si.dimension, si.angle), "{text} printed as {si}");
    }
    assert_eq!(unit("rpm").to_si_unit().to_string(), "rad/s");
    assert_eq!(unit("mV").to_si_unit().to_string(), "V");
    assert_eq!(unit("kN.m/deg").to_si_unit().to_string(), "N.m/rad");
}

#[test]
fn the_table_is_sound() {
    for symbol in super::table::SYMBOLS {
        let one = unit(symbol.name);
        assert!(one.rational > RBig::ZERO, "{}", symbol.name);
        for prefix in symbol.prefixes.chars() {
            let text = format!("{prefix}{}", symbol.name);
            let known = super::table::SYMBOLS.iter().any(|s| s.name == text);
            assert!(known || unit(&text).dimension == one.dimension, "{text}");
        }
    }
}

#[test]
fn domains_are_told_by_either_variable() {
    for domain in Domain::ALL {
        let [(_, effort), (_, flow)] = domain.words();
        assert_eq!(unit(effort).dimension, domain.effort(), "{domain}");
        assert_eq!(unit(flow).dimension, domain.flow(), "{domain}");
        assert_eq!(Domain::of_effort(domain.effort()), Some(domain));
        assert_eq!(Domain::of_flow(domain.flow()), Some(domain));
    }
}

#[test]
fn the_first_symbol_is_found_for_the_clash_with_names() {
    assert_eq!(Unit::first_symbol("m2/s"), "m");
    assert_eq!(Unit::first_symbol("kN/m"), "kN");
    assert_eq!(Unit::first_symbol("1/s"), "s");
    assert_eq!(Unit::first_symbol("%"), "%");
}

/// Texts of units, sound and unsound.
fn unit_text() -> impl Strategy<Value = String> {
    const PIECES: &[&str] = &[
        "m",
        "kg",
        "s",
        "N",
        "rpm",
        "degC",
        "mm",
        "µF",
        "%",
        "°",
        "1",
        "2",
        "3",
        "²",
        "⁻",
        "^",
        "-",
        "(",
        ")",
        ".",
        "*",
        "/",
        "·",
        "0.5",
        "1/2",
        "99999999999",
        "x",
        " ",
        "Ω",
    ];
    prop::collection::vec(prop::sample::select(PIECES), 0..8).prop_map(|pieces| pieces.concat())
}

proptest! {
    #[test]
    fn any_dimension_is_printed_so_that_it_reads_the_same(exponents in prop::array::uniform7(-300i32..300)) {
        let dimension = Dimension(exponents);
        prop_assert_eq!(unit(&dimension.to_string()).dimension, dimension);
    }

    #[test]
    fn any_text_is_a_unit_or_none(text in unit_text(), other in "\\PC{0,12}") {
        for text in [text, other] {
            match Unit::parse(&text) {
                Ok(unit) => {
                    let again = Unit::parse(&unit.to_si_unit().to_string()).expect("what is printed can be read");
                    prop_assert_eq!((again.dimension, again.angle), (unit.dimension, unit.angle));
                    prop_assert!(unit.rational > RBig::ZERO);
                }
                Err(fault) => {
                    let span = Span { start: 0, end: text.len() as u32, ..Span::default() };
                    let place = fault.at(span).primary.span;
                    prop_assert!(text.get(place.start as usize..place.end as usize).is_some());
                }
            }
        }
    }

    #[test]
    fn numbers_go_to_si_and_back(value in -1e6f64..1e6, i in 0usize..20) {
        let name = super::table::SYMBOLS[i * 3].name;
        let there = unit(name).to_si_f64(value);
        prop_assert!((unit(name).from_si_f64(there) - value).abs() <= 1e-9 * (1.0 + value.abs()), "{}", name);
    }

    #[test]
    fn dimensions_multiply_as_exponents_add(a in prop::array::uniform7(-300i32..300), b in prop::array::uniform7(-300i32..300)) {
        let (a, b) = (Dimension(a), Dimension(b));
        prop_assert_eq!(a.times(b), b.times(a));
        prop_assert_eq!(a.times(b).over(b), a);
        prop_assert_eq!(a.times(a), a.power(2 * WHOLE).unwrap());
        prop_assert_eq!(a.power(-WHOLE).unwrap(), a.inverse());
        if let Some(root) = a.power(WHOLE / 2) {
            prop_assert_eq!(root.times(root), a);
        }
    }
}
