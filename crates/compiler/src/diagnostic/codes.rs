//! Every code that a diagnostic can have, with its meaning in one line.
//!
//! The letter is the stage: S syntax, N names, U units, B bond graph structure, C causality, L laws, I initial values,
//! E equations, R run.

/// The code of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DiagnosticCode {
    /// A letter for the stage and three digits.
    pub name: &'static str,
    /// What it means, in one line.
    pub meaning: &'static str,
}

/// Declares the codes, and `ALL` with all of them in this order.
macro_rules! codes {
    ($($name:ident $meaning:literal;)*) => {
        $(#[doc = $meaning] pub const $name: DiagnosticCode = DiagnosticCode { name: stringify!($name), meaning: $meaning };)*
        /// All codes, in the order in which they are declared.
        pub const ALL: &[DiagnosticCode] = &[$($name),*];
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
    C006 "efforts or flows that nothing determines (warning)";
    C007 "the structure degenerates at the given parameters (warning)";
    C008 "a forced causality that the equations cannot follow (warning)";
    C009 "a preferred variable that does not stay independent (warning)";
    E001 "an equation needs the time derivative of an input";
    E002 "a loop of variables has no unique solution";
    E003 "something that an event cannot change or read";
    U001 "an unknown unit";
    U002 "a unit that cannot be read";
    U003 "units that do not agree";
    U005 "elements of different domains on one junction structure";
    U006 "a quantity with a unit where a number is needed";
    U007 "a stiffness where a compliance belongs, or the like";
    U008 "numbers without a unit where another than the SI unit is declared (warning)";
    N001 "an unknown name";
    N002 "a name declared twice";
    N003 "a name that the language keeps for itself";
    N004 "names that define one another";
    N005 "an unknown kind of element";
    N006 "an unknown function";
    N007 "wrong arguments";
    N008 "an unknown argument";
    N009 "a value is missing";
    N010 "an import that cannot be read";
    N011 "imports in a circle";
    N012 "a component that contains itself";
    N013 "a model that is too large or nested too deeply";
    N014 "a statement that has no place here";
    N016 "a value that must be known before the run";
    N017 "something else than a number";
    N018 "a variable that an element does not have";
    N019 "a parameter that cannot be set";
    N020 "a table or file of numbers that cannot be used";
    N021 "indices that belong to no element";
    N022 "something that must be known when the model is compiled";
    B001 "a half arrow out of an I, C or R";
    B002 "too many bonds at a port";
    B003 "a two-port without one bond in and one out";
    B004 "an element without a bond";
    B005 "a port of a component that is not connected";
    B006 "half arrows that meet head on at a port";
    B007 "a bond from an element to itself";
    B008 "a bond that is not there";
    B009 "several ports or bonds could be meant";
    B010 "a causality that an element cannot have";
    B011 "a port of a field without a bond";
    B012 "bonds side by side that differ in number";
    B013 "a port whose signals come twice, not at all or the wrong way";
    B020 "parts that nothing connects";
    B021 "a junction that joins nothing";
    L001 "an element without a law";
    L002 "two laws for one element";
    L003 "a law that belongs to another kind of element";
    L004 "a law that reads what it cannot";
    L005 "laws of a field that come from no energy";
    L006 "a constraint on nothing that moves";
    L007 "a constraint that is not linear in the flows";
    L008 "a value of zero that is divided by";
    L009 "a matrix of the wrong shape";
    L010 "a signal block that cannot be";
    L011 "a condition that never becomes true as time goes on";
    L012 "a variable that no event can change";
    L013 "a variable that one event changes twice";
    L014 "a set-valued law that cannot be read";
    L015 "a constraint on displacements that jumps";
    L016 "a displacement that moves with an input (warning)";
    I001 "a start value of the wrong kind";
    I002 "a start value or a guess given twice";
    I003 "start values that contradict each other or a constraint";
    I004 "start values that no iteration brings together";
    I005 "a start value that is no number";
    I006 "a guess of what is never searched";
    I007 "a guess that is never used (warning)";
    I008 "a storage that begins with what constraints make of what repeats it (warning)";
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
