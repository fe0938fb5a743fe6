//! What a report was made from: program, recordings with digests, data sheet, options, seed, warnings, unit and date.
//!
//! In JSON it is below the key `provenance`, in parameter files in the comments at their head, on pages below
//! "How these figures were made".

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Digits of a digest on pages; the JSON has the whole digest.
const SHOWN_DIGITS: usize = 12;

/// What a report was made from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// The command, such as `diagnose`.
    pub command: String,
    /// When, UTC as RFC 3339; `SOURCE_DATE_EPOCH` in its place where that is set.
    pub date: String,
    /// What the unit is called, by its parameter file or by the folder of its recordings.
    pub unit: String,
    /// The recordings that were given, in their order.
    pub recordings: Vec<RecordingGiven>,
    /// The data sheet.
    pub sheet: SheetUsed,
    /// Options that were given or that decide the result, by name.
    pub options: BTreeMap<String, String>,
    /// Seed of what is drawn at random.
    pub seed: Option<u64>,
    /// What a user should read before believing the figures.
    pub warnings: Vec<String>,
    /// Files that were written together with the report, by name, each with the SHA-256 of its bytes, hexadecimal.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub written: BTreeMap<String, String>,
}

/// A file as it was read.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FileUsed {
    /// The path as given.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// A recording that was given.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordingGiven {
    /// What it is called in the report.
    pub name: String,
    /// Its files.
    pub files: Vec<FileUsed>,
    /// Whether bag or folder state that it was simulated.
    pub synthetic: bool,
    /// The origin that bag or folder state.
    pub origin: Option<String>,
    /// Why it was left out, where it was.
    pub left_out: Option<String>,
    /// What was taken of it, where it was too long to be taken whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excerpt: Option<String>,
}

/// The data sheet that was used.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SheetUsed {
    /// What its file calls the unit.
    pub name: String,
    /// The files that it was merged from; none for the shipped unit.
    pub files: Vec<FileUsed>,
    /// Digest of all its values, tolerances, transducers and effects.
    pub sha256: String,
}

impl Provenance {
    /// The digests of all files of all recordings, sorted.
    pub fn digests(&self) -> Vec<&str> {
        let mut all: Vec<&str> =
            self.recordings.iter().flat_map(|one| one.files.iter().map(|file| file.sha256.as_str())).collect();
        all.sort_unstable();
        all
    }

    /// The origins that bags and folders state, each once.
    pub fn origins(&self) -> Vec<&str> {
        origins(self.recordings.iter().map(|one| (one.synthetic, one.origin.as_deref())))
    }

    /// Names and values for a page.
    pub fn facts(&self) -> Vec<(String, String)> {
        let mut facts = vec![
            ("program".to_owned(), format!("{} {}", self.program, self.command)),
            ("date".to_owned(), self.date.clone()),
            ("unit".to_owned(), self.unit.clone()),
            ("data sheet".to_owned(), self.sheet.text()),
        ];
        facts.extend(self.recordings.iter().map(|one| (format!("recording {}", one.name), one.text())));
        facts.extend(self.options.iter().map(|(name, value)| (format!("--{name}"), value.clone())));
        facts.extend(self.seed.map(|seed| ("seed".to_owned(), seed.to_string())));
        facts.push((
            "warnings".to_owned(),
            if self.warnings.is_empty() { "none".to_owned() } else { listed(&self.warnings) },
        ));
        facts
    }

    /// Lines of comment for the head of a parameter file.
    pub fn comments(&self) -> Vec<String> {
        let mut lines = vec![format!("Made by {} {} on {}.", self.program, self.command, self.date)];
        lines.push(format!("Unit: {}. Data sheet: {}.", self.unit, self.sheet.text()));
        lines.extend(self.recordings.iter().map(|one| format!("Recording {}: {}.", one.name, one.text())));
        let mut options: Vec<String> = self.options.iter().map(|(name, value)| format!("--{name} {value}")).collect();
        options.extend(self.seed.map(|seed| format!("seed {seed}")));
        if !options.is_empty() {
            lines.push(format!("Options: {}.", options.join(", ")));
        }
        lines.extend(self.warnings.iter().map(|warning| format!("Warning: {warning}")));
        lines
    }
}

/// The same of recordings by whether they are marked as synthetic, and by their stated origin.
pub fn origins<'a>(recordings: impl Iterator<Item = (bool, Option<&'a str>)>) -> Vec<&'a str> {
    let mut all: Vec<&str> = Vec::new();
    let (mut count, mut marked, mut unsaid) = (0, 0, false);
    for (synthetic, origin) in recordings {
        all.extend(origin.filter(|origin| !all.contains(origin)));
        count += 1;
        marked += usize::from(synthetic);
        unsaid |= synthetic && origin.is_none();
    }
    if unsaid {
        all.push(if marked == count {
            "Synthetic data: the bags say that they were simulated, not measured."
        } else {
            "Synthetic data among the recordings: some of the bags say that they were simulated, not measured."
        });
    }
    all
}

impl RecordingGiven {
    /// One line: its files, whether it is synthetic, what was taken of it, why it was left out.
    fn text(&self) -> String {
        let mut parts: Vec<String> = self.files.iter().map(ToString::to_string).collect();
        parts.extend(self.synthetic.then(|| "synthetic".to_owned()));
        parts.extend(self.excerpt.clone());
        parts.extend(self.left_out.iter().map(|reason| format!("left out: {reason}")));
        if parts.is_empty() { "no file".to_owned() } else { parts.join(", ") }
    }
}

impl fmt::Display for FileUsed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (SHA-256 {})", self.path, short(&self.sha256))
    }
}

impl SheetUsed {
    fn text(&self) -> String {
        let files: Vec<String> = self.files.iter().map(ToString::to_string).collect();
        let files = if files.is_empty() { "the shipped reference unit".to_owned() } else { files.join(" over ") };
        format!("{files}, values {}", short(&self.sha256))
    }
}

/// Warnings in a line: some end in a full stop, some do not.
fn listed(warnings: &[String]) -> String {
    warnings.iter().map(|warning| warning.trim_end_matches('.')).collect::<Vec<_>>().join("; ")
}

/// The first digits of a digest.
fn short(sha256: &str) -> &str {
    sha256.get(..SHOWN_DIGITS).unwrap_or(sha256)
}

#[cfg(test)]
mod tests {
    use super::{FileUsed, Provenance, RecordingGiven};

    fn input(name: &str, synthetic: bool, origin: Option<&str>) -> RecordingGiven {
        let files = vec![FileUsed { path: format!("{name}.mcap"), bytes: 3, sha256: "ab".repeat(32) }];
        RecordingGiven {
            name: name.into(),
            files,
            synthetic,
            origin: origin.map(str::to_owned),
            ..RecordingGiven::default()
        }
    }

    #[test]
    fn what_is_synthetic_is_said_once_wherever_it_is_marked() {
        let of = |recordings: Vec<RecordingGiven>| Provenance { recordings, ..Provenance::default() };
        assert!(of(vec![input("a", false, None)]).origins().is_empty());
        let said = of(vec![input("a", true, Some("Made up.")), input("b", true, Some("Made up."))]);
        assert_eq!(said.origins(), ["Made up."]);
        let all = of(vec![input("a", true, None), input("b", true, None)]);
        assert!(all.origins()[0].starts_with("Synthetic data: the bags say"));
        let some = of(vec![input("a", true, None), input("b", false, None)]);
        assert!(some.origins()[0].starts_with("Synthetic data among the recordings"));
    }

    #[test]
    fn people_are_shown_everything_and_machines_read_it_back() {
        let mut left = input("b", true, None);
        left.left_out = Some("too short".into());
        let made = Provenance {
            program: "govtwin 0.1.0".into(),
            command: "diagnose".into(),
            date: "2026-11-24T08:54:27Z".into(),
            unit: "case 3".into(),
            recordings: vec![input("a", false, None), left],
            options: [("without".to_owned(), "load".to_owned())].into(),
            seed: Some(7),
            warnings: vec!["a: its clock jumps".into()],
            ..Provenance::default()
        };
        let page: String = made.facts().into_iter().map(|(name, value)| format!("{name}: {value}\n")).collect();
        let head = made.comments().join("\n");
        for text in [&page, &head] {
            for word in [
                "govtwin 0.1.0 diagnose",
                "2026-11-24",
                "case 3",
                "a.mcap (SHA-256 abababababab)",
                "too short",
                "load",
                "7",
                "its clock jumps",
            ] {
                assert!(text.contains(word), "{word}: {text}");
            }
        }
        let json = serde_json::to_string(&made).unwrap();
        assert_eq!(serde_json::from_str::<Provenance>(&json).unwrap(), made);
    }
}
