//! What a watch says on the bus: a size that moves beyond its interval warns in the verdict and in `/diagnostics`.

use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use govtwin_bag::msg::{Interface, Time, UnitVerdict};
use govtwin_diagnosis::watch::history::{ProcessEntry, ProcessSize, SCHEMA, courses, write};
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::diagnostics::{DiagnosticArray, DiagnosticStatus, TYPE_NAME};
use govtwin_node::environment::Environment;
use serde::{Deserialize, Serialize};

use super::{generate, tight_sheet};

/// Processes between two false alarms, as without the option.
const BETWEEN: f64 = 1000.0;
/// The size that `generate` puts into a recording, m.
const NOW_M: f64 = 3e-4;
/// What the bus is called for these tests alone.
const NAME: &str = "/unit3/govtwin_watch";

/// The message as a monitor takes it.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
struct Health(DiagnosticArray);

impl Interface for Health {
    const TYPE_NAME: &'static str = TYPE_NAME;

    fn stamp(&self) -> Option<Time> {
        Some(self.0.header.stamp)
    }
}

/// A load rejection that showed the overlap of this size.
fn entry(i: u32, value: f64) -> ProcessEntry {
    let size = ProcessSize {
        effect: "port_overlap".into(),
        parameter: "extra_overlap_m".into(),
        unit: "m".into(),
        value,
        ci90: [value - 5e-6, value + 5e-6],
        named: true,
    };
    ProcessEntry {
        schema: SCHEMA.into(),
        digest: i.to_string(),
        bag: "earlier".into(),
        synthetic: true,
        origin: None,
        time_ns: 1_000_000_000 * i64::from(i),
        duration_s: 40.0,
        process: "load_rejection".into(),
        verdict: "named".into(),
        explained_fraction: None,
        sizes: vec![size],
        notes: vec![],
        warnings: vec![],
        program: "govtwin".into(),
    }
}

/// A history that stays, and grows in its last processes, so that one of [`NOW_M`] is the one that tells.
fn on_the_brink() -> Vec<ProcessEntry> {
    let warns = |entries: &[ProcessEntry]| courses(entries, BETWEEN).iter().any(|course| course.warning().is_some());
    let mut entries: Vec<_> = (0..30).map(|i| entry(i, 1.5e-4 + 1e-6 * (f64::from(i * 7 % 5) - 2.0))).collect();
    loop {
        let i = entries.len() as u32;
        entries.push(entry(i, NOW_M));
        if warns(&entries) {
            entries.pop();
            return entries;
        }
        entries.pop();
        entries.push(entry(i, 1.6e-4 + 2e-6 * f64::from(i - 30)));
    }
}

/// Ends with the test, however that ends.
struct Watching(Child);

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits for a message of which this holds.
fn heard<M>(what: &str, mut take: impl FnMut() -> Option<M>, holds: impl Fn(&M) -> bool) -> M {
    let until = Instant::now() + Duration::from_secs(120);
    loop {
        while let Some(message) = take() {
            if holds(&message) {
                return message;
            }
        }
        assert!(Instant::now() < until, "{what}: waited two minutes in vain");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn status<'a>(health: &'a Health, part: &str) -> Option<&'a DiagnosticStatus> {
    health.0.status.iter().find(|status| status.name == format!("{NAME}: {part}"))
}

#[test]
fn a_size_that_moves_beyond_its_interval_warns_on_the_bus() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    tight_sheet::write(folder);
    fs::create_dir(folder.join("unit")).unwrap();
    fs::create_dir(folder.join("seen")).unwrap();
    let before = on_the_brink();
    fs::write(folder.join("seen/history.jsonl"), write(&before).unwrap()).unwrap();
    // A domain of its own, so that tests that run beside this one are not heard.
    let domain = (101 + std::process::id() % 100).to_string();
    let variables = [("ROS_DOMAIN_ID", domain.as_str()), ("ROS_LOCALHOST_ONLY", "1")];
    let value = |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
    let environment = Environment::read(value).unwrap();
    let mut peer = Bus::open(&environment, Arguments::parse(&[], "monitor").unwrap()).unwrap();
    let verdicts = peer.subscribe::<UnitVerdict>(&format!("{NAME}/verdict")).unwrap();
    let diagnostics = peer.subscribe::<Health>("/diagnostics").unwrap();
    let mut verdict = || verdicts.take().ok().flatten().map(|(message, _)| message);
    let mut health = || diagnostics.take().ok().flatten().map(|(message, _)| message);
    let arguments = "watch unit --params sheet.yaml --only port_overlap --out seen --every 1 --settled 1 --publish \
                     --ros-args -r __ns:=/unit3";
    let watching = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .envs(variables)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let _watching = Watching(watching.unwrap());

    let calm =
        heard("the history as it is", &mut health, |health| status(health, "port_overlap.extra_overlap_m").is_some());
    assert!(calm.0.status.iter().all(|status| status.level == 0), "{:?}", calm.0);
    assert!(status(&calm, "verdict").unwrap().message.ends_with("no size has moved"), "{:?}", calm.0);

    generate(folder, "unit/monday", "1");
    let said = heard("the verdict", &mut verdict, |said| said.processes as usize == before.len() + 1);
    assert_eq!((said.header.frame_id.as_str(), said.process.as_str()), ("unit", "load_rejection"));
    assert_eq!(said.sizes.len(), 1, "{said:?}");
    let size = &said.sizes[0];
    assert_eq!((size.effect.as_str(), size.parameter.as_str()), ("port_overlap", "extra_overlap_m"));
    assert!(size.moved && size.growth >= size.limit && size.mean_before < size.low, "{size:?}");
    assert!(size.low < NOW_M && NOW_M < size.high, "{size:?}");
    assert_eq!(said.warnings.len(), 1, "{said:?}");
    assert!(said.warnings[0].contains(" has grown: "), "{said:?}");

    let warned = heard("the warning", &mut health, |health| status(health, "verdict").is_some_and(|one| one.level > 0));
    let [whole, moved] = ["verdict", "port_overlap.extra_overlap_m"].map(|part| status(&warned, part).unwrap());
    assert_eq!((whole.level, &whole.message, moved.level), (1, &said.warnings[0], 1));
    assert!(moved.message.starts_with("has grown: "), "{moved:?}");
    assert!(warned.0.status.iter().all(|status| status.hardware_id == "unit"), "{:?}", warned.0);
}
