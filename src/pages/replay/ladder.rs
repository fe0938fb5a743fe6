//! The ladder of a replay as a table and a picture.

use crate::ink::Ink;
use crate::picture::{Panel, Picture};
use crate::scale;
use crate::table::Table;
use govtwin_model::number::significant;
use govtwin_model::recording::Process;
use govtwin_model::replay::ladder::Ladder;

/// The figures of every rung; a star marks a process that a residual was not trained on.
pub fn ladder_table(ladder: &Ladder) -> Table {
    let signal = ladder.judged();
    let processes: Vec<Option<Process>> = ladder.processes().into_iter().map(Some).chain([None]).collect();
    let (scale, unit) = scale(signal);
    let mut table = Table::new().words(format!("{}: MAE, {unit}", signal.title()));
    for process in &processes {
        table = table.numbers(process.map_or("overall", Process::title));
    }
    for rung in &ladder.rungs {
        let cell = |process: &Option<Process>| {
            let star = process.is_some_and(|process| rung.unseen.iter().any(|id| id == process.id()));
            let value = rung.mae(*process, signal).map_or_else(|| "–".to_owned(), |mae| significant(scale * mae, 3));
            if star { format!("{value}*") } else { value }
        };
        let title = std::iter::once(rung.title.clone());
        table.row(title.chain(processes.iter().map(cell)));
    }
    table
}

/// What the stars mean, where there are any.
pub fn reason_for_stars(ladder: &Ladder) -> Option<&'static str> {
    let any = ladder.rungs.iter().any(|rung| !rung.unseen.is_empty());
    any.then_some("* left out of the residual's training.")
}

/// The rungs side by side in every process.
pub fn ladder_picture(ladder: &Ladder) -> Picture {
    let signal = ladder.judged();
    let processes = ladder.processes();
    let inks = [Ink::Command, Ink::Measured, Ink::Good, Ink::Simulated, Ink::Extra1, Ink::Extra2, Ink::Extra3];
    let (scale, unit) = scale(signal);
    let mut panel = Panel::new(format!("{}: MAE, {unit}", signal.title()))
        .height(230)
        .x_categories(processes.iter().map(|process| process.title()));
    for (k, (rung, ink)) in ladder.rungs.iter().zip(inks.into_iter().cycle()).enumerate() {
        let value = |process: &Process| scale * rung.mae(Some(*process), signal).unwrap_or(0.0);
        let values: Vec<f64> = processes.iter().map(value).collect();
        panel = panel.bars(ink, &rung.title, &values, k, ladder.rungs.len());
    }
    Picture::grid("Mean absolute error by process", 1, vec![panel])
}
