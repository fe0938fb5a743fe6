//! The writers of the laboratory: batteries, what is learned from them, and what is learned of residuals.

use std::fs;

use govtwin_diagnosis::result::Verdict;
use govtwin_diagnosis::result::schema::DiagnosisReport;

use super::cases::{self, Case, PLAIN};

pub fn blind() -> Case {
    Case {
        name: "blind",
        arguments: "blind ROOT/new --params ROOT/sheet.yaml --out ROOT/out",
        prepare: |root| {
            cases::recordings(root);
            // A unit is a folder in another.
            fs::create_dir(root.join("new/unit")).unwrap();
            fs::rename(root.join("new/run"), root.join("new/unit/run")).unwrap();
            fs::create_dir(root.join("out")).unwrap();
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        stepwise: true,
        costly: true,
        ..PLAIN
    }
}

#[cfg(feature = "residual")]
pub fn train() -> Case {
    Case {
        name: "train",
        arguments: "train ROOT/new/run --manual --out ROOT/out",
        prepare: |root| {
            cases::recordings(root);
            cases::govtwin(root, "train old/run --manual --out out");
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        ..PLAIN
    }
}

#[cfg(feature = "residual")]
pub fn compare() -> Case {
    Case {
        name: "compare",
        arguments: "compare ROOT/new/run --quick --iterations 10 --out ROOT/out",
        prepare: |root| {
            cases::recordings(root);
            fs::create_dir(root.join("out")).unwrap();
            fs::write(root.join("out/compare.json"), "older, of govtwin").unwrap();
            fs::write(root.join("out/diary"), "mine").unwrap();
        },
        // So that a run that was broken off goes on.
        journal: "search.json",
        stepwise: true,
        costly: true,
        ..PLAIN
    }
}

pub fn battery() -> Case {
    Case {
        name: "blind --generate",
        arguments: "blind ROOT/units --generate 1 --rate 5 --unchecked",
        prepare: |root| {
            // Nothing is diagnosed: the report is there.
            fs::create_dir_all(root.join("units/case_001")).unwrap();
            fs::write(root.join("units/case_001/report.json"), report()).unwrap();
            fs::write(root.join("units/diary"), "mine").unwrap();
        },
        // Recordings, answers and score are kept one after the other, each whole.
        stepwise: true,
        costly: true,
        ..PLAIN
    }
}

pub fn calibrate() -> Case {
    Case {
        name: "calibrate",
        arguments: "calibrate ROOT/units --out ROOT/weights.json",
        prepare: |root| {
            cases::recordings(root);
            cases::diagnosis(root);
            fs::create_dir_all(root.join("units/answers")).unwrap();
            fs::rename(root.join("out"), root.join("units/one")).unwrap();
            fs::write(root.join("units/answers/labels.yaml"), "one: {effects: []}\n").unwrap();
            fs::write(root.join("units/answers/strengths.yaml"), "one: 1.5\n").unwrap();
            fs::write(root.join("units/score.json"), r#"{"closures": {"one": 0.5}}"#).unwrap();
            fs::write(root.join("weights.json"), "older, of govtwin").unwrap();
        },
        ..PLAIN
    }
}

/// A report of no difference, of what it does not say.
fn report() -> String {
    DiagnosisReport::of_verdict(Verdict::NoGap).json().to_string()
}
