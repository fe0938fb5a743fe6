//! The effect catalogue: what a real unit may do beyond the nominal model, as switches of the same twin.
//!
//! An effect is one file and one line of [`CATALOGUE`]. Applied with its neutral values it leaves the
//! plant as it is, to the last bit.

/// An effect as its file defines it: its id, stage and law, then a row for each parameter, from least to most.
///
/// The law takes as many values as there are rows, which the compiler checks; the file's own text is its source.
macro_rules! effect {
    ($id:literal, $stage:ident, $law:ident; $($name:literal [$unit:literal] $min:literal ..= $max:literal,
        neutral $neutral:literal, typical $typical:literal $(, scales with $scaling:ident)?: $doc:literal;)+) => {{
        const LAW: $crate::effects::EffectLaw<{ [$($name),+].len() }> = $crate::effects::EffectLaw($law);
        $crate::effects::EffectSpec {
            id: $id,
            stage: $crate::effects::Stage::$stage,
            source: include_str!(concat!($id, ".rs")),
            parameters: &[$($crate::effects::EffectParameter {
                name: $name,
                unit: $unit,
                neutral: $neutral,
                min: $min,
                max: $max,
                typical: $typical,
                scaling: [$($crate::effects::Scaling::$scaling,)? $crate::effects::Scaling::Fixed][0],
                doc: $doc,
            }),+],
            law: &LAW,
        }
    }};
}

pub(crate) mod backlash;
pub(crate) mod chamber_leak;
pub(crate) mod clock_offset;
pub(crate) mod command_delay;
pub(crate) mod command_gain;
pub(crate) mod current_limit;
pub(crate) mod cushion;
pub(crate) mod entrained_air;
pub(crate) mod esv_delay;
pub(crate) mod esv_slow;
pub(crate) mod feedback_bias;
pub(crate) mod feedback_lag;
pub(crate) mod flow_force;
pub(crate) mod flow_saturation;
pub(crate) mod load;
pub(crate) mod lvdt_bias;
pub(crate) mod lvdt_gain;
pub mod on_unit;
pub mod own;
pub(crate) mod pilot_filter;
pub(crate) mod port_asymmetry;
pub(crate) mod port_overlap;
pub(crate) mod port_wear;
pub(crate) mod pv_bandwidth;
pub(crate) mod pv_hysteresis;
pub(crate) mod pv_null_shift;
pub(crate) mod pv_overlap;
pub(crate) mod regulator_cycle;
pub(crate) mod return_loss;
pub mod scaling;
pub(crate) mod servo_friction;
pub(crate) mod servo_leak;
pub(crate) mod spool_friction;
pub(crate) mod spring;
pub(crate) mod supply_loss;
pub(crate) mod valve_lag;
pub(crate) mod viscosity;

use std::fmt;

pub use crate::effects::scaling::Scaling;
use crate::effects::scaling::UnitSize;
use crate::parameters::{Parameters, Unit};
use crate::plant::Plant;
use crate::stored::{held_by_id, with_words};

with_words! {
    /// The stage of the chain in which an effect sits.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum Stage: id {
        /// The discrete regulator and the command's way to it.
        Regulator = "regulator",
        /// The proportional (pilot) valve.
        PilotValve = "pilot_valve",
        /// The emergency shutdown valve.
        Esv = "esv",
        /// Control chamber and spool.
        Spool = "spool",
        /// Main ports, servomotor and its load.
        Servomotor = "servomotor",
        /// Tank, line and oil supply.
        Supply = "supply",
        /// Transducers and clocks.
        Sensor = "sensor",
    }
}

held_by_id!(Stage, "a stage of the chain");

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
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
    /// What range and typical value are proportional to; the values given are those of the reference unit.
    pub scaling: Scaling,
    /// What it is.
    pub doc: &'static str,
}

impl EffectParameter {
    /// The same on a unit of another size: range and typical value as they are there.
    #[must_use]
    pub fn on(&self, parameters: &Parameters) -> Self {
        if self.scaling == Scaling::Fixed {
            return *self;
        }
        let factor = self.scaling.factor(&UnitSize::new(parameters));
        let scaled = |value: f64| self.neutral + factor * (value - self.neutral);
        Self { min: scaled(self.min), max: scaled(self.max), typical: scaled(self.typical), ..*self }
    }
}

/// An effect: what it is called, what it needs, and how it enters the plant.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct EffectSpec {
    /// Its id, a contract with reports and parameter files.
    pub id: &'static str,
    /// Where it sits.
    pub stage: Stage,
    /// Summary, equation, symbols, symptom and limits.
    pub source: &'static str,
    /// Its parameters; [`EffectSetting::values`](crate::parameters::EffectSetting::values) has their order.
    pub parameters: &'static [EffectParameter],
    law: &'static dyn Build,
}

/// How an effect of `N` parameters enters a plant.
pub(crate) struct EffectLaw<const N: usize>(pub fn([f64; N], &mut Plant));

/// A law of any number of parameters.
pub(crate) trait Build: Send + Sync {
    /// Builds it into a plant; one value for each parameter.
    fn build(&self, values: &[f64], plant: &mut Plant);
}

impl<const N: usize> Build for EffectLaw<N> {
    fn build(&self, values: &[f64], plant: &mut Plant) {
        // `EffectSpec::apply` hands over as many as there are parameters.
        if let Ok(values) = values.try_into() {
            self.0(values, plant);
        }
    }
}

impl fmt::Debug for EffectSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EffectSpec").field("id", &self.id).field("stage", &self.stage).finish_non_exhaustive()
    }
}

/// What the head of an effect's file says, in plain words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EffectHead {
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
    /// Builds it into a plant. Values that a setting lacks are neutral; what it has too many is ignored.
    pub(crate) fn apply(&self, values: &[f64], plant: &mut Plant) {
        self.law.build(&self.completed(values), plant);
    }

    /// One value for each parameter, in their order and units: as given, and neutral from where the given ones end.
    pub fn completed(&self, values: &[f64]) -> Vec<f64> {
        let given = values.iter().copied().map(Some).chain(std::iter::repeat(None));
        self.parameters.iter().zip(given).map(|(parameter, value)| value.unwrap_or(parameter.neutral)).collect()
    }

    /// Reads the head of its file.
    pub fn head(&self) -> EffectHead {
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
        EffectHead { summary, equation, symbols, symptom: symptom.to_owned(), limits: limits.to_owned() }
    }
}

/// Every effect that the twin can switch on, by stage along the chain.
///
/// ```
/// use govtwin_model::effects::{CATALOGUE, Stage};
///
/// let friction = CATALOGUE.iter().find(|effect| effect.id == "spool_friction").expect("it is in the catalogue");
/// assert_eq!(friction.stage, Stage::Spool);
/// assert_eq!(friction.parameters.iter().map(|one| (one.name, one.unit)).collect::<Vec<_>>(), [("coulomb_n", "N"), ("static_ratio", "1")]);
/// println!("{}", friction.head().equation);
/// ```
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

/// Effects that are tried only for a servomotor stage alone. No generated unit of the benchmark has them in its list of faults, so it is not
/// known how much probability they would take from others in the whole chain. There the regulator compensates worn ports: in generated units
/// that have them the strongest signal changes by 0.9 to 2.3 times its noise floor. Lag and saturation of a recorded valve signal are no part
/// of a simulated spool.
pub const STAGE_ALONE: &[&str] = &["valve_lag", "flow_saturation", "port_wear", "port_asymmetry"];

/// The effects that are tried in the whole chain.
pub fn of_the_chain() -> impl Iterator<Item = &'static EffectSpec> {
    CATALOGUE.iter().filter(|spec| !STAGE_ALONE.contains(&spec.id))
}

/// The effect with this id.
pub fn find(id: &str) -> Option<&'static EffectSpec> {
    CATALOGUE.iter().find(|spec| spec.id == id)
}

/// An effect's id as words: `pilot-valve overlap` of `pv_overlap`.
pub fn id_words(id: &str) -> String {
    let word = |part| match part {
        "pv" => "pilot-valve",
        "esv" => "ESV",
        "lvdt" => "LVDT",
        part => part,
    };
    id.split('_').map(word).collect::<Vec<_>>().join(" ")
}

/// The effect with this id, of the catalogue or of the unit's owner.
pub fn find_in(unit: &Unit, id: &str) -> Option<&'static EffectSpec> {
    find(id).or_else(|| unit.own_effects.iter().find(|own| own.id == id).and_then(|own| own::spec(own).ok()))
}

/// Builds a unit's effects into its plant in the catalogue's order, so that the order of the list does not matter;
/// then the owner's.
///
/// Settings of unknown effects, and invalid definitions, change nothing: the edge refuses them. Takes no lock.
pub fn apply(unit: &Unit, plant: &mut Plant) {
    for spec in CATALOGUE {
        for setting in unit.effects.iter().filter(|setting| setting.id == spec.id) {
            spec.apply(&setting.values, plant);
        }
    }
    for own in &unit.own_effects {
        for setting in unit.effects.iter().filter(|setting| setting.id == own.id) {
            own::build(own, &setting.values, plant);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_may_be_short_or_long_and_is_completed() {
        let spec = find("cushion").unwrap();
        assert_eq!(spec.completed(&[1e8]), [1e8, 0.1]);
        assert_eq!(spec.completed(&[]), [0.0, 0.1]);
        assert_eq!(spec.completed(&[1e8, 0.06, 7.0]), [1e8, 0.06]);
        let plant = |values: &[f64]| {
            let mut plant = crate::plant::reference();
            spec.apply(values, &mut plant);
            format!("{plant:?}")
        };
        assert_eq!(plant(&[1e8]), plant(&[1e8, 0.1]));
        assert_ne!(plant(&[1e8]), plant(&[]));
        // Every effect of the catalogue takes nothing at all for neutral.
        for spec in CATALOGUE {
            let (mut none, mut neutral) = (crate::plant::reference(), crate::plant::reference());
            spec.apply(&[], &mut none);
            spec.apply(&spec.completed(&[]), &mut neutral);
            assert_eq!(format!("{none:?}"), format!("{neutral:?}"), "{}", spec.id);
        }
    }

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
