//! Recordings read for a fit: short ones whole, of long ones the processes in them; all of them within bounds.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::bail;
use govtwin_bag::{BagError, Health, Positions, ReadOptions, Rows};
use govtwin_diagnosis::watch::excerpt::{Excerpts, FoundProcess, MOST_ROWS, WHOLE_S, choose};
use govtwin_model::frame::Frame;
use govtwin_model::recording::Recording;
use rayon::prelude::{IntoParallelIterator, ParallelIterator};

use super::Bag;
use crate::commands::output::Progress;

/// Rows of all recordings together that are taken whole: as many as one may have, 0.6 GB, and several times that in a fit.
const MOST_WHOLE_ROWS: usize = 10_000_000;
/// Processes are left out by name up to here, and counted beyond.
const MOST_NAMED: usize = 12;

/// What is taken of a bag.
pub struct Taken {
    /// The recording, or the processes of a long one.
    pub recordings: Vec<Recording>,
    /// How the bag is.
    pub health: Health,
    /// What was taken of it, where it was too long to be taken whole.
    pub excerpt: Option<String>,
}

/// Reads all bags, or says for each why it cannot be used; where `uncut`, long ones whole, as long as there is room.
pub fn read(bags: &[Bag], options: &ReadOptions, uncut: bool) -> anyhow::Result<Vec<Result<Taken, String>>> {
    let (whole_rows, held_rows) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let first: Vec<Result<LookedThrough, BagError>> = Progress::each(bags, "recordings read", |bag| {
        let mut reading = looked_through(bag, options, uncut)?;
        let rows = reading.excerpts.held();
        let (all, most) =
            if reading.excerpts.is_long() { (&held_rows, 2 * MOST_ROWS) } else { (&whole_rows, MOST_WHOLE_ROWS) };
        // What finds no room is let go: processes are read again, and whole recordings refused by the sum below.
        if all.fetch_add(rows, Ordering::Relaxed).saturating_add(rows) > most {
            if reading.excerpts.is_long() {
                all.fetch_sub(rows, Ordering::Relaxed);
                reading.excerpts.list_only();
            } else {
                reading.excerpts.restart();
            }
        }
        Ok(reading)
    });
    let rows = whole_rows.into_inner();
    if rows > MOST_WHOLE_ROWS {
        bail!(
            "the recordings make {rows} rows together at 1 ms, expected at most {MOST_WHOLE_ROWS}; name fewer of them, those that move the unit most"
        );
    }
    let found = |reading: &Result<LookedThrough, BagError>| {
        reading.as_ref().map_or(vec![], |reading| reading.excerpts.found().to_vec())
    };
    let found: Vec<Vec<FoundProcess>> = first.iter().map(found).collect();
    let chosen = choose(&found, MOST_ROWS);
    let all: Vec<_> = bags.iter().zip(first).zip(found.into_iter().zip(chosen)).collect();
    Ok(all
        .into_par_iter()
        .map(|((bag, reading), (found, chosen))| {
            let reading = reading.map_err(|error| error.to_string())?;
            reading.taken(bag, options, &found, &chosen, uncut)
        })
        .collect())
}

/// A bag that was looked through.
struct LookedThrough {
    excerpts: Excerpts,
    health: Health,
    stroke: Option<f64>,
}

/// Looks through a bag, and again where the unit of its positions shows only then.
fn looked_through(bag: &Bag, options: &ReadOptions, uncut: bool) -> Result<LookedThrough, BagError> {
    let stroke = (options.positions != Positions::AnyUnit).then_some(1.0);
    let excerpts = |stroke| if uncut { Excerpts::new(stroke).by_rows() } else { Excerpts::new(stroke) };
    let mut taking = Taking(excerpts(stroke));
    let mut health = govtwin_bag::read_rows(&bag.path, options, &mut taking)?;
    taking.0.end();
    let stroke = stroke.or(taking.0.stroke());
    if taking.0.is_long() && options.positions == Positions::AnyUnit && stroke.is_some() {
        taking = Taking(excerpts(stroke));
        health = govtwin_bag::read_rows(&bag.path, options, &mut taking)?;
        taking.0.end();
    }
    Ok(LookedThrough { excerpts: taking.0, health, stroke })
}

/// Takes rows as they come; of a recording with very many processes only a list.
struct Taking(Excerpts);

impl Rows for Taking {
    fn restart(&mut self) {
        self.0.restart();
    }

    fn row(&mut self, frame: &Frame) {
        self.0.row(frame);
        if self.0.is_long() && self.0.held() > 2 * MOST_ROWS {
            self.0.list_only();
        }
    }
}

impl LookedThrough {
    /// What is taken of the bag; what was let go is read again.
    fn taken(
        self,
        bag: &Bag,
        options: &ReadOptions,
        found: &[FoundProcess],
        chosen: &BTreeSet<usize>,
        uncut: bool,
    ) -> Result<Taken, String> {
        let Self { excerpts, health, stroke } = self;
        if !excerpts.is_long() {
            return Ok(Taken { recordings: vec![excerpts.into_whole(&bag.name)], health, excerpt: None });
        }
        let duration_s = excerpts.duration_s();
        if found.is_empty() {
            return Err(no_process(bag, duration_s, excerpts.stroke(), options.positions));
        }
        if chosen.is_empty() {
            return Err(format!(
                "{}: lasts {duration_s:.0} s, and what the other recordings hold takes all the room that a fit has for processes of long \
                 recordings ({MOST_ROWS} rows); name fewer of them",
                bag.path.display()
            ));
        }
        let excerpt = Some(told(duration_s, found, chosen));
        if let Some(recordings) = excerpts.into_chosen(&bag.name, chosen) {
            return Ok(Taken { recordings, health, excerpt });
        }
        let again = Excerpts::of(stroke, chosen.clone());
        let mut taking = Taking(if uncut { again.by_rows() } else { again });
        let health = govtwin_bag::read_rows(&bag.path, options, &mut taking).map_err(|error| error.to_string())?;
        taking.0.end();
        let changed = || format!("{}: changed while it was read; try again once it is whole", bag.path.display());
        let recordings = taking.0.into_chosen(&bag.name, chosen).ok_or_else(changed)?;
        Ok(Taken { recordings, health, excerpt })
    }
}

/// Why a long recording cannot be used.
fn no_process(bag: &Bag, duration_s: f64, moved: Option<f64>, positions: Positions) -> String {
    let unit = if positions == Positions::AnyUnit { "in its own unit" } else { "pu" };
    let moved = moved.map_or("does not move".to_owned(), |moved| format!("moves by {moved:.4} {unit} altogether"));
    format!(
        "{}: lasts {duration_s:.0} s; of more than {WHOLE_S:.0} s, with --stage-alone of more than {MOST_ROWS} rows, a fit takes the processes alone, and there is none: expected command or \
         position to move by more than 3 % of the stroke within 4 s, or the emergency valve to trip, found a position that {moved}; name a \
         recording with a start-up, a load change or a trip, or cut out at most {WHOLE_S:.0} s, which are taken whole",
        bag.path.display()
    )
}

/// What was taken of a long recording.
fn told(duration_s: f64, found: &[FoundProcess], chosen: &BTreeSet<usize>) -> String {
    let of = |kept: bool| {
        let all = found.iter().enumerate().filter(move |(place, _)| chosen.contains(place) == kept);
        all.map(|(place, one)| (place + 1, one.duration_s, one.process.title())).collect::<Vec<_>>()
    };
    let seconds = |list: &[(usize, f64, &str)]| list.iter().map(|(_, duration_s, _)| duration_s).sum::<f64>();
    let names = |list: &[(usize, f64, &str)]| {
        let named = list.iter().take(MOST_NAMED).map(|(number, _, title)| format!("#{number} {title}"));
        let more = (list.len() > MOST_NAMED).then(|| format!("{} more", list.len() - MOST_NAMED));
        named.chain(more).collect::<Vec<_>>().join(", ")
    };
    let (kept, left) = (of(true), of(false));
    let noun = if found.len() == 1 { "process" } else { "processes" };
    let mut text = format!(
        "lasts {duration_s:.0} s, of which {} {noun} were cut out ({:.0} s: {}) and the rest dropped",
        found.len(),
        seconds(&kept),
        names(&kept)
    );
    if !left.is_empty() {
        text += &format!(
            "; {} of them are left out for want of room ({:.0} s: {}), so that those kept are of each kind the largest, evenly over time, and \
             no more than {MOST_ROWS} rows",
            left.len(),
            seconds(&left),
            names(&left)
        );
    }
    text
}
