//! What `ros2` asks of every node besides parameters: levels of its logger, and descriptions of its types.

use futures::stream::LocalBoxStream;

use super::super::bus::{Bus, BusError};
use super::call::Calls;
use super::{Aftermath, MOST_ITEMS, ServiceContext};
use govtwin_bag::msg::definition::{Definition, closure_of, text_of};
use govtwin_bag::msg::type_hash::{field_type, hash_of};
use govtwin_bag::msg::upkeep::{
    DescribedField, GetLevelsRequest, GetLoggerLevels, GetTypeDescription, IndividualTypeDescription, Levels,
    LoggerLevel, SetLevelsResponse, SetLoggerLevels, SetLoggerLevelsResult, TypeDescription, TypeRequest, TypeResponse,
    TypeSource,
};

/// Levels of a logger.
const LEVELS: [(u8, &str); 5] = [(10, "debug"), (20, "info"), (30, "warn"), (40, "error"), (50, "fatal")];

/// The services.
pub(crate) struct UpkeepServices {
    logger: String,
    get_levels: Calls,
    set_levels: Calls,
    describe: Calls,
}

impl UpkeepServices {
    /// Opens the services under the node's name.
    ///
    /// # Errors
    /// When DDS refuses.
    pub(crate) fn open(bus: &mut Bus) -> Result<Self, BusError> {
        Ok(Self {
            logger: logger_name(&bus.arguments().full_name()),
            get_levels: bus.offer::<GetLoggerLevels>("~/get_logger_levels")?,
            set_levels: bus.offer::<SetLoggerLevels>("~/set_logger_levels")?,
            describe: bus.offer::<GetTypeDescription>("~/get_type_description")?,
        })
    }

    /// Answers calls as they come.
    pub(crate) fn answers<'a>(&'a self, context: &'a ServiceContext<'a>) -> Vec<LocalBoxStream<'a, Aftermath>> {
        let logger = self.logger.as_str();
        vec![
            self.get_levels.answer(context, move |request: GetLevelsRequest, context, _| {
                let level = |name: &String| if name == logger { u32::from(context.least()) } else { 0 };
                let names = request.names.iter().take(MOST_ITEMS);
                Levels { levels: names.map(|name| LoggerLevel { name: name.clone(), level: level(name) }).collect() }
            }),
            self.set_levels.answer(context, move |request: Levels, context, aftermath| {
                let items = request.levels.iter().take(MOST_ITEMS);
                let refusal = context.refusal();
                let wanted = |item: &LoggerLevel| match refusal {
                    Some(reason) => Err(reason.to_owned()),
                    None => level(item, logger),
                };
                let set = |item: &LoggerLevel| match wanted(item) {
                    Ok((least, word)) => {
                        context.set_least(least);
                        aftermath.words.push(format!("logger `{logger}` set to {word}"));
                        SetLoggerLevelsResult { successful: true, reason: String::new() }
                    }
                    Err(reason) => SetLoggerLevelsResult { successful: false, reason },
                };
                SetLevelsResponse { results: items.map(set).collect() }
            }),
            self.describe.answer(context, |request: TypeRequest, _, _| describe(&request)),
        ]
    }
}

/// The name of a node's logger: its full name with dots.
fn logger_name(full_name: &str) -> String {
    full_name.trim_start_matches('/').replace('/', ".")
}

/// The level that is asked for, as number and word.
fn level(item: &LoggerLevel, logger: &str) -> Result<(u8, &'static str), String> {
    if item.name != logger {
        return Err(format!("there is no logger `{}`; this node has `{logger}`", item.name));
    }
    let known = LEVELS.into_iter().find(|(number, _)| u32::from(*number) == item.level);
    known
        .ok_or_else(|| format!("{} is no level: expected 10 debug, 20 info, 30 warn, 40 error or 50 fatal", item.level))
}

/// Describes a type that this program carries.
fn describe(request: &TypeRequest) -> TypeResponse {
    let fail = |failure_reason: String| TypeResponse { failure_reason, ..TypeResponse::default() };
    let closure = match closure_of(&request.type_name) {
        Ok(closure) => closure,
        Err(error) => return fail(error.to_string()),
    };
    let hash = hash_of(&closure);
    if !request.type_hash.is_empty() && request.type_hash != hash {
        return fail(format!("`{}` is {hash} here, not {}", request.type_name, request.type_hash));
    }
    let mut described = closure.iter().map(individual);
    let type_description = described.next().unwrap_or_default();
    let mut referenced_type_descriptions: Vec<IndividualTypeDescription> = described.collect();
    referenced_type_descriptions.sort_by(|a, b| a.type_name.cmp(&b.type_name));
    let source = |definition: &Definition| TypeSource {
        type_name: definition.type_name.clone(),
        encoding: "msg".to_owned(),
        raw_file_contents: text_of(&definition.type_name).unwrap_or_default().to_owned(),
    };
    let sources = if request.include_type_sources { closure.iter().map(source).collect() } else { Vec::new() };
    TypeResponse {
        successful: true,
        failure_reason: String::new(),
        type_description: TypeDescription { type_description, referenced_type_descriptions },
        type_sources: sources,
        extra_information: Vec::new(),
    }
}

fn individual(definition: &Definition) -> IndividualTypeDescription {
    let field = |field| -> DescribedField {
        let field: &govtwin_bag::msg::definition::Field = field;
        DescribedField { name: field.name.clone(), r#type: field_type(field), default_value: String::new() }
    };
    IndividualTypeDescription {
        type_name: definition.type_name.clone(),
        fields: definition.fields.iter().map(field).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::{LoggerLevel, TypeRequest, describe, hash_of, level, logger_name};
    use govtwin_bag::msg::definition::{DefinitionError, closure_with, known};
    use govtwin_bag::msg::type_hash::{texts_of, type_hash};

    #[test]
    fn a_description_without_texts_gives_the_definition_again() {
        for name in known() {
            let request = TypeRequest { type_name: name.to_owned(), ..TypeRequest::default() };
            let texts = texts_of(&describe(&request).type_description);
            let text = |name: &str| texts.get(name).cloned().ok_or_else(|| DefinitionError::Unknown(name.to_owned()));
            assert_eq!(hash_of(&closure_with(name, &text).unwrap()), type_hash(name).unwrap(), "{name}");
        }
    }

    #[test]
    fn a_logger_is_named_as_rcl_names_it_and_takes_the_five_levels() {
        assert_eq!(logger_name("/unit7/govtwin"), "unit7.govtwin");
        let ask = |name: &str, number| level(&LoggerLevel { name: name.to_owned(), level: number }, "govtwin");
        assert_eq!(ask("govtwin", 30), Ok((30, "warn")));
        assert!(ask("govtwin", 35).unwrap_err().contains("35 is no level"));
        assert!(ask("other", 30).unwrap_err().contains("this node has `govtwin`"));
    }

    #[test]
    fn a_type_is_described_with_all_that_it_is_made_of_and_a_foreign_hash_is_refused() {
        let ask = |type_hash: &str| {
            let type_name = "sensor_msgs/msg/JointState".to_owned();
            describe(&TypeRequest { type_name, type_hash: type_hash.to_owned(), include_type_sources: true })
        };
        let hash = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";
        let described = ask(hash);
        assert!(described.successful, "{}", described.failure_reason);
        let of = &described.type_description;
        assert_eq!(of.type_description.fields[2].r#type.type_id, 11 + 144, "float64[]");
        let names: Vec<&str> = of.referenced_type_descriptions.iter().map(|one| one.type_name.as_str()).collect();
        assert_eq!(names, ["builtin_interfaces/msg/Time", "std_msgs/msg/Header"]);
        assert!(described.type_sources[0].raw_file_contents.contains("float64[] effort"));
        assert!(ask("RIHS01_00").failure_reason.contains(hash));
        assert!(!describe(&TypeRequest { type_name: "a/msg/B".to_owned(), ..TypeRequest::default() }).successful);
    }
}
