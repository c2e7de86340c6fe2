//! A reader of expressions for tests. Names that start with a capital are positive parameters of value 2.

use super::super::*;

/// The expression of a text; `d(e, x)` is the derivative, `solve(e, x)` the solution of `e = 0`.
pub fn read(x: &mut Exprs, text: &str) -> Expr {
    let mut reader = Reader { x, rest: text };
    let e = reader.choice();
    assert!(reader.rest.trim().is_empty(), "left over in {text}: {}", reader.rest);
    e
}

pub fn symbol(x: &mut Exprs, name: &str) -> Symbol {
    if let Some(of) = name.strip_suffix('\'') {
        let of = symbol(x, of);
        return x.rate(of);
    }
    let two = x.int(2);
    let positive = name.starts_with(|c: char| c.is_uppercase());
    x.symbol(name, Facts { positive, nonzero: positive, given: positive.then_some(two) })
}

struct Reader<'a> {
    x: &'a mut Exprs,
    rest: &'a str,
}

impl Reader<'_> {
    fn eat(&mut self, token: &str) -> bool {
        self.rest = self.rest.trim_start();
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn word(&mut self) -> String {
        self.rest = self.rest.trim_start();
        let end = self.rest.find(|c: char| !(c.is_alphanumeric() || "_.'".contains(c))).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        if word.starts_with(|c: char| c.is_ascii_digit()) && word.ends_with('e') && self.eat("-") {
            return format!("{word}-{}", self.word());
        }
        word.to_owned()
    }

    fn choice(&mut self) -> Expr {
        if !self.eat("if ") {
            return self.relation();
        }
        let c = self.relation();
        assert!(self.eat("then"));
        let a = self.choice();
        assert!(self.eat("else"));
        let b = self.choice();
        self.x.select(c, a, b)
    }

    fn relation(&mut self) -> Expr {
        use Comparison::*;
        let a = self.sum();
        for (sign, c) in [("<=", Le), (">=", Ge), ("==", Eq), ("!=", Ne), ("<", Lt), (">", Gt)] {
            if self.eat(sign) {
                let b = self.sum();
                return self.x.compare(c, a, b);
            }
        }
        a
    }

    fn sum(&mut self) -> Expr {
        let minus = self.eat("-");
        let mut sum = self.product();
        if minus {
            sum = self.x.neg(sum);
        }
        loop {
            if self.eat("+") {
                let b = self.product();
                sum = self.x.add(&[sum, b]);
            } else if self.eat("-") {
                let b = self.product();
                sum = self.x.sub(sum, b);
            } else {
                return sum;
            }
        }
    }

    fn product(&mut self) -> Expr {
        let mut product = self.power();
        loop {
            if self.eat("*") {
                let b = self.power();
                product = self.x.mul(&[product, b]);
            } else if self.eat("/") {
                let b = self.power();
                product = self.x.div(product, b);
            } else {
                return product;
            }
        }
    }

    fn power(&mut self) -> Expr {
        let base = self.atom();
        if !self.eat("^") {
            return base;
        }
        let minus = self.eat("-");
        let n = self.power();
        let n = if minus { self.x.neg(n) } else { n };
        self.x.pow(base, n)
    }

    fn atom(&mut self) -> Expr {
        if self.eat("(") {
            let e = self.choice();
            assert!(self.eat(")"), "a bracket is open before {}", self.rest);
            return e;
        }
        let word = self.word();
        if word.starts_with(|c: char| c.is_ascii_digit()) {
            return self.x.decimal(&word).unwrap_or_else(|| panic!("{word} is no number"));
        }
        if self.eat("(") {
            let mut arguments = vec![self.choice()];
            while self.eat(",") {
                arguments.push(self.choice());
            }
            assert!(self.eat(")"));
            return self.call(&word, &arguments);
        }
        if word == "pi" {
            return self.x.pi();
        }
        let symbol = symbol(self.x, &word);
        self.x.sym(symbol)
    }

    fn call(&mut self, name: &str, arguments: &[Expr]) -> Expr {
        let by = |x: &Exprs| match x.node(arguments[1]) {
            Node::Symbol(s) => *s,
            other => panic!("{other:?} is no symbol"),
        };
        match name {
            "d" => {
                let by = by(self.x);
                self.x.derivative(arguments[0], by)
            }
            "solve" => {
                let by = by(self.x);
                self.x.solve_for(arguments[0], by).expect("a solution")
            }
            _ => self.x.call(Function::named(name).unwrap_or_else(|| panic!("no function {name}")), arguments),
        }
    }
}
