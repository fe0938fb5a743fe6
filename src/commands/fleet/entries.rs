//! Plans as files: where one is, its entries, and which entry the engine that started this process means.

use anyhow::{Context, bail};
use govtwin_diagnosis::fleet::entry::Entry;
use govtwin_files::store::Store;

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

    /// One entry, counted from 0: by the offsets beside the plan, or, where there are none of this plan, by reading up to its line.
    pub fn nth(&self, index: usize) -> anyhow::Result<Entry> {
        let line = if let Some(line) = self.by_offset(index) {
            Ok(line)
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

    /// A line of a plan by its offsets, and nothing else of either file. Of offsets that are not those of the plan none comes: they must
    /// state its size and point from line break to line break.
    fn by_offset(&self, index: usize) -> Option<String> {
        let place = u64::try_from(index).ok()?.checked_mul(OFFSET_BYTES)?;
        let (records, _) = self.beside.part(&offsets_of(&self.name), place, 2 * OFFSET_BYTES).ok()?;
        let (from, to) = records.split_at_checked(usize::try_from(OFFSET_BYTES).ok()?)?;
        let ((begin, size), (end, same)) = (offset(from)?, offset(to)?);
        // The line break before the line is read with it.
        let before = begin.min(1);
        let len = end.checked_sub(begin).filter(|len| (1..=LONGEST_LINE_BYTES).contains(len) && size == same)?;
        let (line, whole) = self.beside.part(&self.name, begin - before, before + len).ok()?;
        let text = String::from_utf8(line).ok().filter(|text| whole == size && text.len() as u64 == before + len)?;
        let line = if before == 1 { text.strip_prefix('\n')? } else { &text }.strip_suffix('\n')?;
        (!line.contains('\n')).then(|| line.to_owned())
    }
}

/// A record of the offsets: where a line begins and the size of the plan, 15 digits each, so that the record of a line has a place that
/// can be told.
const OFFSET_BYTES: u64 = 32;

/// An entry of ten thousand recordings has a tenth of it.
const LONGEST_LINE_BYTES: u64 = 1 << 24;

/// The offsets beside a plan.
fn offsets_of(plan: &str) -> String {
    format!("{}.offsets", plan.trim_end_matches(".jsonl"))
}

fn offset(record: &[u8]) -> Option<(u64, u64)> {
    let (begin, size) = std::str::from_utf8(record).ok()?.strip_suffix('\n')?.split_once(' ')?;
    Some((begin.parse().ok()?, size.parse().ok()?))
}

/// Writes a plan, and where its lines begin, so that a worker reads its own line and not the whole.
pub fn write(store: &Store, entries: &[Entry]) -> anyhow::Result<()> {
    let lines: Vec<String> = entries.iter().map(Entry::line).collect();
    let size: usize = lines.iter().map(String::len).sum();
    let mut offsets = String::with_capacity((lines.len() + 1) * 32);
    let mut begin = 0;
    for len in lines.iter().map(String::len).chain([0]) {
        offsets += &format!("{begin:015} {size:015}\n");
        begin += len;
    }
    // Old offsets beside a new plan are seen for what they are; new ones beside an old plan would be, too.
    store.put(ENTRIES, lines.concat().as_bytes())?;
    Ok(store.put(&offsets_of(ENTRIES), offsets.as_bytes())?)
}

/// The entry that option or engine names, or that the engine handed over whole; all of the plan where neither does.
pub fn wanted(plan: &PlanFile, index: Option<usize>) -> anyhow::Result<Vec<Entry>> {
    if let Some(index) = index {
        return Ok(vec![plan.nth(index)?]);
    }
    let set = VARIABLES
        .into_iter()
        .find_map(|name| Some((name, std::env::var(name).ok().filter(|value| !value.trim().is_empty())?)));
    let Some((name, value)) = set else { return plan.all() };
    if value.trim_start().starts_with('{') {
        return Ok(vec![Entry::read(&value, PROGRAM).with_context(|| format!("the variable {name}"))?]);
    }
    let index = value.trim().trim_matches('"').parse().map_err(|_| {
        usage(format!("the variable {name}: expected the index of an entry, or an entry, found `{value}`"))
    })?;
    Ok(vec![plan.nth(index)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(count: usize) -> Vec<Entry> {
        let entry = |k: usize| Entry { unit: "x".repeat(k % 3 + 1), period: k.to_string(), ..Entry::default() };
        (0..count).map(|k| entry(k).keyed(PROGRAM)).collect()
    }

    #[test]
    fn a_line_is_read_by_its_offset_and_by_no_offset_of_another_plan() {
        let dir = tempfile::tempdir().unwrap();
        let address = dir.path().display().to_string();
        let store = Store::open(&address).unwrap();
        let all = entries(23);
        write(&store, &all).unwrap();
        let plan = PlanFile::open(&address).unwrap();
        for (index, entry) in all.iter().enumerate() {
            assert_eq!(plan.by_offset(index).map(|line| line + "\n"), Some(entry.line()), "{index}");
        }
        assert_eq!((plan.by_offset(23), plan.by_offset(usize::MAX)), (None, None));
        let slip = plan.nth(23).unwrap_err().to_string();
        assert!(slip.contains("has 23 entries; expected 0 to 22"), "{slip}");
        // The plan without its second line, and one of the same size with its first two lines turned: what does not fit is not believed.
        let text = String::from_utf8(store.get(ENTRIES).unwrap()).unwrap();
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        let shorter = [&lines[..1], &lines[2..]].concat().concat();
        let turned = [&[lines[1], lines[0]], &lines[2..]].concat().concat();
        for changed in [shorter, turned] {
            store.put(ENTRIES, changed.as_bytes()).unwrap();
            assert_eq!(plan.by_offset(0), None);
            for index in [0, 1, 5] {
                let line = changed.lines().nth(index).unwrap();
                assert_eq!(plan.nth(index).unwrap(), Entry::read(line, PROGRAM).unwrap());
            }
        }
        // A part of a plan has no offsets.
        store.put("part.jsonl", lines[7..9].concat().as_bytes()).unwrap();
        let part = PlanFile::open(&format!("{address}/part.jsonl")).unwrap();
        assert_eq!(part.nth(1).unwrap(), all[8]);
    }
}
