//! The effects of an overlay file: the catalogue's by their values, the owner's with their definitions.

use crate::effects::find_in;
use crate::parameters::{EffectSetting, OwnEffect, OwnParameter};
use crate::params::number::number_text;

use super::{Overlay, line, quoted};

/// Adds the lines of one effect.
pub(super) fn push(lines: &mut Vec<String>, overlay: &Overlay, setting: &EffectSetting) {
    let id = &setting.id;
    let comment = |name: &str| overlay.comments.get(&format!("{id}.{name}")).map_or("", String::as_str);
    if let Some(own) = overlay.unit.own_effects.iter().find(|own| own.id == *id) {
        lines.push(line(2, id, "", ""));
        definition(lines, own);
        for (parameter, value) in own.parameters.iter().zip(&setting.values) {
            lines.push(line(6, &parameter.name, &of_own(parameter, *value), comment(&parameter.name)));
        }
        return;
    }
    let known = find_in(&overlay.unit, id).map_or(&[][..], |spec| spec.parameters);
    let values = known.iter().map(|known| known.name).zip(setting.values.iter().map(|value| number_text(*value)));
    if known.iter().all(|known| comment(known.name).is_empty()) {
        let values: Vec<String> = values.map(|(name, value)| format!("{name}: {value}")).collect();
        lines.push(line(2, id, &format!("{{{}}}", values.join(", ")), ""));
    } else {
        lines.push(line(2, id, "", ""));
        lines.extend(values.map(|(name, value)| line(4, name, &value, comment(name))));
    }
}

fn definition(lines: &mut Vec<String>, own: &OwnEffect) {
    for (key, text) in [("at", &own.at), ("stage", &own.stage), ("doc", &own.doc), ("expression", &own.expression)] {
        if !text.is_empty() {
            lines.push(line(4, key, &quoted(text), ""));
        }
    }
    lines.push(line(4, "parameters", "", ""));
}

fn of_own(parameter: &OwnParameter, value: f64) -> String {
    let OwnParameter { unit, neutral, min, max, typical, doc, .. } = parameter;
    let numbers = [("value", value), ("neutral", *neutral), ("min", *min), ("max", *max), ("typical", *typical)];
    let mut parts = vec![format!("unit: {}", quoted(unit))];
    parts.extend(numbers.map(|(key, number)| format!("{key}: {}", number_text(number))));
    if !doc.is_empty() {
        parts.push(format!("doc: {}", quoted(doc)));
    }
    format!("{{{}}}", parts.join(", "))
}
