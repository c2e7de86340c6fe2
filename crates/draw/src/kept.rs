//! Where things stand in a drawing that was made before.

use std::collections::BTreeMap;

use crate::text::unescape;

/// The places of the elements in an earlier drawing, in px by their names; empty if the text is none of our drawings.
pub fn positions(svg: &str) -> BTreeMap<String, [f64; 2]> {
    svg.split("<g class=\"element\" ").skip(1).filter_map(position).collect()
}

fn position(text: &str) -> Option<(String, [f64; 2])> {
    let tag = text.split_once('>')?.0;
    let value = |key: &str| tag.split_once(&format!("{key}=\""))?.1.split_once('"').map(|v| v.0);
    let (x, y) = value("data-at")?.split_once(' ')?;
    let at = [x.parse().ok()?, y.parse().ok()?];
    Some((unescape(value("data-name")?), at)).filter(|(_, at): &(String, [f64; 2])| at.iter().all(|x| x.is_finite()))
}
