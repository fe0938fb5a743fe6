//! The writers, and what each of them needs: an older output where one may be replaced, and inputs of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A fixed date, one thread so that steps come in one order, and no engine.
pub const ENVIRONMENT: [(&str, &str); 2] = [("SOURCE_DATE_EPOCH", "1700000000"), ("RAYON_NUM_THREADS", "1")];

/// A writer.
pub struct Case {
    pub name: &'static str,
    /// What is typed, with spaces between; `ROOT` stands for the folder of everything.
    pub arguments: &'static str,
    pub prepare: fn(&Path),
    /// Several outputs that take their names one after the other, each of them whole.
    pub stepwise: bool,
    /// What a user does before the next run, where the last one tells it.
    pub before_next: fn(&Path),
    /// Says what changed since it ran last, so that another run says something else.
    pub tells_of_before: bool,
    /// Takes seconds a run: one step of it is tried in the ordinary tests.
    pub costly: bool,
    /// Name of a journal that grows while it works, whole JSON at any moment; empty where there is none.
    pub journal: &'static str,
    /// Draws the names of its reports, and leaves a note of each try that failed: the one are compared whatever their names, the other not at all.
    pub drawn: bool,
}

fn nothing(_: &Path) {}

/// What most of them are like.
pub const PLAIN: Case = Case {
    name: "",
    arguments: "",
    prepare: nothing,
    stepwise: false,
    before_next: nothing,
    tells_of_before: false,
    costly: false,
    journal: "",
    drawn: false,
};

pub fn replay() -> Case {
    Case {
        name: "replay",
        arguments: "replay ROOT/new/run --out ROOT/out",
        prepare: |root| {
            recordings(root);
            govtwin(root, "replay old/run --out out");
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

pub fn generate() -> Case {
    Case {
        name: "generate",
        arguments: "generate --duration 30 --rate 10 --out ROOT/out",
        prepare: |root| fs::write(root.join("diary"), "mine").unwrap(),
        stepwise: true,
        // Broken off between two names, it is refused as a folder of others would be.
        before_next: |root| drop(fs::remove_dir_all(root.join("out"))),
        ..PLAIN
    }
}

pub fn fit() -> Case {
    Case {
        name: "fit",
        arguments: "fit ROOT/new/run --params ROOT/sheet.yaml --effect port_overlap --starts 1 --out ROOT/out",
        prepare: |root| {
            recordings(root);
            govtwin(root, "fit old/run --params sheet.yaml --effect port_overlap --starts 1 --out out");
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

pub fn diagnose() -> Case {
    Case {
        name: "diagnose",
        arguments: "diagnose ROOT/new/run --params ROOT/sheet.yaml WITHOUT --out ROOT/out --overwrite",
        prepare: |root| {
            recordings(root);
            diagnosis(root);
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        costly: true,
        ..PLAIN
    }
}

pub fn import() -> Case {
    Case {
        name: "import",
        arguments: "import ROOT/table.csv --map ROOT/look/map.yaml --out ROOT/out",
        prepare: |root| {
            let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import/pandas_iso.csv");
            let table = fs::read_to_string(fixture).unwrap();
            fs::write(root.join("table.csv"), &table).unwrap();
            govtwin(root, "import --suggest table.csv --out look");
            let shorter: Vec<&str> = table.lines().take(200).collect();
            fs::write(root.join("table.csv"), shorter.join("\n")).unwrap();
            govtwin(root, "import table.csv --map look/map.yaml --out out");
            fs::write(root.join("table.csv"), table).unwrap();
            fs::write(root.join("diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

pub fn import_suggest() -> Case {
    Case {
        name: "import --suggest",
        arguments: "import --suggest ROOT/table.csv --out ROOT/out",
        prepare: |root| {
            let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import/pandas_iso.csv");
            fs::copy(fixture, root.join("table.csv")).unwrap();
            // The map is the same again: a mended one would be in the way.
            govtwin(root, "import --suggest table.csv --out out");
            fs::write(root.join("out/suggestion.html"), "older, of govtwin").unwrap();
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

pub fn accept() -> Case {
    Case {
        name: "accept",
        arguments: "accept ROOT/new/run --measure-only --params ROOT/sheet.yaml --out ROOT/out",
        prepare: |root| {
            recordings(root);
            govtwin(root, "accept old/run --measure-only --params sheet.yaml --out out");
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

pub fn man() -> Case {
    Case {
        name: "man",
        arguments: "man --out ROOT/out",
        prepare: |root| {
            fs::create_dir(root.join("out")).unwrap();
            fs::write(root.join("out/govtwin.1"), "older, of govtwin").unwrap();
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

pub fn watch() -> Case {
    Case {
        name: "watch",
        arguments: "watch ROOT/seen --once --params ROOT/sheet.yaml --only port_overlap --out ROOT/out",
        prepare: |root| {
            recordings(root);
            fs::create_dir(root.join("seen")).unwrap();
            fs::rename(root.join("old/run"), root.join("seen/first")).unwrap();
            govtwin(root, "watch seen --once --params sheet.yaml --only port_overlap --out out");
            fs::rename(root.join("new/run"), root.join("seen/second")).unwrap();
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        // The history grows line by line; the page follows.
        stepwise: true,
        costly: true,
        ..PLAIN
    }
}

pub fn fleet_plan() -> Case {
    Case {
        name: "fleet plan",
        arguments: "fleet plan ROOT/units --units ROOT/units.csv --out ROOT/store",
        prepare: fleet,
        stepwise: true,
        ..PLAIN
    }
}

pub fn fleet_gather() -> Case {
    Case {
        name: "fleet gather",
        arguments: "fleet gather ROOT/store",
        prepare: |root| {
            fleet(root);
            planned(root);
            govtwin(root, "fleet gather store");
            govtwin(root, "fleet run store --out store");
        },
        tells_of_before: true,
        ..PLAIN
    }
}

pub fn fleet_run() -> Case {
    Case {
        name: "fleet run",
        arguments: "fleet run ROOT/store --out ROOT/store",
        prepare: |root| {
            fleet(root);
            planned(root);
        },
        // Report and result are objects of their own.
        stepwise: true,
        costly: true,
        drawn: true,
        ..PLAIN
    }
}

pub fn recover() -> Case {
    Case {
        name: "recover",
        arguments: "recover ROOT/old/run/run_0.mcap --out ROOT/out",
        prepare: |root| {
            recordings(root);
            let file = root.join("old/run/run_0.mcap");
            let mut bytes = fs::read(&file).unwrap();
            bytes.truncate(bytes.len() / 2);
            fs::write(file, bytes).unwrap();
        },
        // It replaces nothing.
        before_next: |root| drop(fs::remove_dir_all(root.join("out"))),
        ..PLAIN
    }
}

pub fn report() -> Case {
    Case {
        name: "report",
        arguments: "report ROOT/out/report.json",
        prepare: |root| {
            recordings(root);
            diagnosis(root);
            fs::write(root.join("out/report.html"), "older, of govtwin").unwrap();
        },
        ..PLAIN
    }
}

pub fn sheet() -> Case {
    Case {
        name: "sheet new",
        arguments: "sheet new ROOT/plate.yaml --quick --out ROOT/unit.yaml",
        prepare: |root| {
            let plate = "name: ours\ntank_pressure: 63 bar\nservomotor_stroke: 600 mm\nservomotor_volume: 120 L\n";
            fs::write(root.join("plate.yaml"), plate).unwrap();
        },
        // A sheet may have been mended by hand: it replaces none.
        before_next: |root| drop(fs::remove_file(root.join("unit.yaml"))),
        ..PLAIN
    }
}

/// Runs the program in a folder; exit codes 0 and 3 are good.
pub fn govtwin(root: &Path, arguments: &str) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    let run = command.current_dir(root).args(words(root, arguments)).envs(ENVIRONMENT).output().unwrap();
    assert!(matches!(run.status.code(), Some(0 | 3)), "{}", String::from_utf8_lossy(&run.stderr));
}

/// What is typed, `WITHOUT` standing for all effects but one, so that a diagnosis is quick.
pub fn words(root: &Path, arguments: &str) -> Vec<String> {
    let without: String = others().map(|id| format!(" --without {id}")).collect();
    let typed = arguments.replace("WITHOUT", &without);
    typed.split_whitespace().map(|word| word.replace("ROOT", root.to_str().unwrap())).collect()
}

/// All effects but one.
fn others() -> impl Iterator<Item = &'static str> {
    govtwin_model::effects::CATALOGUE.iter().map(|spec| spec.id).filter(|id| *id != "port_overlap")
}

/// Two recordings of one name, `old/run` and `new/run`, and a sheet in which nothing has a tolerance, so that a diagnosis is quick.
pub fn recordings(root: &Path) {
    for (folder, size) in [("old", "1e-4"), ("new", "3e-4")] {
        let fixed = "generate --process load_rejection --rate 20 --spread off --duration 30";
        govtwin(root, &format!("{fixed} --effect port_overlap={size} --out {folder}"));
        fs::remove_file(root.join(folder).join("truth.yaml")).unwrap();
        fs::rename(root.join(folder).join("load_rejection"), root.join(folder).join("run")).unwrap();
        let run = root.join(folder).join("run");
        fs::rename(run.join("load_rejection_0.mcap"), run.join("run_0.mcap")).unwrap();
        let text = fs::read_to_string(run.join("metadata.yaml")).unwrap();
        fs::write(run.join("metadata.yaml"), text.replace("load_rejection_0", "run_0")).unwrap();
    }
    super::tight_sheet::write(root);
}

pub fn diagnosis(root: &Path) {
    govtwin(root, "diagnose old/run --params sheet.yaml WITHOUT --out out");
}

/// A unit, and a table that names it.
fn fleet(root: &Path) {
    recordings(root);
    fs::create_dir_all(root.join("units/one")).unwrap();
    fs::rename(root.join("new/run"), root.join("units/one/run")).unwrap();
    let without = others().collect::<Vec<_>>().join(" ");
    fs::write(root.join("units.csv"), format!("unit,sheet,without\none,sheet.yaml,{without}\n")).unwrap();
}

fn planned(root: &Path) {
    govtwin(root, "fleet plan units --units units.csv --out store");
}

/// What a run says of itself: times, memory, and the name that it drew.
const OF_THE_RUN: [&str; 5] = ["seconds\":", "elapsed_s\":", "processor_s\":", "peak_memory_bytes\":", "\"report\":"];

/// A file's bytes without what was measured of the run itself.
pub fn timeless(bytes: &Option<Vec<u8>>) -> Option<Vec<u8>> {
    let text = String::from_utf8_lossy(bytes.as_ref()?).into_owned();
    let mut kept = String::new();
    let mut rest = text.as_str();
    let next = |rest: &str| OF_THE_RUN.iter().filter_map(|key| Some(rest.find(key)? + key.len())).min();
    while let Some(at) = next(rest) {
        let (before, after) = rest.split_at(at);
        kept += before;
        rest = if before.ends_with("\"report\":") {
            after.trim_start_matches(|c: char| !matches!(c, ',' | '}' | '\n'))
        } else {
            after.trim_start_matches(|c: char| c == ' ' || c == '.' || c == 'e' || c == '-' || c.is_ascii_digit())
        };
    }
    kept += rest;
    Some(kept.into_bytes())
}

/// A path without the name that a fleet's report drew; nothing for a note of a try that failed.
pub fn undrawn(path: &Path, root: &Path) -> Option<PathBuf> {
    let parts: Vec<_> = path.strip_prefix(root.join("store")).into_iter().flatten().collect();
    if parts.first().is_some_and(|part| *part == "notes") {
        return None;
    }
    if parts.len() < 3 || parts[0] != "reports" {
        return Some(path.to_owned());
    }
    let below = parts[3..].iter().collect::<PathBuf>();
    Some(root.join("store").join(parts[0]).join(parts[1]).join("drawn").join(below))
}
