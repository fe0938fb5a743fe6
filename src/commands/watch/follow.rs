//! Following bags: which have come, which have grown, and the processes in what came since.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use govtwin_bag::{self, BagError, Growing, Grown, Health, ReadOptions, Rows, broken_off, intended_place};
use govtwin_diagnosis::watch::cut::{CutProcess, Cutter};
use govtwin_model::frame::Frame;
use govtwin_model::provenance::RecordingGiven;

use crate::commands::bags::{self, is_bag_folder};
use crate::commands::provenance;

/// What is known of a bag.
#[derive(Debug)]
struct KnownBag {
    bytes: u64,
    since: Instant,
    /// Read at this size; and whether it counted as ended then.
    read: Option<(u64, bool)>,
    /// How far it was read; none where it has to be read as a whole.
    growing: Option<Growing>,
    /// What a bag that was read as a whole says of itself.
    health: Option<Health>,
    cutting: Cutting,
}

impl KnownBag {
    fn new(bytes: u64, since: Instant, options: &ReadOptions) -> Self {
        let growing = Some(Growing::new(options.clone()));
        Self { bytes, since, read: None, growing, health: None, cutting: Cutting::default() }
    }

    /// What it is called, and what bag or folder say of where its data comes from.
    fn given(&self, path: &Path) -> anyhow::Result<RecordingGiven> {
        let about = |key: &str| match (&self.growing, &self.health) {
            (Some(growing), _) => growing.about(key),
            (None, health) => health.as_ref().and_then(|health| health.about(key)),
        };
        Ok(RecordingGiven { name: shown(path), ..provenance::marked_by(about, path)? })
    }

    /// The processes that have ended since the last look, with the last one of a bag that has ended.
    fn more(&mut self, path: &Path, ended: bool, options: &ReadOptions) -> Result<Vec<CutProcess>, BagError> {
        let grown = match &mut self.growing {
            Some(growing) => growing.more(path, ended, &mut self.cutting).inspect_err(|_| {
                // Where it stopped nobody knows.
                *growing = Growing::new(options.clone());
            })?,
            None => Grown::NeedsAll,
        };
        if grown == Grown::NeedsAll {
            (self.growing, self.cutting) = (None, Cutting::default());
            self.health = Some(govtwin_bag::read_rows(path, options, &mut self.cutting)?);
        } else if !self.growing.as_ref().is_some_and(Growing::is_measured) {
            return Ok(vec![]);
        }
        if ended {
            self.cutting.cuts.extend(self.cutting.cutter.end());
        }
        Ok(std::mem::take(&mut self.cutting.cuts))
    }
}

/// Bags that come and grow.
pub struct Follower {
    paths: Vec<PathBuf>,
    options: ReadOptions,
    settled: Duration,
    seen: BTreeMap<PathBuf, KnownBag>,
}

/// Cuts rows, as they come from a bag, into processes.
#[derive(Debug, Default)]
struct Cutting {
    cutter: Cutter,
    cuts: Vec<CutProcess>,
}

impl Rows for Cutting {
    fn restart(&mut self) {
        *self = Self::default();
    }

    fn row(&mut self, frame: &Frame) {
        self.cuts.extend(self.cutter.row(frame));
    }
}

/// Whether there is something at a path, or something is being recorded that will stand there.
pub fn may_come(path: &Path) -> bool {
    path.exists() || broken_off(path).is_some()
}

/// Whether `govtwin record` is writing here a bag that is not whole yet.
fn is_unfinished(path: &Path) -> bool {
    intended_place(path).is_some()
}

impl Follower {
    /// Nothing was seen yet.
    pub fn new(paths: &[PathBuf], options: ReadOptions, settled_s: u64) -> Self {
        Self { paths: paths.to_vec(), options, settled: Duration::from_secs(settled_s), seen: BTreeMap::new() }
    }

    /// Hands on the processes in all bags that came or grew; says what could not be read. Where this look is the only one, what is there has ended.
    #[expect(clippy::disallowed_methods, reason = "a bag that has not grown for a while has ended")]
    pub fn look(
        &mut self,
        only_look: bool,
        take: &mut dyn FnMut(&RecordingGiven, CutProcess) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<String>> {
        let mut troubles = vec![];
        let now = Instant::now();
        for path in self.bags(&mut troubles) {
            let bytes = bytes_of(&path);
            if !self.seen.contains_key(&path) {
                let seen = self.renamed(&path).unwrap_or_else(|| KnownBag::new(bytes, now, &self.options));
                self.seen.insert(path.clone(), seen);
            }
            let Some(seen) = self.seen.get_mut(&path) else { continue };
            if seen.bytes != bytes {
                (seen.bytes, seen.since) = (bytes, now);
            }
            // A bag folder gets its metadata, and its name, once it is whole.
            let whole = is_bag_folder(&path) && !is_unfinished(&path);
            let ended = only_look || whole || now.duration_since(seen.since) >= self.settled;
            if bytes == 0 || seen.read == Some((bytes, ended)) || seen.read == Some((bytes, true)) {
                continue;
            }
            seen.read = Some((bytes, ended));
            match seen.more(&path, ended, &self.options) {
                Ok(cuts) if cuts.is_empty() => {}
                Ok(cuts) => {
                    let given = seen.given(&path)?;
                    cuts.into_iter().try_for_each(|cut| take(&given, cut))?;
                }
                // One that is being written may lack anything.
                Err(_) if !ended => {}
                Err(error) => troubles.push(format!("{error} (left out)")),
            }
        }
        Ok(troubles)
    }

    /// What is known of a bag that stood under another name, such as one that is whole by now.
    fn renamed(&mut self, path: &Path) -> Option<KnownBag> {
        let is_it = |(old, seen): (&PathBuf, &KnownBag)| {
            let same = !old.exists() && seen.growing.as_ref().is_some_and(|growing| growing.is_at(path));
            same.then(|| old.clone())
        };
        let old = self.seen.iter().find_map(is_it)?;
        self.seen.remove(&old)
    }

    /// All bags that are there by now, in the order of their names; what is being recorded among them.
    fn bags(&self, troubles: &mut Vec<String>) -> Vec<PathBuf> {
        let mut all = vec![];
        for path in &self.paths {
            if path.is_dir() && !is_bag_folder(path) {
                match bags::find(std::slice::from_ref(path)) {
                    Ok(found) => all.extend(found.into_iter().map(|bag| bag.path)),
                    // A folder without bags may get some.
                    Err(error) if error.root_cause().downcast_ref::<std::io::Error>().is_none() => {}
                    Err(error) => troubles.push(format!("{error:#}")),
                }
                let hidden = path.read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
                let mut hidden: Vec<PathBuf> = hidden.filter(|path| path.is_dir() && is_unfinished(path)).collect();
                hidden.sort();
                all.extend(hidden);
            } else if path.exists() {
                all.push(path.clone());
            } else {
                all.extend(broken_off(path));
            }
        }
        all
    }
}

/// What to call a bag: its name, that of an unfinished one without its dress.
fn shown(path: &Path) -> String {
    let place = intended_place(path).unwrap_or_else(|| path.to_owned());
    place.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Bytes of a file, or of all files of a folder.
fn bytes_of(path: &Path) -> u64 {
    let size = |path: &Path| path.metadata().map_or(0, |data| data.len());
    if !path.is_dir() {
        return size(path);
    }
    let entries = path.read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
    entries
        .filter(|path| path.is_file() && path.file_name().is_some_and(|name| name != "metadata.yaml"))
        .map(|path| size(&path))
        .sum()
}
