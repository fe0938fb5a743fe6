//! A map on the bus: which inputs come from fields of other topics, and what stands in for those that it does not name.
//!
//! The map, its field paths and its conversions are those of [`govtwin_bag::import`], by which bags are read: the same code gives the same values.

pub(super) mod subscriber;

use std::path::{Path, PathBuf};

use super::intake::TopicGate;
use super::intake::mapped::{checked, input_of};
use super::policy::NodeInput;
use super::settings::NodeSettings;
use govtwin_bag::import::{ImportError, Map, MappedField, Target};
use govtwin_model::frame::EsvState;

/// Inputs that a map can hold, each with its signal.
const MAPPED: [(NodeInput, Target); 3] = [
    (NodeInput::Command, Target::OpeningCommand),
    (NodeInput::Esv, Target::Esv),
    (NodeInput::TankPressure, Target::TankPressure),
];

/// What is measured on the unit, to which a residual adapts.
const MEASURED: [Target; 2] = [Target::SpoolPosition, Target::ServomotorPosition];

/// A map by which a node hears its inputs.
#[derive(Debug, Clone)]
pub struct BusMap {
    map: Map,
    /// The fields that are heard.
    fields: Vec<MappedField>,
    /// Folders with definitions of types, `package/msg/Type.msg`.
    definitions: Vec<PathBuf>,
}

impl BusMap {
    /// By the map that stands at `path`; `adapts` says whether a residual adapts to what is measured.
    ///
    /// # Errors
    /// Where a signal is no field of a topic, a constant is none, or what the node needs is not there.
    pub fn new(map: Map, path: &Path, definitions: &[PathBuf], adapts: bool) -> Result<Self, ImportError> {
        let mut fields = map.heard(path)?;
        let wrong = |problem: String| ImportError::File { path: path.to_owned(), problem };
        let named = |target: Target| map.signals.iter().any(|signal| signal.target == target);
        if !named(Target::OpeningCommand) {
            let problem = "the map names no `opening_command`, by which the twin is driven; add `opening_command: /topic.field`, or a `constant`";
            return Err(wrong(problem.to_owned()));
        }
        if adapts && !MEASURED.into_iter().any(named) {
            let problem = "--adapt follows what is measured, and the map names neither `servomotor_position` nor `spool_position`; add one, or \
                           leave out --adapt";
            return Err(wrong(problem.to_owned()));
        }
        for (_, target) in MAPPED {
            let Some(value) = map.constant(target) else { continue };
            checked(target, value, None, &mut TopicGate::default()).map_err(|refusal| {
                wrong(format!("{}: the constant is {value} {}: {}", target.id(), target.unit(), refusal.words()))
            })?;
        }
        let is_heard = |target: Target| input_of(target).is_some() || (adapts && MEASURED.contains(&target));
        fields.retain(|field| is_heard(field.target()));
        Ok(Self { map, fields, definitions: definitions.to_vec() })
    }

    /// The settings with what the map says of inputs that are not heard: a constant is the default of its input, and neither it nor an input that
    /// the map does not name needs to come. Replay, by the same map, has them so too.
    pub(crate) fn settings(&self, mut settings: NodeSettings) -> NodeSettings {
        for (input, target) in MAPPED {
            if self.field(input).is_none() {
                settings.inputs[input as usize].required = false;
            }
            let Some(value) = self.map.constant(target) else { continue };
            match input {
                NodeInput::Command => settings.default_command_pu = value,
                NodeInput::Esv => {
                    settings.default_esv = if value == 0.0 { EsvState::Shutdown } else { EsvState::Normal };
                }
                NodeInput::TankPressure => settings.default_tank_pressure_pa = Some(value),
                NodeInput::Load => {}
            }
        }
        settings
    }

    /// The field from which an input comes.
    pub(crate) fn field(&self, input: NodeInput) -> Option<&MappedField> {
        self.fields.iter().find(|field| input_of(field.target()) == Some(input))
    }

    /// What the map makes of an input, for the words at start; none of one that no map can hold.
    pub(crate) fn words(&self, input: NodeInput) -> Option<String> {
        let (_, target) = MAPPED.into_iter().find(|(known, _)| *known == input)?;
        let name = NodeInput::NAMES[input as usize];
        Some(match (self.field(input), self.map.constant(target)) {
            (Some(field), _) => format!("hears {name} from `{}` of the map", field.place()),
            (None, Some(value)) => format!("takes {name} as the constant of the map, {value} {}", target.unit()),
            (None, None) => format!("takes the default of {name}, which the map does not name"),
        })
    }
}

/// What inputs are called in words, and the topics that they come from: by the map where there is one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputNames {
    /// For people.
    pub labels: [String; NodeInput::COUNT],
    /// Topics before namespace and remapping.
    pub topics: [String; NodeInput::COUNT],
}

impl InputNames {
    /// With the fields of a map.
    pub fn new(map: Option<&BusMap>) -> Self {
        let field = |input| map.and_then(|map| map.field(input));
        let label = |input: NodeInput| match field(input) {
            Some(field) => format!("{} (`{}`)", NodeInput::NAMES[input as usize], field.place()),
            None => input.topic().to_owned(),
        };
        let topic = |input: NodeInput| field(input).map_or(input.topic(), MappedField::topic).to_owned();
        Self { labels: NodeInput::ALL.map(label), topics: NodeInput::ALL.map(topic) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bus_map(text: &str, adapts: bool) -> Result<BusMap, String> {
        let path = Path::new("map.yaml");
        let map = Map::parse(text, path).map_err(|error| error.to_string())?;
        BusMap::new(map, path, &[], adapts).map_err(|error| error.to_string())
    }

    #[test]
    fn constants_and_what_is_not_named_are_defaults_that_need_not_come() {
        let map =
            bus_map("signals:\n  opening_command: /a.data\n  esv: shutdown\n  servomotor_position: /b.data\n", false)
                .unwrap();
        let settings = map.settings(NodeSettings::default());
        assert_eq!(settings.inputs.map(|input| input.required), [true, false, false, false]);
        assert_eq!((settings.default_esv, settings.default_tank_pressure_pa), (EsvState::Shutdown, None));
        assert_eq!(map.fields.len(), 1, "what no residual adapts to is not heard");
        let words = NodeInput::ALL.map(|input| map.words(input).unwrap_or_default());
        assert_eq!(words[0], "hears command from `/a.data` of the map");
        assert!(words[1].contains("constant of the map") && words[2].contains("does not name"), "{words:?}");
        let names = InputNames::new(Some(&map));
        assert_eq!(names.labels[..2], ["command (`/a.data`)", "governor/esv"]);
        assert_eq!(names.topics[..2], ["/a", "governor/esv"]);
    }

    #[test]
    fn what_cannot_drive_a_twin_is_refused_with_the_way_out() {
        for (text, adapts, words) in [
            ("signals:\n  tank_pressure: /a.data\n", false, "the map names no `opening_command`"),
            ("signals:\n  opening_command: /a.data\n", true, "add one, or leave out --adapt"),
            (
                "signals:\n  opening_command: {constant: 50}\n  esv: {field: /a.data, shutdown: 1}\n",
                false,
                "the constant is 50 pu: out of range",
            ),
            ("signals:\n  opening_command: y\n", false, "`y` is a column"),
        ] {
            let said = bus_map(text, adapts).unwrap_err();
            assert!(said.contains(words), "{said}");
        }
        let adapting = bus_map("signals:\n  opening_command: /a.data\n  spool_position: /b.data\n", true).unwrap();
        assert_eq!(adapting.fields.len(), 2);
    }
}
