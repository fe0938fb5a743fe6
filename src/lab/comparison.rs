//! The paper's comparison of models: their errors on rows that none was trained on, process by process.
//!
//! ```json
//! {"schema": "govtwin-comparison/1", "program": "govtwin 0.1.0", "origin": "Synthetic data: …",
//!  "settings": {"signal": "spool_position_pu", "cut": "servomotor", "period_ns": 200000000, "seed": 1, …},
//!  "rows": {"train": 16305, "test": 6948, "purged": 40, "left_out": 0},
//!  "recordings": [{"name": "startup_01", "samples": 1300, "missing": {"count": 0, "first_s": []}, …}],
//!  "models": [{"id": "mbm", "title": "MBM", "overall": FIGURES, "processes": [{"process": "startup", …FIGURES}, …]}, …],
//!  "ranking": ["mdhm", …],
//!  "claims": [{"what": "…", "paper": "43.9 to 68.3", "here": "…", "unit": "%"}],
//!  "seeds": [1, 2, 3],
//!  "spread": [{"id": "mbm", "title": "MBM", "parts": [{"process": "startup", "mae": MEAN_LOW_HIGH, "rmse": MEAN_LOW_HIGH}, …, {"process": "all", …}]}, …],
//!  "ablation": [as spread],
//!  "breakdown": {"models": ["mdhm", "ddm", …], "processes": [{"process": "startup", "parts": [{"phase": "trip", "rows": 2, "mae": […], "square_shares": […]}, …],
//!                "shift_s": [["mbm", 0.1], …], "decided_share": 0.9, "worst": [{"recording": 11, "time_s": 3.2, "phase": "trip", "measured": -1.0, "said": […]}, …],
//!                "guard": {"rows": 1000, "clamped": 0, "faded": 0, "shrunk": 0, "outside": 0, "bad": 0}}, …]},
//!  "left_out_process": [{"process": "startup", "models": [{"id": "mbm", …FIGURES}, …],
//!                       "band": [{"process": "startup", "distance": "near", "rows": 4100, "coverage_share": 0.9, "mean_half_width": 0.011}, …]}, …],
//!  "searches": [{"id": "mdhm", "kind": "bayesian", "trials": […], "slices": […]}, …],
//!  "importance": [{"feature": "model.rate", "group": "model", "gain_share": 0.21}, …],
//!  "band": {"coverage_share": 0.9, "measured": [{"process": "startup", "coverage_share": 0.93, "mean_half_width": 0.011}, …]},
//!  "band_by_distance": [as "band" of a process left out],
//!  "closed_loop": {"spool": [{"id": "mbm", …FIGURES}, {"id": "additive", …}, {"id": "inside", …}], "servomotor": […]}}
//! ```
//!
//! FIGURES are `rows`, `mae`, `rmse` and `r2` of [`govtwin_model::metrics`], in the signal's unit, `null` where the data do not determine it.

#[cfg(feature = "residual")]
pub mod ablation;
pub mod breakdown;
#[cfg(feature = "residual")]
pub mod closed;
#[cfg(feature = "residual")]
pub mod contenders;
pub mod coverage;
#[cfg(feature = "residual")]
pub(crate) mod gate;
#[cfg(feature = "residual")]
pub mod inloop;
pub mod limit;
pub mod page;
#[cfg(feature = "residual")]
pub mod refit;
pub mod summary;

/// A model's word for some rows of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Contender {
    /// Its id in results.
    pub id: &'static str,
    /// What tables and pictures call it.
    pub title: &'static str,
    /// Its estimate of the signal for each row.
    pub estimates: Vec<f64>,
}

#[cfg(test)]
pub(super) mod tests {
    use super::Contender;
    use super::summary::{ModelFigures, reduction};
    use govtwin_correction::features;
    use govtwin_correction::row::{Opening, RateOfInputs};
    use govtwin_correction::table::{FeatureTable, RowMark, TableLayout};
    use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
    use govtwin_model::recording::Process;
    use govtwin_model::recording::Recording;
    use govtwin_model::signal::Signal;
    use govtwin_model::twin::Twin;

    /// So many rows of a twin on a wavy command, every 0.2 s, and their table.
    pub fn made(rows: i64) -> (Recording, FeatureTable) {
        let mut twin = Twin::new(&govtwin_model::params::reference());
        let mut estimates = vec![];
        let frame = |k: i64| {
            let opening_command_pu = 0.4 + 0.1 * (0.14 * k as f64).sin();
            let inputs =
                Inputs { opening_command_pu, esv: EsvState::Normal, tank_pressure_pa: 6.3e6, piston_force_n: 0.0 };
            let mut frame = Frame { time_ns: k * 200_000_000, inputs, measured: Signals::NONE };
            estimates.push(twin.step(&frame));
            frame.measured = estimates[estimates.len() - 1].signals;
            frame
        };
        let recordings = [Recording::new("a", (0..rows).map(frame).collect())];
        let (signal, opening, rate_of_inputs) = (Signal::SpoolPosition, Opening::Simulated, RateOfInputs::Hold);
        let layout = TableLayout { signal, opening, rate_of_inputs, period_ns: 200_000_000, features: features::all() };
        let table = govtwin_correction::table::table(&recordings, &[estimates], layout);
        let [recording] = recordings;
        (recording, table)
    }

    fn table() -> FeatureTable {
        let mark = |frame: usize| RowMark {
            recording: 0,
            frame,
            process: if frame < 10 { Process::Startup } else { Process::Shutdown },
            time_ns: 0,
            measured: frame as f64,
            model: frame as f64 + 1.0,
            motion: 0.0,
        };
        let (signal, opening, rate_of_inputs) = (Signal::SpoolPosition, Opening::Simulated, RateOfInputs::Hold);
        let layout = TableLayout { signal, opening, rate_of_inputs, period_ns: 200_000_000, features: features::all() };
        FeatureTable { layout, values: vec![], marks: (0..20).map(mark).collect(), left_out: 0 }
    }

    #[test]
    fn figures_and_reductions_in_closed_form() {
        let table = table();
        let rows: Vec<usize> = (0..20).collect();
        let off = |by: [f64; 2]| {
            let estimates = rows.iter().map(|&row| row as f64 + by[row / 10]).collect();
            ModelFigures::of(&table, &rows, &Contender { id: "a", title: "A", estimates })
        };
        let (ours, theirs) = (off([0.25, -0.5]), off([1.0, 1.0]));
        assert_eq!(ours.process("startup").unwrap().mae, 0.25);
        assert_eq!(ours.process("load_increase"), None);
        assert_eq!(ours.overall.mae, 0.375);
        assert_eq!(reduction(&ours, &theirs, |figures| figures.mae), [50.0, 75.0]);
        assert!(ours.mean_r2() < 1.0 && ours.mean_r2() > theirs.mean_r2());
    }
}
