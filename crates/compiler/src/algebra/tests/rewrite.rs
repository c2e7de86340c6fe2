use super::super::*;
use super::reader::read;

fn textbook(text: &str) -> String {
    let mut x = Exprs::default();
    let e = read(&mut x, text);
    let short = x.textbook(e);
    let difference = x.sub(e, short);
    assert!(x.is_zero(difference) || !x.total(e), "{text}");
    ascii(&x, short, &PlainNames(&x))
}

macro_rules! prints {
    ($($name:ident: $text:literal => $expected:literal;)*) => {
        $(#[test]
        fn $name() {
            assert_eq!(textbook($text), $expected);
        })*
    };
}

// Capital letters are positive.
prints! {
    parallel: "1/(1/A + 1/B)" => "A*B/(A + B)";
    parallel_of_doubtful: "1/(1/a + 1/b)" => "1/(1/a + 1/b)";
    square_below: "x/(A*B*((a - b)^2/(A*B) + 1))" => "x/(A*B + (a - b)^2)";
    square_found: "a^2 - 2*a*b + b^2 + A*B" => "A*B + (a - b)^2";
    equal_denominators: "a*x/(a - b) + a*y/(a - b)" => "a*(x + y)/(a - b)";
    common_difference: "A*B*x - A*B*y" => "A*B*(x - y)";
    by_variable: "A*B*x - D*B*x - A*C*q - B*C*q" => "B*(A - D)*x - C*(A + B)*q";
    two_sums: "A*p + B*p - A*q - B*q" => "(A + B)*(p - q)";
    voltage_over_resistance: "(q/C - x)/B" => "(q/C - x)/B";
    a_term_alone: "x + A*B*(p - q)/(A + B)" => "x + A*B*(p - q)/(A + B)";
    quotient_stays: "q/q" => "q/q";
    quotient_of_doubtful_sums: "(a - b)*x/(a - b)" => "x*(a - b)/(a - b)";
    inside_a_function: "sin(1/(1/A + 1/B))" => "sin(A*B/(A + B))";
}

#[test]
fn common_factors_are_nonzero() {
    let mut x = Exprs::default();
    let sides = ["M*A^2", "M*A*x - M*A*sin(y)"].map(|t| read(&mut x, t));
    let common = x.common_factor(&sides);
    assert_eq!(ascii(&x, common, &PlainNames(&x)), "M*A");
    let doubtful = ["x*A", "x*B"].map(|t| read(&mut x, t));
    assert_eq!(x.common_factor(&doubtful), ONE);
}

#[test]
fn settled_terms_go() {
    let mut x = Exprs::default();
    let four = x.int(4);
    let a = x.symbol("P1", Facts { given: Some(four), ..Facts::default() });
    let (a, q) = (x.sym(a), read(&mut x, "q"));
    let (root, doubtful) = (x.sqrt(a), x.recip(q));
    let zero = x.int(0);
    let terms = [x.mul(&[zero, root]), x.mul(&[zero, doubtful]), q];
    let sum = x.add(&terms);
    let e = x.without_settled_terms(sum);
    assert_eq!(ascii(&x, e, &PlainNames(&x)), "0/q + q");
}
