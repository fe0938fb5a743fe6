//! Words that must not come back: what the project once called things that the field has names for.

use super::source::Source;

/// A word that is gone, and what the field says.
const GONE: [(&str, &str); 37] = [
    ("knob", "free parameter"),
    ("knobs", "free parameters"),
    ("Knob", "FreeParameter"),
    ("Knobs", "Free parameters"),
    ("cooled", "annealed"),
    ("oddities", "structural mismatch"),
    ("Oddities", "Mismatch"),
    ("RMS miss", "RMS error"),
    ("RMS misses", "RMS errors"),
    ("gap closed", "error explained"),
    ("fair part", "Shapley share"),
    ("taken for whom", "confusion matrix"),
    ("Mouth", "Publishers"),
    ("Ears", "Subscriptions"),
    ("Keeper", "Supervisor"),
    ("News", "NodeEvent"),
    ("Desk", "ServiceContext"),
    ("desk", "context"),
    ("Latent", "DiscrepancyTerm"),
    ("latents", "discrepancy terms"),
    ("leeway", "allowance"),
    ("Dice", "RandomStreams"),
    ("swings_s", "limit_cycles_s"),
    ("Trial", "PreparedRecording"),
    ("Closure", "Explained fraction"),
    ("realised_closure", "realised_fraction"),
    ("Miss", "SignalResidual"),
    ("exam", "fresh recordings"),
    ("exams", "validations"),
    ("SaidError", "ReportError"),
    ("rivals", "competing hypotheses"),
    ("Visible", "DetectableSize"),
    ("Admission", "Data qualification"),
    ("admission", "data qualification"),
    ("cooling", "annealing"),
    ("COOLING", "TEMPERATURES"),
    ("told_text", "figure_text"),
];

/// Uses of such words in sources and documents; what changed is told in the words of its day.
pub fn gone(sources: &[Source]) -> Vec<String> {
    let read = |source: &&Source| {
        let is_text = source.path.ends_with(".rs") || source.path.ends_with(".md");
        is_text
            && !matches!(source.path.as_str(), "CHANGELOG.md" | "tests/tidy/words.rs")
            && !source.path.starts_with("vendor/")
    };
    let mut breaches = Vec::new();
    for source in sources.iter().filter(read) {
        for (number, line) in source.text.lines().enumerate() {
            for (word, instead) in GONE.iter().filter(|(word, _)| is_there(line, word)) {
                breaches.push(format!("{}:{}: `{word}`: say `{instead}`", source.path, number + 1));
            }
        }
    }
    breaches
}

/// Whether a line holds a word as a whole.
fn is_there(line: &str, word: &str) -> bool {
    let is_part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    line.match_indices(word)
        .any(|(at, _)| !is_part(line[..at].chars().next_back()) && !is_part(line[at + word.len()..].chars().next()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_that_came_back_is_seen() {
        let of = |path: &str, text: &str| gone(&[Source::new(path, text)]).len();
        assert_eq!(of("src/estimation/fit.rs", "/// Turns every knob.\nlet x = 1;"), 1);
        assert_eq!(of("docs/a.md", "The RMS miss."), 1);
        assert_eq!(of("src/a.rs", "let door_knob_size = knobby;"), 0);
        assert_eq!(of("CHANGELOG.md", "RMS miss"), 0);
    }
}
