//! From SVG to PNG, with a font of our own.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Pixels of the longer side at most.
const LARGEST: f32 = 16_000.0;

/// Why an SVG could not be turned into a PNG.
#[derive(Debug, Clone, PartialEq)]
pub enum PngError {
    /// The text is no SVG; what the reader says.
    Svg(String),
    /// The picture is too large or the encoder failed; its size in px.
    Size(u32, u32),
}

impl std::fmt::Display for PngError {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            PngError::Svg(reason) => write!(f, "the picture cannot be read as SVG: {reason}"),
            PngError::Size(w, h) => {
                write!(f, "a picture of {w} x {h} pixels cannot be written as PNG: write it as SVG instead")
            }
        }
    }
}

impl std::error::Error for PngError {}

/// DejaVu Sans, whatever the machine has.
static FONTS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(include_bytes!("../fonts/DejaVuSans.ttf").to_vec());
    fonts.load_font_data(include_bytes!("../fonts/DejaVuSans-Bold.ttf").to_vec());
    fonts.load_font_data(include_bytes!("../fonts/DejaVuSans-Oblique.ttf").to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    fonts.set_serif_family("DejaVu Sans");
    fonts.set_monospace_family("DejaVu Sans");
    Arc::new(fonts)
});

/// Turns an SVG into a PNG with `scale` pixels for each px of the drawing. Text is set in a font that comes with the
/// program, so the same SVG gives the same PNG on every machine. Very large drawings are scaled down to 16,000 pixels.
pub fn png(svg: &str, scale: f32) -> Result<Vec<u8>, PngError> {
    let options = Options { fontdb: FONTS.clone(), font_family: "DejaVu Sans".into(), ..Options::default() };
    let tree = Tree::from_str(svg, &options).map_err(|e| PngError::Svg(e.to_string()))?;
    let size = tree.size();
    let scale = scale.min(LARGEST / size.width().max(size.height()));
    let [w, h] = [size.width(), size.height()].map(|x| (x * scale).ceil() as u32);
    let mut pixels = Pixmap::new(w, h).ok_or(PngError::Size(w, h))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels.encode_png().map_err(|_| PngError::Size(w, h))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dark pixels of a picture of this text alone.
    fn ink(text: &str, style: &str) -> usize {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"200\" height=\"40\"><rect width=\"200\" height=\"40\" \
             fill=\"#fff\"/><text x=\"5\" y=\"25\" font-size=\"16\" {style}>{text}</text></svg>"
        );
        let bytes = png(&svg, 1.0).unwrap();
        Pixmap::decode_png(&bytes).unwrap().pixels().iter().filter(|p| p.red() < 128).count()
    }

    #[test]
    fn text_is_visible_without_fonts_of_the_machine() {
        for style in ["", "font-family=\"Verdana, sans-serif\"", "font-style=\"italic\"", "font-weight=\"bold\""] {
            assert!(ink("half arrow", style) > 100, "{style}");
        }
        assert!(ink("φ² − ½ ω₁ → ∂", "") > 100);
    }

    #[test]
    fn no_svg_is_an_error() {
        assert!(matches!(png("no svg", 1.0), Err(PngError::Svg(_))));
    }
}
