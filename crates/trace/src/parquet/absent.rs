//! What a build without Parquet says.

use std::io::{self, ErrorKind, Write};
use std::marker::PhantomData;
use std::path::Path;

use crate::{Trace, WriteError};

fn absent() -> io::Error {
    io::Error::new(ErrorKind::Unsupported, "this build writes no Parquet, for want of the feature `parquet`: write CSV")
}

/// Writes nothing.
///
/// # Errors
/// This build has no Parquet.
pub fn write_parquet(_: &Trace, path: &Path) -> Result<(), WriteError> {
    Err(WriteError { path: path.to_owned(), source: absent() })
}

/// There is none in this build.
pub struct ParquetTable<W: Write + Send>(PhantomData<W>);

impl<W: Write + Send> ParquetTable<W> {
    /// Begins nothing.
    ///
    /// # Errors
    /// This build has no Parquet.
    pub fn new(_: W, _: &[(&str, &str)]) -> io::Result<Self> {
        Err(absent())
    }

    /// Adds nothing.
    ///
    /// # Errors
    /// This build has no Parquet.
    pub fn rows(&mut self, _: &[&[f64]]) -> io::Result<()> {
        Err(absent())
    }

    /// Ends nothing.
    ///
    /// # Errors
    /// This build has no Parquet.
    pub fn finish(self) -> io::Result<()> {
        Err(absent())
    }
}
