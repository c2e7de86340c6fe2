//! Every code that a diagnostic can have, with its meaning in one line.
//!
//! The letter is the stage: S syntax, N names, U units, B bond graph structure, C causality, L laws, I initial values,
//! E equations, R run.

/// The code of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Code {
    /// A letter for the stage and three digits.
    pub name: &'static str,
    /// What it means, in one line.
    pub meaning: &'static str,
}

/// Declares the codes, and `ALL` with all of them in this order.
macro_rules! codes {
    ($($name:ident $meaning:literal;)*) => {
        $(#[doc = $meaning] pub const $name: Code = Code { name: stringify!($name), meaning: $meaning };)*
        /// All codes, in the order in which they are declared.
        pub const ALL: &[Code] = &[$($name),*];
    };
}

codes! {
    S001 "something else was expected here";
    S002 "a bracket or a brace has no partner";
    S003 "a character that has no meaning here";
    S004 "text without its closing quote";
    S005 "the model does not begin with `model Name`";
    S006 "nested too deeply";
    S007 "a number that cannot be read";
    S008 "reserved for a later version";
    S009 "a reserved word stands where a name is needed";
    S010 "a node without a name or without a kind";
    S011 "quoted text that documents nothing";
    S012 "the text is too large";
    S013 "an unknown word in a statement";
    C001 "two sources set the same variable";
    C002 "sources or constraints cannot hold together";
    C003 "forced strokes or causality cannot hold together";
    C004 "a source or constraint repeats what others impose (warning)";
    C005 "sources alone fix a storage (warning)";
    C006 "a flow or effort circulates undetermined (warning)";
    C007 "the structure degenerates at the given parameters (warning)";
    C008 "a forced causality that the equations cannot follow (warning)";
    E001 "an equation needs the time derivative of an input";
    E002 "a loop of variables has no unique solution";
    U001 "an unknown unit";
    U002 "a unit that cannot be read";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_a_letter_and_three_digits_and_differ() {
        let mut names: Vec<&str> = ALL.iter().map(|c| c.name).collect();
        for name in &names {
            assert_eq!(name.len(), 4);
            assert!("SNUBCLIER".contains(&name[..1]) && name[1..].bytes().all(|b| b.is_ascii_digit()), "{name}");
        }
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
    }
}
