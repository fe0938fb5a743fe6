//! Effects of the owner's: a force, flow or signal term with an expression in the state, from a file alone.
//!
//! The value of the expression is added to the signal at its point. It is evaluated once a tick with the state at the tick's
//! start and holds over the tick, so that a force that falls by more than twice the mass within a tick's change of
//! speed makes the simulation ring; where it gives no finite number, nothing is added.

pub mod expression;
pub mod names;

use std::sync::{Arc, Mutex, PoisonError};

use crate::effects::own::expression::{Expression, Fault, functions};
use crate::effects::own::names::{VARIABLES, sample};
use crate::effects::{Build, EffectParameter, EffectSpec, Scaling, Stage, find};
use crate::parameters::{OwnEffect, OwnParameter};
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};

/// States at which a definition is tried.
const SAMPLES: usize = 256;
/// No recording can distinguish more parameters.
const MOST_PARAMETERS: usize = 6;

/// What can be wrong with a definition.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OwnError {
    /// A word that means nothing at its place.
    #[error("`{found}` is not known; known are {}", known.join(", "))]
    Unknown {
        /// The key of the definition that holds it.
        key: &'static str,
        /// The word.
        found: String,
        /// The words known there.
        known: Vec<&'static str>,
    },
    /// A name in the expression that means nothing.
    #[error("`{found}` is neither a parameter nor in the state; known are {}", known.join(", "))]
    Name {
        /// The name.
        found: String,
        /// The names known there.
        known: Vec<String>,
    },
    /// Anything else wrong under one key.
    #[error("{message}")]
    At {
        /// The key of the definition, dotted.
        key: String,
        /// What was found, what is expected.
        message: String,
    },
}

impl OwnError {
    fn at(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self::At { key: key.into(), message: message.into() }
    }

    /// The key of the definition that is wrong, dotted; empty for the whole.
    pub fn key(&self) -> &str {
        match self {
            Self::Unknown { key, .. } => key,
            Self::Name { .. } => "expression",
            Self::At { key, .. } => key,
        }
    }
}

/// Definitions used so far, each with a specification of static lifetime: every distinct one once, so that fits and
/// reports treat them like the catalogue's. Building a twin does not use it.
static MET: Mutex<Vec<(OwnEffect, &'static EffectSpec)>> = Mutex::new(Vec::new());

/// The specification of an owner's effect.
///
/// # Errors
/// When a name is not known, the expression cannot be read, a range is not one, or the effect does not vanish at its
/// neutral values.
pub fn spec(own: &OwnEffect) -> Result<&'static EffectSpec, OwnError> {
    let mut met = MET.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, spec)) = met.iter().find(|(known, _)| known == own) {
        return Ok(spec);
    }
    let spec: &'static EffectSpec = Box::leak(Box::new(specified(own)?));
    met.push((own.clone(), spec));
    Ok(spec)
}

/// The stage to which a term at a point belongs unless its definition names another.
fn usual_stage(point: Point) -> Stage {
    match point {
        Point::Command | Point::RegulatorServomotor | Point::RegulatorSpool | Point::ValveCurrent => Stage::Regulator,
        Point::EsvOpening => Stage::Esv,
        Point::SupplyPressure => Stage::Supply,
        Point::ServomotorReading => Stage::Sensor,
        Point::DrivingSpool | Point::SpoolForce | Point::ChamberFlow => Stage::Spool,
        Point::ServomotorForce | Point::OpeningFlow | Point::ClosingFlow => Stage::Servomotor,
    }
}

/// Builds an owner's effect into a plant; values that the setting lacks are neutral. An invalid definition adds nothing.
pub(super) fn build(own: &OwnEffect, values: &[f64], plant: &mut Plant) {
    if let Ok((_, law)) = law(own) {
        let missing = law.neutral.iter().skip(values.len());
        let values: Vec<f64> = values.iter().chain(missing).copied().take(law.neutral.len()).collect();
        law.build(&values, plant);
    }
}

/// The law of a definition, and its stage.
fn law(own: &OwnEffect) -> Result<(Stage, OwnLaw), OwnError> {
    let unknown = |key, found: &str, known| OwnError::Unknown { key, found: found.to_owned(), known };
    if !is_name(&own.id) || find(&own.id).is_some() {
        return Err(OwnError::at(
            "",
            "an effect of your own needs an id of lower-case letters, digits and `_` that the catalogue does not have",
        ));
    }
    let point = Point::ALL
        .into_iter()
        .find(|point| point.id() == own.at)
        .ok_or_else(|| unknown("at", &own.at, Point::ALL.map(Point::id).to_vec()))?;
    let stage = match own.stage.as_str() {
        "" => usual_stage(point),
        id => Stage::with_id(id).ok_or_else(|| unknown("stage", id, Stage::ALL.map(Stage::id).to_vec()))?,
    };
    if !(1..=MOST_PARAMETERS).contains(&own.parameters.len()) {
        let message = format!(
            "expected 1 to {MOST_PARAMETERS} parameters, found {}: what has none cannot be switched off or fitted",
            own.parameters.len()
        );
        return Err(OwnError::at("parameters", message));
    }
    own.parameters.iter().try_for_each(check)?;
    let neutral = own.parameters.iter().map(|parameter| parameter.neutral).collect();
    Ok((stage, OwnLaw { law: Arc::new(Law { point, expression: compile(own)? }), neutral }))
}

/// The specification of a definition; its contents have static lifetime.
fn specified(own: &OwnEffect) -> Result<EffectSpec, OwnError> {
    let (stage, law) = law(own)?;
    let typical: Vec<f64> = own.parameters.iter().map(|parameter| parameter.typical).collect();
    tried(&law.law, &law.neutral, &typical)?;
    let parameters: Vec<EffectParameter> = own.parameters.iter().map(lasting).collect();
    Ok(EffectSpec {
        id: leaked(&own.id),
        stage,
        source: leaked(&head(own)),
        parameters: Box::leak(parameters.into_boxed_slice()),
        law: Box::leak(Box::new(law)),
    })
}

fn is_name(text: &str) -> bool {
    let letters = text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    letters && text.starts_with(|c: char| c.is_ascii_lowercase())
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

fn lasting(own: &OwnParameter) -> EffectParameter {
    EffectParameter {
        name: leaked(&own.name),
        unit: leaked(&own.unit),
        neutral: own.neutral,
        min: own.min,
        max: own.max,
        typical: own.typical,
        scaling: Scaling::Fixed,
        doc: leaked(if own.doc.is_empty() { &own.name } else { &own.doc }),
    }
}

fn check(own: &OwnParameter) -> Result<(), OwnError> {
    let key = format!("parameters.{}", own.name);
    let taken = VARIABLES.iter().any(|v| v.name == own.name) || functions().any(|f| f == own.name) || own.name == "pi";
    if taken || !is_name(&own.name.to_lowercase()) {
        return Err(OwnError::at(key, "a parameter needs a name of its own, of letters, digits and `_`"));
    }
    let OwnParameter { neutral, min, max, typical, .. } = *own;
    if ![neutral, min, max, typical].iter().all(|value| value.is_finite()) || min >= max {
        return Err(OwnError::at(key, format!("expected finite numbers with min < max, found {min} and {max}")));
    }
    for (word, value) in [("neutral", neutral), ("typical", typical)] {
        if !(min..=max).contains(&value) {
            return Err(OwnError::at(key, format!("{word} {value} lies outside min {min} to max {max}")));
        }
    }
    if neutral == typical {
        return Err(OwnError::at(key, "`typical` must differ from `neutral`: it is the scale of a search"));
    }
    Ok(())
}

fn compile(own: &OwnEffect) -> Result<Expression, OwnError> {
    let place = |name: &str| {
        let variable = VARIABLES.iter().position(|variable| variable.name == name);
        let parameter = || own.parameters.iter().position(|parameter| parameter.name == name);
        variable.or_else(|| parameter().map(|k| VARIABLES.len() + k))
    };
    let expression = Expression::new(&own.expression, &place).map_err(|fault| match fault {
        Fault::Syntax { column, message } => OwnError::at("expression", format!("at character {column}: {message}")),
        Fault::Function(found) => OwnError::Unknown { key: "expression", found, known: functions().collect() },
        Fault::Name(found) => {
            let parameters = own.parameters.iter().map(|parameter| parameter.name.clone());
            OwnError::Name { found, known: parameters.chain(VARIABLES.map(|v| v.name.to_owned())).collect() }
        }
    })?;
    match own.parameters.iter().enumerate().find(|(k, _)| !expression.uses(VARIABLES.len() + k)) {
        Some((_, unused)) => {
            Err(OwnError::at(format!("parameters.{}", unused.name), "the expression does not use this parameter"))
        }
        None => Ok(expression),
    }
}

/// Refuses what does not vanish when neutral, or has no value in usual states.
fn tried(law: &Law, neutral: &[f64], typical: &[f64]) -> Result<(), OwnError> {
    for number in 0..SAMPLES {
        let state = sample(number);
        let at_state = || {
            let used = VARIABLES.iter().enumerate().filter(|(k, _)| law.expression.uses(*k));
            let words: Vec<String> =
                used.map(|(k, variable)| format!("{} = {:.4e}", variable.name, state[k])).collect();
            if words.is_empty() { String::new() } else { format!(" at {}", words.join(", ")) }
        };
        for (words, values) in [("neutral", neutral), ("typical", typical)] {
            let added = law.added(|k| state[k], values);
            if !added.is_finite() {
                let found = format!("with {words} parameters it gives {added}{}", at_state());
                return Err(OwnError::at("expression", format!("{found}; guard it, as in `max(…, 1e-9)`")));
            }
        }
        let added = law.added(|k| state[k], neutral);
        if added != 0.0 {
            let found = format!("with neutral parameters it adds {added:.4e}{}", at_state());
            let expected = "it must add exactly 0 there, or the twin without the effect is another one";
            return Err(OwnError::at("expression", format!("{found}; {expected}")));
        }
    }
    Ok(())
}

/// The head of an effect's file, as the catalogue's files have it.
fn head(own: &OwnEffect) -> String {
    let sentence = |text: &str| format!("{}.", text.trim_end_matches('.'));
    let doc = if own.doc.is_empty() { format!("A term of the owner's at {}", own.at) } else { own.doc.clone() };
    let mut lines = vec![sentence(&doc), String::new(), format!("`{} += {}`.", own.at, own.expression), String::new()];
    lines.extend(["| symbol | meaning | unit |".to_owned(), "|---|---|---|".to_owned()]);
    for p in &own.parameters {
        lines.push(format!("| {} | {} | {} |", p.name, if p.doc.is_empty() { "parameter" } else { &p.doc }, p.unit));
    }
    for variable in VARIABLES.iter().filter(|variable| own.expression.contains(variable.name)) {
        lines.push(format!("| {} | {} | {} |", variable.name, variable.doc, variable.unit));
    }
    lines.push(String::new());
    lines.push("Without it the twin lacks what its author supposes. Limits: no memory; held over a tick.".to_owned());
    lines.iter().map(|line| format!("//! {line}\n")).collect()
}

/// What an expression adds at a point.
#[derive(Debug)]
struct Law {
    point: Point,
    expression: Expression,
}

impl Law {
    #[inline]
    fn added(&self, variable: impl Fn(usize) -> f64, values: &[f64]) -> f64 {
        self.expression.value(|place| match place.checked_sub(VARIABLES.len()) {
            None => variable(place),
            Some(parameter) => values.get(parameter).copied().unwrap_or(f64::NAN),
        })
    }
}

/// A law with the values at which it vanishes.
struct OwnLaw {
    law: Arc<Law>,
    neutral: Vec<f64>,
}

impl Build for OwnLaw {
    fn build(&self, values: &[f64], plant: &mut Plant) {
        if values != self.neutral {
            plant.terms.push(Arc::new(Added { law: Arc::clone(&self.law), values: values.to_vec() }));
        }
    }
}

/// A law with its parameters, built into a plant.
#[derive(Debug)]
struct Added {
    law: Arc<Law>,
    values: Vec<f64>,
}

impl Term for Added {
    fn point(&self) -> Point {
        self.law.point
    }

    fn apply(&self, signal: f64, view: &View<'_>, _memory: &mut [f64]) -> f64 {
        let added = self.law.added(|k| (VARIABLES[k].of)(signal, view), &self.values);
        if added.is_finite() { signal + added } else { signal }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::time::Duration;

    use super::*;
    use crate::params::reference;
    use crate::twin::Twin;

    #[test]
    fn a_twin_is_built_while_somebody_holds_the_definitions() {
        let parameter = OwnParameter {
            name: "a".to_owned(),
            unit: "1".to_owned(),
            neutral: 0.0,
            min: 0.0,
            max: 1.0e3,
            typical: 1.0,
            doc: String::new(),
        };
        let own = OwnEffect {
            id: "mine".to_owned(),
            doc: String::new(),
            at: "servomotor_force_n".to_owned(),
            stage: String::new(),
            expression: "-a*servomotor_velocity_m_s".to_owned(),
            parameters: vec![parameter],
        };
        let unit = reference().with_own_effect(own).unwrap().with_effect("mine", &[("a", 5.0)]).unwrap();
        let held = MET.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, built) = mpsc::channel();
        std::thread::spawn(move || done.send(Twin::new(&unit).plant().terms.is_empty_at(Point::ServomotorForce)));
        assert_eq!(built.recv_timeout(Duration::from_secs(60)), Ok(false));
        drop(held);
    }
}
