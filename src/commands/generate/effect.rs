//! Effects as a command line names them: `ID=VALUE[,VALUE…]` or `ID.parameter=VALUE`.

use anyhow::bail;
use govtwin_model::effects::{CATALOGUE, EffectParameter, EffectSpec, find_in};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params::{nearest, number_text, quantity_text};

use crate::commands::usage;

/// Adds what the arguments name to a unit's effects; parameters not named stay as they are, or neutral.
pub fn add(arguments: &[String], unit: &mut Unit) -> anyhow::Result<()> {
    for argument in arguments {
        add_one(argument, unit).map_err(|error| usage(format!("--effect {argument}: {error}")))?;
    }
    Ok(())
}

fn add_one(argument: &str, unit: &mut Unit) -> anyhow::Result<()> {
    let Some((place, values)) = argument.split_once('=') else {
        bail!("expected ID=VALUE, such as `port_overlap=2e-4`; `govtwin effects` lists ids and parameters");
    };
    let (id, name) = place.split_once('.').map_or((place, None), |(id, name)| (id, Some(name)));
    let spec = known(unit, id)?;
    let values: Vec<&str> = values.split(',').map(str::trim).collect();
    let first = match name {
        None => 0,
        Some(name) => match spec.parameters.iter().position(|parameter| parameter.name == name) {
            Some(first) => first,
            None => bail!("`{id}` has no parameter `{name}`{}", hint(name, spec.parameters.iter().map(|p| p.name))),
        },
    };
    if values.len() > spec.parameters.len() || (name.is_some() && values.len() > 1) {
        let names: Vec<&str> = spec.parameters.iter().map(|parameter| parameter.name).collect();
        bail!("too many values; the parameters of `{id}` are {}", names.join(", "));
    }
    let at = unit.effect_at(spec);
    for (k, text) in values.iter().enumerate() {
        unit.effects[at].values[first + k] = value(text, &spec.parameters[first + k].on(&unit.parameters))?;
    }
    Ok(())
}

/// The effect with this id, of the catalogue or of the unit's owner.
pub fn known(unit: &Unit, id: &str) -> anyhow::Result<&'static EffectSpec> {
    let own = unit.own_effects.iter().map(|own| own.id.as_str());
    match find_in(unit, id) {
        Some(spec) => Ok(spec),
        None => Err(usage(format!(
            "there is no effect `{id}`{}",
            hint(id, CATALOGUE.iter().map(|spec| spec.id).chain(own))
        ))),
    }
}

fn value(text: &str, parameter: &EffectParameter) -> anyhow::Result<f64> {
    let Ok(value) = text.parse::<f64>() else {
        bail!("{}: expected a number, found `{text}`", parameter.name);
    };
    if !(parameter.min..=parameter.max).contains(&value) {
        bail!(
            "{}: {} is outside the physical range, {} to {}",
            parameter.name,
            quantity_text(value, parameter.unit),
            number_text(parameter.min),
            quantity_text(parameter.max, parameter.unit),
        );
    }
    Ok(value)
}

fn hint<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> String {
    nearest(word, known).map(|near| format!("; did you mean `{near}`?")).unwrap_or_default()
}

/// An effect with its values, in words.
pub fn text(unit: &Unit, setting: &EffectSetting) -> String {
    let known = find_in(unit, &setting.id).map_or(&[][..], |spec| spec.parameters);
    let values: Vec<String> = known
        .iter()
        .zip(&setting.values)
        .map(|(parameter, value)| format!("{} {}", parameter.name, quantity_text(*value, parameter.unit)))
        .collect();
    format!("{} ({})", setting.id, values.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(arguments: &[&str]) -> anyhow::Result<Vec<EffectSetting>> {
        let mut unit = govtwin_model::params::reference();
        add(&arguments.iter().map(|argument| (*argument).to_owned()).collect::<Vec<_>>(), &mut unit)?;
        Ok(unit.effects)
    }

    #[test]
    fn values_go_by_order_or_by_name() {
        let by_order = read(&["servo_friction=6e4,1.5", "backlash=0.002"]).unwrap();
        let by_name =
            read(&["servo_friction.static_ratio=1.5", "backlash.play_pu=0.002", "servo_friction.extra_coulomb_n=6e4"]);
        assert_eq!(by_order, by_name.unwrap());
        assert_eq!(by_order[0].values, [6e4, 1.5]);
        assert_eq!(read(&["servo_friction=6e4"]).unwrap()[0].values, [6e4, 1.0]);
    }

    #[test]
    fn slips_say_the_way_out() {
        for (argument, expected) in [
            ("backlash", "expected ID=VALUE"),
            ("backlsh=1", "did you mean `backlash`?"),
            ("backlash.play=1", "did you mean `play_pu`?"),
            ("backlash=x", "expected a number, found `x`"),
            ("backlash=0.5", "0.5 pu is outside the physical range, 0.0 to 0.1 pu"),
            ("backlash=nan", "outside the physical range"),
            ("backlash=0.001,0.002", "too many values; the parameters of `backlash` are play_pu"),
        ] {
            let error = format!("{:#}", read(&[argument]).unwrap_err());
            assert!(error.contains(expected), "{argument}: {error}");
        }
    }
}
