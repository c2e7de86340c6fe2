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
