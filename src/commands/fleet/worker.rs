//! The work on one entry: recordings as they were planned, a diagnosis, one result that no other worker has written.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use govtwin_diagnosis::fleet::entry::Entry;
use govtwin_diagnosis::fleet::result::{EntryResult, FoundCause, Work};
use govtwin_files::digest::sha256;
use govtwin_files::store::Store;
use govtwin_model::provenance::FileUsed;

use crate::commands::bags::MapArgs;
use crate::commands::diagnose::{self, Diagnosed, NAMES, UnitArgs};
use crate::commands::provenance::{self, PROGRAM};
use crate::commands::report_file::is_there;

/// How often an object is read whose bytes are not those of the plan, before it counts as changed.
const READS: usize = 3;

/// What became of an entry.
pub enum Done {
    /// Its result was there.
    There,
    /// Its result is written.
    Written(Box<EntryResult>),
    /// Another worker wrote it meanwhile.
    Beaten,
}

/// Does an entry whose result is not there. An error means that there is no result and that the entry is to be tried again; a note of it
/// stands in the store, where that can be written.
pub fn work(entry: &Entry, beside: &Store, store: &Store, again: bool) -> anyhow::Result<Done> {
    let path = EntryResult::path(&entry.key);
    if store.has(&path)? {
        let failed = || {
            EntryResult::read(&store.get(&path)?, &entry.key)
                .map(|there| there.error.is_some())
                .map_err(anyhow::Error::from)
        };
        if !(again && failed()?) {
            return Ok(Done::There);
        }
        store.remove(&path)?;
    }
    let outcome = attempt(entry, beside, store).inspect_err(|error| note(entry, store, error))?;
    let written = store.create(&path, outcome.json().as_bytes())?;
    Ok(if written { Done::Written(Box::new(outcome)) } else { Done::Beaten })
}

/// Where a note on a try without result stands; one a text.
fn note(entry: &Entry, store: &Store, error: &anyhow::Error) {
    let text = format!("{error:#}");
    // Where the store itself refuses, standard error has it.
    let _ = store.create(&format!("notes/{}/{}.txt", entry.key, &sha256(&text)[..16]), text.as_bytes());
}

/// Diagnoses an entry. What fails for reasons of its data is an outcome; what may go well another time is an error.
fn attempt(entry: &Entry, beside: &Store, store: &Store) -> anyhow::Result<EntryResult> {
    let clock = Stopwatch::start();
    let folder = tempfile::tempdir().context("no temporary folder")?;
    let inputs = EntryFiles::gather(entry, beside, folder.path())?;
    let out = folder.path().join("out");
    let request = diagnose::Args {
        unit: Some(entry.unit.clone()),
        bags: inputs.bags,
        unit_of: UnitArgs { params: inputs.sheet, ..UnitArgs::default() },
        map: MapArgs { map: inputs.map },
        without: entry.options.without.clone(),
        seed: entry.options.seed,
        out: Some(out.clone()),
        overwrite: true,
        stand_ins: inputs.stand_ins.clone(),
        ..diagnose::Args::default()
    };
    let mut outcome = EntryResult::of(entry, PROGRAM);
    match catch_unwind(AssertUnwindSafe(|| diagnose::unit(&request))) {
        Ok(Ok(diagnosed)) => keep(&mut outcome, &diagnosed, &out, store)?,
        Ok(Err(error)) if may_pass(&error) => return Err(error),
        Ok(Err(error)) => outcome.error = Some(shown(format!("{error:#}"), &inputs.stand_ins)),
        Err(panic) => {
            let words = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
            outcome.error =
                Some(format!("the diagnosis broke off, which is a defect: {}", words.unwrap_or("without a word")));
        }
    }
    outcome.work = clock.work();
    Ok(outcome.sealed())
}

/// Puts the report into the store, and what a fleet is compared by into the outcome.
fn keep(outcome: &mut EntryResult, diagnosed: &Diagnosed, out: &Path, store: &Store) -> anyhow::Result<()> {
    // Whoever works on the same entry has a folder of his own: reports differ by date and duration.
    let folder = format!("reports/{}/{}", outcome.key, &sha256(&diagnosed.json)[..16]);
    for name in NAMES {
        let path = out.join(name);
        if is_there(&path)? {
            let bytes = std::fs::read(&path).with_context(|| format!("cannot read {name}"))?;
            store.put(&format!("{folder}/{name}"), &bytes)?;
            outcome.files.insert(name.to_owned(), sha256(&bytes));
        }
    }
    outcome.unit.clone_from(&diagnosed.made.unit);
    outcome.found = Some(FoundCause::of(&diagnosed.diagnosis));
    outcome.warnings.clone_from(&diagnosed.made.warnings);
    outcome.origins = diagnosed.made.origins().into_iter().map(str::to_owned).collect();
    outcome.report = Some(folder);
    Ok(())
}

/// Whether an error is the machine's and not the data's: a full disk, a file that went away, memory that is short.
fn may_pass(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|io| io.kind() != std::io::ErrorKind::InvalidData)
    })
}

fn shown(text: String, stand_ins: &[(String, String)]) -> String {
    stand_ins.iter().fold(text, |text, (from, to)| text.replace(from, to))
}

/// Files of an entry on this machine.
struct EntryFiles {
    bags: Vec<PathBuf>,
    sheet: Option<PathBuf>,
    map: Option<PathBuf>,
    /// Folders that stand in for stores, each with the store's address.
    stand_ins: Vec<(String, String)>,
}

impl EntryFiles {
    /// Has all files at hand, each with the digest of the plan.
    fn gather(entry: &Entry, beside: &Store, folder: &Path) -> anyhow::Result<Self> {
        let source = Store::open(&entry.source).context("the source of the entry")?;
        let mut stand_ins = Vec::new();
        for (store, name) in [(&source, "source"), (beside, "plan")] {
            if store.local("").is_none() {
                stand_ins.push((folder.join(name).display().to_string(), store.address()));
            }
        }
        let mut bags = Vec::new();
        for bag in &entry.bags {
            for file in &bag.files {
                fetch(&source, file, &folder.join("source"))?;
            }
            let local = source.local(&bag.path);
            if local.is_none() && bag.files.iter().all(|file| file.path != bag.path) {
                let metadata = format!("{}/metadata.yaml", bag.path);
                source.fetch(&metadata, &folder.join("source").join(&metadata))?;
            }
            bags.push(local.unwrap_or_else(|| folder.join("source").join(&bag.path)));
        }
        let one =
            |file: &Option<FileUsed>| file.as_ref().map(|file| fetch(beside, file, &folder.join("plan"))).transpose();
        Ok(Self { bags, sheet: one(&entry.sheet)?, map: one(&entry.map)?, stand_ins })
    }
}

/// A file on this machine, with the digest that it was planned with.
fn fetch(store: &Store, wanted: &FileUsed, folder: &Path) -> anyhow::Result<PathBuf> {
    let (path, reads) = match store.local(&wanted.path) {
        Some(path) => (path, 1),
        None => (folder.join(&wanted.path), READS),
    };
    let mut found = String::new();
    for read in 1..=reads {
        if store.local(&wanted.path).is_none() {
            std::fs::create_dir_all(path.parent().unwrap_or(folder)).context("no temporary folder")?;
            match store.fetch(&wanted.path, &path) {
                // A connection that tore may hold the next time.
                Err(_) if read < reads => continue,
                other => other?,
            }
        }
        found = provenance::file(&path)?.sha256;
        if found == wanted.sha256 {
            return Ok(path);
        }
    }
    bail!(
        "{}: expected the bytes that were planned (SHA-256 {}), found others ({}); it changed since, or was not read whole: make the plan anew with \
         `govtwin fleet plan`",
        wanted.path,
        &wanted.sha256[..12.min(wanted.sha256.len())],
        &found[..12.min(found.len())]
    )
}

/// Time and memory of a piece of work.
struct Stopwatch {
    start: Instant,
    processor_s: Option<f64>,
}

impl Stopwatch {
    #[expect(clippy::disallowed_methods, reason = "a result says how long it took")]
    fn start() -> Self {
        Self { start: Instant::now(), processor_s: processor_s() }
    }

    fn work(&self) -> Work {
        let processor_s = processor_s().zip(self.processor_s).map(|(now, then)| now - then);
        Work { elapsed_s: self.start.elapsed().as_secs_f64(), processor_s, peak_memory_bytes: peak_memory_bytes() }
    }
}

/// Processor time of all threads of this process, s, where Linux tells it: in hundredths, whatever the kernel's own tick.
fn processor_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let mut fields = text.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}

/// The most memory that this process held, bytes, where Linux tells it.
fn peak_memory_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix(" kB")?;
    Some(kilobytes.parse::<u64>().ok()? * 1024)
}
