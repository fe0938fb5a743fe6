//! A diagnosis in plain text, for a terminal.

use super::stage::{figure_text, model_title};
use super::{answers, next_test, sheet};
use crate::table::wrapped;
use govtwin_diagnosis::result::{Diagnosis, Verdict};
use govtwin_diagnosis::words::{place, probability, values};
use govtwin_model::number::significant;

/// The verdict in plain text, a few lines for a terminal of so many columns.
pub fn summary(diagnosis: &Diagnosis, width: usize) -> String {
    let mut text = String::new();
    for words in answers::leads(diagnosis) {
        text.push_str(&format!("{}\n\n", wrapped(&words, width).join("\n")));
    }
    let mut line = |name: &str, words: String| {
        for (i, words) in wrapped(&words, width.saturating_sub(15)).iter().enumerate() {
            text.push_str(&format!("  {:<12} {words}\n", if i == 0 { name } else { "" }));
        }
    };
    line("verdict", diagnosis.verdict.id().to_owned());
    if let Some((_, title)) = place(diagnosis) {
        line("stage", title);
    }
    for blame in &diagnosis.blamed {
        let values = values(&blame.parameters);
        line("effect", format!("{}: {values}; probability {}", blame.id, probability(blame.probability)));
    }
    let [(_, causes), (_, sure), (_, far), _] = answers::answers(diagnosis);
    let nearest: Vec<String> = causes
        .into_iter()
        .skip(answers::leads(diagnosis).len())
        .filter(|_| diagnosis.verdict == Verdict::Unknown)
        .collect();
    for (question, words) in [("nearest", nearest), ("how sure", sure), ("error", far)] {
        for (i, words) in words.into_iter().enumerate() {
            line(if i == 0 { question } else { "" }, words);
        }
    }
    for one in diagnosis.part.iter().flat_map(|part| &part.figures) {
        line("fitted", format!("{}: {}", one.title, figure_text(one)));
    }
    for model in diagnosis.part.iter().flat_map(|part| &part.models) {
        let [all, first, second] =
            [model.held_out, model.halves[0], model.halves[1]].map(|error| significant(100.0 * error, 3));
        let title = model_title(model);
        line(
            "free runs",
            format!("{title}: RMS error {all} % on held-out pieces (one half {first} %, the other {second} %)"),
        );
    }
    for (i, words) in sheet::sentences(diagnosis).into_iter().enumerate() {
        line(if i == 0 { "data sheet" } else { "" }, words);
    }
    for (name, words) in next_test::lines(diagnosis) {
        line(name, words);
    }
    text
}
