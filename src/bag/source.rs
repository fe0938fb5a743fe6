//! Where a bag's files are: a single file, a folder with or without `metadata.yaml`, split bags.

use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::channels::Channels;
use super::mcap_file::{self, ScannedFile};
use super::metadata::{self, Metadata};
use super::segment::Segment;
use super::topic::{OnMessage, RawView, TopicInfo, shown};
use super::{BagError, Damage, FileHealth, Finding, Warning, qualification, unpack};
use govtwin_files::{Scratch, check_regular, read_text, settle};

/// More than `metadata.yaml` has for ten thousand topics.
const LARGEST_METADATA_BYTES: u64 = 1 << 24;

const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";

/// A bag's files in order, and the findings of the search for them.
#[derive(Debug)]
pub(super) struct BagSource {
    /// What people call the bag.
    pub(super) name: String,
    /// The files, oldest first.
    pub(super) files: Vec<BagFile>,
    /// The contents of `metadata.yaml`, if there is one.
    pub(super) metadata: Option<Metadata>,
    /// Files that are missing, metadata that cannot be used.
    pub(super) warnings: Vec<Warning>,
}

/// Which storage a file is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    /// MCAP.
    Mcap,
    /// rosbag2's sqlite3.
    Sqlite,
}

/// A file of a bag, and where it can be read.
#[derive(Debug)]
pub(super) struct BagFile {
    /// Where it is.
    pub(super) path: PathBuf,
    pub(super) storage: Storage,
    /// The same without the compression of the whole file, where there is one, and what was wrong with it.
    unpacked: Option<(Scratch, Option<Damage>)>,
}

impl BagFile {
    fn open(path: PathBuf, quoted: bool) -> Result<Self, BagError> {
        let (storage, unpacked) = match storage_of(&path, quoted) {
            Ok(storage) => (storage, None),
            Err(Unknown::Packed) => {
                let (unpacked, damage) = unpack::file(&path)?;
                let storage = storage_of(unpacked.path(), quoted).map_err(|unknown| unknown.inside(&path))?;
                (storage, Some((unpacked, damage)))
            }
            Err(unknown) => return Err(unknown.at(&path)),
        };
        Ok(Self { path, storage, unpacked })
    }

    /// Where its storage can be read.
    pub(super) fn readable(&self) -> &Path {
        self.unpacked.as_ref().map_or(&self.path, |(unpacked, _)| unpacked.path())
    }

    /// Reads it, hands on each message, and returns its state.
    fn scan(&self, on_message: &mut OnMessage<'_>) -> Result<ScannedFile, BagError> {
        let path = self.readable();
        let bytes = fs::metadata(path).map_err(BagError::io(&self.path, "read"))?.len();
        let mut messages = unpack::Messages::new(bytes);
        let on_message = &mut |message: RawView<'_>| on_message(messages.unpack(message));
        let scanned = match self.storage {
            Storage::Mcap => mcap_file::scan(path, on_message),
            #[cfg(feature = "sqlite")]
            Storage::Sqlite => super::db3::scan(path, on_message),
            #[cfg(not(feature = "sqlite"))]
            Storage::Sqlite => Err(BagError::Sqlite { path: self.path.clone() }),
        };
        let mut scanned = scanned.map_err(|error| error.of(&self.path))?;
        let health = &mut scanned.health;
        health.damage.extend(messages.damage());
        if messages.packed > 0 {
            health.packed = "message";
        }
        if let Some((_, damage)) = &self.unpacked {
            health.damage.extend(damage.clone());
            health.path.clone_from(&self.path);
            health.packed = "file";
            health.bytes = fs::metadata(&self.path).map_err(BagError::io(&self.path, "read"))?.len();
        }
        Ok(scanned)
    }
}

/// Finds the files of a bag, and unpacks those that are compressed.
///
/// # Errors
/// Where there is nothing at the path, or something that is no bag.
pub(super) fn open(path: &Path) -> Result<BagSource, BagError> {
    settle(path).map_err(BagError::io(path, "read"))?;
    open_as_it_is(path)
}

/// The same for who writes in the folder, and may be at work on its journal.
pub(super) fn open_as_it_is(path: &Path) -> Result<BagSource, BagError> {
    let kind = fs::metadata(path).map_err(BagError::io(path, "open"))?;
    let name = path.file_stem().or_else(|| path.file_name()).unwrap_or(path.as_os_str());
    let mut source =
        BagSource { name: name.to_string_lossy().into_owned(), files: vec![], metadata: None, warnings: vec![] };
    let mut files = vec![];
    if kind.is_dir() {
        folder(path, &mut source, &mut files)?;
    } else {
        check_regular(path).map_err(BagError::io(path, "read"))?;
        files.push(path.to_owned());
    }
    // A link may have come with the folder, and lead anywhere.
    let is_named = !kind.is_dir() && !fs::symlink_metadata(path).is_ok_and(|kind| kind.is_symlink());
    source.files = files.into_iter().map(|file| BagFile::open(file, is_named)).collect::<Result<_, _>>()?;
    Ok(source)
}

/// Finds the files of a folder: those that `metadata.yaml` names, or else all that look like a bag's.
fn folder(path: &Path, source: &mut BagSource, files: &mut Vec<PathBuf>) -> Result<(), BagError> {
    // A dot in a folder's name is no suffix.
    if let Some(name) = path.file_name() {
        source.name = name.to_string_lossy().into_owned();
    }
    let file = path.join(metadata::FILE_NAME);
    match read_text(&file, LARGEST_METADATA_BYTES) {
        Ok(text) => match Metadata::parse(&text) {
            Ok(metadata) => {
                if metadata.is_packed_otherwise() {
                    let format = shown(&metadata.compression_format);
                    return Err(BagError::Compressed { path: path.to_owned(), format });
                }
                let mut known = BTreeSet::new();
                for relative in &metadata.relative_file_paths {
                    let file = named(path, relative);
                    if !file.as_ref().map_or_else(|| is_inside(relative), |file| lies_below(path, file)) {
                        let problem = format!(
                            "names `{}`, which leads outside of the bag's folder; it is not read: copy or link the file into the folder, or name it itself",
                            shown(relative)
                        );
                        source.warnings.push(Warning::Metadata { problem });
                        continue;
                    }
                    match file {
                        // A file that is named again is read once, by whatever way its name leads there.
                        Some(file) => {
                            let real = file.canonicalize().unwrap_or_else(|_| file.clone());
                            files.extend(Some(file).filter(|_| known.insert(real)));
                        }
                        // A name from the file, within the words of a warning.
                        None => source.warnings.push(Warning::FileMissing { path: path.join(shown(relative)) }),
                    }
                }
                source.metadata = Some(metadata);
            }
            Err(problem) => source.warnings.push(Warning::Metadata { problem }),
        },
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => source.warnings.push(Warning::Metadata { problem: error.to_string() }),
    }
    if files.is_empty() {
        *files = files_like_a_bag(path)?;
    }
    if files.is_empty() {
        return Err(BagError::NotABag {
            path: path.to_owned(),
            expected: "metadata.yaml or .mcap files in the folder; name the bag's own folder or file",
            found: source.warnings.first().map_or(describe_folder(path)?, Warning::to_string),
        });
    }
    Ok(())
}

/// Whether a file lies in a folder or below it. It may be a link itself, as large files of archives are: it has its place by who made the folder.
fn lies_below(folder: &Path, file: &Path) -> bool {
    let [folder, beside] = [Some(folder), file.parent()].map(|path| path.and_then(|path| path.canonicalize().ok()));
    folder.is_some_and(|folder| beside.is_some_and(|beside| beside.starts_with(folder)))
}

/// Whether a name leads to a file in the bag's folder, or below it.
fn is_inside(relative: &str) -> bool {
    let within = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    Path::new(relative).components().all(within)
}

/// A file that `metadata.yaml` names. rosbag2 also wrote names with the bag's own folder before them, and a user may have unpacked a
/// compressed file.
fn named(folder: &Path, relative: &str) -> Option<PathBuf> {
    let beside = Path::new(relative).file_name().map(Path::new);
    let plain = |name: &Path| if has_suffix(name, "zstd") { name.with_extension("") } else { name.to_owned() };
    let names = [Some(Path::new(relative)), beside].into_iter().flatten();
    let names = names.clone().map(Path::to_owned).chain(names.map(plain));
    names.map(|name| folder.join(name)).find(|path| path.is_file())
}

/// The `.mcap` files of a folder, or else its `.db3` files, compressed or not, by name with numbers in numeric order.
fn files_like_a_bag(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    let mut entries = entries_of(path)?;
    entries.retain(|entry| entry.is_file());
    for suffix in ["mcap", "db3"] {
        let packed = |entry: &Path| has_suffix(entry, "zstd") && has_suffix(&entry.with_extension(""), suffix);
        let is_one = |entry: &&PathBuf| has_suffix(entry, suffix) || packed(entry);
        let mut files: Vec<PathBuf> = entries.iter().filter(is_one).cloned().collect();
        if !files.is_empty() {
            files.sort_by_key(|file| natural_key(&file.to_string_lossy()));
            return Ok(files);
        }
    }
    Ok(vec![])
}

fn has_suffix(path: &Path, suffix: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(suffix))
}

fn entries_of(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    let entries = fs::read_dir(path).map_err(BagError::io(path, "list"))?;
    let mut found = vec![];
    for entry in entries {
        found.push(entry.map_err(BagError::io(path, "list"))?.path());
    }
    found.sort();
    Ok(found)
}

/// `bag_10` after `bag_2`: runs of digits compare as numbers.
fn natural_key(name: &str) -> Vec<(u64, String)> {
    let mut key = vec![];
    let mut rest = name;
    while !rest.is_empty() {
        let text_len = rest.find(|letter: char| letter.is_ascii_digit()).unwrap_or(rest.len());
        let (text, digits) = rest.split_at(text_len);
        let digits_len = digits.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(digits.len());
        key.push((0, text.to_owned()));
        key.push((digits[..digits_len].parse().unwrap_or(u64::MAX), digits[..digits_len].to_owned()));
        rest = &digits[digits_len..];
    }
    key
}

fn describe_folder(path: &Path) -> Result<String, BagError> {
    let names: Vec<String> = entries_of(path)?
        .iter()
        .filter_map(|entry| entry.file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    Ok(match names.len() {
        0 => "an empty folder".to_owned(),
        1..=5 => format!("a folder with {}", names.join(", ")),
        count => format!("a folder with {} and {} more", names[..5].join(", "), count - 5),
    })
}

/// Why a file's storage is not known.
enum Unknown {
    /// It is compressed as a whole.
    Packed,
    /// The operating system refused.
    Io(&'static str, std::io::Error),
    /// It is something else.
    Other(String),
}

impl Unknown {
    /// The error for a file as it is.
    fn at(self, path: &Path) -> BagError {
        let found = match self {
            Self::Io(action, error) => return BagError::io(path, action)(error),
            Self::Packed => "a file compressed twice with zstd".to_owned(),
            Self::Other(found) => found,
        };
        let expected = "an MCAP file (first bytes 89 4d 43 41 50), a sqlite3 bag, or a bag folder";
        BagError::NotABag { path: path.to_owned(), expected, found }
    }

    /// The error for what is in a compressed file.
    fn inside(self, path: &Path) -> BagError {
        match self {
            Self::Other(found) => Self::Other(format!("{found}, compressed with zstd")).at(path),
            unknown => unknown.at(path),
        }
    }
}

/// Tells the storage of a file by its first bytes; its name plays no part. What stands in it is quoted only where a user named the file: a name in
/// `metadata.yaml`, or a link, may lead to a file of others.
fn storage_of(path: &Path, quoted: bool) -> Result<Storage, Unknown> {
    let file = fs::File::open(path).map_err(|error| Unknown::Io("open", error))?;
    let mut head = vec![];
    file.take(512).read_to_end(&mut head).map_err(|error| Unknown::Io("read", error))?;
    if head.starts_with(mcap::MAGIC) {
        return Ok(Storage::Mcap);
    }
    if head.starts_with(SQLITE_MAGIC) {
        return Ok(Storage::Sqlite);
    }
    Err(if head.is_empty() {
        Unknown::Other("an empty file".to_owned())
    } else if unpack::is_packed(&head) {
        Unknown::Packed
    } else if head.starts_with(b"#ROSBAG V") {
        Unknown::Other("a ROS 1 bag; convert it first: `rosbags-convert --src FILE --dst OUT`".to_owned())
    } else if let Ok(text) = std::str::from_utf8(&head[..head.len().min(64)]) {
        let first = text.lines().next().unwrap_or_default();
        Unknown::Other(if quoted { format!("text that begins with {first:?}") } else { "text".to_owned() })
    } else {
        let bytes = &head[..head.len().min(8)];
        Unknown::Other(if quoted {
            format!("a file that begins with the bytes {bytes:02x?}")
        } else {
            "other first bytes".to_owned()
        })
    })
}

/// What is in a bag besides its messages.
#[derive(Debug)]
pub(super) struct Scanned {
    pub(super) files: Vec<FileHealth>,
    /// Topics by name; several entries of one name where the bag gives it several types, or definitions of a type.
    pub(super) topics: Vec<Arc<TopicInfo>>,
    /// For each file, what it takes to load its messages again.
    pub(super) parts: Vec<(Channels, Vec<Segment>)>,
}

impl BagSource {
    /// The names of all topics with a message, where every file's summary counts them.
    pub(super) fn topics(&self) -> Option<BTreeSet<String>> {
        let mut names = BTreeSet::new();
        for file in &self.files {
            if file.storage != Storage::Mcap {
                return None;
            }
            names.extend(mcap_file::topics(file.readable())?);
        }
        Some(names)
    }

    /// All findings on the files.
    pub(super) fn all_warnings(&self, files: &[FileHealth]) -> Vec<Warning> {
        let mut warnings: Vec<Warning> = files.iter().flat_map(FileHealth::warnings).collect();
        let read: u64 = files.iter().map(|file| file.messages).sum();
        let stated = self.metadata.as_ref().and_then(|metadata| metadata.message_count);
        if let Some(stated) = stated.filter(|stated| *stated != read) {
            let problem = format!("counts {stated} messages, the files hold {read}");
            warnings.push(Warning::Metadata { problem });
        }
        warnings.extend(self.warnings.iter().cloned());
        warnings
    }

    /// What is to be known of the files beside what is wrong with them.
    pub(super) fn notes(&self, files: &[FileHealth]) -> Vec<Finding> {
        let is_counted = self.metadata.as_ref().is_some_and(|metadata| metadata.message_count.is_some());
        qualification::of_files(files, is_counted)
    }

    /// Reads all files in order, hands on each message, and gives their health and topics.
    ///
    /// # Errors
    /// Where the operating system refuses, or a file is in a storage that this build cannot read.
    pub(super) fn scan(&self, on_message: &mut OnMessage<'_>) -> Result<Scanned, BagError> {
        let mut scanned = Scanned { files: vec![], topics: vec![], parts: vec![] };
        let mut known = BTreeSet::new();
        for file in &self.files {
            let ScannedFile { health, channels, segments } = file.scan(on_message)?;
            for (_, topic) in channels.topics() {
                if known.insert(topic.definition()) {
                    scanned.topics.push(Arc::clone(topic));
                }
            }
            scanned.files.push(health);
            scanned.parts.push((channels, segments));
        }
        scanned.topics.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(scanned)
    }
}
