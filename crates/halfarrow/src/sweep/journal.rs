//! What a sweep has done, in a file that survives it.
//!
//! A line that tells which sweep it is, then an entry for each chunk: its length, its contents and a number that tells
//! whether they are whole. What was written last when the program was killed is cut off.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::{SetFailure, fingerprint};
use crate::drift::SetDrift;
use crate::error::Problem;

/// The rows of a chunk.
#[derive(Debug, Clone, PartialEq)]
pub struct JournalChunk {
    /// Its number.
    pub chunk: usize,
    /// Number of rows.
    pub rows: usize,
    /// Row by row.
    pub values: Vec<f64>,
    /// How far positions have drifted in these sets.
    pub drifts: Vec<SetDrift>,
    /// Sets that failed.
    pub failures: Vec<SetFailure>,
}

/// The file, and where each chunk stands in it.
pub struct Journal {
    path: PathBuf,
    file: File,
    /// Where each chunk begins, and how many rows it has.
    places: BTreeMap<usize, (u64, usize)>,
    end: u64,
    columns: usize,
}

impl Journal {
    /// Opens the journal of the sweep that writes `out`, or begins one.
    pub fn open(out: &Path, identity: &str, columns: usize, restart: bool) -> Result<Journal, Problem> {
        let mut name = out.file_name().unwrap_or_default().to_os_string();
        name.push(".partial");
        let path = out.with_file_name(name);
        let unwritable = |why: io::Error| Problem::Unwritable { path: path.clone(), why: why.to_string() };
        let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let file = opened.map_err(unwritable)?;
        lock(&file, out)?;
        if restart {
            file.set_len(0).map_err(unwritable)?;
        }
        let mut journal = Journal { file, path: path.clone(), places: BTreeMap::new(), end: 0, columns };
        let header = format!("halfarrow sweep 2 {:016x}\n", fingerprint(identity.as_bytes()));
        let mut found = vec![0; header.len()];
        let there = journal.file.read_exact(&mut found).is_ok();
        if there && found != header.as_bytes() {
            let reason = format!(
                "{} holds another sweep that was interrupted: take another --out, or --restart to give that one up",
                path.display()
            );
            return Err(Problem::BadOption { reason });
        }
        journal.end = header.len() as u64;
        let ready = match there {
            true => journal.look_through(),
            false => journal.begin(&header),
        };
        ready.map_err(unwritable)?;
        Ok(journal)
    }

    fn begin(&mut self, header: &str) -> io::Result<()> {
        self.file.set_len(0)?;
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(header.as_bytes())
    }

    /// Finds the entries that are whole.
    fn look_through(&mut self) -> io::Result<()> {
        while let Ok(entry) = self.read_at(self.end) {
            let size = bytes(&entry).len() as u64;
            self.places.insert(entry.chunk, (self.end, entry.rows));
            self.end += 16 + size;
        }
        self.file.set_len(self.end)
    }

    /// Number of chunks that are done.
    pub fn chunks(&self) -> usize {
        self.places.len()
    }

    /// Number of sets that are done.
    pub fn sets(&self) -> usize {
        self.places.values().map(|place| place.1).sum()
    }

    /// Whether a chunk is done.
    pub fn has(&self, chunk: usize) -> bool {
        self.places.contains_key(&chunk)
    }

    /// Adds a chunk.
    pub fn add(&mut self, entry: &JournalChunk) -> io::Result<()> {
        let contents = bytes(entry);
        let mut all = Vec::with_capacity(contents.len() + 16);
        all.extend((contents.len() as u64).to_le_bytes());
        all.extend(&contents);
        all.extend(fingerprint(&contents).to_le_bytes());
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.write_all(&all)?;
        self.file.flush()?;
        self.places.insert(entry.chunk, (self.end, entry.rows));
        self.end += all.len() as u64;
        Ok(())
    }

    /// A chunk that is done.
    pub fn entry(&mut self, chunk: usize) -> io::Result<JournalChunk> {
        let missing = || io::Error::other("a part of the results is missing");
        let place = self.places.get(&chunk).ok_or_else(missing)?.0;
        self.read_at(place)
    }

    fn read_at(&mut self, place: u64) -> io::Result<JournalChunk> {
        self.file.seek(SeekFrom::Start(place))?;
        let mut reader = BufReader::new(&self.file);
        let size = number(&mut reader)?;
        let left = self.file.metadata()?.len().saturating_sub(place + 16);
        if size > left {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut contents = vec![0; size as usize];
        reader.read_exact(&mut contents)?;
        if number(&mut reader)? != fingerprint(&contents) {
            return Err(io::ErrorKind::InvalidData.into());
        }
        from_bytes(&contents, self.columns).ok_or_else(|| io::ErrorKind::InvalidData.into())
    }

    /// Takes the file away.
    pub fn remove(self) {
        let _ = fs::remove_file(&self.path); // the results are there; what is left over does no harm
    }
}

/// Keeps other sweeps away as long as the file is open; where the file system knows no locks there are none.
fn lock(file: &File, out: &Path) -> Result<(), Problem> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            let reason = format!(
                "another sweep is writing {} just now: wait until it is done, or take another --out",
                out.display()
            );
            Err(Problem::BadOption { reason })
        }
        Err(TryLockError::Error(_)) | Ok(()) => Ok(()),
    }
}

fn number(reader: &mut impl Read) -> io::Result<u64> {
    let mut bytes = [0; 8];
    reader.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

fn bytes(entry: &JournalChunk) -> Vec<u8> {
    let mut all = Vec::new();
    for number in [entry.chunk as u64, entry.rows as u64, entry.values.len() as u64] {
        all.extend(number.to_le_bytes());
    }
    entry.values.iter().for_each(|value| all.extend(value.to_bits().to_le_bytes()));
    all.extend((entry.drifts.len() as u64).to_le_bytes());
    for drift in &entry.drifts {
        let numbers = [drift.greatest.to_bits(), drift.set as u64, drift.sets as u64, drift.resolution.to_bits()];
        numbers.iter().for_each(|number| all.extend(number.to_le_bytes()));
        add_text(&mut all, &drift.relation);
    }
    for failure in &entry.failures {
        all.extend((failure.set as u64).to_le_bytes());
        add_text(&mut all, &failure.reason);
    }
    all
}

fn add_text(all: &mut Vec<u8>, text: &str) {
    all.extend((text.len() as u64).to_le_bytes());
    all.extend(text.as_bytes());
}

fn text(from: &mut &[u8]) -> Option<String> {
    let length = number(from).ok()? as usize;
    let (text, rest) = from.split_at_checked(length)?;
    *from = rest;
    String::from_utf8(text.to_vec()).ok()
}

fn drift(from: &mut &[u8]) -> Option<SetDrift> {
    let [greatest, set, sets, resolution] = std::array::from_fn(|_| number(from).ok());
    Some(SetDrift {
        greatest: f64::from_bits(greatest?),
        set: set? as usize,
        sets: sets? as usize,
        resolution: f64::from_bits(resolution?),
        relation: text(from)?,
    })
}

fn from_bytes(mut from: &[u8], columns: usize) -> Option<JournalChunk> {
    let from = &mut from;
    let (chunk, rows, count) = (number(from).ok()? as usize, number(from).ok()? as usize, number(from).ok()? as usize);
    if count != rows.checked_mul(columns)? || from.len() < count * 8 {
        return None;
    }
    let values = (0..count).map(|_| number(from).ok().map(f64::from_bits)).collect::<Option<Vec<_>>>()?;
    let drifts = (0..number(from).ok()?).map(|_| drift(from)).collect::<Option<Vec<_>>>()?;
    let mut failures = Vec::new();
    while !from.is_empty() {
        failures.push(SetFailure { set: number(from).ok()? as usize, reason: text(from)? });
    }
    Some(JournalChunk { chunk, rows, values, drifts, failures })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(chunk: usize) -> JournalChunk {
        let failures = vec![SetFailure { set: 2, reason: "no".into() }];
        let drifts = vec![SetDrift { relation: "x".into(), greatest: 1e-9, set: 1, sets: 2, resolution: 1e-16 }];
        JournalChunk { chunk, rows: 2, values: vec![1.0, f64::NAN, -0.0, chunk as f64], drifts, failures }
    }

    fn open(out: &Path) -> Journal {
        Journal::open(out, "this one", 2, false).unwrap_or_else(|e| panic!("{e:?}"))
    }

    #[test]
    fn what_is_whole_survives_and_what_is_torn_is_cut_off() {
        let folder = temp_dir::TempDir::new().unwrap();
        let out = folder.path().join("r.csv");
        let mut journal = open(&out);
        journal.add(&entry(3)).unwrap();
        journal.add(&entry(0)).unwrap();
        let whole = journal.end;
        journal.add(&entry(1)).unwrap();
        drop(journal);
        let partial = folder.path().join("r.csv.partial");
        for torn in [whole + 1, whole + 20, whole] {
            OpenOptions::new().write(true).open(&partial).unwrap().set_len(torn).unwrap();
            let mut journal = open(&out);
            assert_eq!((journal.chunks(), journal.sets(), journal.has(1)), (2, 4, false));
            let read = journal.entry(0).unwrap();
            assert_eq!(bytes(&read), bytes(&entry(0)));
            journal.add(&entry(1)).unwrap();
            assert_eq!(journal.chunks(), 3);
        }
        open(&out).remove();
        assert!(!partial.exists());
    }

    #[test]
    fn two_sweeps_do_not_write_one_file() {
        let folder = temp_dir::TempDir::new().unwrap();
        let out = folder.path().join("r.csv");
        let mut first = open(&out);
        first.add(&entry(0)).unwrap();
        for restart in [false, true] {
            let Err(second) = Journal::open(&out, "this one", 2, restart) else { panic!("two at once") };
            assert!(second.to_string().contains("another sweep is writing"), "{second}");
        }
        assert_eq!(bytes(&first.entry(0).unwrap()), bytes(&entry(0)), "what the first has written stays");
        drop(first);
        assert_eq!(open(&out).chunks(), 1);
    }

    #[test]
    fn another_sweep_is_not_taken_for_this_one() {
        let folder = temp_dir::TempDir::new().unwrap();
        let out = folder.path().join("r.csv");
        open(&out).add(&entry(0)).unwrap();
        assert!(Journal::open(&out, "another", 2, false).is_err());
        assert_eq!(Journal::open(&out, "another", 2, true).map(|j| j.chunks()).ok(), Some(0));
    }
}
