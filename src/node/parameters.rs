//! The node's ROS 2 parameters: a table with units, ranges and reasons, and the rules for changing them.

mod domain;

use ros2_client::parameters::{ParameterValue, raw};

use domain::Domain;
pub(crate) use domain::words_of;

use super::arguments::{ParameterOverride, hint};
use super::policy::{NodeInput, OnStale};
use super::settings::{InputSettings, NodeSettings};
use govtwin_model::effects::{CATALOGUE, EffectParameter, EffectSpec, own};
use govtwin_model::frame::EsvState;
use govtwin_model::parameters::{ENTRIES, EffectSetting, Unit, entry};
use govtwin_model::params::{Conflict, conflicts};

/// Prefix of the plant's parameters.
const UNIT_PREFIX: &str = "unit.";

/// Prefix of the effects' parameters.
const EFFECTS_PREFIX: &str = "effects.";

/// Effects that a running node can have: the catalogue's but the one that looks ahead in time, then the owner's.
fn live_effects(unit: &Unit) -> impl Iterator<Item = &EffectSpec> {
    let catalogue = CATALOGUE.iter().filter(|spec| spec.id != "clock_offset");
    catalogue.chain(unit.own_effects.iter().filter_map(|own| own::spec(own).ok()))
}

/// The fail-safes of one input, and the word for that of all.
const OWN_ON_STALE: [&str; 5] = [OnStale::NAMES[0], OnStale::NAMES[1], OnStale::NAMES[2], OnStale::NAMES[3], AS_ALL];
const AS_ALL: &str = "as_all";

/// States of the ESV.
const ESV_NAMES: [&str; 2] = ["shutdown", "normal"];

/// One parameter.
#[derive(Clone, Debug)]
struct NodeParameter {
    name: String,
    value: ParameterValue,
    domain: Domain,
    read_only: bool,
    description: String,
}

/// All parameters of the node, in the order of their names.
#[derive(Clone, Debug)]
pub(crate) struct ParameterStore {
    entries: Vec<NodeParameter>,
    unit: Unit,
}

impl ParameterStore {
    /// The table for these settings and this unit.
    pub(crate) fn new(settings: &NodeSettings, unit: &Unit) -> Self {
        let mut entries = Vec::new();
        let mut add = |name: &str, value, domain, read_only, description: &str| {
            entries.push(NodeParameter {
                name: name.to_owned(),
                value,
                domain,
                read_only,
                description: description.to_owned(),
            });
        };
        let real = ParameterValue::Double;
        let cpu = settings.wishes.cpu.and_then(|cpu| i64::try_from(cpu).ok()).unwrap_or(-1);
        let priority = i64::from(settings.wishes.priority);
        add("rate", real(settings.rate_hz), Domain::Real(1.0, 10_000.0), true, "Ticks of the model per second [Hz]");
        let publish_rate = Domain::Real(0.1, 10_000.0);
        add("publish_rate", real(settings.publish_rate_hz), publish_rate, false, "Published states per second [Hz]");
        let seconds = Domain::Real(0.001, 86_400.0);
        add("stale_after", real(settings.stale_after_s), seconds, false, "An input older than this is stale [s]");
        let hold = "How long a stale input is held before the fail-safe [s]";
        add("hold", real(settings.hold_s), Domain::Real(0.0, 86_400.0), false, hold);
        let on_stale = ParameterValue::String(settings.on_stale.name().to_owned());
        let choices = Domain::Choice(&OnStale::NAMES);
        add("on_stale", on_stale, choices, false, "Fail-safe: trip the ESV, hold for ever, or stop the node");
        let simulated = ParameterValue::Boolean(settings.use_sim_time);
        let follow = "Follow /clock instead of the machine's clock; where it changes, the process's nodes begin anew";
        add("use_sim_time", simulated, Domain::Bool, false, follow);
        let cpu_doc = "Core of the integration thread, -1 for any";
        add("cpu", ParameterValue::Integer(cpu), Domain::Whole(-1, 1023), true, cpu_doc);
        let priority_doc = "SCHED_FIFO priority of the integration thread, 0 for none";
        add("priority", ParameterValue::Integer(priority), Domain::Whole(0, 99), true, priority_doc);
        for (input, name) in settings.inputs.iter().zip(NodeInput::NAMES) {
            let required = ParameterValue::Boolean(input.required);
            let wait =
                "Whether the twin waits for this input; one that is not required has its default until it is heard";
            add(&format!("inputs.{name}.required"), required, Domain::Bool, true, wait);
            let own = Domain::Real(0.0, 86_400.0);
            let stale = "This input is stale when older than this; 0 for stale_after [s]";
            add(&format!("inputs.{name}.stale_after"), real(input.stale_after_s.unwrap_or(0.0)), own, false, stale);
            let held = "How long this stale input is held; -1 for hold [s]";
            let from_minus_one = Domain::Real(-1.0, 86_400.0);
            add(&format!("inputs.{name}.hold"), real(input.hold_s.unwrap_or(-1.0)), from_minus_one, false, held);
            let choice = input.on_stale.map_or(AS_ALL, OnStale::name);
            let choice = ParameterValue::String(choice.to_owned());
            let fail_safe = "Fail-safe of this input; `as_all` for on_stale";
            add(&format!("inputs.{name}.on_stale"), choice, Domain::Choice(&OWN_ON_STALE), false, fail_safe);
        }
        let command = "Command that stands in for one never heard [pu]";
        add("inputs.command.default", real(settings.default_command_pu), Domain::Real(-0.5, 1.5), true, command);
        let esv = ParameterValue::String(ESV_NAMES[usize::from(settings.default_esv == EsvState::Normal)].to_owned());
        let esv_doc = "ESV state that stands in for one never heard";
        add("inputs.esv.default", esv, Domain::Choice(&ESV_NAMES), true, esv_doc);
        let pressure = real(settings.default_tank_pressure_pa.unwrap_or(0.0));
        let pressure_doc = "Tank pressure that stands in for one never heard; 0 for the unit's own [Pa]";
        add("inputs.tank_pressure.default", pressure, Domain::Real(0.0, 1.0e8), true, pressure_doc);
        let own_clock = "Count time from 0 and publish it as /clock";
        add("publish_clock", ParameterValue::Boolean(settings.publish_clock), Domain::Bool, true, own_clock);
        let max_age = "A sample whose stamp is older, or as far ahead, is refused; 0 for no limit [s]";
        let age = real(settings.max_stamp_age_s.unwrap_or(0.0));
        add("max_stamp_age", age, Domain::Real(0.0, 86_400.0), false, max_age);
        let latch = "Whether the trip of a fail-safe stays until ~/reset_trip, also when all inputs are back";
        add("latch_trip", ParameterValue::Boolean(settings.latch_trip), Domain::Bool, true, latch);
        let timeout = "How long a step waits for the inputs that await it [s]";
        add("steps.timeout", real(settings.step_timeout_s), Domain::Real(0.001, 3600.0), true, timeout);
        for (awaited, name) in settings.step_inputs.into_iter().zip(NodeInput::NAMES) {
            let awaited = ParameterValue::Boolean(awaited);
            let doc = "Whether each order to step waits for a new sample of this input, which is then read reliably";
            add(&format!("steps.await.{name}"), awaited, Domain::Bool, true, doc);
        }
        let commanders = "Who may command, between commas: full names of nodes, `/bench/*` for several, or beginnings of ids; all where empty";
        add("commanders", ParameterValue::String(String::new()), Domain::Text, true, commanders);
        let paused = "Whether the simulation stands at first, to be stepped or played by its services";
        add("start_paused", ParameterValue::Boolean(settings.paused), Domain::Bool, true, paused);
        for row in ENTRIES {
            let description = format!("{} [{}]", row.doc.trim(), row.unit);
            let value = real((row.get)(&unit.parameters));
            add(&format!("{UNIT_PREFIX}{}", row.key), value, Domain::Real(row.min, row.max), false, &description);
        }
        for spec in live_effects(unit) {
            let setting = unit.effects.iter().find(|setting| setting.id == spec.id);
            for (index, parameter) in spec.parameters.iter().map(|one| one.on(&unit.parameters)).enumerate() {
                let value = setting.and_then(|setting| setting.values.get(index)).copied();
                let description =
                    format!("{}; {} is without it [{}]", parameter.doc, parameter.neutral, parameter.unit);
                let name = format!("{EFFECTS_PREFIX}{}.{}", spec.id, parameter.name);
                let domain = Domain::Real(parameter.min, parameter.max);
                add(&name, real(value.unwrap_or(parameter.neutral)), domain, false, &description);
            }
        }
        entries.sort_by(|a, b| a.name.cmp(&b.name));
        Self { entries, unit: unit.clone() }
    }

    /// The settings as they stand.
    pub(crate) fn settings(&self) -> NodeSettings {
        let real = |name: &str| match self.value(name) {
            ParameterValue::Double(value) => value,
            _ => f64::NAN,
        };
        let whole = |name| match self.value(name) {
            ParameterValue::Integer(value) => value,
            _ => 0,
        };
        let text = |name: &str| match self.value(name) {
            ParameterValue::String(text) => text,
            _ => String::new(),
        };
        let inputs = NodeInput::NAMES.map(|name| InputSettings {
            required: self.value(&format!("inputs.{name}.required")) != ParameterValue::Boolean(false),
            stale_after_s: Some(real(&format!("inputs.{name}.stale_after"))).filter(|own_s| *own_s > 0.0),
            hold_s: Some(real(&format!("inputs.{name}.hold"))).filter(|own_s| *own_s >= 0.0),
            on_stale: OnStale::named(&text(&format!("inputs.{name}.on_stale"))),
        });
        NodeSettings {
            rate_hz: real("rate"),
            publish_rate_hz: real("publish_rate"),
            stale_after_s: real("stale_after"),
            hold_s: real("hold"),
            on_stale: OnStale::named(&text("on_stale")).unwrap_or_default(),
            inputs,
            default_command_pu: real("inputs.command.default"),
            default_esv: if text("inputs.esv.default") == ESV_NAMES[0] { EsvState::Shutdown } else { EsvState::Normal },
            default_tank_pressure_pa: Some(real("inputs.tank_pressure.default")).filter(|own_pa| *own_pa > 0.0),
            use_sim_time: self.value("use_sim_time") == ParameterValue::Boolean(true),
            publish_clock: self.value("publish_clock") == ParameterValue::Boolean(true),
            paused: self.value("start_paused") == ParameterValue::Boolean(true),
            max_stamp_age_s: Some(real("max_stamp_age")).filter(|limit_s| *limit_s > 0.0),
            latch_trip: self.value("latch_trip") == ParameterValue::Boolean(true),
            step_inputs: NodeInput::NAMES
                .map(|name| self.value(&format!("steps.await.{name}")) == ParameterValue::Boolean(true)),
            step_timeout_s: real("steps.timeout"),
            wishes: super::realtime::Wishes {
                cpu: usize::try_from(whole("cpu")).ok(),
                priority: u8::try_from(whole("priority")).unwrap_or(0),
            },
        }
    }

    /// The unit with what was set before start.
    pub(crate) fn unit(&self) -> &Unit {
        &self.unit
    }

    /// Sets a parameter before start; read-only ones too.
    ///
    /// # Errors
    /// In words, on a name that is not there or a value that may not be.
    pub(crate) fn preset(&mut self, name: &str, given: &ParameterOverride) -> Result<(), String> {
        let index = self.find(name).ok_or_else(|| self.unknown(name))?;
        let domain = self.entries[index].domain;
        let value = match (domain, given) {
            (Domain::Real(..), ParameterOverride::Number(value)) => ParameterValue::Double(*value),
            #[expect(clippy::cast_possible_truncation, reason = "checked to be whole; out of range is refused below")]
            (Domain::Whole(..), ParameterOverride::Number(value)) if value.fract() == 0.0 => {
                ParameterValue::Integer(*value as i64)
            }
            (Domain::Bool, ParameterOverride::Bool(value)) => ParameterValue::Boolean(*value),
            (Domain::Choice(_) | Domain::Text, ParameterOverride::Text(text)) => ParameterValue::String(text.clone()),
            (_, given) => return Err(format!("`{name}` is {}, not {given}", domain.words())),
        };
        domain.check(name, &value)?;
        self.take(index, value);
        Ok(())
    }

    /// Takes a value that was checked, into the unit too where it is one of its own.
    fn take(&mut self, index: usize, value: ParameterValue) {
        let name = self.entries[index].name.clone();
        if let (Some(row), ParameterValue::Double(number)) = (name.strip_prefix(UNIT_PREFIX).and_then(entry), &value) {
            (row.set)(&mut self.unit.parameters, *number);
        }
        self.entries[index].value = value;
        if let Some((id, _)) = name.strip_prefix(EFFECTS_PREFIX).and_then(|rest| rest.split_once('.')) {
            self.switch(id);
        }
    }

    /// Switches the effect with this id on in the unit as its parameters say, or off where all are neutral.
    fn switch(&mut self, id: &str) {
        let Some(spec) = live_effects(&self.unit).find(|spec| spec.id == id) else { return };
        let value = |parameter: &EffectParameter| match self.value(&format!("{EFFECTS_PREFIX}{id}.{}", parameter.name))
        {
            ParameterValue::Double(value) => value,
            _ => parameter.neutral,
        };
        let values: Vec<f64> = spec.parameters.iter().map(value).collect();
        let neutral = spec.parameters.iter().zip(&values).all(|(one, value)| one.neutral.to_bits() == value.to_bits());
        self.unit.effects.retain(|setting| setting.id != id);
        if !neutral {
            self.unit.effects.push(EffectSetting { id: id.to_owned(), values });
        }
    }

    /// Whether the values go together; asked once all are set, since two may be right only together.
    ///
    /// # Errors
    /// In words, with all parameters that contradict each other.
    pub(crate) fn check_together(&self) -> Result<(), String> {
        let words = |conflict: Conflict| {
            let names: Vec<String> = conflict.keys.iter().map(|key| format!("{UNIT_PREFIX}{key}")).collect();
            format!("{}: {}", names.join(", "), conflict.message)
        };
        let mut all: Vec<String> = conflicts(&self.unit.parameters).map(words).collect();
        let has = |name| self.value(name) == ParameterValue::Boolean(true);
        if has("use_sim_time") && has("publish_clock") {
            all.push("use_sim_time, publish_clock: a node that follows /clock cannot publish it too".to_owned());
        }
        if all.is_empty() { Ok(()) } else { Err(all.join("; ")) }
    }

    /// Sets one parameter of the running node.
    ///
    /// # Errors
    /// In words for the caller.
    pub(crate) fn set(&mut self, name: &str, value: ParameterValue) -> Result<(), String> {
        let index = self.check(name, &value)?;
        self.take(index, value);
        Ok(())
    }

    /// Whether [`ParameterStore::set`] would succeed.
    ///
    /// # Errors
    /// As [`ParameterStore::set`].
    pub(crate) fn check(&self, name: &str, value: &ParameterValue) -> Result<usize, String> {
        let index = self.find(name).ok_or_else(|| self.unknown(name))?;
        let entry = &self.entries[index];
        if entry.read_only {
            return Err(format!("`{name}` is read-only: give it at start with `--ros-args -p {name}:=VALUE`"));
        }
        entry.domain.check(name, value).map(|()| index)
    }

    /// The value, `NotSet` where there is no such parameter.
    pub(crate) fn value(&self, name: &str) -> ParameterValue {
        self.find(name).map_or(ParameterValue::NotSet, |index| self.entries[index].value.clone())
    }

    /// The descriptor; of an unknown parameter only its name.
    pub(crate) fn describe(&self, name: &str) -> raw::ParameterDescriptor {
        let mut descriptor = raw::ParameterDescriptor {
            name: name.to_owned(),
            r#type: raw::ParameterType::NOT_SET,
            description: String::new(),
            additional_constraints: String::new(),
            read_only: false,
            dynamic_typing: false,
            floating_point_range: Vec::new(),
            integer_range: Vec::new(),
        };
        if let Some(index) = self.find(name) {
            let entry = &self.entries[index];
            descriptor.r#type = ParameterValue::to_parameter_type_raw(&entry.value);
            descriptor.description.clone_from(&entry.description);
            descriptor.read_only = entry.read_only;
            match entry.domain {
                Domain::Real(from_value, to_value) => {
                    descriptor.floating_point_range.push(raw::FloatingPointRange { from_value, to_value, step: 0.0 });
                }
                Domain::Whole(from_value, to_value) => {
                    descriptor.integer_range.push(raw::IntegerRange { from_value, to_value, step: 1 });
                }
                Domain::Bool | Domain::Text => {}
                Domain::Choice(_) => descriptor.additional_constraints = entry.domain.words(),
            }
        }
        descriptor
    }

    /// Names with their prefixes, as `ListParameters` wants them: under any of `prefixes`, at most `depth` levels
    /// deep (0: any).
    pub(crate) fn list(&self, prefixes: &[String], depth: u64) -> (Vec<String>, Vec<String>) {
        let shallow = |rest: &str| depth == 0 || (rest.matches('.').count() as u64) < depth;
        let wanted = |name: &str| {
            let under = |prefix: &String| {
                name == prefix
                    || name.strip_prefix(prefix.as_str()).and_then(|rest| rest.strip_prefix('.')).is_some_and(shallow)
            };
            if prefixes.is_empty() { shallow(name) } else { prefixes.iter().any(under) }
        };
        let names: Vec<String> =
            self.entries.iter().map(|entry| &entry.name).filter(|name| wanted(name)).cloned().collect();
        let mut namespaces: Vec<String> =
            names.iter().filter_map(|name| name.rsplit_once('.').map(|(namespace, _)| namespace.to_owned())).collect();
        namespaces.dedup();
        (names, namespaces)
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.entries.binary_search_by(|entry| entry.name.as_str().cmp(name)).ok()
    }

    fn unknown(&self, name: &str) -> String {
        format!("there is no parameter `{name}`{}", hint(name, self.entries.iter().map(|entry| &entry.name)))
    }
}

#[cfg(test)]
mod tests {
    use ros2_client::parameters::ParameterValue;

    use super::{NodeSettings, ParameterOverride, ParameterStore};
    use crate::core::OnStale;

    fn store() -> ParameterStore {
        ParameterStore::new(&NodeSettings::default(), &govtwin_model::params::reference())
    }

    #[test]
    fn settings_go_in_and_come_out_unchanged() {
        assert_eq!(store().settings(), NodeSettings::default());
    }

    #[test]
    fn what_is_set_is_in_range_of_its_type_and_not_read_only() {
        let mut store = store();
        assert_eq!(store.set("hold", ParameterValue::Double(3.0)), Ok(()));
        assert_eq!(store.settings().hold_s.to_bits(), 3.0_f64.to_bits());
        assert_eq!(store.set("on_stale", ParameterValue::String("hold".to_owned())), Ok(()));
        assert_eq!(store.settings().on_stale, OnStale::Hold);
        for (name, value, word) in [
            ("hold", ParameterValue::Double(-1.0), "from 0"),
            ("hold", ParameterValue::Double(f64::NAN), "NaN"),
            ("hold", ParameterValue::Integer(1), "a number"),
            ("hold", ParameterValue::NotSet, "a number"),
            ("on_stale", ParameterValue::String("panic".to_owned()), "trip, hold, stop, default"),
            ("rate", ParameterValue::Double(500.0), "read-only"),
            ("hodl", ParameterValue::Double(1.0), "did you mean `hold`?"),
        ] {
            let reason = store.set(name, value).unwrap_err();
            assert!(reason.contains(word), "{reason}");
        }
    }

    #[test]
    fn presets_reach_the_settings_and_the_unit() {
        let mut store = store();
        store.preset("rate", &ParameterOverride::Number(500.0)).unwrap();
        store.preset("use_sim_time", &ParameterOverride::Bool(true)).unwrap();
        store.preset("priority", &ParameterOverride::Number(0.0)).unwrap();
        store.preset("unit.oil.density_kg_m3", &ParameterOverride::Number(865.0)).unwrap();
        let settings = store.settings();
        assert!(settings.use_sim_time && settings.wishes.priority == 0);
        assert_eq!(settings.pace().period_ns, 2_000_000);
        assert_eq!(store.unit().parameters.oil.density_kg_m3.to_bits(), 865.0_f64.to_bits());
        assert!(store.preset("priority", &ParameterOverride::Number(0.5)).unwrap_err().contains("whole"));
        assert!(store.preset("unit.oil.density_kg_m3", &ParameterOverride::Number(-1.0)).is_err());
    }

    #[test]
    fn presets_that_do_not_go_together_are_refused_once_all_are_in() {
        let mut store = store();
        assert_eq!(store.check_together(), Ok(()));
        store.preset("unit.oil.tank_pressure_pa", &ParameterOverride::Number(1.0e6)).unwrap();
        store.preset("unit.oil.return_pressure_pa", &ParameterOverride::Number(2.0e6)).unwrap();
        let reason = store.check_together().unwrap_err();
        assert!(reason.contains("unit.oil.return_pressure_pa, unit.oil.tank_pressure_pa: the return line"), "{reason}");
        assert!(!reason.contains("publish_clock"), "{reason}");
        store.preset("use_sim_time", &ParameterOverride::Bool(true)).unwrap();
        store.preset("publish_clock", &ParameterOverride::Bool(true)).unwrap();
        assert!(store.check_together().unwrap_err().contains("use_sim_time, publish_clock: a node that follows"));
    }

    #[test]
    fn descriptors_tell_range_unit_and_read_only() {
        let store = store();
        let hold = store.describe("hold");
        assert!(hold.description.ends_with("[s]") && !hold.read_only);
        assert_eq!(hold.floating_point_range[0].from_value.to_bits(), 0.0_f64.to_bits());
        assert!(store.describe("on_stale").additional_constraints.contains("trip"));
        assert!(store.describe("rate").read_only && !store.describe("use_sim_time").read_only);
        assert!(!store.describe("unit.oil.density_kg_m3").read_only);
        let leak = store.describe("effects.servo_leak.leakage_m3_s_pa");
        assert!(leak.description.ends_with("[m3/(s Pa)]") && !leak.read_only, "{}", leak.description);
        assert_eq!(store.describe("nothing").r#type, 0);
    }

    #[test]
    fn lists_by_prefix_and_depth() {
        let store = store();
        let (names, prefixes) = store.list(&["unit.oil".to_owned()], 0);
        assert!(names.iter().all(|name| name.starts_with("unit.oil.")) && !names.is_empty());
        assert_eq!(prefixes, ["unit.oil"]);
        let (names, prefixes) = store.list(&[], 1);
        assert!(names.contains(&"hold".to_owned()) && names.iter().all(|name| !name.contains('.')));
        assert!(prefixes.is_empty());
    }
}
