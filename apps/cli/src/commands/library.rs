//! `library`: the components that come with the program.

use halfarrow::{Component, Entry, Error, Library};
use serde_json::json;

use crate::arguments;
use crate::page::Page;
use crate::screen;

/// Lists libraries and their components, or shows one component.
pub fn library(arguments: &arguments::Library) -> u8 {
    let found = match Library::named(arguments.name.as_deref().unwrap_or_default()) {
        Ok(found) => found,
        Err(problem) => return screen::fail(&Error::Usage(problem), arguments.json),
    };
    let printed = match arguments.json {
        true => screen::print_json(&json!({"libraries": found})),
        false => screen::print(&text(&found, Page::of(&arguments.page))),
    };
    screen::printed(printed, 0)
}

fn text(found: &[Library], page: Page) -> String {
    match found {
        [library] if library.components.len() == 1 => component(library, &library.components[0], page),
        [library] => page.lines(&library.about) + "\n" + &listed(library, page),
        all => {
            let each: Vec<String> = all.iter().map(|library| listed(library, page)).collect();
            format!("{}\n{}", each.join("\n"), page.line("halfarrow library electrical.DCMotor shows one of them"))
        }
    }
}

/// The components of a library, a line each.
fn listed(library: &Library, page: Page) -> String {
    let width = library.components.iter().map(|c| c.name.len()).max().unwrap_or(0);
    let lines: String =
        library.components.iter().map(|c| page.line(&format!("  {:width$}  {}", c.name, c.doc))).collect();
    format!("import {}\n{lines}", library.name)
}

fn component(library: &Library, c: &Component, page: Page) -> String {
    let row = |what: &str, e: &Entry| {
        let dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".into());
        [what.to_string(), e.name.clone(), dash(&e.default), dash(&e.unit), e.doc.clone()]
    };
    let rows = c.groups().into_iter().flat_map(|(what, list)| list.iter().map(move |e| row(what, e)));
    let table = page.table(["", "name", "default", "unit", ""], rows);
    let usage = format!("import {}\n{}\n", library.name, c.usage());
    format!("{}: {}\n\n{}\n{usage}\n{table}\n{}\n", c.name, c.doc, page.lines(&c.law), c.text)
}
