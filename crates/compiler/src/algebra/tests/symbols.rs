use super::super::*;

#[test]
fn a_twin_has_the_name_of_its_variable() {
    let mut x = Exprs::default();
    let flow = x.symbol("m.f", Facts::default());
    let twin = x.twin(flow);
    assert_ne!(twin, flow);
    assert_eq!(x.twin(flow), twin, "there is one twin of a variable");
    assert_eq!((x.name(twin), x.label(twin)), ("m.f", "m.f*"));
    assert_eq!((x.kind(twin), x.untwinned(twin)), (SymbolKind::Twin(flow), flow));
}

#[test]
fn what_shares_a_name_is_told_apart_by_its_label() {
    let mut x = Exprs::default();
    let effort = x.symbol("w.e", Facts::default());
    let speed = x.symbol("w.f", Facts::default());
    let (twin, reaction) = (x.twin(effort), x.reaction(speed, "w.e"));
    assert_eq!((x.label(twin), x.label(reaction)), ("w.e*", "w.e**"));
    assert_eq!((x.name(twin), x.name(reaction)), ("w.e", "w.e"));
    assert_eq!(x.untwinned(reaction), reaction, "what acts on a kept variable is no variable of a bond");
}

#[test]
fn a_rate_is_the_same_whoever_asks_for_it() {
    let mut x = Exprs::default();
    let flow = x.symbol("m.f", Facts::default());
    let twin = x.twin(flow);
    let (rate, of_twin) = (x.rate(flow), x.rate(twin));
    assert_eq!(x.rate(flow), rate);
    assert_eq!((x.name(rate), x.name(of_twin)), ("m.f'", "m.f'"));
    assert_ne!(x.label(rate), x.label(of_twin));
    let second = x.rate(rate);
    assert_eq!((x.name(second), x.undotted(second)), ("m.f''", (flow, 2)));
}

#[test]
fn a_name_that_is_taken_gets_a_number() {
    let mut x = Exprs::default();
    let own = x.symbol("m.pi", Facts::default());
    let speed = x.symbol("m.f", Facts::default());
    let momentum = x.made_of(SymbolKind::Momentum(speed), "m.pi");
    assert_ne!(momentum, own);
    assert_eq!(x.name(momentum), "m.pi_2");
    assert_eq!(x.made_of(SymbolKind::Momentum(speed), "m.pi"), momentum);
}

/// A vector turned two hundred times depends on each angle, its length on none: what the length leaves of it is rounding.
#[test]
fn rounding_of_a_long_chain_is_told_from_what_it_depends_on() {
    let mut x = Exprs::default();
    let angles: Vec<Symbol> = (0..200).map(|i| x.symbol(&format!("q{i}"), Facts::default())).collect();
    let (mut along, mut across) = (x.int(3), x.int(4));
    for &angle in &angles {
        let angle = x.sym(angle);
        let [sine, cosine] = [Function::Sin, Function::Cos].map(|f| x.call(f, &[angle]));
        let minus = x.neg(sine);
        let mut turned = |a: Expr, b: Expr| {
            let terms = [x.mul(&[a, along]), x.mul(&[b, across])];
            let sum = x.add(&terms);
            x.whole(sum)
        };
        (along, across) = (turned(cosine, minus), turned(sine, cosine));
    }
    let squares = [along, across].map(|e| x.powi(e, 2));
    let minus = x.int(-25);
    let zero = x.add(&[squares[0], squares[1], minus]);
    let moved = EvaluationOrder::new(&x, &[along, zero]).hardly_moved(&|_| true);
    assert_eq!(moved.len(), angles.len());
    moved.into_iter().for_each(|(symbol, members)| assert_eq!(members, [1], "{symbol:?}"));
}
