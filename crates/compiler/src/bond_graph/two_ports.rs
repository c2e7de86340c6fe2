//! What a modulus of another unit would have to be.

use super::builder::Builder;
use super::flatten::Word;
use crate::unit::Dimension as Dim;

impl Builder<'_, '_> {
    /// What to do about a two-port whose modulus does not fit the flows at its two sides; `None` if `part` is none, or
    /// too little is known. `says` is the flow that one side should have, where it has the flow `is` now.
    pub fn modulus_hint(&self, part: usize, says: Dim, is: Dim) -> Option<String> {
        let p = self.part(part);
        let (inner, outer) = (self.wire_at(part, 0)?, self.wire_at(part, 1)?);
        if !p.word.is_two_port() || self.pseudo[inner] || self.pseudo[outer] {
            return None;
        }
        let modulus = self.dims.value(self.moduli.get(&part)?)?;
        let inner = self.dims.value(&self.pairs[inner].flow_in)?;
        let outer = self.dims.value(&self.pairs[outer].flow_in)?;
        // The side that took its flow from the modulus has the other one instead.
        let fits = |inner: Dim, outer: Dim| match p.word {
            Word::Tf => outer.over(inner),
            _ => Dim::WATT.over(inner.times(outer)),
        };
        let wanted = match (inner == is, outer == is) {
            (false, true) => fits(inner, says),
            (true, false) => fits(says, outer),
            _ => return None,
        };
        let (name, kind) = (&p.ast.name.text, &p.ast.kind.text);
        let (law, direct, inverse) = match p.word {
            Word::Tf => ("f_out = m f_in, e_in = m e_out", "f_out", "e_out"),
            _ => ("e_out = r f_in, e_in = r f_out", "e_out", "f_out"),
        };
        Some(match wanted == modulus.inverse() {
            true => {
                let given = p.ast.args.first()?;
                let value = self.sources.slice(given.value.span);
                let inverted = given.label.as_ref().is_some_and(|l| l.name.text == inverse);
                let (way, value) = match value.strip_prefix("1/") {
                    Some(rest) if !rest.contains(['*', '/', '+', '-']) => (direct, rest),
                    _ => (if inverted { direct } else { inverse }, value),
                };
                format!(
                    "the modulus of `{name}` is the wrong way round ({law}): write `{kind}:{name}({way} = {value})`"
                )
            }
            false => format!("a modulus of `{name}` in {wanted} would fit ({law}); this one is in {modulus}"),
        })
    }
}
