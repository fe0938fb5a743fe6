//! The residuals of a fit for other solvers: positions in, residuals out, a line of JSON each.

use std::io::{BufRead, Write};

use anyhow::Context;
use govtwin::parameters::Unit;
use govtwin::tuning::bench::Bench;
use govtwin::tuning::calibration::Calibration;
use govtwin::tuning::knob::unit_at;
use serde_json::json;

/// First says what was fitted and where; then answers until the input ends.
///
/// The residuals are the misses over their noise, then the positions of all knobs with a tolerance: half the sum of their
/// squares is what the fit makes least.
pub fn serve(bench: &Bench, base: &Unit, fitted: &Calibration) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    let ranges: Vec<(f64, f64)> = fitted.knobs.iter().map(|knob| knob.range(base)).collect();
    let keys: Vec<String> = fitted.knobs.iter().map(|knob| knob.key(base).0).collect();
    let cost = fitted.fit.cost();
    let head = json!({
        "keys": keys, "ranges": ranges, "positions": fitted.fit.positions, "deviations": fitted.deviations, "cost": cost,
    });
    writeln!(stdout, "{head}")?;
    for line in std::io::stdin().lock().lines() {
        let positions: Vec<f64> =
            serde_json::from_str(&line?).context("expected a list of positions, one number for each knob")?;
        let misses = bench.misses_of(&[unit_at(base, &fitted.knobs, &positions)]).pop().unwrap_or_default();
        let priors = fitted.knobs.iter().zip(&positions).filter(|(knob, _)| knob.has_prior()).map(|(_, p)| *p);
        let residuals: Vec<f64> = misses.iter().flatten().copied().chain(priors).collect();
        writeln!(stdout, "{}", json!(residuals))?;
        stdout.flush()?;
    }
    Ok(())
}
