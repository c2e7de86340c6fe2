use super::super::*;
use super::reader::read;

macro_rules! zero {
    ($($name:ident: $text:literal;)*) => {
        $(#[test]
        fn $name() {
            let mut x = Exprs::default();
            let e = read(&mut x, $text);
            assert!(x.is_zero(e));
            assert!(x.is_zero_given(e));
        })*
    };
}

macro_rules! nonzero {
    ($($name:ident: $text:literal;)*) => {
        $(#[test]
        fn $name() {
            let mut x = Exprs::default();
            let e = read(&mut x, $text);
            assert!(!x.is_zero(e));
        })*
    };
}

zero! {
    polynomial: "(a + b)^3 - a^3 - 3*a^2*b - 3*a*b^2 - b^3";
    rational: "1/(x - 1) - 1/(x + 1) - 2/(x^2 - 1)";
    circle: "sin(x)^2 + cos(x)^2 - 1";
    double_angle: "sin(2*x) - 2*sin(x)*cos(x)";
    half_angle: "cos(x) - 1 + 2*sin(x/2)^2";
    third_of_angle: "cos(x) - 4*cos(x/3)^3 + 3*cos(x/3)";
    angle_sum: "sin(a + b) - sin(a)*cos(b) - cos(a)*sin(b)";
    quarter_turn: "sin(x + pi/2) - cos(x)";
    sixth_turn: "sin(x + pi/6) - cos(x)/2 - sin(x)*sqrt(3)/2";
    tangent: "tan(x)*cos(x) - sin(x)";
    factored_angle: "sin(x*(y + z)) - sin(x*y + x*z)";
    exponentials: "exp(a)*exp(b) - exp(a + b)";
    exponential_of_product: "exp(a*(b + 1)) - exp(a)*exp(a*b)";
    logarithms: "log(A*B) - log(A) - log(B)";
    hyperbolic: "cosh(x)^2 - sinh(x)^2 - 1";
    hyperbolic_tangent: "tanh(x) - sinh(x)/cosh(x)";
    roots: "sqrt(A*B) - sqrt(A)*sqrt(B)";
    root_of_square: "sqrt(A^2 + 2*A*B + B^2) - A - B";
    golden: "sqrt(5 + 2*sqrt(6)) - sqrt(2) - sqrt(3)";
    powers: "A^x*A^y - A^(x + y)";
    arctangent: "atan(A) + atan(1/A) - pi/2";
    equal_opaque: "abs((a + b)^2 - a^2) - abs(2*a*b + b^2)";
    singular_zero: "0*(1/x)";
}

nonzero! {
    symbol: "x";
    number: "0.0000000000000000000000000001";
    tiny_difference: "x - x*1.0000000000000000000000001";
    root_has_a_sign: "sqrt(x^2 + 2*x*y + y^2) - x - y";
    abs_is_not_its_argument: "abs(x) - x";
    rare_branch: "if x > 1000000 then 1 else 0";
    sum_of_logs: "log(A + B) - log(A) - log(B)";
    almost: "sin(x) - x + x^3/6 - x^5/120";
    singular: "1/(x - x)";
    nearly_pi: "sin(3.14159265358979323846264338327950288)";
}

#[test]
fn zero_at_the_given_parameters_only() {
    let mut x = Exprs::default();
    let four = x.int(4);
    let [a, b] = ["a", "b"].map(|n| x.symbol(n, Facts { positive: true, given: Some(four), ..Facts::default() }));
    let (a, b) = (x.sym(a), x.sym(b));
    let difference = x.sub(a, b);
    assert!(!x.is_zero(difference) && x.is_zero_given(difference));
    let root = x.sqrt(a);
    let two = x.int(2);
    let difference = x.sub(root, two);
    assert!(!x.is_zero(difference) && x.is_zero_given(difference));
    let logs = read(&mut x, "log(a) - 2*log(2)");
    assert!(!x.is_zero(logs) && x.is_zero_given(logs));
    let angle = read(&mut x, "sin(a*q) - sin(4*q)");
    assert!(!x.is_zero(angle) && x.is_zero_given(angle));
    let inside = read(&mut x, "if a > b then q else 0");
    assert!(!x.is_zero(inside));
}

#[test]
fn regular_matrices_are_told_from_singular_ones_and_doubtful_ones() {
    let mut x = Exprs::default();
    let mut matrix = |rows: [[&str; 2]; 2]| -> Vec<Vec<Expr>> {
        rows.iter().map(|row| row.iter().map(|text| read(&mut x, text)).collect()).collect()
    };
    let regular = matrix([["m + j*cos(a)^2", "j*cos(a)"], ["j*cos(a)", "j"]]);
    let singular = matrix([["j*cos(a)^2", "j*cos(a)"], ["j*cos(a)", "j"]]);
    let doubtful = matrix([["log(a*b)", "1"], ["log(a) + log(b)", "1"]]);
    assert!(x.is_regular_given(&regular));
    assert!(!x.is_regular_given(&singular));
    assert!(!x.is_regular_given(&doubtful));
}
