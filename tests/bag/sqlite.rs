//! Bags in sqlite3 storage, made by an independent writer.

use std::path::{Path, PathBuf};

use govtwin_bag::{BagError, ReadOptions, Warning};

use super::make::{BEGIN_NS, MS, in_file};

fn run() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/sqlite/run")
}

#[test]
fn a_sqlite_bag_reads_like_any_other() {
    let loaded = govtwin_bag::read(&run(), &ReadOptions::default()).unwrap();
    assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
    assert_eq!(loaded.health.files[0].storage, "sqlite3");
    assert_eq!(loaded.recording.frames.len(), 40);
    for (step, frame) in loaded.recording.frames.iter().enumerate() {
        assert_eq!(frame.time_ns, BEGIN_NS + step as i64 * 50 * MS);
        assert_eq!(frame.inputs.opening_command_pu, 0.2 + step as f64 / 1000.0);
        assert_eq!(frame.measured.control_pressure_pa, 2.0e6);
    }
    let messages: Vec<_> = govtwin_bag::messages(&run()).unwrap().map(Result::unwrap).collect();
    assert_eq!(messages.len(), 40 + 40 + 8 + 2);
    assert!(messages.windows(2).all(|pair| pair[0].log_time_ns <= pair[1].log_time_ns));
    let survey = govtwin_bag::survey(&run()).unwrap();
    assert!(survey.topics.iter().all(|topic| topic.type_hash_fits == Some(true)), "{:?}", survey.topics);
}

#[test]
fn damaged_databases_are_errors_or_warnings() {
    let file = std::fs::read_dir(run()).unwrap().map(|entry| entry.unwrap().path());
    let file = file.into_iter().find(|path| path.extension().is_some_and(|suffix| suffix == "db3")).unwrap();
    let bytes = std::fs::read(file).unwrap();
    for len in (100..bytes.len()).step_by(1777) {
        let (_folder, path) = in_file(&bytes[..len]);
        match govtwin_bag::read(&path, &ReadOptions::default()) {
            Ok(loaded) => {
                let damaged = |warning: &Warning| matches!(warning, Warning::Damaged { .. });
                assert!(loaded.health.warnings.iter().any(damaged), "cut at {len} without a word");
            }
            Err(error) => assert!(
                matches!(error, BagError::Database { .. } | BagError::Empty { .. } | BagError::Missing { .. }),
                "{error}"
            ),
        }
    }
}
