//! The residuals of a fit for other solvers: positions in, residuals out, a line of JSON each.

use std::io::{BufRead, Write};

use anyhow::Context;
use govtwin_diagnosis::estimation::coordinate::{Coordinate, subject_at};
use govtwin_diagnosis::identification::calibration::Calibration;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_model::parameters::Unit;
use serde_json::json;

/// First says what was fitted and where; then answers until the input ends.
///
/// They are the innovations over their noise, then the positions of all free parameters with a tolerance: half the sum of their
/// squares is what the fit makes least.
pub fn serve(problem: &Problem, base: &Unit, fitted: &Calibration) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    let ranges: Vec<(f64, f64)> =
        fitted.free_parameters.iter().map(|free_parameter| free_parameter.range(base)).collect();
    let keys: Vec<String> = fitted.free_parameters.iter().map(|free_parameter| free_parameter.key(base).0).collect();
    let cost = fitted.fit.cost();
    let head = json!({
        "keys": keys, "ranges": ranges, "positions": fitted.fit.positions, "deviations": fitted.deviations, "cost": cost,
    });
    writeln!(stdout, "{head}")?;
    for line in std::io::stdin().lock().lines() {
        let positions: Vec<f64> =
            serde_json::from_str(&line?).context("expected a list of positions, one number for each free parameter")?;
        let residuals =
            problem.residuals_of(&[subject_at(base, &fitted.free_parameters, &positions)]).pop().unwrap_or_default();
        let priors = fitted
            .free_parameters
            .iter()
            .zip(&positions)
            .filter(|(free_parameter, _)| free_parameter.has_prior())
            .map(|(_, p)| *p);
        let residuals: Vec<f64> = residuals.iter().flatten().copied().chain(priors).collect();
        writeln!(stdout, "{}", json!(residuals))?;
        stdout.flush()?;
    }
    Ok(())
}
