//! `govtwin record` and `govtwin run --bag`: what they hear differs from run to run, so that each trial is judged by itself and not by a run
//! without a fault.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::trace::{self, Fault, Kind, Traced};
use super::{is_hidden, tree};

/// A domain of its own, on this machine alone.
fn environment(temporary: &str) -> [(&'static str, String); 3] {
    let domain = 100 + std::process::id() % 100;
    [("ROS_DOMAIN_ID", domain.to_string()), ("ROS_LOCALHOST_ONLY", "1".into()), ("TMPDIR", temporary.into())]
}

/// Somebody who publishes, until dropped: a child of a thread of its own, since the tracer waits for all children of the thread that it is in.
struct Playing(Option<(Sender<()>, JoinHandle<()>)>);

impl Playing {
    fn new(temporary: &str) -> Self {
        let bag = format!("{}/bags/reference/startup_01.mcap", env!("CARGO_MANIFEST_DIR"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
        command.args(["play", &bag, "--loop", "--wait", "0"]).envs(environment(temporary));
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let (end, ended) = channel();
        let playing = std::thread::spawn(move || {
            let mut child = command.spawn().unwrap();
            let _ = ended.recv();
            child.kill().unwrap();
            child.wait().unwrap();
        });
        Self(Some((end, playing)))
    }
}

impl Drop for Playing {
    fn drop(&mut self) {
        if let Some((end, playing)) = self.0.take() {
            drop(end);
            let _ = playing.join();
        }
    }
}

/// Who writes what is heard; the bag is `ROOT/run`.
#[derive(Clone, Copy)]
struct Writer {
    arguments: &'static str,
    /// Another output, which appears whole or not at all.
    figures: Option<&'static str>,
}

const RECORD: Writer = Writer { arguments: "record --out ROOT/run --duration 4", figures: None };

/// It goes on where its bag cannot: that is told, and nothing else comes of it.
const NODE: Writer = Writer {
    arguments: "run --bag ROOT/run --out ROOT/figures.json --duration 4 --priority 0",
    figures: Some("figures.json"),
};

/// A writer's own folder for temporary files, empty.
fn temporary(root: &Path) -> PathBuf {
    let temporary = root.join("tmp");
    let _ = fs::remove_dir_all(&temporary);
    fs::create_dir(&temporary).unwrap();
    temporary
}

/// Records for some seconds; a step has a fault.
fn run(writer: Writer, root: &Path, fault: Option<(usize, Fault)>) -> Traced {
    let temporary = temporary(root);
    let mut command = vec![env!("CARGO_BIN_EXE_govtwin").to_owned()];
    command.extend(super::cases::words(root, writer.arguments));
    let command: Vec<&str> = command.iter().map(String::as_str).collect();
    let environment = environment(temporary.to_str().unwrap());
    let environment: Vec<(&str, &str)> = environment.iter().map(|(key, value)| (*key, value.as_str())).collect();
    let traced = trace::run(&command, &environment, root, fault);
    let _ = fs::remove_dir_all(&temporary);
    traced
}

/// Records while others of the same command come and are killed; what is wrong then with what the first one left, and how many others there were.
fn beside(writer: Writer, root: &Path) -> (Vec<String>, usize) {
    let temporary = temporary(root);
    let start = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
        command.args(super::cases::words(root, writer.arguments)).envs(environment(temporary.to_str().unwrap()));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let (mut first, mut others) = (start(), 0);
    while first.try_wait().unwrap().is_none() && !root.join(".run.unfinished").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    for life_ms in super::beside::LIVES_MS.iter().cycle() {
        if first.try_wait().unwrap().is_some() {
            break;
        }
        let mut other = start();
        std::thread::sleep(Duration::from_millis(*life_ms));
        other.kill().unwrap();
        other.wait().unwrap();
        others += 1;
    }
    let first = first.wait_with_output().unwrap();
    let _ = fs::remove_dir_all(&temporary);
    let mut found = vec![];
    // The node goes on without its bag, which is not what was asked for here.
    if !matches!(first.status.code(), Some(0 | 3)) || !root.join("run").exists() {
        found.push(format!("the first: {:?}, {}", first.status, String::from_utf8_lossy(&first.stderr)));
    }
    (found, others)
}

/// What is wrong with the bag, where there is one; one that ended before anything was heard has no message.
fn wrong(root: &Path, may_be_empty: bool) -> Option<String> {
    let survey = match govtwin_bag::survey(&root.join("run")) {
        Ok(survey) => survey,
        Err(error) => return Some(error.to_string()),
    };
    let is_empty = survey.messages == 0 && !may_be_empty;
    (!survey.warnings.is_empty() || is_empty).then(|| format!("{survey:?}"))
}

/// Judges what a run left, saves what was kept of it, and lets another one follow.
fn judge(writer: Writer, root: &Path, told: Option<(&Traced, Kind)>) -> Vec<String> {
    let mut found = vec![];
    if let Some(figures) = writer.figures.map(|name| root.join(name)).filter(|path| path.exists()) {
        let whole = fs::read_to_string(&figures).is_ok_and(|text| serde_json::from_str::<Value>(&text).is_ok());
        found.extend((!whole).then(|| "half of the figures".to_owned()));
        fs::remove_file(figures).unwrap();
    }
    let out = root.join("run");
    if let Some((traced, kind)) = told {
        let cause = std::io::Error::from_raw_os_error(kind.error() as i32).to_string();
        let named = traced.stderr.contains(&cause) && traced.stderr.contains(root.to_str().unwrap());
        match traced.code {
            Some(1) if !named => found.push(format!("no cause or no place in {}", traced.stderr)),
            Some(1) => {}
            Some(0 | 3) if out.is_dir() => {}
            Some(3) if writer.figures.is_some() && named => {}
            code => found.push(format!("code {code:?} and no bag: {}", traced.stderr)),
        }
        if traced.stderr.contains("panicked") {
            found.push(format!("panicked: {}", traced.stderr));
        }
    }
    let kept = root.join(".run.unfinished");
    let mut may_be_empty = false;
    if !out.exists() && kept.exists() {
        let mut recover = Command::new(env!("CARGO_BIN_EXE_govtwin"));
        let recovered = recover.arg("recover").arg(&out).output().unwrap();
        // What had reached the disk; before the first message, nothing had.
        let held = govtwin_bag::survey(&kept).map_or(0, |survey| survey.messages);
        may_be_empty = held == 0;
        let saved = govtwin_bag::survey(&out).map_or(0, |survey| survey.messages);
        if saved != held {
            let told = String::from_utf8_lossy(&recovered.stderr).into_owned();
            found.push(format!("{saved} of {held} messages that were kept are saved: {told}"));
        }
        // Saving it leaves it where it is, for the user to throw away.
        fs::remove_dir_all(&kept).unwrap();
    }
    if out.exists() {
        found.extend(wrong(root, may_be_empty));
        fs::remove_dir_all(&out).unwrap();
    }
    super::age(root);
    let again = run(writer, root, None);
    if !matches!(again.code, Some(0 | 3)) || !out.exists() {
        found.push(format!("the next run: code {:?}, {}", again.code, again.stderr));
    } else {
        found.extend(wrong(root, false));
        fs::remove_dir_all(&out).unwrap();
    }
    if let Some(name) = writer.figures {
        found.extend(fs::remove_file(root.join(name)).is_err().then(|| "no figures of the next run".to_owned()));
    }
    let strange = |path: &PathBuf| is_hidden(path) || path.to_string_lossy().contains("unfinished");
    let left: Vec<_> = tree(root).into_keys().filter(strange).collect();
    if !left.is_empty() {
        found.push(format!("left {left:?}"));
        for path in left {
            let _ = fs::remove_dir_all(&path).or_else(|_| fs::remove_file(&path));
        }
    }
    if fs::read_to_string(root.join("diary")).ok().as_deref() != Some("mine") {
        found.push("another's file was touched".to_owned());
    }
    found
}

#[test]
#[ignore = "records for minutes; scripts/faults runs it"]
fn record() {
    try_writer(RECORD);
}

#[test]
#[ignore = "records for minutes; scripts/faults runs it"]
fn run_of_a_node() {
    try_writer(NODE);
}

fn try_writer(writer: Writer) {
    let name = writer.arguments.split(' ').next().unwrap();
    if !trace::is_allowed() {
        println!("{name}: skipped, ptrace is refused here");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().canonicalize().unwrap().join("root");
    fs::create_dir(&root).unwrap();
    fs::write(root.join("diary"), "mine").unwrap();
    let _playing = Playing::new(dir.path().to_str().unwrap());
    let first = run(writer, &root, None);
    assert!(matches!(first.code, Some(0 | 3)), "{}", first.stderr);
    assert_eq!(wrong(&root, false), None);
    fs::remove_dir_all(root.join("run")).unwrap();
    writer.figures.into_iter().for_each(|name| fs::remove_file(root.join(name)).unwrap());
    let sampled = match std::env::var("FAULTS").as_deref() {
        Ok("all") => usize::MAX,
        Ok(count) => count.parse().unwrap(),
        Err(_) => 4,
    };
    let (mut refused, mut killed, mut told, mut faults) = (0, 0, 0, vec![]);
    for at in (0..first.steps.len()).step_by(first.steps.len().div_ceil(sampled)) {
        let traced = run(writer, &root, Some((at, Fault::Refused)));
        // It may have ended before, where it heard less.
        let Some(step) = traced.steps.get(at).cloned() else { continue };
        refused += 1;
        told += usize::from(traced.code == Some(1));
        let found = judge(writer, &root, Some((&traced, step.kind)));
        faults.extend(found.into_iter().map(|found| format!("step {at}, {step:?} refused: {found}")));
    }
    let changing: Vec<_> = first.steps.iter().enumerate().filter(|(_, step)| step.kind.changes()).collect();
    for (at, step) in changing.iter().rev().step_by(changing.len().div_ceil(sampled)) {
        let traced = run(writer, &root, Some((*at, Fault::Killed)));
        killed += usize::from(traced.code.is_none());
        let found = judge(writer, &root, None);
        faults.extend(found.into_iter().map(|found| format!("killed before step {at}, {step:?}: {found}")));
    }
    let most = sampled.min(super::memory::MOST);
    let (mut starved, mut ended) = (0, 0);
    for at in (0..first.requests).rev().step_by(first.requests.div_ceil(most).max(1)) {
        let traced = run(writer, &root, Some((at, Fault::Starved)));
        starved += 1;
        ended += usize::from(!matches!(traced.code, Some(0 | 3)));
        let known = matches!(traced.code, None | Some(0 | 1 | 3 | 127)) || traced.stderr.contains("thread");
        let mut found = judge(writer, &root, None);
        found.extend((!known).then(|| format!("code {:?}: {}", traced.code, traced.stderr)));
        faults.extend(found.into_iter().map(|found| format!("no memory from request {at} on: {found}")));
    }
    let (mut found, others) = beside(writer, &root);
    found.extend(judge(writer, &root, None));
    faults.extend(found.into_iter().map(|found| format!("others beside it: {found}")));
    println!(
        "{name}: {} steps, {refused} refused, {told} told, {killed} killed; {} requests for memory, from {starved} on without, {ended} ended \
         by it; {others} others beside it",
        first.steps.len(),
        first.requests
    );
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}
