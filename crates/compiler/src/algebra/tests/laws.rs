use super::super::*;
use super::reader::read;

/// The left side, simplified, is the right side.
macro_rules! law {
    ($($name:ident: $left:literal => $right:literal;)*) => {
        $(#[test]
        fn $name() {
            let mut x = Exprs::default();
            let (left, right) = (read(&mut x, $left), read(&mut x, $right));
            let short = x.simplify(left);
            let text = |e| ascii(&x, e, &PlainNames(&x));
            assert_eq!(text(short), text(right), "from {}", text(left));
            assert_eq!(short, right);
        })*
    };
}

law! {
    like_terms: "x + 2*x - 3*y + y" => "3*x - 2*y";
    flat: "(a + b) + (c + (a - b))" => "2*a + c";
    exact_numbers: "0.1 + 0.2 - 0.3" => "0";
    powers_meet: "x^2*x^3" => "x^5";
    quotient_of_products: "M*a/M" => "a";
    minus_one_factor: "(a - b)/(b - a)*(b - a)" => "(a - b)/(b - a)*(b - a)";
    no_cancel_at_zero: "q/q" => "q/q";
    no_cancel_of_sums: "(a*q + b*q)/q" => "(a + b)*q/q";
    cancel_known: "(a*M + b*M)/M" => "a + b";
    zero_times_singular: "0*(1/q)" => "0*(1/q)";
    zero_times_regular: "0*(sin(q) + exp(q)/M)" => "0";
    zeroth_power_of_singular: "(1/q)^0" => "q/q";
    difference_of_singular: "1/q - 1/q" => "0*(1/q)";
    root_squared: "sqrt(q)^2" => "sqrt(q)^2";
    root_squared_positive: "sqrt(M)^2" => "M";
    square_rooted: "sqrt(q^2)" => "abs(q)";
    square_rooted_positive: "sqrt(M^2)" => "M";
    inverse_twice: "1/(1/q)" => "1/(1/q)";
    inverse_twice_nonzero: "1/(1/M)" => "M";
    root_of_number: "sqrt(9/4)" => "3/2";
    root_of_eight: "sqrt(2)*sqrt(2)*sqrt(8)" => "2*sqrt(8)";
    exponentials_meet: "exp(a)*exp(b)/exp(a + b)" => "1";
    log_of_exp: "log(exp(x))" => "x";
    exp_of_log: "exp(log(q))" => "exp(log(q))";
    odd_and_even: "sin(-x) + cos(-x) + x*0" => "cos(x) - sin(x)";
    angles: "sin(pi/6) + cos(pi/3) + sin(3*pi/2)" => "0";
    abs_of_product: "abs(-2*x)" => "2*abs(x)";
    abs_squared: "abs(x)^2" => "x^2";
    choice_known: "if 1 < 2 then a else b" => "a";

    pythagoras: "sin(x)^2 + cos(x)^2" => "1";
    pythagoras_with_factors: "M*A^2*sin(x)^2 + M*A^2*cos(x)^2" => "M*A^2";
    pythagoras_in_a_sum: "J + M*A^2*sin(x)^2 + M*A^2*cos(x)^2" => "J + M*A^2";
    pythagoras_of_products: "(A*sin(x))^2*M + M*(A*cos(x))^2" => "A^2*M";
    pythagoras_backwards: "1 - sin(x)^2" => "cos(x)^2";
    pythagoras_partly: "3*sin(x)^2 + 3*cos(x)^2 + y*cos(x)" => "3 + y*cos(x)";
    difference_of_angles: "cos(a)*cos(b) + sin(a)*sin(b)" => "cos(a - b)";
    sum_of_angles: "M*sin(a)*cos(b) + M*cos(a)*sin(b)" => "M*sin(a + b)";
    common_factor: "K2*s - K1*K2*x" => "K2*(s - K1*x)";
    common_divisor: "a/M + b/M" => "(a + b)/M";
    nested_fraction: "1/(1 + R1/R2)" => "R2/(R1 + R2)";
    nested_fraction_doubtful: "1/(1 + a/b)" => "1/(1 + a/b)";
    parallel: "1/(1/R1 + 1/R2)" => "R1*R2/(R1 + R2)";
    voltage_divider: "1 - R1/(R1 + R2)" => "R2/(R1 + R2)";
    sum_that_divides: "(A^2 + 2*A*B + B^2)/(A + B)" => "A + B";
    expansion_that_cancels: "(a + b)*(a - b) - a^2 + b^2" => "0";
    inside_functions: "sin(a*M/M + b - b)" => "sin(a)";

    d_product: "d(q * sin(q), q)" => "sin(q) + q * cos(q)";
    d_quotient: "d(a/q, q)" => "-a/q^2";
    d_chain: "d(exp(-x^2), x)" => "-2*x*exp(-x^2)";
    d_power: "d(x^a, x)" => "a*x^(a - 1)";
    d_exponent: "d(M^x, x)" => "M^x*log(M)";
    d_root: "d(sqrt(x), x)" => "1/(2*sqrt(x))";
    d_tan: "d(tan(x), x)" => "1 + tan(x)^2";
    d_tanh: "d(tanh(x), x)" => "1 - tanh(x)^2";
    d_asin: "d(asin(x), x)" => "1/sqrt(1 - x^2)";
    d_atan2: "d(atan2(x, y), x)" => "y/(x^2 + y^2)";
    d_abs: "d(abs(x), x)" => "sign(x)";
    d_choice: "d(if x > 0 then x^2 else -x, x)" => "if x > 0 then 2*x else -1";
    d_min: "d(min(x, y), x)" => "if x <= y then 1 else 0";
    d_other: "d(sin(y), x)" => "0";
    d_log10: "d(log10(x), x)" => "1/(x*log(10))";

    solve_linear: "solve(e - R*f, f)" => "e/R";
    solve_two_terms: "solve(a*f + b*f - e, f)" => "e/(a + b)";
    solve_cube: "solve(e - B*f^3, f)" => "sign(e)*(abs(e)/B)^(1/3)";
    solve_fourth_power_of_positive: "solve(y - X^4, X)" => "y^(1/4)";
    solve_signed_square: "solve(e - B*f*abs(f), f)" => "sign(e)*sqrt(abs(e)/B)";
    solve_diode: "solve(f - I0*(exp(e/V) - 1), e)" => "V*log(1 + f/I0)";
    solve_log: "solve(y - log(x/A), x)" => "A*exp(y)";
    solve_root: "solve(y - sqrt(x), x)" => "sqrt(y)^4";
    solve_sinh: "solve(y - sinh(x), x)" => "log(y + sqrt(1 + y^2))";
    solve_fraction: "solve(y - A*x/(A + x), x)" => "A*y/(A - y)";
    solve_nested: "solve(y - exp(1 + 2*x^3), x)" => "solve(log(y) - 1 - 2*x^3, x)";
    solve_atan: "solve(y - atan(x), x)" => "if abs(y) < pi/2 then tan(y) else 0/0";
}

#[test]
fn no_unique_solution_none_given() {
    for text in ["y - x^2", "y - sin(x)", "y - x - exp(x)", "y - cosh(x)", "y - x^3 + x", "y - floor(x)"] {
        let mut x = Exprs::default();
        let e = read(&mut x, text);
        let s = x.find_symbol("x").unwrap();
        assert_eq!(x.solve_for(e, s), None, "{text}");
    }
}

#[test]
fn linear_forms() {
    let mut x = Exprs::default();
    let e = read(&mut x, "R*(i - 2*j) + (if c > 0 then 3*i else u) + sin(u)");
    let [i, j] = ["i", "j"].map(|n| x.find_symbol(n).unwrap());
    let (coefficients, rest) = x.linear_in(e, &[i, j]).unwrap();
    let expected =
        ["R + (if c > 0 then 3 else 0)", "-2*R", "(if c > 0 then 0 else u) + sin(u)"].map(|t| read(&mut x, t));
    assert_eq!((coefficients, rest), (expected[..2].to_vec(), expected[2]));
    for text in ["i*j", "sin(i)", "1/i", "floor(i)", "if i > 0 then i else 0"] {
        let e = read(&mut x, text);
        assert_eq!(x.linear_in(e, &[i, j]), None, "{text}");
    }
}

#[test]
fn the_same_from_any_order() {
    let build = |names: [&str; 3]| {
        let mut x = Exprs::default();
        let parts: Vec<Expr> = names.iter().map(|n| read(&mut x, n)).collect();
        let e = x.add(&parts);
        ascii(&x, e, &PlainNames(&x))
    };
    assert_eq!(build(["b*sin(a)", "x2*x10", "a^2"]), build(["a^2", "b*sin(a)", "x10*x2"]).replace("x10*x2", "x2*x10"));
}

#[test]
fn assumed_nonzero_cancels() {
    let mut x = Exprs::default();
    let e = read(&mut x, "a - b");
    x.assume_nonzero(e);
    let ratio = read(&mut x, "(a - b)/(b - a)");
    assert_eq!(ratio, MINUS_ONE);
}

#[test]
fn symbols_are_found_in_large_expressions() {
    let mut x = Exprs::default();
    let symbols: Vec<Symbol> = (0..200).map(|i| x.symbol(&format!("s{i}"), Facts::default())).collect();
    let terms: Vec<Expr> = symbols.iter().map(|&s| x.sym(s)).collect();
    let sum = x.add(&terms);
    let e = x.call(Function::Sin, &[sum]);
    assert_eq!(x.symbols_of(e).len(), 200);
    assert!(x.depends_on(e, symbols[199]));
    let other = x.symbol("other", Facts::default());
    assert!(!x.depends_on(e, other));
}

#[test]
fn costs_count_shared_parts_once() {
    let mut x = Exprs::default();
    let a = read(&mut x, "sin(q)*M + a/(b*c)");
    let b = read(&mut x, "sin(q) - 3*x^2");
    assert_eq!(x.cost(&[a, b]), Cost { adds: 2, muls: 4, divs: 2, calls: 1 });
}
