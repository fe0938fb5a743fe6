//! What a report is made from, gathered at the edge: digests of files, the date, options as they were given.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_bag::Health;
use govtwin_files::digest::Digest;
use govtwin_files::{check_regular, look_at};
use govtwin_model::params::{self, Sheet};
use govtwin_model::provenance::{FileUsed, Provenance, RecordingGiven, SheetUsed};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

use super::bags::{GivenBag, MapArgs, Mapped, TopicArgs};
use super::replay::origin;

/// Program and version, as reports name it.
pub const PROGRAM: &str = concat!("govtwin ", env!("CARGO_PKG_VERSION"));

/// The variable that stands in for the clock where builds and reports are to be the same to the last byte
/// (<https://reproducible-builds.org/specs/source-date-epoch/>).
const EPOCH: &str = "SOURCE_DATE_EPOCH";

/// What a command was made from; recordings, options and warnings are added by it.
pub fn new(command: &str, sheet: &Sheet, seed: Option<u64>) -> anyhow::Result<Provenance> {
    let files = sheet.files.iter().map(|path| file(path)).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(Provenance {
        program: PROGRAM.to_owned(),
        command: command.to_owned(),
        date: date()?,
        unit: sheet.name.clone(),
        sheet: SheetUsed { name: sheet.name.clone(), files, sha256: params::unit_digest(&sheet.unit) },
        seed,
        ..Provenance::default()
    })
}

/// Now, UTC.
#[expect(clippy::disallowed_methods, reason = "a report says when it was made")]
fn date() -> anyhow::Result<String> {
    let seconds = if let Some(text) = std::env::var_os(EPOCH) {
        let seconds = text.to_str().and_then(|text| text.trim().parse().ok());
        seconds.with_context(|| format!("{EPOCH}: expected whole seconds since 1970, found {}", text.display()))?
    } else {
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        since.map_or(0, |since| i64::try_from(since.as_secs()).unwrap_or_default())
    };
    Ok(utc(seconds))
}

fn utc(seconds: i64) -> String {
    jiff::Timestamp::from_second(seconds).map_or_else(|_| seconds.to_string(), |time| time.to_string())
}

/// A time of a recording, ns since 1970, UTC to the second.
pub fn date_of(time_ns: i64) -> String {
    utc(time_ns.div_euclid(1_000_000_000))
}

/// A file with its digest.
pub fn file(path: &Path) -> anyhow::Result<FileUsed> {
    let reading = || format!("cannot read {}", path.display());
    // A pipe would be waited for, and a device never ends.
    check_regular(path).with_context(reading)?;
    let mut reader = File::open(path).with_context(reading)?;
    let (mut digest, mut bytes, mut piece) = (Digest::default(), 0, vec![0; 1 << 16]);
    loop {
        let read = reader.read(&mut piece).with_context(reading)?;
        if read == 0 {
            break;
        }
        digest.update(&piece[..read]);
        bytes += read as u64;
    }
    Ok(FileUsed { path: path.display().to_string(), bytes, sha256: digest.text() })
}

/// The files of a bag that hold its data: itself, or all of a bag folder but `metadata.yaml`, which tools write anew.
fn files_of(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let reading = || format!("cannot read the folder {}", path.display());
    if !look_at(path).with_context(reading)?.is_some_and(|kind| kind.is_dir()) {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = vec![];
    for entry in path.read_dir().with_context(reading)? {
        let entry = entry.with_context(reading)?.path();
        let name = entry.file_name().unwrap_or_default();
        let is_file = look_at(&entry).with_context(reading)?.is_some_and(|kind| kind.is_file());
        if is_file && name != "metadata.yaml" && !name.as_encoded_bytes().starts_with(b".") {
            files.push(entry);
        }
    }
    files.sort();
    Ok(files)
}

/// Notes topics and map among the options of a report, the map with its digest.
pub fn options(topics: &TopicArgs, map: &MapArgs, made: &mut Provenance) -> anyhow::Result<()> {
    note(made, "topic", topics.named.iter().map(|(stream, name)| format!("{stream}={name}")));
    note_files(made, "map", &map.map)
}

/// Notes an option among those of a report, with its values; not one that was not given.
pub fn note(made: &mut Provenance, option: &str, values: impl IntoIterator<Item = impl Into<String>>) {
    let values: Vec<String> = values.into_iter().map(Into::into).collect();
    if !values.is_empty() {
        made.options.insert(option.to_owned(), values.join(", "));
    }
}

/// The same with files as values, each with its digest.
pub fn note_files(
    made: &mut Provenance,
    option: &str,
    files: impl IntoIterator<Item = impl AsRef<Path>>,
) -> anyhow::Result<()> {
    let files = files.into_iter().map(|path| Ok(file(path.as_ref())?.to_string()));
    note(made, option, files.collect::<anyhow::Result<Vec<_>>>()?);
    Ok(())
}

/// Notes which of the recordings were left out, and why: of each the reason begins with `head`, its name and a colon.
pub fn note_left_out(made: &mut Provenance, head: &str, reasons: &[String]) {
    for one in made.recordings.iter_mut().filter(|one| one.left_out.is_none()) {
        let head = format!("{head}{}: ", one.name);
        one.left_out = reasons.iter().find_map(|reason| Some(reason.strip_prefix(&head)?.to_owned()));
    }
}

#[cfg(feature = "lab")]
/// The files of bags with their digests; what cannot be read has none.
pub fn files_of_bags(bags: &[super::bags::Bag]) -> Vec<FileUsed> {
    let files = bags.iter().flat_map(|bag| files_of(&bag.path).unwrap_or_default());
    files.filter_map(|path| file(&path).ok()).collect()
}

/// The recordings that a command line named, as they were read or left out; what was left out may have no digest.
pub fn inputs(read: &[GivenBag], mapped: &Mapped) -> anyhow::Result<Vec<RecordingGiven>> {
    read.par_iter()
        .map(|one| {
            let given = mapped.given(&one.path);
            let input = marked(one.health.as_ref(), given).and_then(|marked| {
                let files = files_of(given)?.iter().map(|path| file(path)).collect::<anyhow::Result<_>>()?;
                Ok(RecordingGiven { files, ..marked })
            });
            let input = if one.left_out.is_some() { input.unwrap_or_default() } else { input? };
            let (name, left_out, excerpt) = (one.name.clone(), one.left_out.clone(), one.excerpt.clone());
            Ok(RecordingGiven { name, left_out, excerpt, ..input })
        })
        .collect()
}

/// Whether bag or folder say that the data is synthetic, and where it comes from.
pub fn marked(health: Option<&Health>, given: &Path) -> anyhow::Result<RecordingGiven> {
    marked_by(|key| health.and_then(|health| health.about(key)), given)
}

/// The same of a bag that says under each key what `about` gives.
pub fn marked_by<'a>(about: impl Fn(&str) -> Option<&'a str>, given: &Path) -> anyhow::Result<RecordingGiven> {
    let origin = match about(govtwin_bag::ORIGIN) {
        Some(stated) => Some(stated.to_owned()),
        None => origin::read(given)?,
    };
    let synthetic = origin.as_deref().is_some_and(says_synthetic) || about(govtwin_bag::SYNTHETIC) == Some("true");
    Ok(RecordingGiven { synthetic, origin, ..RecordingGiven::default() })
}

/// Whether a note of origin begins by saying that the data is synthetic.
pub fn says_synthetic(origin: &str) -> bool {
    origin
        .to_lowercase()
        .split_whitespace()
        .take(4)
        .any(|word| word.trim_matches(|c: char| !c.is_alphanumeric()) == "synthetic")
}

/// What to call the unit of some recordings where no sheet names it: the folder that holds them all, or the one recording.
pub fn unit_of(paths: &[PathBuf]) -> String {
    let full: Vec<PathBuf> = paths.iter().map(|path| path.canonicalize().unwrap_or_else(|_| path.clone())).collect();
    let name = |path: &Path| {
        let stem = if path.is_dir() { path.file_name() } else { path.file_stem() };
        stem.map(|name| name.to_string_lossy().into_owned())
    };
    let common = match &full[..] {
        [one] => name(one),
        all => {
            let shared = |folder: &&Path| all.iter().all(|path| path.starts_with(folder));
            all.first().and_then(|first| first.ancestors().skip(1).find(shared).and_then(name))
        }
    };
    common.filter(|name| !name.is_empty()).unwrap_or_else(|| "unit".to_owned())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::{file, files_of_bags, says_synthetic, unit_of};
    use crate::commands::bags::Bag;

    #[test]
    fn a_unit_is_called_by_what_holds_its_recordings() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir_all(at("unit 3/days")).unwrap();
        for name in ["unit 3/a.mcap", "unit 3/b.mcap", "unit 3/days/c.mcap"] {
            std::fs::write(at(name), "").unwrap();
        }
        assert_eq!(unit_of(&[at("unit 3")]), "unit 3");
        assert_eq!(unit_of(&[at("unit 3/a.mcap")]), "a");
        assert_eq!(unit_of(&[at("unit 3/a.mcap"), at("unit 3/days/c.mcap")]), "unit 3");
        assert_eq!(unit_of(&[PathBuf::from("/"), PathBuf::from("/nowhere")]), "unit");
    }

    #[test]
    fn digests_are_of_content_and_not_of_places() {
        let dir = tempfile::tempdir().unwrap();
        let bag = |name: &str| Bag { path: dir.path().join(name), name: name.to_owned() };
        std::fs::create_dir(dir.path().join("folder")).unwrap();
        for (name, text) in [("a.mcap", "abc"), ("folder/b.mcap", "abc"), ("folder/metadata.yaml", "x")] {
            std::fs::write(dir.path().join(name), text).unwrap();
        }
        let of = |name: &str| files_of_bags(&[bag(name)])[0].sha256.clone();
        assert_eq!(of("a.mcap"), of("folder"));
        assert_eq!(of("a.mcap"), govtwin_files::digest::sha256("abc"));
        assert!(files_of_bags(&[bag("none.mcap")]).is_empty());
        assert!(file(&dir.path().join("none.mcap")).unwrap_err().to_string().contains("none.mcap"));
        assert!(format!("{:#}", file(dir.path()).unwrap_err()).contains("expected a regular file"));
    }

    #[test]
    fn a_note_says_that_data_is_synthetic_at_its_start() {
        for note in ["Synthetic data: these recordings", "All units are synthetic: made by"] {
            assert!(says_synthetic(note));
        }
        assert!(!says_synthetic("Measured on a fatigue rig, with synthetic oil."));
    }
}
