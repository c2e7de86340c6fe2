//! Formulas as the data write them: `-M*a**2*sin(phi)**2/J`.

use halfarrow_compiler::algebra::{Expr, Exprs, Facts, Function};

/// The expression of a formula; names that are not yet symbols become ones.
pub fn formula(text: &str, exprs: &mut Exprs) -> Expr {
    let mut reader = Reader { rest: text, exprs };
    let expr = reader.sum();
    assert!(reader.rest.trim().is_empty(), "left over in {text}: {}", reader.rest);
    expr
}

struct Reader<'a> {
    rest: &'a str,
    exprs: &'a mut Exprs,
}

impl Reader<'_> {
    fn take(&mut self, token: &str) -> bool {
        self.rest = self.rest.trim_start();
        let rest = self.rest.strip_prefix(token);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn sum(&mut self) -> Expr {
        let mut sum = self.product();
        loop {
            if self.take("+") {
                let term = self.product();
                sum = self.exprs.add(&[sum, term]);
            } else if self.take("-") {
                let term = self.product();
                sum = self.exprs.sub(sum, term);
            } else {
                return sum;
            }
        }
    }

    fn product(&mut self) -> Expr {
        if self.take("-") {
            let factor = self.product();
            return self.exprs.neg(factor);
        }
        let mut product = self.power();
        loop {
            if self.take("*") {
                let factor = self.power();
                product = self.exprs.mul(&[product, factor]);
            } else if self.take("/") {
                let factor = self.power();
                product = self.exprs.div(product, factor);
            } else {
                return product;
            }
        }
    }

    fn power(&mut self) -> Expr {
        let base = self.atom();
        if !self.take("**") {
            return base;
        }
        let exponent = self.power();
        self.exprs.pow(base, exponent)
    }

    fn atom(&mut self) -> Expr {
        if self.take("(") {
            let inner = self.sum();
            assert!(self.take(")"), "a bracket is open before {}", self.rest);
            return inner;
        }
        let end = self.rest.find(|c: char| !c.is_alphanumeric() && c != '.' && c != '_').unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        if word.starts_with(|c: char| c.is_ascii_digit()) {
            return self.exprs.decimal(word).expect("a number");
        }
        if self.take("(") {
            let argument = self.sum();
            assert!(self.take(")"), "a bracket is open before {}", self.rest);
            return self.exprs.call(Function::named(word).expect("a function"), &[argument]);
        }
        let symbol = self.exprs.find_symbol(word).unwrap_or_else(|| self.exprs.symbol(word, Facts::default()));
        self.exprs.sym(symbol)
    }
}
