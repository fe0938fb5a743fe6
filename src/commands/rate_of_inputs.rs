//! The option `--rate-of-inputs`, the same in all commands.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use govtwin_correction::row::RateOfInputs;

/// Reads the option's value.
pub fn parser() -> impl TypedValueParser<Value = RateOfInputs> {
    let help = |rate| match rate {
        RateOfInputs::Hold => "Inputs keep their last value, as in the live node",
        RateOfInputs::Linear => {
            "Command and tank pressure change linearly from row to row, which a slow recording of a fast command needs; a trip that was \
             recorded with a slow row is placed in the middle of the interval before it"
        }
    };
    let values = RateOfInputs::ALL.map(|rate| PossibleValue::new(rate.id()).help(help(rate)));
    PossibleValuesParser::new(values)
        .try_map(|id| RateOfInputs::ALL.into_iter().find(|rate| rate.id() == id).ok_or("expected one of these values"))
}
