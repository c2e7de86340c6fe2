//! The page: a scene, the program that draws it, and curves beside it.

use maud::{DOCTYPE, PreEscaped, html};

use super::Scene;
use crate::error::Problem;
use crate::report::{LIBRARY, LIBRARY_STYLE};

/// three.js r170, MIT, as it comes (`three/README.md`).
const THREE: &str = include_str!("three/three.module.min.js");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

impl Scene {
    /// One page that shows the scene as it moves. Nothing in it points outside: it opens without a network.
    ///
    /// # Errors
    /// None in this build; one without the feature `animation` makes no pages.
    pub fn page(&self) -> Result<String, Problem> {
        let data = serde_json::to_string(self).map_err(|why| Problem::BadOption { reason: why.to_string() })?;
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.model) }
                    style { (PreEscaped(LIBRARY_STYLE)) (PreEscaped(STYLE)) }
                }
                body {
                    main {
                        div #view tabindex="0" aria-label="the machine" {}
                        aside #side {
                            h1 { (self.model) }
                            details #columns { summary { "Plots: choose columns" } input #filter type="search" placeholder="columns with …"; ul #names {} }
                            div #plots {}
                        }
                    }
                    footer {
                        button #play title="play or pause (space)" { "Play" }
                        input #time type="range" min="0" max="1000" value="0" step="any" aria-label="time";
                        output #clock {}
                        label { "speed " select #speed {} }
                        label { "follow " select #follow {} }
                        fieldset #shown {}
                        button #reset title="the camera as at first" { "Reset view" }
                        span #grid {}
                    }
                    script #scene type="application/json" { (PreEscaped(inert(&data))) }
                    script #three type="text/plain" { (PreEscaped(THREE)) }
                    script { (PreEscaped(LIBRARY)) }
                    script type="module" { (PreEscaped(SCRIPT)) }
                }
            }
        };
        Ok(page.into_string())
    }
}

/// JSON that cannot end the script it stands in.
fn inert(json: &str) -> String {
    json.replace('<', "\\u003c")
}
