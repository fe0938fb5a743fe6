//! Plans as files: where one is, its entries, and which entry the engine that started this process means.

use std::io::{BufRead as _, BufReader};

use anyhow::{Context, bail};
use govtwin::fleet::entry::Entry;
use govtwin::store::Store;

use crate::commands::provenance::PROGRAM;
use crate::commands::usage;

/// The plan's list of entries.
pub const ENTRIES: &str = "entries.jsonl";

/// Variables by which engines tell a process which entry is its own, in the order in which they are asked.
const VARIABLES: [&str; 3] = ["HQ_ENTRY", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"];

/// A plan that can be read.
pub struct PlanFile {
    /// The store or folder in which it lies, with sheets and maps beside it.
    pub beside: Store,
    /// Its name in there.
    name: String,
}

impl PlanFile {
    /// A plan by its file, or by the folder or store that holds `entries.jsonl`.
    pub fn open(text: &str) -> anyhow::Result<Self> {
        let text = text.trim_end_matches('/');
        let (folder, name) = match text.strip_suffix(".jsonl") {
            None => (text, ENTRIES),
            Some(_) => text.rsplit_once('/').unwrap_or((".", text)),
        };
        let folder = if folder.is_empty() { "/" } else { folder };
        Ok(Self { beside: Store::open(folder)?, name: name.to_owned() })
    }

    /// Whether it is there.
    pub fn is_there(&self) -> anyhow::Result<bool> {
        Ok(self.beside.has(&self.name)?)
    }

    fn shown(&self) -> String {
        format!("{}/{}", self.beside.address(), self.name)
    }

    /// All entries.
    pub fn all(&self) -> anyhow::Result<Vec<Entry>> {
        let text = self.text()?;
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let read = |(number, line): (usize, &str)| {
            Entry::read(line, PROGRAM).with_context(|| format!("{}: line {}", self.shown(), number + 1))
        };
        lines.map(read).collect()
    }

    fn text(&self) -> anyhow::Result<String> {
        let bytes = self.beside.get(&self.name).context("cannot read the plan; `govtwin fleet plan` makes one")?;
        String::from_utf8(bytes).with_context(|| format!("{}: expected text", self.shown()))
    }

    /// One entry, counted from 0. Of a plan in a folder nothing behind it is read.
    pub fn nth(&self, index: usize) -> anyhow::Result<Entry> {
        let reading = || format!("cannot read {}", self.shown());
        let line = if let Some(path) = self.beside.local(&self.name).filter(|path| path.is_file()) {
            let lines = BufReader::new(std::fs::File::open(path).with_context(reading)?).lines();
            let mut seen = 0;
            let mut wanted = None;
            for line in lines {
                let line = line.with_context(reading)?;
                if seen == index {
                    wanted = Some(line);
                    break;
                }
                seen += 1;
            }
            wanted.ok_or(seen)
        } else {
            let text = self.text()?;
            text.lines().nth(index).map(str::to_owned).ok_or_else(|| text.lines().count())
        };
        match line {
            Ok(line) => Entry::read(&line, PROGRAM).with_context(|| format!("{}: line {}", self.shown(), index + 1)),
            Err(0) => bail!("{}: the plan has no entry", self.shown()),
            Err(count) => {
                Err(usage(format!("index {index}: {} has {count} entries; expected 0 to {}", self.shown(), count - 1)))
            }
        }
    }
}

/// Which entry is meant.
pub enum Wanted {
    /// The one at an index.
    At(usize),
    /// The one that the engine handed over whole.
    This(Box<Entry>),
    /// All of them.
    All,
}

/// The entry that option or engine names; all where neither does.
pub fn wanted(index: Option<usize>) -> anyhow::Result<Wanted> {
    if let Some(index) = index {
        return Ok(Wanted::At(index));
    }
    let set = VARIABLES
        .into_iter()
        .find_map(|name| Some((name, std::env::var(name).ok().filter(|value| !value.trim().is_empty())?)));
    let Some((name, value)) = set else { return Ok(Wanted::All) };
    if value.trim_start().starts_with('{') {
        let entry = Entry::read(&value, PROGRAM).with_context(|| format!("the variable {name}"))?;
        return Ok(Wanted::This(Box::new(entry)));
    }
    let index = value.trim().trim_matches('"').parse();
    index.map(Wanted::At).map_err(|_| {
        usage(format!("the variable {name}: expected the index of an entry, or an entry, found `{value}`"))
    })
}
