//! Every step of every writer that the file system may refuse is refused once, and every step that changes something is a kill's moment:
//! the cause is named, everything under a final name is the old one or the new one, nothing foreign is touched, and the next run
//! completes and cleans. The same where there is no more memory from one request for it on, and where
//! others of the same command are killed beside it.
//!
//! Some steps of each writer in the ordinary tests; all of them by `scripts/faults`.
#![cfg(all(feature = "cli", target_os = "linux", target_arch = "x86_64"))]

#[path = "faults/beside.rs"]
mod beside;
#[path = "faults/cases.rs"]
mod cases;
#[path = "faults/laboratory.rs"]
mod laboratory;
#[path = "faults/memory.rs"]
mod memory;
#[cfg(feature = "node")]
#[path = "faults/record.rs"]
mod record;
#[path = "support/tight_sheet.rs"]
mod tight_sheet;
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
            // What a program that ends just now removes is no longer there.
            match fs::read(&path) {
                Ok(bytes) => drop(found.insert(path, Some(bytes))),
                Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::NotFound, "{}: {error}", path.display()),
            }
        }
    }
    found
}

/// The same, as it can be compared with that of another run.
fn seen(case: &Case, root: &Path) -> Tree {
    let named =
        |(path, bytes): (PathBuf, _)| Some((if case.drawn { cases::undrawn(&path, root)? } else { path }, bytes));
    tree(root).into_iter().filter_map(named).collect()
}

/// Hidden files and folders of the program, and what is in them.
fn is_hidden(path: &Path) -> bool {
    path.iter().any(|part| part.to_string_lossy().starts_with(".govtwin"))
}

/// Lets two minutes pass for what is left: younger ones may be in the making.
fn age(root: &Path) {
    let then = fs::FileTimes::new().set_modified(std::time::SystemTime::now() - std::time::Duration::from_secs(120));
    for path in tree(root).into_keys().filter(|path| is_hidden(path)) {
        fs::File::open(path).unwrap().set_times(then).unwrap();
    }
}

/// How often each outcome was met.
#[derive(Debug, Default)]
struct Outcomes {
    refused: usize,
    told: usize,
    warned: usize,
    no_matter: usize,
    killed: usize,
    killed_old: usize,
    starved: memory::Starved,
    beside: beside::Beside,
}

struct FaultRun<'a> {
    case: &'a Case,
    /// Where everything is.
    root: PathBuf,
    /// Before the run, and after one without a fault.
    old: Tree,
    new: Tree,
    code: i32,
    requests: usize,
    /// A copy of everything before the run.
    kept: tempfile::TempDir,
}

impl<'a> FaultRun<'a> {
    /// Makes what the writer needs, and sees what it does without a fault; gives the steps as well.
    fn new(case: &'a Case, root: &Path) -> (Self, Vec<Step>) {
        (case.prepare)(root);
        fs::create_dir_all(root.join("tmp")).unwrap();
        let kept = tempfile::tempdir().unwrap();
        copy(root, kept.path());
        let old = seen(case, root);
        let mut run = Self { case, root: root.to_owned(), old, new: Tree::new(), code: 0, requests: 0, kept };
        let first = run.run(None);
        assert!(matches!(first.code, Some(0 | 3)), "{}: {}", case.name, first.stderr);
        run.code = first.code.unwrap();
        run.requests = first.requests;
        run.new = seen(case, root);
        assert!(run.new != run.old, "{}: nothing came of it", case.name);
        let strange: Vec<_> = run.new.keys().filter(|path| is_hidden(path)).collect();
        assert!(strange.is_empty(), "{}: left {strange:?}", case.name);
        (run, first.steps)
    }

    fn run(&self, fault: Option<(usize, Fault)>) -> trace::Traced {
        let mut command = vec![env!("CARGO_BIN_EXE_govtwin").to_owned()];
        command.extend(cases::words(&self.root, self.case.arguments));
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
        let now = seen(self.case, &self.root);
        let names = now.keys().chain(from.keys()).filter(|path| !is_hidden(path));
        let mut other: Vec<_> = names.filter(|path| !self.same(now.get(*path), from.get(*path))).cloned().collect();
        // The system's temporary folder is nobody's output.
        other.retain(|path| !path.starts_with(self.root.join("tmp")));
        other.sort();
        other.dedup();
        other
    }

    fn same(&self, one: Option<&Option<Vec<u8>>>, other: Option<&Option<Vec<u8>>>) -> bool {
        one == other || one.zip(other).is_some_and(|(one, other)| cases::timeless(one) == cases::timeless(other))
    }

    fn hidden(&self) -> Vec<PathBuf> {
        tree(&self.root).into_keys().filter(|path| is_hidden(path)).collect()
    }

    /// Whether everything is the old one or everything the new one; where names are taken one after the other, each for itself.
    fn old_or_new(&self, found: &mut Vec<String>) -> bool {
        let (from_old, from_new) = (self.differs(&self.old), self.differs(&self.new));
        let grown = |path: &Path| {
            !self.case.journal.is_empty()
                && path.ends_with(self.case.journal)
                && fs::read(self.root.join(path))
                    .is_ok_and(|text| serde_json::from_slice::<serde_json::Value>(&text).is_ok())
        };
        let each = self.case.stepwise && from_old.iter().all(|path| !from_new.contains(path) || grown(path));
        if !(from_old.is_empty() || from_new.is_empty() || each) {
            found.push(format!("neither old (other: {from_old:?}) nor new (other: {from_new:?})"));
        }
        from_old.is_empty()
    }

    /// Refuses one step; what is wrong then.
    fn refuse(&self, at: usize, step: &Step, outcomes: &mut Outcomes) -> Vec<String> {
        self.restore();
        let run = self.run(Some((at, Fault::Refused)));
        outcomes.refused += 1;
        let mut found = vec![];
        let step = run.steps.get(at).unwrap_or(step);
        let cause = std::io::Error::from_raw_os_error(step.kind.error() as i32).to_string();
        let from_new = self.differs(&self.new);
        match run.code {
            Some(1) => {
                outcomes.told += 1;
                if !run.stderr.contains(&cause) || !run.stderr.contains(self.root.to_str().unwrap()) {
                    found.push(format!("no cause or no place in {}", run.stderr));
                }
                self.old_or_new(&mut found);
            }
            Some(0 | 3) if from_new.is_empty() => outcomes.no_matter += 1,
            Some(3) if self.tells(&run.stderr, &cause) => outcomes.warned += 1,
            _ => found.push(format!("code {:?}, {from_new:?} is another: {}", run.code, run.stderr)),
        }
        if run.stderr.contains("panicked") {
            found.push(format!("panicked: {}", run.stderr));
        }
        // Where the way to what is to be removed is refused, or removing itself, it stays for the next run; so does a lock that is none.
        let removing = matches!(step.kind, Kind::Remove | Kind::List | Kind::Open | Kind::Look | Kind::Lock);
        if !removing && !self.hidden().is_empty() {
            found.push(format!("left {:?}", self.hidden()));
        }
        self.next(&mut found);
        found
    }

    /// Whether a warning or an output holds some words.
    fn tells(&self, stderr: &str, words: &str) -> bool {
        let holds =
            |bytes: &Option<Vec<u8>>| bytes.as_ref().is_some_and(|b| String::from_utf8_lossy(b).contains(words));
        stderr.contains(words) || tree(&self.root).values().any(holds)
    }

    /// Kills the program before one step; what is wrong then.
    fn kill(&self, at: usize, outcomes: &mut Outcomes) -> Vec<String> {
        self.restore();
        let run = self.run(Some((at, Fault::Killed)));
        let mut found = vec![];
        if let Some(code) = run.code {
            found.push(format!("not killed: exit code {code}"));
        }
        outcomes.killed += 1;
        outcomes.killed_old += usize::from(self.broken_off(&mut found));
        self.next(&mut found);
        found
    }

    /// Judges what one that ended amid its work left; whether that is the old one.
    fn broken_off(&self, found: &mut Vec<String>) -> bool {
        // What a reader does first.
        for folder in tree(&self.root).into_iter().filter_map(|(path, bytes)| bytes.is_none().then_some(path)) {
            if let Err(error) = govtwin_files::settle(&folder.join("anything")) {
                found.push(error.to_string());
            }
        }
        self.clear_temporary();
        self.old_or_new(found)
    }

    fn clear_temporary(&self) {
        let _ = fs::remove_dir_all(self.root.join("tmp"));
        fs::create_dir(self.root.join("tmp")).unwrap();
    }

    /// The same again without a fault.
    fn next(&self, found: &mut Vec<String>) {
        self.clear_temporary();
        (self.case.before_next)(&self.root);
        age(&self.root);
        let run = self.run(None);
        if run.code != Some(self.code) {
            found.push(format!("the next run: code {:?}, {}", run.code, run.stderr));
        }
        let from_new = if self.case.tells_of_before { vec![] } else { self.differs(&self.new) };
        // What a killed try left in a report's folder of a drawn name stays: nobody writes there again.
        let reports = self.root.join("store/reports");
        let mut hidden = self.hidden();
        hidden.retain(|path| !(self.case.drawn && path.starts_with(&reports)));
        if !from_new.is_empty() || !hidden.is_empty() {
            found.push(format!("after the next run {from_new:?} is another, {hidden:?} is left"));
        }
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

/// How many steps of each writer are tried, refused and killed each: some, or `FAULTS`, which may be `all`.
fn sampled(case: &Case) -> usize {
    match std::env::var("FAULTS").as_deref() {
        Err(_) if case.costly => 1,
        Ok("all") => usize::MAX,
        Ok(count) => count.parse().expect("FAULTS: expected `all` or a count"),
        Err(_) => SAMPLED,
    }
}

fn try_case(case: &Case) {
    if !trace::is_allowed() {
        println!("{}: skipped, ptrace is refused here", case.name);
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().canonicalize().unwrap().join("root");
    fs::create_dir(&root).unwrap();
    let (run, steps) = FaultRun::new(case, &root);
    let mut outcomes = Outcomes::default();
    let mut wrong = vec![];
    let mut note =
        |found: Vec<String>, place: String| wrong.extend(found.into_iter().map(|found| format!("{place}: {found}")));
    // Another part of all steps for each writer.
    let stride = steps.len().div_ceil(sampled(case));
    let first = case.name.len() % stride;
    for (at, step) in steps.iter().enumerate().skip(first).step_by(stride) {
        note(
            run.refuse(at, step, &mut outcomes),
            format!("step {at}, {:?} of {} refused", step.kind, step.path.display()),
        );
    }
    let changing: Vec<_> = steps.iter().enumerate().filter(|(_, step)| step.kind.changes()).collect();
    let stride = changing.len().div_ceil(sampled(case));
    for (at, step) in changing.into_iter().rev().step_by(stride) {
        note(
            run.kill(at, &mut outcomes),
            format!("killed before step {at}, {:?} of {}", step.kind, step.path.display()),
        );
    }
    let stride = run.requests.div_ceil(memory::sampled(case)).max(1);
    for at in (0..run.requests).rev().step_by(stride) {
        note(run.starve(at, &mut outcomes.starved), format!("no memory from request {at} on"));
    }
    // What it says depends on what ran before it.
    if !case.tells_of_before {
        note(run.beside(&mut outcomes.beside), "others beside it".to_owned());
    }
    let mut kinds = BTreeMap::new();
    for step in &steps {
        *kinds.entry(step.kind).or_insert(0) += 1;
    }
    println!("{}: {} steps {kinds:?}, {} requests for memory, {outcomes:?}", case.name, steps.len(), run.requests);
    assert!(
        wrong.is_empty(),
        "{}: {} faults\n{}",
        case.name,
        wrong.len(),
        wrong.join("\n").replace(root.to_str().unwrap(), "ROOT")
    );
}

macro_rules! tests {
    ($($(#[$mark:meta])* $place:ident::$name:ident)*) => { $(#[test] $(#[$mark])* fn $name() { try_case(&$place::$name()); })* };
}

tests! {
    cases::replay cases::generate cases::fit cases::diagnose cases::import cases::import_suggest cases::accept cases::man
    cases::fleet_plan cases::fleet_gather cases::recover cases::report cases::sheet laboratory::calibrate
    #[ignore = "a minute of diagnoses; scripts/faults runs it"]
    cases::fleet_run
    #[ignore = "a minute of diagnoses; scripts/faults runs it"]
    cases::watch
    #[ignore = "a minute of diagnoses; scripts/faults runs it"]
    laboratory::blind
    #[ignore = "a minute of simulations; scripts/faults runs it"]
    laboratory::battery
    #[cfg(feature = "residual")]
    #[ignore = "minutes of training; scripts/faults runs it"]
    laboratory::train
    #[cfg(feature = "residual")]
    #[ignore = "minutes of training; scripts/faults runs it"]
    laboratory::compare
}
