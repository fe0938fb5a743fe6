//! Every step of every writer that the file system may refuse is refused once, and every step that changes something is a kill's moment:
//! the cause is named, everything under a final name is the old one or the new one, nothing foreign is touched, and the next run
//! completes and cleans.
//!
//! Some steps of each writer in the ordinary tests; all of them by `scripts/faults`.
#![cfg(all(feature = "cli", target_os = "linux", target_arch = "x86_64"))]

#[path = "faults/cases.rs"]
mod cases;
#[path = "faults/trace.rs"]
mod trace;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use cases::{Case, ENVIRONMENT};
use trace::{Fault, Kind, Step};

/// Steps of each writer that are tried in the ordinary tests, each of them refused, and killed where it changes something.
const SAMPLED: usize = 4;

/// What stands below a folder: files with their bytes, but for times of measuring; folders and links without.
type Tree = BTreeMap<PathBuf, Option<Vec<u8>>>;

fn tree(folder: &Path) -> Tree {
    let mut found = Tree::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(tree(&path));
            found.insert(path, None);
        } else {
            let bytes = fs::read(&path).unwrap();
            found.insert(path, Some(bytes));
        }
    }
    found
}

/// Hidden files and folders of the program, and what is in them.
fn is_hidden(path: &Path) -> bool {
    path.iter().any(|part| part.to_string_lossy().starts_with(".govtwin"))
}

/// How often each outcome was met.
#[derive(Debug, Default)]
struct Outcomes {
    steps: usize,
    refused: usize,
    told: usize,
    warned: usize,
    no_matter: usize,
    killed: usize,
    killed_old: usize,
}

struct Trial<'a> {
    case: &'a Case,
    /// Where everything is.
    root: PathBuf,
    /// Before the run, and after one without a fault.
    old: Tree,
    new: Tree,
    code: i32,
    /// A copy of everything before the run.
    kept: tempfile::TempDir,
}

impl<'a> Trial<'a> {
    /// Makes what the writer needs, and sees what it does without a fault; gives the steps as well.
    fn new(case: &'a Case, root: &Path) -> (Self, Vec<Step>) {
        (case.prepare)(root);
        fs::create_dir_all(root.join("tmp")).unwrap();
        let kept = tempfile::tempdir().unwrap();
        copy(root, kept.path());
        let old = tree(root);
        let mut trial =
            Self { case, root: root.to_owned(), old, new: Tree::new(), code: 0, kept };
        let first = trial.run(None);
        assert!(matches!(first.code, Some(0 | 3)), "{}: {}", case.name, first.stderr);
        trial.code = first.code.unwrap();
        trial.new = tree(root);
        assert!(trial.new != trial.old, "{}: nothing came of it", case.name);
        let strange: Vec<_> = trial.new.keys().filter(|path| is_hidden(path)).collect();
        assert!(strange.is_empty(), "{}: left {strange:?}", case.name);
        (trial, first.steps)
    }

    fn run(&self, fault: Option<(usize, Fault)>) -> trace::Traced {
        let mut command = vec![env!("CARGO_BIN_EXE_govtwin").to_owned()];
        command.extend(self.case.arguments.iter().map(|word| word.replace("ROOT", self.root.to_str().unwrap())));
        let command: Vec<&str> = command.iter().map(String::as_str).collect();
        let temporary = self.root.join("tmp");
        let mut environment = ENVIRONMENT.to_vec();
        environment.push(("TMPDIR", temporary.to_str().unwrap()));
        trace::run(&command, &environment, &self.root, fault)
    }

    fn restore(&self) {
        fs::remove_dir_all(&self.root).unwrap();
        copy(self.kept.path(), &self.root);
    }

    /// What is other than in a tree, but for hidden files and times.
    fn differs(&self, from: &Tree) -> Vec<PathBuf> {
        let now = tree(&self.root);
        let names = now.keys().chain(from.keys()).filter(|path| !is_hidden(path));
        let mut other: Vec<_> = names.filter(|path| !self.same(now.get(*path), from.get(*path))).cloned().collect();
        other.dedup();
        other
    }

    fn same(&self, one: Option<&Option<Vec<u8>>>, other: Option<&Option<Vec<u8>>>) -> bool {
        one == other || one.zip(other).is_some_and(|(one, other)| cases::timeless(one) == cases::timeless(other))
    }

    fn hidden(&self) -> Vec<PathBuf> {
        let mut all: Vec<_> = tree(&self.root).into_keys().filter(|path| is_hidden(path)).collect();
        all.extend(tree(&self.root.join("tmp")).into_keys());
        all
    }

    /// Everything is the old one or everything the new one; where names are taken one after the other, each for itself.
    fn old_or_new(&self, from_old: &[PathBuf], from_new: &[PathBuf], place: &str) {
        let together = from_old.is_empty() || from_new.is_empty();
        let each = from_old.iter().all(|path| !from_new.contains(path));
        assert!(
            together || (self.case.stepwise && each),
            "{place}: neither old (other: {from_old:?}) nor new (other: {from_new:?})"
        );
    }

    /// Refuses one step.
    fn refuse(&self, at: usize, step: &Step, outcomes: &mut Outcomes) {
        self.restore();
        let run = self.run(Some((at, Fault::Refused)));
        let place = format!("{}: step {at}, {:?} of {} refused", self.case.name, step.kind, step.path.display());
        assert!(!run.stderr.contains("panicked"), "{place}: {}", run.stderr);
        let code = run.code.unwrap_or_else(|| panic!("{place}: ended by a signal: {}", run.stderr));
        let (from_old, from_new) = (self.differs(&self.old), self.differs(&self.new));
        outcomes.refused += 1;
        match code {
            1 => {
                outcomes.told += 1;
                let cause = std::io::Error::from_raw_os_error(step.kind.error() as i32).to_string();
                assert!(run.stderr.contains(&cause), "{place}: no cause in {}", run.stderr);
                assert!(
                    run.stderr.contains(self.root.to_str().unwrap()) || run.stderr.contains("temporary"),
                    "{place}: no place in {}",
                    run.stderr
                );
                self.old_or_new(&from_old, &from_new, &place);
            }
            0 | 3 if code == self.code => {
                outcomes.no_matter += 1;
                assert!(from_new.is_empty(), "{place}: went on in silence, and {from_new:?} is another");
            }
            3 => outcomes.warned += 1,
            _ => panic!("{place}: exit code {code}: {}", run.stderr),
        }
        // Where even removing is refused, something may stay, for the next run.
        let removing = matches!(step.kind, Kind::Remove | Kind::List | Kind::Open | Kind::Look);
        assert!(removing || self.hidden().is_empty(), "{place}: left {:?}", self.hidden());
        self.next(&place);
    }

    /// Kills the program before one step.
    fn kill(&self, at: usize, step: &Step, outcomes: &mut Outcomes) {
        self.restore();
        let run = self.run(Some((at, Fault::Killed)));
        let place = format!("{}: killed before step {at}, {:?} of {}", self.case.name, step.kind, step.path.display());
        assert_eq!(run.code, None, "{place}");
        // What a reader does first.
        for folder in tree(&self.root).into_iter().filter_map(|(path, bytes)| bytes.is_none().then_some(path)) {
            govtwin::files::settle(&folder.join("anything")).unwrap();
        }
        let (from_old, from_new) = (self.differs(&self.old), self.differs(&self.new));
        let unsettled = |path: &PathBuf| !path.starts_with(self.root.join("tmp"));
        let [from_old, from_new] = [from_old, from_new].map(|all| all.into_iter().filter(unsettled).collect::<Vec<_>>());
        self.old_or_new(&from_old, &from_new, &place);
        outcomes.killed += 1;
        outcomes.killed_old += usize::from(from_old.is_empty());
        self.next(&place);
    }

    /// The same again without a fault.
    fn next(&self, place: &str) {
        let _ = fs::remove_dir_all(self.root.join("tmp"));
        fs::create_dir(self.root.join("tmp")).unwrap();
        (self.case.before_next)(&self.root);
        let run = self.run(None);
        assert_eq!(run.code, Some(self.code), "{place}; the next run: {}", run.stderr);
        let from_new = self.differs(&self.new);
        assert!(from_new.is_empty(), "{place}; after the next run {from_new:?} is another");
        assert!(self.hidden().is_empty(), "{place}; after the next run {:?} is left", self.hidden());
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).unwrap();
        }
    }
}

/// Whether all steps are tried.
fn all() -> bool {
    std::env::var("FAULTS").is_ok_and(|which| which == "all")
}

fn try_case(case: &Case) {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().canonicalize().unwrap().join("root");
    fs::create_dir(&root).unwrap();
    let (trial, steps) = Trial::new(case, &root);
    let mut outcomes = Outcomes { steps: steps.len(), ..Outcomes::default() };
    // Another part of all steps for each writer.
    let stride = if all() { 1 } else { steps.len().div_ceil(SAMPLED) };
    let first = case.name.len() % stride;
    for (at, step) in steps.iter().enumerate().skip(first).step_by(stride) {
        trial.refuse(at, step, &mut outcomes);
    }
    let changing: Vec<_> = steps.iter().enumerate().filter(|(_, step)| step.kind.changes()).collect();
    let stride = if all() { 1 } else { changing.len().div_ceil(SAMPLED) };
    for (at, step) in changing.into_iter().rev().step_by(stride) {
        trial.kill(at, step, &mut outcomes);
    }
    let mut kinds = BTreeMap::new();
    for step in &steps {
        *kinds.entry(step.kind).or_insert(0) += 1;
    }
    println!("{}: {outcomes:?} {kinds:?}", case.name);
}

macro_rules! tests {
    ($($name:ident)*) => { $(#[test] fn $name() { try_case(&cases::$name()); })* };
}

tests! { replay generate fit diagnose import watch fleet_plan fleet_run fleet_gather blind recover report sheet }
