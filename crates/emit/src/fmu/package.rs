//! Files in one: a ZIP archive as the interface wants it.

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::File;

/// An archive; the same files give the same bytes.
pub(super) fn zip(files: &[File]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    for file in files {
        writer.start_file(&file.path, options).expect("a name that is not too long");
        writer.write_all(&file.bytes).expect("memory takes all bytes");
    }
    writer.finish().expect("an archive in memory").into_inner()
}
