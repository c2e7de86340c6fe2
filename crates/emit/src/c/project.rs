//! A program that steps the model, and how to build it.

use super::{Export, Names, messages, template};

/// `main.c`.
pub(super) fn main(export: &Export, name: &str, names: &Names) -> String {
    let outputs = export.recorded.iter().map(|&i| format!(",{}", messages::escaped(&export.program.observed[i].name)));
    let text = include_str!("runtime/main.c")
        .replace("OUTPUT_NAMES", &outputs.collect::<String>().replace('%', "%%"))
        .replace("NAME.h", &format!("{name}.h"));
    let _ = names;
    template::name(&text, name)
}

/// `CMakeLists.txt`.
pub(super) fn cmake(name: &str) -> String {
    template::name(include_str!("runtime/CMakeLists.txt"), name)
}
