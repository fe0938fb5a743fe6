//! What a calibration says of its recordings, in sentences.

use super::{Calibration, CalibrationRow};
use govtwin_model::signal::Signal;

impl CalibrationRow {
    /// Whether the interval leaves the sheet's value out.
    fn is_off_sheet(&self) -> bool {
        !(self.ci90[0]..=self.ci90[1]).contains(&self.sheet)
    }
}

impl Calibration {
    /// What the recordings could and could not tell, in sentences.
    pub fn identifiability(&self) -> Vec<String> {
        let keys = |of: &dyn Fn(&CalibrationRow) -> bool| {
            let keys: Vec<String> =
                self.rows.iter().filter(|row| of(row)).map(|row| format!("`{}`", row.key)).collect();
            keys.join(", ")
        };
        let mut words = Vec::new();
        // What was moved off the sheet was not left there, however little its own interval narrowed: something else moves with it.
        let groups: [(&str, f64, f64, Option<bool>); 4] = [
            ("Well determined by these recordings", 0.9, 1.1, None),
            ("Narrowed down", 0.3, 0.9, None),
            ("Not seen by these recordings, so left where the sheet has them", -1.0, 0.3, Some(false)),
            (
                "Moved off the sheet, though these recordings do not determine them: they stand for something else, or the error of a model that lacks \
                 something",
                -1.0,
                0.3,
                Some(true),
            ),
        ];
        for (title, from, to, moved) in groups {
            let named =
                keys(&|row| (from..to).contains(&row.learned) && moved.is_none_or(|moved| moved == row.is_off_sheet()));
            if !named.is_empty() {
                words.push(format!("{title}: {named}."));
            }
        }
        for pair in self.correlations.iter().filter(|pair| pair.coefficient.abs() > 0.95) {
            let [one, other] = &pair.keys;
            let what = if pair.coefficient > 0.0 { "both up or both down" } else { "one up and the other down" };
            words.push(format!(
                "`{one}` and `{other}` cannot be told apart: {what} fits as well (r = {:.2}).",
                pair.coefficient
            ));
        }
        words
    }

    /// What the user should know before using the fit, in sentences.
    pub fn warnings(&self) -> Vec<String> {
        let mut words = Vec::new();
        for row in self.rows.iter().filter(|row| row.at_bound && row.learned > 0.05) {
            words.push(format!(
                "`{}` ended at a bound ({} {}): the truth may lie beyond, or another effect is fitted with it",
                row.key, row.fitted, row.unit
            ));
        }
        for row in self.rows.iter().filter(|row| row.deviation.is_none() && row.learned < 0.3 && !row.at_bound) {
            words.push(format!("`{}`: too little excitation; these recordings do not determine it", row.key));
        }
        for (signal, ratio) in Signal::ALL.into_iter().zip(self.leftover) {
            if let Some(ratio) = ratio.filter(|ratio| *ratio > 2.0) {
                words.push(format!(
                    "{} misses by {ratio:.1} times the noise to be expected: something is missing that no fitted parameter \
                     replaces; intervals are widened by as much",
                    signal.id()
                ));
            }
        }
        words
    }
}
