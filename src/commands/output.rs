//! What several commands say and leave behind: text on standard output, progress, whole files.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Writes text to standard output; a reader that has gone away (`… | head`) is no error.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// Writes a warning line to standard error.
pub fn warn(text: &str) {
    // Where even standard error is closed there is nobody left to tell.
    let _ = writeln!(io::stderr().lock(), "govtwin: warning: {text}");
}

/// Writes a file, whole or not at all, making missing folders on the way.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    govtwin::files::write_atomically(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Writes a line for the person who waits to standard error.
#[cfg(feature = "node")]
pub fn say(text: &str) {
    // Where even standard error is closed there is nobody left to tell.
    let _ = writeln!(io::stderr().lock(), "govtwin: {text}");
}

/// A progress bar on standard error that shows itself only on a terminal, and only after a second of work.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// Starts counting to `total` of whatever `noun` names, such as `recordings`.
    pub fn new(total: usize, noun: &str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::hidden());
        let template = format!("{{bar:40}} {{pos}}/{{len}} {noun}, {{eta}} left {{msg}}");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// One more done.
    pub fn step(&self) {
        if self.bar.is_hidden() && self.bar.elapsed() > Duration::from_secs(1) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.bar.inc(1);
    }

    /// This share is done by now, and this is what goes on.
    pub fn at(&self, share: f64, what: &str) {
        if self.bar.is_hidden() && self.bar.elapsed() > Duration::from_secs(1) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of 100 steps")]
        self.bar.set_position((share.clamp(0.0, 1.0) * 100.0) as u64);
        self.bar.set_message(what.to_owned());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
