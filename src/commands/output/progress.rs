//! How far work has come: a bar on a terminal, lines now and then anywhere else.

use std::io::{self, IsTerminal as _};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

use super::{plain, say};

/// Work that is over sooner shows no bar.
const SHORT: Duration = Duration::from_secs(1);

/// Off a terminal the first line comes after so long, s.
const FIRST_LINE_S: u64 = 10;

/// Between two lines there are at most so many seconds.
const LONGEST_SILENCE_S: u64 = 60;

/// Below this share of the work nothing is said of what is left: the first steps are no sample of the others.
const LEAST_SHARE: f64 = 0.05;

/// A progress bar on standard error that shows itself only after a second of work; a line after ten seconds where nobody sees a bar.
pub struct Progress {
    bar: ProgressBar,
    noun: String,
    on_terminal: bool,
    /// When the next line is due, s from the start.
    line_due_s: AtomicU64,
}

impl Progress {
    /// Starts counting to `total` of whatever `noun` names, such as `recordings`.
    pub fn new(total: usize, noun: &str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::hidden());
        let template = format!("{{bar:40}} {{pos}}/{{len}} {noun}, {{msg}}");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        let on_terminal = io::stderr().is_terminal();
        Self { bar, noun: noun.to_owned(), on_terminal, line_due_s: AtomicU64::new(FIRST_LINE_S) }
    }

    /// Works on all items side by side, each a step; what comes of them stands in their order.
    pub fn each<T: Send, Made: Send>(
        items: impl IntoParallelIterator<Item = T, Iter: IndexedParallelIterator>,
        noun: &str,
        work: impl Fn(T) -> Made + Sync,
    ) -> Vec<Made> {
        let items = items.into_par_iter();
        let progress = Self::new(items.len(), noun);
        let done = |item| {
            let made = work(item);
            progress.step();
            made
        };
        items.map(done).collect()
    }

    /// One more done.
    pub fn step(&self) {
        self.bar.inc(1);
        let share = self.bar.position() as f64 / self.bar.length().unwrap_or(1).max(1) as f64;
        self.show(share, "");
    }

    /// This share is done by now, and this is what goes on.
    pub fn at(&self, share: f64, what: &str) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of 100 steps")]
        self.bar.set_position((share.clamp(0.0, 1.0) * 100.0) as u64);
        self.show(share, what);
    }

    fn show(&self, share: f64, what: &str) {
        let elapsed = self.bar.elapsed();
        let mut words = estimate(elapsed.as_secs_f64(), share);
        if !what.is_empty() {
            words = format!("{words}: {}", plain(what));
        }
        if self.on_terminal {
            if self.bar.is_hidden() && elapsed > SHORT {
                self.bar.set_draw_target(ProgressDrawTarget::stderr());
            }
            self.bar.set_message(words);
            return;
        }
        let now_s = elapsed.as_secs();
        let due_s = self.line_due_s.load(Ordering::Relaxed);
        let next_s = now_s + (now_s / 2).clamp(1, LONGEST_SILENCE_S);
        let is_mine = || self.line_due_s.compare_exchange(due_s, next_s, Ordering::Relaxed, Ordering::Relaxed).is_ok();
        if now_s >= due_s && share < 1.0 && is_mine() {
            let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
            say(&format!("{done}/{all} {}, {words}", self.noun));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// How long it took so far, and what is left if the rest goes as fast; nothing of what is left where that cannot be known yet.
fn estimate(elapsed_s: f64, share: f64) -> String {
    let so_far = format!("{} so far", time(elapsed_s));
    if !(LEAST_SHARE..1.0).contains(&share) || elapsed_s < 2.0 {
        return so_far;
    }
    format!("{so_far}, about {} left", time(elapsed_s * (1.0 - share) / share))
}

/// A time as people say it.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::estimate;

    #[test]
    fn what_is_left_is_said_only_where_it_can_be_known() {
        assert_eq!(estimate(1.0, 0.5), "1 s so far");
        assert_eq!(estimate(30.0, 0.01), "30 s so far");
        assert_eq!(estimate(30.0, 0.25), "30 s so far, about 90 s left".replace("90 s", "2 min"));
        assert_eq!(estimate(30.0, 0.5), "30 s so far, about 30 s left");
        assert_eq!(estimate(4000.0, 0.1), "67 min so far, about 10.0 h left");
        assert_eq!(estimate(30.0, 1.0), "30 s so far");
    }
}
