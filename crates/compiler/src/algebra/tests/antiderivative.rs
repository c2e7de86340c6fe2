//! Antiderivatives by `x`; each that is given is proven by its derivative.

use super::super::*;
use super::reader::read;

/// The antiderivative of the left side by `x` is the right side, up to a constant.
macro_rules! antiderivative {
    ($($name:ident: $left:literal => $right:literal;)*) => {
        $(#[test]
        fn $name() {
            let mut x = Exprs::default();
            let (left, right) = (read(&mut x, $left), read(&mut x, $right));
            let by = x.find_symbol("x").expect("it reads x");
            let found = x.antiderivative(left, by).expect("there is one");
            let other = x.sub(found, right);
            assert!(!x.depends_on(other, by) || { let slope = x.derivative(other, by); x.is_zero(slope) });
        })*
    };
}

/// Of the left side none is given.
macro_rules! without_antiderivative {
    ($($name:ident: $left:literal;)*) => {
        $(#[test]
        fn $name() {
            let mut x = Exprs::default();
            let left = read(&mut x, $left);
            let by = x.find_symbol("x").expect("it reads x");
            assert_eq!(x.antiderivative(left, by), None);
        })*
    };
}

antiderivative! {
    constant: "a + 0*x" => "a*x";
    power: "x^3" => "x^4/4";
    of_a_line: "sin(2*x + a)" => "-cos(2*x + a)/2";
    sum: "cos(x) + a*x" => "sin(x) + a*x^2/2";
    product_of_functions: "sin(x)*cos(x)" => "sin(x)^2/2";
    crank_with_rod: "R*sin(x) + R^2*sin(x)*cos(x)/sqrt(L^2 - R^2*sin(x)^2)" => "-R*cos(x) - sqrt(L^2 - R^2*sin(x)^2)";
    length: "x/sqrt(x^2 + y^2)" => "sqrt(x^2 + y^2)";
    exponential: "x*exp(-x^2)" => "-exp(-x^2)/2";
    multiplied_out: "x*(a + x)" => "a*x^2/2 + x^3/3";
    square: "(x + a)*(x + a)" => "(x + a)^3/3";
}

without_antiderivative! {
    elliptic: "sqrt(1 - a*sin(x)^2)";
    logarithm_of_either_sign: "1/x";
    steps: "sign(x)";
}

#[test]
fn a_potential_of_two_variables() {
    let mut x = Exprs::default();
    let (first, second) = (read(&mut x, "2*x*y + cos(x)"), read(&mut x, "x^2"));
    let (a, b) = (x.find_symbol("x").expect("x"), x.find_symbol("y").expect("y"));
    let found = x.potential(&[(a, first), (b, second)]).expect("it is a gradient");
    let wanted = read(&mut x, "x^2*y + sin(x)");
    let left = x.sub(found, wanted);
    assert!(x.is_zero(left));
    assert_eq!(x.potential(&[(a, second), (b, first)]), None);
}
