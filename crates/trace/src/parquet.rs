//! Columns of numbers as Parquet.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

use crate::{Trace, WriteError, write_whole};

/// Rows of a row group.
const GROUP: usize = 1 << 16;

/// Writes a trace as Parquet: a column `t` and one for each name, all `DOUBLE`; the unit of each column stands in the
/// file's metadata as `unit:NAME`. The file is written whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write_parquet(trace: &Trace, path: &Path) -> Result<(), WriteError> {
    let names = trace.columns.iter().map(|c| (c.name.as_str(), c.unit.as_str()));
    let header: Vec<(&str, &str)> = std::iter::once(("t", "s")).chain(names).collect();
    write_whole(path, |out| {
        let mut table = ParquetTable::new(out, &header)?;
        for first in (0..trace.samples()).step_by(GROUP) {
            let rows = first..trace.samples().min(first + GROUP);
            let columns = std::iter::once(&trace.times).chain(trace.columns.iter().map(|c| &c.values));
            let group: Vec<&[f64]> = columns.map(|values| &values[rows.clone()]).collect();
            table.rows(&group)?;
        }
        table.finish()
    })
}

/// A Parquet file of columns of numbers while it is written, a group of rows at a time.
pub struct ParquetTable<W: Write + Send> {
    writer: SerializedFileWriter<W>,
}

impl<W: Write + Send> ParquetTable<W> {
    /// Begins a file with columns given by name and unit; an empty unit is left out.
    ///
    /// # Errors
    /// Nothing can be written to `out`.
    pub fn new(out: W, columns: &[(&str, &str)]) -> io::Result<Self> {
        let units = columns.iter().filter(|(_, unit)| !unit.is_empty());
        let units = units.map(|(name, unit)| KeyValue::new(format!("unit:{name}"), unit.to_string())).collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(concat!("halfarrow ", env!("CARGO_PKG_VERSION")).to_string())
            .set_key_value_metadata(Some(units))
            .build();
        let schema = schema(columns).map_err(other)?;
        let writer = SerializedFileWriter::new(out, schema, Arc::new(properties)).map_err(other)?;
        Ok(ParquetTable { writer })
    }

    /// Adds rows: the values of each column, all of one length.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn rows(&mut self, columns: &[&[f64]]) -> io::Result<()> {
        let mut group = self.writer.next_row_group().map_err(other)?;
        let mut columns = columns.iter();
        while let Some(mut column) = group.next_column().map_err(other)? {
            let values = columns.next().copied().unwrap_or(&[]);
            column.typed::<DoubleType>().write_batch(values, None, None).map_err(other)?;
            column.close().map_err(other)?;
        }
        group.close().map_err(other)?;
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The end cannot be written.
    pub fn finish(self) -> io::Result<()> {
        self.writer.close().map(|_| ()).map_err(other)
    }
}

fn schema(columns: &[(&str, &str)]) -> Result<TypePtr, ParquetError> {
    let field = |name: &str| {
        let column = Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED);
        column.build().map(Arc::new)
    };
    let fields = columns.iter().map(|(name, _)| field(name)).collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("samples").with_fields(fields).build().map(Arc::new)
}

fn other(why: ParquetError) -> io::Error {
    match why {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(own) => *own,
            Err(source) => io::Error::other(source),
        },
        why => io::Error::other(why),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_sim::Sink;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    #[test]
    fn every_number_comes_back_with_its_unit() {
        let folder = temp_dir::TempDir::new().unwrap();
        let path = folder.path().join("x.parquet");
        let mut trace = Trace::new([("spring.q", "m"), ("max(a, b)", "")]);
        let numbers = [0.1 + 0.2, -0.0, 5e-324, f64::MAX, f64::NAN, f64::INFINITY];
        let rows = GROUP + 3;
        (0..rows).for_each(|i| trace.sample(i as f64, &[numbers[i % 6], 2.0 * i as f64]));
        write_parquet(&trace, &path).unwrap();

        let file = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        let about = file.metadata().file_metadata();
        let units = about.key_value_metadata().unwrap();
        let unit = |key: &str| units.iter().find(|k| k.key == key).and_then(|k| k.value.clone());
        assert_eq!((unit("unit:t").as_deref(), unit("unit:spring.q").as_deref()), (Some("s"), Some("m")));
        assert_eq!(unit("unit:max(a, b)"), None);
        assert_eq!(file.num_row_groups(), 2);
        let mut read = 0;
        for (i, row) in file.get_row_iter(None).unwrap().enumerate() {
            let row = row.unwrap();
            let values = [0, 1, 2].map(|c| row.get_double(c).unwrap().to_bits());
            assert_eq!(values, [i as f64, numbers[i % 6], 2.0 * i as f64].map(f64::to_bits));
            read += 1;
        }
        assert_eq!(read, rows);
    }

    #[test]
    fn a_trace_without_samples_is_a_file() {
        let folder = temp_dir::TempDir::new().unwrap();
        let path = folder.path().join("empty.parquet");
        write_parquet(&Trace::new([("x", "m")]), &path).unwrap();
        let file = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!(file.metadata().file_metadata().num_rows(), 0);
    }
}
