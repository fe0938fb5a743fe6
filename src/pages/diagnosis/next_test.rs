//! The next test in words: what it distinguishes, how an operator runs it, and why none is proposed.

use govtwin_diagnosis::experiment::LEAST_BITS;
use govtwin_diagnosis::result::{Diagnosis, Experiment, Verdict};
use govtwin_diagnosis::words::{id_words, listed, probability, stage_words};
use govtwin_model::number::{fixed, significant};

/// What to do where the recordings are of no servomotor stage.
pub(crate) const CHECK_SIGNALS: &str = "Check which signals were recorded: the spool position of the main distributing valve and the position of its \
                                 servomotor are needed.";

/// Share of the remaining entropy below which a test is expected to settle little.
const LITTLE: f64 = 0.1;

/// A hypothesis of a posterior in words: effects joined by `+`, `none`, or `unknown:STAGE`.
pub(crate) fn hypothesis_words(name: &str) -> String {
    match name.split_once(':') {
        Some(("unknown", id)) => format!("something unknown in the {}", stage_words(id)),
        _ => name.split('+').map(id_words).collect::<Vec<_>>().join(" with "),
    }
}

/// How an operator runs a test.
pub(crate) fn how_to_run(one: &Experiment) -> String {
    let signals = one.records.iter().map(|signal| signal.title().to_lowercase()).collect::<Vec<_>>();
    let commanded = if one.script.is_some() { "opening command, ESV state, tank pressure, " } else { "" };
    format!("{}. Record {commanded}{} at {} Hz.", one.unit_state, listed(&signals, "and"), significant(one.rate_hz, 3))
}

/// The length of a test in seconds; most are whole.
pub(crate) fn length_s(one: &Experiment) -> String {
    let tenths = (one.length_s * 10.0).round() / 10.0;
    fixed(tenths, usize::from(tenths.fract() > 0.0))
}

/// Why no test is proposed.
fn nothing_to_settle(diagnosis: &Diagnosis) -> String {
    if diagnosis.entropy_bits < LEAST_BITS {
        format!("none needed, as less than {LEAST_BITS} bits are open between the fault sets")
    } else {
        let bits = significant(diagnosis.entropy_bits, 2);
        format!("no candidate is expected to lower the posterior's entropy of {bits} bits by 0.01 bit")
    }
}

/// What a test settles: `distinguish a from b`, or `find out whether a is present`.
fn settles(one: &Experiment) -> String {
    let acting: Vec<String> =
        one.separates.iter().filter(|name| *name != "none").map(|name| hypothesis_words(name)).collect();
    if acting.len() == 1 && acting.len() < one.separates.len() {
        format!("find out whether {} is present", acting[0])
    } else {
        let names: Vec<String> = one.separates.iter().map(|name| hypothesis_words(name)).collect();
        format!("distinguish {}", listed(&names, "from"))
    }
}

/// The best test in paragraphs: what it is, how to run it, and one with a trip that would be more informative.
pub(crate) fn paragraphs(diagnosis: &Diagnosis) -> Vec<String> {
    let Some(one) = diagnosis.experiments.first() else {
        return vec![format!("Next test: {}.", nothing_to_settle(diagnosis))];
    };
    let trips = |trips: u32| if trips == 0 { "no ESV trip".to_owned() } else { format!("{trips} ESV trip") };
    let sent = if one.bag.is_some() { " `govtwin play next_test.mcap` sends it." } else { "" };
    let share = one.expected_drop_bits / one.entropy_bits;
    let purpose = if share < LITTLE {
        format!("No candidate test would settle much; the best one, to {}", settles(one))
    } else {
        format!("To {}", settles(one))
    };
    let mut all = vec![
        format!(
            "{purpose}: {}. It takes {} s, with {}, and is expected to remove {} of the posterior's entropy ({} of {} bits).{sent}",
            one.test,
            length_s(one),
            trips(one.trips),
            probability(share),
            significant(one.expected_drop_bits, 2),
            significant(one.entropy_bits, 2),
        ),
        how_to_run(one),
    ];
    if let Some(other) = diagnosis.experiments.iter().find(|other| one.trips == 0 && other.trips > 0) {
        let bits = significant(other.bits_per_minute, 2);
        all.push(format!("With an ESV trip more can be learnt per minute: {} ({bits} bits/min).", other.test));
    }
    all
}

/// Lines of the summary on a terminal: label and text.
pub(crate) fn lines(diagnosis: &Diagnosis) -> Vec<(&'static str, String)> {
    if diagnosis.verdict == Verdict::NoSuchUnit {
        return vec![("next", CHECK_SIGNALS.to_owned())];
    }
    let Some(one) = diagnosis.experiments.first() else { return vec![("next test", nothing_to_settle(diagnosis))] };
    let bits = significant(one.expected_drop_bits, 2);
    vec![("next test", format!("{} (to {}; {bits} bits)", one.test, settles(one))), ("how to run", how_to_run(one))]
}
