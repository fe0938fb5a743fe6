//! Output that commands share: text on standard output, progress, whole files.

mod progress;

use std::borrow::Cow;
use std::io::{self, IsTerminal as _, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_bag::Sealed;
use govtwin_files::{Claim, Place, Together, journalled, place_of, try_place};
use govtwin_pages::table::Table;

pub use progress::Progress;

/// Prints help, version or wrong usage, and ends: as `clap::Error::exit`, but help that cannot be written is an error.
#[expect(clippy::exit, reason = "parsing the command line ends here, as it does in clap")]
pub fn leave(told: &clap::Error) -> ! {
    let written = told.print().and_then(|()| io::stdout().flush());
    if let Err(error) = written.or_else(unless_gone)
        && !told.use_stderr()
    {
        fail(&anyhow::Error::new(error).context(UNWRITTEN));
        std::process::exit(1);
    }
    std::process::exit(told.exit_code())
}

const UNWRITTEN: &str = "cannot write to standard output";

/// A reader that has gone away is no error.
fn unless_gone(error: io::Error) -> io::Result<()> {
    if error.kind() == io::ErrorKind::BrokenPipe { Ok(()) } else { Err(error) }
}

/// Writes text to standard output; a reader that has gone away (`… | head`) is no error.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = io::stdout().lock();
    let written = stdout.write_all(plain(text).as_bytes()).and_then(|()| stdout.flush());
    written.or_else(unless_gone).context(UNWRITTEN)
}

/// How many characters a line of standard output may have: those of the terminal, or of the variable `COLUMNS`; no end in a pipe or file.
pub fn width() -> usize {
    let stated = std::env::var("COLUMNS").ok().and_then(|text| text.trim().parse().ok());
    let terminal = || terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| usize::from(width.0));
    if io::stdout().is_terminal() { stated.or_else(terminal).unwrap_or(80).max(NARROWEST) } else { usize::MAX }
}

/// A table as wide as the terminal has room for.
pub fn table_text(table: &Table) -> String {
    table.to_text_within(width())
}

/// A narrower terminal is taken for one that does not know its width.
const NARROWEST: usize = 40;

/// Writes a warning line to standard error.
pub fn warn(text: &str) {
    say(&format!("warning: {text}"));
}

/// The same for each of several.
pub fn warn_all(texts: impl IntoIterator<Item = impl AsRef<str>>) {
    texts.into_iter().for_each(|text| warn(text.as_ref()));
}

/// Writes why a command failed to standard error.
pub fn fail(error: &anyhow::Error) {
    say(&format!("{error:#}"));
}

/// A line with names from files in it, which may hold breaks that would pass for the program's own.
pub fn one_line(line: &str) -> String {
    line.replace('\n', "\\u000a")
}

/// Text of which a terminal shows every character: names in files and bags may hold sequences that move its cursor, or turn the
/// direction of writing. They are shown as `\u001b`, which JSON reads back.
fn plain(text: &str) -> Cow<'_, str> {
    let acts = |c: char| {
        let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        turns || (c.is_control() && !matches!(c, '\n' | '\t'))
    };
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let show = |c: char| if acts(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    Cow::Owned(text.chars().map(show).collect())
}

/// Writes a file, whole or not at all, making missing folders on the way.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    govtwin_files::write_atomically(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Refuses a place for a file before the work that it comes from: where nothing can be made, or others' file stands.
pub fn check_place(option: &str, path: &Path) -> anyhow::Result<()> {
    let there = place_of(path).with_context(|| format!("{option}: cannot look at {}", path.display()))?;
    if let Some(found) = in_the_way(there) {
        anyhow::bail!("{option}: {}: {found}; name another file, or move it away", path.display());
    }
    try_place(path).with_context(|| format!("{option}: cannot write {}", path.display()))
}

/// The same, and claims the name for the whole command: of two that write there, one is refused before its work.
pub fn claim_place(option: &'static str, path: &Path) -> anyhow::Result<Claim> {
    check_place(option, path)?;
    let claim = Claim::name(path).context(option)?;
    // Who had it until now may have left something there.
    check_place(option, path)?;
    Ok(claim)
}

/// What must not be replaced.
fn in_the_way(there: Place) -> Option<&'static str> {
    match there {
        Place::Free | Place::Ours => None,
        Place::Foreign => Some("expected a file of this program or nothing there, found another"),
        Place::Folder => Some("expected a file or nothing there, found a folder"),
    }
}

/// Tables say nothing of who made them: they go with the files beside them.
fn is_table(name: &str) -> bool {
    [".csv", ".parquet"].iter().any(|suffix| name.ends_with(suffix))
}

/// Writes a line for the person who waits to standard error.
pub fn say(text: &str) {
    // Where even standard error is closed there is nobody left to tell.
    let _ = writeln!(io::stderr().lock(), "govtwin: {}", plain(text));
}

/// A write beyond the largest size of a file (`ulimit -f`) is an error like any other, and does not end the process amid its work.
pub fn hear_of_file_sizes() {
    #[cfg(target_os = "linux")]
    // Where no handler can be set, the signal ends the process as before, and the next run cleans up.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
}

/// What a command leaves in a folder: claimed before the work, placed together after it.
#[derive(Debug)]
pub struct Output {
    folder: PathBuf,
    bags: Vec<Sealed>,
    files: Together,
    /// Files of an earlier run that would no longer be true.
    outdated: Vec<PathBuf>,
    _claim: Claim,
}

impl Output {
    /// Claims a folder for files of these names; missing folders are made, and go again where nothing comes of it. Where others' files have these
    /// names it is refused.
    pub fn claim(folder: &Path, names: &[&str]) -> anyhow::Result<Self> {
        Self::claim_over(folder, names, false)
    }

    /// The same, over others' files where they are to be replaced.
    pub fn claim_over(folder: &Path, names: &[&str], replaces_all: bool) -> anyhow::Result<Self> {
        let claim = Claim::folder(folder).context("--out")?;
        let mut places = vec![];
        for name in names {
            let path = folder.join(name);
            let there = place_of(&path).with_context(|| format!("--out: cannot look at {}", path.display()))?;
            places.push((*name, there));
        }
        let any_ours = places.iter().any(|(_, there)| *there == Place::Ours);
        for (name, there) in places {
            let let_go = there == Place::Foreign && (replaces_all || any_ours && is_table(name));
            if let Some(found) = in_the_way(there).filter(|_| !let_go) {
                let path = folder.join(name);
                anyhow::bail!("--out: {}: {found}; name another folder, or move it away", path.display());
            }
        }
        Ok(Self {
            folder: folder.to_owned(),
            bags: vec![],
            files: Together::default(),
            outdated: vec![],
            _claim: claim,
        })
    }

    /// Where a file of this name will be.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes a file under a temporary name.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        let path = self.path(name);
        self.files.add(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    }

    /// Writes figures as JSON under a temporary name.
    pub fn add_json(&mut self, name: &str, figures: &impl serde::Serialize) -> anyhow::Result<()> {
        let mut json = serde_json::to_string_pretty(figures).context("cannot write the figures as JSON")?;
        json.push('\n');
        self.add(name, json.as_bytes())
    }

    /// Removes the file of this name that an earlier run left, once everything else has its name.
    pub fn remove(&mut self, name: &str) {
        self.outdated.push(self.path(name));
    }

    /// Takes bags that are whole but for their names.
    pub fn add_bags(&mut self, bags: impl IntoIterator<Item = Sealed>) {
        self.bags.extend(bags);
    }

    /// Gives everything its name: first the bags, then the files in the order in which they were added. A process that is killed
    /// meanwhile leaves a journal, by which the next reader or writer of the folder does the rest.
    pub fn place(self) -> anyhow::Result<()> {
        let Self { folder, bags, files, outdated, _claim } = self;
        let moves: Vec<_> = bags.iter().map(Sealed::moves).chain(files.moves()).collect();
        let placing = || format!("cannot place the files in {}", folder.display());
        let act = || -> anyhow::Result<()> {
            let mut bags = bags;
            for number in 0..bags.len() {
                if let Err(error) = bags[number].put() {
                    bags[..number].iter_mut().rev().for_each(Sealed::take_back);
                    return Err(error.into());
                }
            }
            if let Err(error) = files.place() {
                bags.iter_mut().rev().for_each(Sealed::take_back);
                return Err(error).with_context(placing);
            }
            // Older bags go here.
            drop(bags);
            for path in &outdated {
                match std::fs::remove_file(path) {
                    Err(error) if error.kind() != io::ErrorKind::NotFound => {
                        return Err(error).with_context(|| format!("cannot remove {}", path.display()));
                    }
                    _ => {}
                }
            }
            Ok(())
        };
        journalled(&folder, &moves, &outdated, act).with_context(placing)?
    }
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn what_would_act_on_a_terminal_is_shown_instead() {
        assert_eq!(
            plain("/a\u{1b}[2J\u{7}\r\u{9b}31m\u{7f}\u{202e}b"),
            "/a\\u001b[2J\\u0007\\u000d\\u009b31m\\u007f\\u202eb"
        );
        assert_eq!(plain("one\n\ttwo ≤ 3 µm – Größe"), "one\n\ttwo ≤ 3 µm – Größe");
        let json = serde_json::to_string(&["\u{1b}\u{9b}\u{202e}"]).unwrap();
        let back: Vec<String> = serde_json::from_str(&plain(&json)).unwrap();
        assert_eq!(back, ["\u{1b}\u{9b}\u{202e}"], "JSON stays JSON");
    }
}
