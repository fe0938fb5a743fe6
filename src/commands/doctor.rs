//! `govtwin doctor`: whether a bag is whole, and what to do where it is not.

use std::path::{Path, PathBuf};

use govtwin_bag::{FileHealth, Survey, Warning};
use serde_json::json;

use super::info::topics_in_doubt;
use super::output::{Progress, one_line, print};
use crate::commands::{Outcome, bags};

/// Arguments of `govtwin doctor`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Bags: files, bag folders, or folders that contain bags.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Reads every byte, and checks checksums, indices, counts, times, schemas and metadata. Only findings
are reported; `govtwin info` reports them together with the contents of the bag.
  lost      a part that cannot be read; `govtwin recover` saves the rest
  warning   a problem for other readers, such as an index without some chunks; `govtwin recover`
            writes a new bag
  note      something that nothing protects or describes: no checksums, no definition of a type

Example:
  govtwin doctor bags/reference bags/practice

Exit codes: 0 sound, 1 not readable as a bag, 2 wrong usage, 3 a bag is damaged or has warnings.";

/// Checks all bags.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let found = bags::find(&args.bags)?;
    let progress = Progress::new(found.len(), "bags");
    let (mut texts, mut values, mut errors, mut sound) = (vec![], vec![], vec![], true);
    for one in found {
        match govtwin_bag::survey(&one.path) {
            Ok(survey) => {
                let report = Report::of(&survey);
                sound &= report.is_sound();
                texts.push(report.text(&one.path, &survey));
                values.push(json!({
                    "path": one.path, "sound": report.is_sound(), "messages": survey.messages, "lost": report.lost,
                    "warnings": report.warnings, "notes": report.notes,
                }));
            }
            Err(error) => errors.push(error.to_string()),
        }
        progress.step();
    }
    drop(progress);
    let text = if args.json { serde_json::to_string_pretty(&values)? + "\n" } else { texts.join("\n") };
    print(&text)?;
    if !errors.is_empty() {
        anyhow::bail!("{}", errors.join("\n"));
    }
    Ok(if sound { Outcome::Ok } else { Outcome::Warnings })
}

/// What is to be said of a bag, in words.
struct Report {
    lost: Vec<String>,
    warnings: Vec<String>,
    notes: Vec<String>,
}

impl Report {
    fn of(survey: &Survey) -> Self {
        let is_loss = |warning: &&Warning| {
            matches!(warning, Warning::Damaged { .. } | Warning::FileMissing { .. } | Warning::Count { .. })
        };
        let (lost, doubtful): (Vec<&Warning>, Vec<&Warning>) = survey.warnings.iter().partition(is_loss);
        let words = |warnings: Vec<&Warning>| warnings.into_iter().map(ToString::to_string).collect::<Vec<_>>();
        let mut warnings = words(doubtful);
        warnings.extend(topics_in_doubt(survey));
        let mut notes: Vec<String> = survey.notes.iter().map(ToString::to_string).collect();
        let undescribed = survey.topics.iter().filter(|topic| topic.messages > 0 && !topic.readable);
        notes.extend(undescribed.map(|topic| {
            format!(
                "{}: no definition of `{}` that can be read stands beside its messages",
                topic.name, topic.type_name
            )
        }));
        Self { lost: words(lost), warnings, notes }
    }

    fn is_sound(&self) -> bool {
        self.lost.is_empty() && self.warnings.is_empty()
    }

    fn text(&self, path: &Path, survey: &Survey) -> String {
        let mut lines = vec![path.display().to_string()];
        lines.push(format!("  read       {}", read(survey)));
        for (word, findings) in [("lost", &self.lost), ("warning", &self.warnings), ("note", &self.notes)] {
            lines.extend(findings.iter().map(|finding| format!("  {word:<10} {finding}")));
        }
        lines.push(if self.is_sound() {
            "  sound".to_owned()
        } else {
            format!("  repair     govtwin recover {} writes every readable message into a new bag", path.display())
        });
        let lines: Vec<String> = lines.iter().map(|line| one_line(line)).collect();
        lines.join("\n") + "\n"
    }
}

/// What was read.
fn read(survey: &Survey) -> String {
    let plural = |count: u64, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let sum = |of: fn(&FileHealth) -> u64| survey.files.iter().map(of).sum::<u64>();
    let unchecked = sum(|file| file.unchecked_messages);
    let checked = if unchecked == 0 { ", all under a checksum" } else { "" };
    format!(
        "{}, {}, {} on {}{checked}",
        plural(survey.files.len() as u64, "file"),
        plural(sum(|file| file.chunks), "chunk"),
        plural(survey.messages, "message"),
        plural(survey.topics.len() as u64, "topic"),
    )
}
