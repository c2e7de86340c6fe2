use super::super::*;
use super::reader::{read, symbol};

/// What must hold of parameters, in words.
fn told(x: &mut Exprs) -> Vec<String> {
    let all = x.assumptions(&|_| true);
    all.iter().map(|a| format!("{} {:?}", ascii(x, a.expr, &PlainNames(x)), a.holds)).collect()
}

#[test]
fn what_a_divisor_tells_does_not_depend_on_when_things_were_made() {
    for early in [true, false] {
        let mut x = Exprs::default();
        let q = symbol(&mut x, "q");
        let q = x.sym(q);
        if early {
            let _ = read(&mut x, "1/(q*exp(q))");
        }
        x.assume_nonzero(q);
        let quotient = read(&mut x, "1/(q*exp(q))");
        assert!(x.nonzero(quotient) && x.total(quotient));
        assert_eq!(read(&mut x, "0/q"), ZERO);
        assert_eq!(read(&mut x, "q/q"), ONE);
    }
}

#[test]
fn an_attempt_that_is_given_up_leaves_nothing_assumed() {
    let mut x = Exprs::default();
    let q = symbol(&mut x, "q");
    let q = x.sym(q);
    let before = x.div(q, q);
    let one = x.tried(|x| {
        x.assume_nonzero(q);
        let root = read(x, "sqrt(M^2)");
        assert_eq!(root, read(x, "M"), "M is above zero");
        x.div(q, q)
    });
    assert_eq!(one, ONE);
    assert!(!x.nonzero(q));
    assert_eq!(x.div(q, q), before);
    assert!(told(&mut x).is_empty());
    let found = x.if_found(|x| {
        x.assume_nonzero(q);
        Some(x.div(q, q))
    });
    assert_eq!(found, Some(ONE));
    assert!(x.nonzero(q), "what counts stays assumed");
}

#[test]
fn what_was_never_asked_for_is_no_decision() {
    let mut x = Exprs::default();
    let quotient = read(&mut x, "q/M + log(R)");
    assert!(told(&mut x).is_empty(), "it is divided by M, and nothing follows from that");
    assert!(x.total(quotient));
    assert_eq!(told(&mut x), ["M NotZero", "R Positive"]);
}

#[test]
fn what_values_alone_tell_of_a_compound_is_an_assumption() {
    let mut x = Exprs::default();
    let difference = read(&mut x, "A - B/2");
    assert!(!x.positive(difference), "its signs tell nothing");
    x.decide_positive(difference);
    let product = read(&mut x, "A*B");
    x.decide_nonzero(product);
    assert_eq!(told(&mut x), ["A NotZero", "B NotZero", "A - B/2 Positive"]);
}

#[test]
fn divisors_of_states_are_forgotten_where_nobody_watches_them() {
    let mut x = Exprs::default();
    let [kept, state, parameters] = ["u", "q", "A - B"].map(|text| read(&mut x, text));
    x.assume_nonzero(kept);
    let before = x.assumed();
    x.assume_nonzero(state);
    x.assume_nonzero(parameters);
    x.forget_unwatched(&before);
    assert_eq!([kept, state, parameters].map(|e| x.nonzero(e)), [true, false, true]);
}
