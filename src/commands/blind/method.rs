//! The methods that judge a unit: the diagnosis, and the baselines. Neither sees a label.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin::baselines::ground::Ground;
use govtwin::baselines::{BASELINES, Baseline};
use govtwin::blind::said::Said;
use govtwin::parameters::Unit;

use super::cases::Case;
use crate::commands::output::write_atomically;

/// A method that says something of a unit.
#[derive(Clone, Copy, Debug)]
pub enum Method {
    /// One of the baselines.
    Baseline(&'static Baseline),
}

impl Method {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline(baseline) => baseline.id,
        }
    }

    /// Where it leaves what it said of a unit.
    pub fn report(self, out: &Path, case: &str) -> PathBuf {
        match self {
            Self::Baseline(baseline) => out.join(case).join(format!("baseline_{}.json", baseline.id)),
        }
    }

    /// What it said of a unit; none where it has not spoken.
    pub fn said(self, out: &Path, case: &str) -> anyhow::Result<Option<Said>> {
        let path = self.report(out, case);
        if !path.is_file() {
            return Ok(None);
        }
        let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        Said::read(&text).with_context(|| path.display().to_string()).map(Some)
    }
}

/// The methods asked for.
pub fn methods(_baselines: bool, _only: bool) -> Vec<Method> {
    BASELINES.iter().map(Method::Baseline).collect()
}

/// Lets every method judge a unit, unless its report is there already.
pub fn judge(case: &Case, unit: &Unit, methods: &[Method], out: &Path) -> anyhow::Result<()> {
    let ground: OnceCell<Ground> = OnceCell::new();
    for method in methods {
        let path = method.report(out, &case.name);
        if path.is_file() {
            continue;
        }
        match method {
            Method::Baseline(baseline) => {
                if ground.get().is_none() {
                    let made = Ground::new(case.recordings()?, unit, &case.catalogue());
                    // Nobody else can have set it.
                    let _ = ground.set(made);
                }
                let Some(ground) = ground.get() else { continue };
                write_atomically(&path, (baseline.judge)(ground).to_json().as_bytes())?;
            }
        }
    }
    Ok(())
}
