//! What a build without PNG says.

/// Why there is no PNG.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PngError;

impl std::fmt::Display for PngError {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("this build writes none, for want of the feature `png`: write it as SVG")
    }
}

impl std::error::Error for PngError {}

/// Makes nothing.
///
/// # Errors
/// This build has no PNG.
pub fn png(_: &str, _: f32) -> Result<Vec<u8>, PngError> {
    Err(PngError)
}
