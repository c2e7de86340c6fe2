//! Methods that choose their step. Not there yet: refused by name.

use crate::Failure;
use crate::simulate::Run;

pub(crate) fn run(_run: &mut Run<'_>, _x: &mut [f64]) -> Result<(), Failure> {
    let expected = "a method of fixed step: those of variable step are still being built";
    Err(Failure::BadOption { option: "method", value: f64::NAN, expected })
}
