//! Equations as a textbook prints them: put into each other where that is short, with names where it is not; as text, LaTeX and
//! MathML. Apart from deriving them, since to run a model takes none of it.

mod display;
mod named;
mod only;
mod places;
mod text;
mod vectors;

pub use display::{Dependent, DisplayEquation, Shown, ShownDefinition, show};
pub use only::only;
pub use text::{
    Style, dependent_within, events_within, meanings_within, print, print_certificate, print_definitions,
    print_dependent, print_events, print_expr, print_expr_within, print_form, print_meanings, print_symbol,
    print_within, sides_within,
};
pub use vectors::{VectorEquation, Vectors};
