//! The page of a trained residual: how much of the error it removes, and how its hyperparameters were found.

use super::answers::of_training;
use super::{models_table, search_blocks};
use crate::comparison::summary::{Covered, ModelFigures, Searched};
use govtwin_model::signal::Signal;
use govtwin_pages::page::{Page, Tone};
use govtwin_pages::replay::thousands;

/// The contents of the page.
#[derive(Clone, Copy, Debug)]
pub struct Training<'a> {
    /// The signal that is corrected.
    pub signal: Signal,
    /// Training rows and test rows.
    pub rows: [usize; 2],
    /// Where the recordings come from, where that is stated.
    pub origin: Option<&'a str>,
    /// The twin alone first, the model as it runs last.
    pub models: &'a [ModelFigures],
    /// Searches for hyperparameters.
    pub searches: &'a [Searched],
    /// Coverage of its band.
    pub band: Option<&'a Covered>,
}

/// The page.
pub fn training_page(training: &Training) -> Page {
    let Training { signal, rows, origin, models, searches, band } = *training;
    let [teach, judge] = rows.map(|count| thousands(count as u64));
    let mut page = Page::new("Training of the learned residual", format!("{teach} training rows, {judge} test rows"));
    if let [twin, .., with] = models {
        page.body.answers(of_training(twin, with, &signal.title().to_lowercase(), signal.unit(), band));
    }
    if let Some(origin) = origin {
        page.body.note(Tone::Plain, origin);
    }
    page.body.table(models_table(models, signal.unit()), "Errors on the test rows, the last 30 % of each process.");
    search_blocks(&mut page.body, searches, signal.unit());
    page
}
