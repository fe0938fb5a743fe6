//! The effect catalogue: what a real unit may do beyond the nominal model, as switches of the same twin.
//!
//! An effect is one file and one line of [`CATALOGUE`]. Applied with its neutral values it leaves the
//! plant as it is, to the last bit.

pub mod backlash;
pub mod chamber_leak;
pub mod clock_offset;
pub mod command_delay;
pub mod command_gain;
pub mod current_limit;
pub mod cushion;
pub mod entrained_air;
pub mod esv_delay;
pub mod esv_slow;
pub mod feedback_bias;
pub mod feedback_lag;
pub mod flow_force;
pub mod flow_saturation;
pub mod load;
pub mod lvdt_bias;
pub mod lvdt_gain;
pub mod own;
pub mod pilot_filter;
pub mod port_asymmetry;
pub mod port_overlap;
pub mod port_wear;
pub mod pv_bandwidth;
pub mod pv_hysteresis;
pub mod pv_null_shift;
pub mod pv_overlap;
pub mod regulator_cycle;
pub mod return_loss;
pub mod servo_friction;
pub mod servo_leak;
pub mod spool_friction;
pub mod spring;
pub mod supply_loss;
pub mod valve_lag;
pub mod viscosity;

use std::fmt;

use crate::parameters::Unit;
use crate::plant::Plant;

/// The stage of the chain in which an effect sits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// The discrete regulator and the command's way to it.
    Regulator,
    /// The proportional (pilot) valve.
    PilotValve,
    /// The emergency shutdown valve.
    Esv,
    /// Control chamber and spool.
    Spool,
    /// Main ports, servomotor and its load.
    Servomotor,
    /// Tank, line and oil supply.
    Supply,
    /// Transducers and clocks.
    Sensor,
}

impl Stage {
    /// All stages, along the chain.
    pub const ALL: [Self; 7] =
        [Self::Regulator, Self::PilotValve, Self::Esv, Self::Spool, Self::Servomotor, Self::Supply, Self::Sensor];

    /// The id in reports and labels.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Regulator => "regulator",
            Self::PilotValve => "pilot_valve",
            Self::Esv => "esv",
            Self::Spool => "spool",
            Self::Servomotor => "servomotor",
            Self::Supply => "supply",
            Self::Sensor => "sensor",
        }
    }
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectParameter {
    /// Name as parameter files write it, with its unit suffix.
    pub name: &'static str,
    /// Unit, `1` where there is none.
    pub unit: &'static str,
    /// Value at which the effect vanishes exactly.
    pub neutral: f64,
    /// Smallest value that makes physical sense.
    pub min: f64,
    /// Largest value that makes physical sense.
    pub max: f64,
    /// Value of a moderate fault: where searches start, and the scale of their steps.
    pub typical: f64,
    /// What it is.
    pub doc: &'static str,
}

/// An effect: what it is called, what it needs, and how it enters the plant.
#[derive(Clone, Copy)]
pub struct EffectSpec {
    /// Its id, a contract with reports and parameter files.
    pub id: &'static str,
    /// Where it sits.
    pub stage: Stage,
    /// The source file, whose head is the effect's documentation.
    pub source: &'static str,
    /// Its parameters; [`crate::parameters::EffectSetting::values`] has their order.
    pub parameters: &'static [EffectParameter],
    /// Builds it into a plant; one value for each parameter.
    pub apply: &'static (dyn Fn(&[f64], &mut Plant) + Send + Sync),
}

impl fmt::Debug for EffectSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EffectSpec").field("id", &self.id).field("stage", &self.stage).finish_non_exhaustive()
    }
}

/// What the head of an effect's file says, in plain words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// What it is.
    pub summary: String,
    /// Its equation and where it comes from.
    pub equation: String,
    /// Symbol, meaning and unit, symbol by symbol.
    pub symbols: Vec<[String; 3]>,
    /// What the gap looks like where the twin lacks it.
    pub symptom: String,
    /// What it leaves out.
    pub limits: String,
}

impl EffectSpec {
    /// Reads the head of its file.
    #[must_use]
    pub fn head(&self) -> Head {
        let lines = self.source.lines().map_while(|line| line.strip_prefix("//!")).map(str::trim);
        let mut paragraphs = vec![String::new()];
        let mut symbols = Vec::new();
        for line in lines {
            let mut cells = line.split('|').map(|cell| cell.trim().to_owned());
            match (line.strip_prefix('|'), paragraphs.last_mut()) {
                (Some(_), _) => {
                    symbols.extend(cells.next().and_then(|_| Some([cells.next()?, cells.next()?, cells.next()?])));
                }
                (None, Some(paragraph)) if !line.is_empty() && !paragraph.is_empty() => {
                    paragraph.push(' ');
                    paragraph.push_str(line);
                }
                (None, Some(paragraph)) if !line.is_empty() => paragraph.push_str(line),
                (None, Some(paragraph)) if !paragraph.is_empty() => paragraphs.push(String::new()),
                (None, _) => {}
            }
        }
        let mut paragraphs = paragraphs.into_iter();
        let mut next = || paragraphs.next().unwrap_or_default();
        let (summary, equation, last) = (next(), next(), next());
        let (symptom, limits) = last.split_once(" Limits: ").unwrap_or((&last, ""));
        // The first two rows of the table are its head.
        let symbols = symbols.split_off(2.min(symbols.len()));
        Head { summary, equation, symbols, symptom: symptom.to_owned(), limits: limits.to_owned() }
    }
}

/// Every effect that the twin can switch on, by stage along the chain.
pub const CATALOGUE: &[EffectSpec] = &[
    command_delay::SPEC,
    command_gain::SPEC,
    regulator_cycle::SPEC,
    pv_overlap::SPEC,
    pv_null_shift::SPEC,
    pv_hysteresis::SPEC,
    pv_bandwidth::SPEC,
    pilot_filter::SPEC,
    current_limit::SPEC,
    esv_delay::SPEC,
    esv_slow::SPEC,
    spool_friction::SPEC,
    entrained_air::SPEC,
    chamber_leak::SPEC,
    spring::SPEC,
    flow_force::SPEC,
    viscosity::SPEC,
    valve_lag::SPEC,
    flow_saturation::SPEC,
    port_overlap::SPEC,
    port_wear::SPEC,
    port_asymmetry::SPEC,
    backlash::SPEC,
    servo_friction::SPEC,
    servo_leak::SPEC,
    cushion::SPEC,
    load::SPEC,
    supply_loss::SPEC,
    return_loss::SPEC,
    lvdt_gain::SPEC,
    lvdt_bias::SPEC,
    feedback_bias::SPEC,
    feedback_lag::SPEC,
    clock_offset::SPEC,
];

/// Effects that are tried only where the servomotor stage stands alone: no unit of a planned battery has them, so that nobody knows yet what
/// they would take from others in the whole chain. There the regulator makes up for worn ports: in units of the battery that have them the
/// strongest signal moves by 0.9 to 2.3 times its noise floor. Lag and saturation behind a recorded valve signal are no part of a simulated spool.
pub const STAGE_ALONE: &[&str] = &["valve_lag", "flow_saturation", "port_wear", "port_asymmetry"];

/// The effects that are tried in the whole chain.
pub fn of_the_chain() -> impl Iterator<Item = &'static EffectSpec> {
    CATALOGUE.iter().filter(|spec| !STAGE_ALONE.contains(&spec.id))
}

/// The effect with this id.
#[must_use]
pub fn find(id: &str) -> Option<&'static EffectSpec> {
    CATALOGUE.iter().find(|spec| spec.id == id)
}

/// The effect with this id, of the catalogue or of the unit's owner.
#[must_use]
pub fn find_in(unit: &Unit, id: &str) -> Option<&'static EffectSpec> {
    find(id).or_else(|| unit.own_effects.iter().find(|own| own.id == id).and_then(|own| own::spec(own).ok()))
}

/// Builds a unit's effects into its plant in the catalogue's order, so that the order of the list does not matter;
/// then the owner's.
///
/// Settings that nobody knows, and definitions that are not right, are for the edge to refuse.
pub fn apply(unit: &Unit, plant: &mut Plant) {
    let own = unit.own_effects.iter().filter_map(|own| own::spec(own).ok());
    for spec in CATALOGUE.iter().chain(own) {
        for setting in unit.effects.iter().filter(|setting| setting.id == spec.id) {
            (spec.apply)(&setting.values, plant);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_read_in_its_parts() {
        for spec in CATALOGUE {
            let head = spec.head();
            for part in [&head.summary, &head.equation, &head.symptom, &head.limits] {
                assert!(part.len() > 6 && !part.contains('\n') && part.ends_with('.'), "{}: {part}", spec.id);
            }
            assert!(head.symptom.starts_with("Without it ") && !head.symptom.contains("Limits"), "{}", spec.id);
            assert!(head.symbols.len() >= spec.parameters.len(), "{}", spec.id);
            assert!(head.symbols.iter().flatten().all(|cell| !cell.is_empty()), "{}: {:?}", spec.id, head.symbols);
        }
        let head = find("port_overlap").map(EffectSpec::head).unwrap_or_default();
        assert_eq!(head.symbols, [["Δh", "extra overlap `extra_overlap_m`", "m"].map(str::to_owned)]);
    }
}
