use super::super::*;
use super::reader::read;

fn printed(text: &str, print: fn(&Exprs, Expr, &dyn Names) -> String) -> String {
    let mut x = Exprs::default();
    let e = read(&mut x, text);
    print(&x, e, &PlainNames(&x))
}

macro_rules! prints {
    ($($name:ident $style:ident: $text:literal => $expected:literal;)*) => {
        $(#[test]
        fn $name() {
            assert_eq!(printed($text, $style), $expected);
        })*
    };
}

prints! {
    gain ascii: "-R1/R2" => "-R1/R2";
    divided_by_product ascii: "a/(b*c)" => "a/(b*c)";
    positive_first ascii: "-b + a" => "a - b";
    all_negative ascii: "-b - a" => "-a - b";
    number_last ascii: "exp(e/V) - 1" => "exp(e/V) - 1";
    number_first_if_positive ascii: "1 - x" => "1 - x";
    square ascii: "x*x" => "x^2";
    negative_base ascii: "(a - b)^2*(-2)" => "-2*(a - b)^2";
    minus_goes_into_sum ascii: "K*(x - y)*(-1)" => "K*(y - x)";
    flipped_divisor ascii: "x/(B - A)" => "x/(B - A)";
    divisor_that_varies_stays ascii: "x/(b - a)" => "-x/(a - b)";
    decimal_number ascii: "9.81*M" => "9.81*M";
    third ascii: "x/3" => "x/3";
    two_thirds ascii: "2*x/3" => "2*x/3";
    many_digits ascii: "0.8432708698133384*0.8690672397953783*x" => "0.7328590872285258*x";
    long_quotient ascii: "1.125899906842624e15*x/1.134749184297165e15" => "0.9922015564522991*x";
    long_quotient_below ascii: "a*1.125899906842624e15/(b*1.134749184297165e15)" => "0.9922015564522991*a/b";
    long_quotient_unicode unicode: "1.125899906842624e15*sin(q)/1.134749184297165e15" => "0.9922 sin q";
    long_quotient_latex latex: "11*x/1.134749184297165e15/3" => "3.2313\\cdot 10^{-15} x";
    short_quotient unicode: "355*x/113" => "355 x/113";
    lone_third ascii: "1/3" => "1/3";
    small_number ascii: "1.4e-13" => "1.4e-13";
    large_number ascii: "6.02e23*x" => "6.02e23*x";
    negative_exponent ascii: "x^-2" => "1/x^2";
    odd_exponent ascii: "P*(V/(V - q))^1.4" => "P*(V/(V - q))^1.4";
    third_power ascii: "abs(x)^(1/3)" => "abs(x)^(1/3)";
    root ascii: "sqrt(K/M)" => "sqrt(K/M)";
    choice ascii: "if x > 0 then a else b" => "if x > 0 then a else b";
    choice_in_sum ascii: "1 + (if x > 0 then a else b)" => "1 + (if x > 0 then a else b)";
    exponent_of_sum ascii: "M^(x + 1)" => "M^(1 + x)";
    pendulum unicode: "-M*g*A*cos(phi)" => "-M A g cos φ";
    inertia unicode: "(J + M*A^2)*omega'" => "(J + M A²) ω'";
    function_over_a_number unicode: "sin(phi)/2" => "sin(φ)/2";
    function_over_a_number_latex latex: "sin(phi)/2" => "\\frac{\\sin\\varphi}{2}";
    function_before_a_factor unicode: "cos(phi)*(x - y)*M" => "M (x - y) cos φ";
    orientation unicode: "x - M*(q - P)" => "x + M (P - q)";
    square_of_difference unicode: "(q - P)^2*x" => "x (P - q)²";
    power_of_sine unicode: "M*sin(phi)^2*omega" => "M ω sin² φ";
    sine_of_product unicode: "sin(2*phi)" => "sin(2 φ)";
    fraction unicode: "K1*x/(K1 + K2)" => "K1 x/(K1 + K2)";
    subscript unicode: "phi_1 + omega2" => "ω2 + φ_1";
    small_unicode unicode: "1.4e-13*x" => "1.4·10⁻¹³ x";
    pendulum_latex latex: "-M*g*A*cos(phi)" => "-M A g \\cos\\varphi";
    fraction_latex latex: "K1*x/(K1 + K2)" => "\\frac{K_{1} x}{K_{1} + K_{2}}";
    half_latex latex: "M*v^2/2" => "\\frac{M v^{2}}{2}";
    squared_latex latex: "sin(phi)^2*omega'" => "\\dot{\\omega} \\sin^{2}\\varphi";
    words_latex latex: "Load*kp*x" => "\\mathit{Load} \\, \\mathit{kp} \\, x";
    tall_exponent_latex latex: "exp((q/C - x)/V)" => "\\exp\\left(\\frac{\\frac{q}{C} - x}{V}\\right)";
    diode_latex latex: "I0*(exp(d.e/V) - 1)" => "I_{0} \\left(e^{\\frac{e_{d}}{V}} - 1\\right)";
}

#[test]
fn endless_expressions_are_cut() {
    let mut x = Exprs::default();
    let mut e = read(&mut x, "q");
    for _ in 0..5000 {
        let parts = [Function::Sin, Function::Exp].map(|f| x.call(f, &[e]));
        e = x.add(&parts);
    }
    assert!(ascii(&x, e, &PlainNames(&x)).contains('…'));
}

#[test]
fn what_is_printed_reads_back() {
    for text in [
        "a - (b - c)/D*x^2",
        "-(x + y)^3/(2*z)",
        "if a < b then sin(x)^2 else -y/3",
        "M^(x - 1)*exp(-x/K)",
        "(x/(y/z))^2",
    ] {
        let mut x = Exprs::default();
        let e = read(&mut x, text);
        let printed = ascii(&x, e, &PlainNames(&x));
        assert_eq!(read(&mut x, &printed), e, "{text} printed as {printed}");
    }
}

#[test]
fn long_text_is_cut_at_its_limit() {
    let mut x = Exprs::default();
    let e = read(&mut x, "a*(b - c)*x + sin(q)*(y + z)/M + exp(x*y)*b");
    let whole = ascii(&x, e, &PlainNames(&x));
    let length = whole.chars().count();
    for most in 1..length {
        let cut = ascii_within(&x, e, &PlainNames(&x), most);
        assert!(cut.ends_with('…') && cut.chars().count() <= most + 1, "{most}: {cut}");
    }
    for most in [length, usize::MAX] {
        assert_eq!(ascii_within(&x, e, &PlainNames(&x), most), whole);
    }
    let cut = unicode_within(&x, e, &PlainNames(&x), 12);
    assert!(unicode(&x, e, &PlainNames(&x)).starts_with(cut.trim_end_matches('…')), "{cut}");
}
