//! The next test in words: what it tells apart, how an operator runs it, and why none is proposed.

use crate::diagnosis::experiment::LEAST_BITS;
use crate::diagnosis::result::{Diagnosis, Experiment};
use crate::report::diagnosis::words::{id_words, listed, probability, stage_words};
use crate::report::table::significant;

/// A hypothesis of a posterior in words: effects joined by `+`, `none`, or `unknown:STAGE`.
pub fn hypothesis_words(name: &str) -> String {
    match name.split_once(':') {
        Some(("unknown", id)) => format!("something unknown in the {}", stage_words(id)),
        _ => name.split('+').map(id_words).collect::<Vec<_>>().join(" with "),
    }
}

/// How an operator runs a test.
pub fn how_to_run(one: &Experiment) -> String {
    let signals = one.records.iter().map(|signal| signal.title().to_lowercase()).collect::<Vec<_>>();
    let commanded = if one.script.is_some() { "opening command, ESV state, tank pressure, " } else { "" };
    format!("{}. Record {commanded}{} at {} Hz.", one.unit_state, listed(&signals, "and"), significant(one.rate_hz, 3))
}

/// Why no test is proposed.
fn nothing_to_settle(diagnosis: &Diagnosis) -> String {
    let bits = significant(diagnosis.entropy_bits, 2);
    if diagnosis.entropy_bits < LEAST_BITS {
        format!("nothing to settle: the posterior's entropy is {bits} bits")
    } else {
        format!("none of the candidates would take a hundredth of a bit off the posterior's entropy of {bits} bits")
    }
}

/// The best test in paragraphs: what it is, how to run it, and one with a trip that would tell more.
pub fn paragraphs(diagnosis: &Diagnosis) -> Vec<String> {
    let Some(one) = diagnosis.experiments.first() else {
        return vec![format!("Next test: {}.", nothing_to_settle(diagnosis))];
    };
    let names: Vec<String> = one.separates.iter().map(|name| hypothesis_words(name)).collect();
    let trips = |trips: u32| if trips == 0 { "no trip".to_owned() } else { format!("{trips} trip of the ESV") };
    let sent = if one.script.is_some() { " `govtwin play next_test.mcap` sends it." } else { "" };
    let mut all = vec![
        format!(
            "To tell {} apart: {}. It takes {} s, with {}, and is expected to settle {} of what is open ({} of {} bits).{sent}",
            listed(&names, "and"),
            one.test,
            significant(one.length_s, 3),
            trips(one.trips),
            probability(one.expected_drop_bits / one.entropy_bits),
            significant(one.expected_drop_bits, 2),
            significant(one.entropy_bits, 2),
        ),
        how_to_run(one),
    ];
    if let Some(other) = diagnosis.experiments.iter().find(|other| one.trips == 0 && other.trips > 0) {
        let bits = significant(other.bits_per_minute, 2);
        all.push(format!("With a trip more can be had: {}, {bits} bits a minute.", other.test));
    }
    all
}

/// Lines of the summary on a terminal: what they are called, and what they say.
pub fn lines(diagnosis: &Diagnosis) -> Vec<(&'static str, String)> {
    let Some(one) = diagnosis.experiments.first() else { return vec![("next test", nothing_to_settle(diagnosis))] };
    let names: Vec<String> = one.separates.iter().map(|name| hypothesis_words(name)).collect();
    let bits = significant(one.expected_drop_bits, 2);
    vec![
        ("next test", format!("{} (tells {} apart; {bits} bits)", one.test, listed(&names, "and"))),
        ("how to run", how_to_run(one)),
    ]
}
