//! Options whose words stand for values of other rooms, each word with its help.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use govtwin_correction::row::RateOfInputs;
use govtwin_model::recording::Process;

/// A word of the command line, what it means, and its value.
pub type Choice<T> = (&'static str, &'static str, T);

/// What `--rate-of-inputs` may be.
pub const RATES_OF_INPUTS: [Choice<RateOfInputs>; 2] = [
    ("hold", "Inputs keep their last value, as in the live node", RateOfInputs::Hold),
    (
        "linear",
        "Command and tank pressure change linearly from row to row, which a slow recording of a fast command needs; a trip that was \
         recorded with a slow row is placed in the middle of the interval before it",
        RateOfInputs::Linear,
    ),
];

/// The processes.
pub const PROCESSES: [Choice<Process>; 4] = [
    ("startup", "From closed to speed-no-load", Process::Startup),
    ("load_increase", "On load, to a larger opening", Process::LoadIncrease),
    ("shutdown", "To closed, with the emergency shutdown valve (ESV)", Process::Shutdown),
    ("load_rejection", "Sudden closure from load", Process::LoadRejection),
];

/// Reads one of these words.
pub fn choice<T: Clone + Send + Sync + 'static>(
    choices: impl IntoIterator<Item = Choice<T>>,
) -> impl TypedValueParser<Value = T> {
    let choices: Vec<Choice<T>> = choices.into_iter().collect();
    let values = choices.iter().map(|(word, help, _)| PossibleValue::new(*word).help(*help));
    PossibleValuesParser::new(values.collect::<Vec<_>>()).try_map(move |given| {
        let chosen = choices.iter().find(|(word, ..)| *word == given);
        chosen.map(|(.., value)| value.clone()).ok_or("expected one of these values")
    })
}
