//! Names in C: valid, unique, readable.

use std::collections::BTreeSet;

/// Words that mean something in C, in what it includes, or in the files written.
const TAKEN: &[&str] = &[
    "auto",
    "break",
    "case",
    "char",
    "const",
    "continue",
    "default",
    "do",
    "double",
    "else",
    "enum",
    "extern",
    "float",
    "for",
    "goto",
    "if",
    "inline",
    "int",
    "long",
    "register",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "static",
    "struct",
    "switch",
    "typedef",
    "union",
    "unsigned",
    "void",
    "volatile",
    "while",
    "main",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "exp",
    "log",
    "pow",
    "sqrt",
    "fabs",
    "floor",
    "ceil",
    "round",
    "fmod",
    "gamma",
    "div",
    "abs",
    "time",
    "clock",
    "signal",
    "printf",
    "puts",
    "exit",
    "free",
    "malloc",
    "memset",
    "memcpy",
    "index",
    "bool",
    "true",
    "false",
    "asm",
    "class",
    "new",
    "delete",
    "this",
    "template",
    "namespace",
    "public",
    "private",
    "double_t",
    "float_t",
    "y0",
    "y1",
    "yn",
    "j0",
    "j1",
    "jn",
    "linux",
    "unix",
    "system",
    "rename",
    "remove",
    "raise",
    "abort",
    "random",
    "select",
    "read",
    "write",
    "open",
    "close",
    "link",
    "pipe",
    "sleep",
    "wait",
    "errno",
    "hypot",
    "erf",
    "scale",
    "test",
    "acosf",
    "acosh",
    "asinf",
    "asinh",
    "atanf",
    "atan2f",
    "atanh",
    "cbrt",
    "ceilf",
    "copysign",
    "cosf",
    "cosh",
    "coshf",
    "erfc",
    "exp2",
    "expf",
    "expm1",
    "fabsf",
    "fdim",
    "floorf",
    "fma",
    "fmax",
    "fmin",
    "fmodf",
    "frexp",
    "ilogb",
    "isfinite",
    "isinf",
    "isnan",
    "ldexp",
    "lgamma",
    "llrint",
    "llround",
    "log10",
    "log1p",
    "log2",
    "logb",
    "logf",
    "lrint",
    "lround",
    "modf",
    "nan",
    "nearbyint",
    "nextafter",
    "powf",
    "remainder",
    "remquo",
    "rint",
    "scalbln",
    "scalbn",
    "signbit",
    "sinf",
    "sinh",
    "sinhf",
    "sqrtf",
    "tanf",
    "tanh",
    "tanhf",
    "tgamma",
    "trunc",
    "atexit",
    "atof",
    "atoi",
    "atol",
    "atoll",
    "bsearch",
    "calloc",
    "getenv",
    "labs",
    "ldiv",
    "llabs",
    "lldiv",
    "mblen",
    "mbtowc",
    "qsort",
    "rand",
    "realloc",
    "srand",
    "strtod",
    "strtof",
    "strtol",
    "strtold",
    "strtoll",
    "strtoul",
    "strtoull",
    "wctomb",
    "clearerr",
    "fclose",
    "feof",
    "ferror",
    "fflush",
    "fgetc",
    "fgetpos",
    "fgets",
    "fopen",
    "fprintf",
    "fputc",
    "fputs",
    "fread",
    "freopen",
    "fscanf",
    "fseek",
    "fsetpos",
    "ftell",
    "fwrite",
    "getc",
    "getchar",
    "gets",
    "perror",
    "putc",
    "putchar",
    "rewind",
    "scanf",
    "setbuf",
    "setvbuf",
    "snprintf",
    "sprintf",
    "sscanf",
    "stderr",
    "stdin",
    "stdout",
    "tmpfile",
    "tmpnam",
    "ungetc",
    "vfprintf",
    "vprintf",
    "vsnprintf",
    "vsprintf",
    "memchr",
    "memcmp",
    "memmove",
    "strcat",
    "strchr",
    "strcmp",
    "strcoll",
    "strcpy",
    "strcspn",
    "strerror",
    "strlen",
    "strncat",
    "strncmp",
    "strncpy",
    "strpbrk",
    "strrchr",
    "strspn",
    "strstr",
    "strtok",
    "strxfrm",
    "acosl",
    "size_t",
    "ptrdiff_t",
    "offsetof",
    "wchar_t",
    "int8_t",
    "int16_t",
    "int32_t",
    "int64_t",
    "uint8_t",
    "uint16_t",
    "uint32_t",
    "uint64_t",
    "intptr_t",
    "uintptr_t",
    "intmax_t",
    "uintmax_t",
];

/// A name of letters, digits and underscores that begins with a letter: `.` becomes `_`, Greek letters their names, `'`
/// `rate`, other characters their code.
pub(crate) fn word(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        match c {
            c if c.is_ascii_alphanumeric() || c == '_' => out.push(c),
            '.' | ' ' | '-' | '[' | ',' => out.push('_'),
            ']' => {}
            '\'' => out.push_str("_rate"),
            c => match greek(c) {
                Some(letter) => out.push_str(letter),
                None => out.push_str(&format!("u{:x}", c as u32)),
            },
        }
    }
    if !out.starts_with(|c: char| c.is_ascii_alphabetic()) {
        out.insert(0, 'v');
    }
    out
}

fn greek(c: char) -> Option<&'static str> {
    const NAMES: [&str; 25] = [
        "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu",
        "xi", "omicron", "pi", "rho", "sigma", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega",
    ];
    const CAPITALS: [&str; 25] = [
        "Alpha", "Beta", "Gamma", "Delta", "Epsilon", "Zeta", "Eta", "Theta", "Iota", "Kappa", "Lambda", "Mu", "Nu",
        "Xi", "Omicron", "Pi", "Rho", "Sigma", "Sigma", "Tau", "Upsilon", "Phi", "Chi", "Psi", "Omega",
    ];
    match c {
        'α'..='ω' => NAMES.get(c as usize - 'α' as usize).copied(),
        'Α'..='Ω' => CAPITALS.get(c as usize - 'Α' as usize).copied(),
        'µ' => Some("mu"),
        _ => None,
    }
}

/// The words of names, made unique by a number behind the second.
pub(crate) fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    names
        .map(|name| {
            let word = word(name);
            let free = (1..).map(|i| if i == 1 { word.clone() } else { format!("{word}_{i}") });
            let chosen = free.into_iter().find(|w| !taken.contains(w)).unwrap_or_default();
            taken.insert(chosen.clone());
            chosen
        })
        .collect()
}

/// Headers that the system has: a file of that name beside the sources would stand in their place.
const HEADERS: &[&str] = &[
    "alloca",
    "assert",
    "complex",
    "ctype",
    "dlfcn",
    "errno",
    "fcntl",
    "fenv",
    "float",
    "inttypes",
    "iso646",
    "libc",
    "limits",
    "locale",
    "malloc",
    "math",
    "memory",
    "process",
    "pthread",
    "sched",
    "search",
    "setjmp",
    "signal",
    "stdalign",
    "stdarg",
    "stdatomic",
    "stdbool",
    "stddef",
    "stdint",
    "stdio",
    "stdlib",
    "stdnoreturn",
    "string",
    "strings",
    "tgmath",
    "threads",
    "time",
    "uchar",
    "unistd",
    "values",
    "wchar",
    "wctype",
    "windows",
];

/// The name of a model in files and functions: `QuarterCar` is `quarter_car`.
pub(crate) fn of_model(name: &str) -> String {
    let mut out = String::new();
    let word = word(name);
    let mut before = '_';
    let mut rest = word.chars().peekable();
    while let Some(c) = rest.next() {
        let ends = before.is_ascii_uppercase() && rest.peek().is_some_and(char::is_ascii_lowercase);
        let begins = before.is_ascii_lowercase() || before.is_ascii_digit();
        if c.is_ascii_uppercase() && before != '_' && (begins || ends) {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
        before = c;
    }
    if TAKEN.contains(&out.as_str()) || HEADERS.contains(&out.as_str()) || out.starts_with("ha_") {
        out.push_str("_model");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_words() {
        assert_eq!(of_model("QuarterCar"), "quarter_car");
        assert_eq!(of_model("RCBridge"), "rc_bridge");
        assert_eq!(of_model("Class2Class4"), "class2_class4");
        assert_eq!(of_model("Double"), "double_model");
        assert_eq!(of_model("Math"), "math_model");
        assert_eq!(word("body.p"), "body_p");
        assert_eq!(word("φ'"), "phi_rate");
        assert_eq!(word("2Ω€"), "v2Omegau20ac");
        assert_eq!(word("cell[3].q"), "cell_3_q");
    }

    #[test]
    fn equal_words_are_told_apart() {
        assert_eq!(unique(["a.b", "a_b", "µ", "mu"].into_iter()), ["a_b", "a_b_2", "mu", "mu_2"]);
    }
}
