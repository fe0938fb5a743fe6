//! `--ros-args`: names, remappings, parameters and log level as every ROS 2 program takes them.

use std::collections::BTreeSet;
use std::fmt;

use ros2args::{LogLevel, ParamAssignment, Ros2Args, Ros2ArgsError, build_node_fqn, expand_topic_name};

use govtwin_model::params::nearest;

/// A value given for a parameter before start.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterOverride {
    /// `true` or `false`.
    Bool(bool),
    /// A number; ROS 2 tells 1 from 1.0, a person at a shell need not.
    Number(f64),
    /// Text.
    Text(String),
}

impl fmt::Display for ParameterOverride {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::Text(text) => write!(f, "`{text}`"),
        }
    }
}

/// The arguments of one node, resolved.
#[derive(Debug, Clone)]
pub struct Arguments {
    /// Namespace, such as `/` or `/plant`.
    pub namespace: String,
    /// Base name of the node.
    pub name: String,
    /// Parameters in the order in which they count: later ones win.
    pub parameters: Vec<(String, ParameterOverride)>,
    /// Least level of what is said.
    pub log_level: LogLevel,
    /// Whether words also go to `/rosout`.
    pub rosout: bool,
    /// What was given and cannot be followed.
    pub remarks: Vec<String>,
    rules: Vec<(String, String)>,
}

impl Arguments {
    /// Resolves what stands behind `--ros-args` for a node whose own name is `default_name`.
    ///
    /// # Errors
    /// On words that are no ROS 2 arguments, names that are no names, or parameter files that cannot be read.
    pub fn parse(words: &[String], default_name: &str) -> Result<Self, Ros2ArgsError> {
        let section = std::iter::once("--ros-args").chain(words.iter().map(String::as_str));
        let (args, _) = Ros2Args::from_args(section)?;
        let special = |names: &[&str]| {
            let rules = args.remap_rules.iter().filter(|rule| rule.applies_to_node(default_name));
            rules.rev().find(|rule| names.contains(&rule.from.as_str())).map(|rule| rule.to.clone())
        };
        let namespace = special(&["__ns"]).unwrap_or_else(|| "/".to_owned());
        let name = special(&["__node", "__name"]).unwrap_or_else(|| default_name.to_owned());
        ros2args::validate_namespace(&namespace)?;
        ros2args::validate_node_name(&name)?;
        let (mut rules, mut remarks) = (Vec::new(), Vec::new());
        for rule in &args.remap_rules {
            let mine = rule.applies_to_node(default_name) || rule.applies_to_node(&name);
            if !mine {
                let of = rule.node_name.as_deref().unwrap_or_default();
                remarks.push(format!(
                    "-r {of}:{}:={} is for a node `{of}`; this process has only `{name}`",
                    rule.from, rule.to
                ));
            } else if !rule.from.starts_with("__") {
                let from = expand_topic_name(&namespace, &name, &rule.from)?;
                rules.push((from, expand_topic_name(&namespace, &name, &rule.to)?));
            } else if !["__ns", "__node", "__name"].contains(&rule.from.as_str()) {
                remarks.push(format!("-r {}:={} is no remapping: expected __ns or __node", rule.from, rule.to));
            }
        }
        let mut parameters = Vec::new();
        for file in &args.param_files {
            for assignment in ros2args::parse_param_file(file)? {
                collect(&assignment, &namespace, &name, &mut parameters, &mut remarks);
            }
        }
        for assignment in &args.param_assignments {
            collect(assignment, &namespace, &name, &mut parameters, &mut remarks);
        }
        if args.enclave.is_some() {
            remarks.push("--enclave is not followed: this build has no DDS security".to_owned());
        }
        if args.log_config_file.is_some() {
            remarks.push("--log-config-file is not followed: there is one log, on standard error".to_owned());
        }
        let mut levels = args.log_levels.iter().filter(|level| level.logger_name.as_ref().is_none_or(|of| *of == name));
        let log_level = levels.next_back().map_or(LogLevel::Info, |level| level.level);
        let rosout = args.logging_output.rosout.unwrap_or(true);
        Ok(Self { namespace, name, parameters, log_level, rosout, remarks, rules })
    }

    /// The same for a node that helps this one, under one of the names that ROS 2 hides.
    pub(crate) fn helper(&self, what: &str) -> Self {
        let name = format!("_{}_{what}", self.name);
        Self { name, rosout: false, remarks: Vec::new(), ..self.clone() }
    }

    /// The node's full name.
    pub fn full_name(&self) -> String {
        build_node_fqn(&self.namespace, &self.name)
    }

    /// Remappings that no name among `opened` is behind, in words; `opened` are full names before remapping.
    pub(crate) fn idle_remappings(&self, opened: &BTreeSet<String>) -> Vec<String> {
        let idle = self.rules.iter().filter(|(from, _)| !opened.contains(from));
        let words = |(from, to): &(String, String)| {
            format!("-r {from}:={to} matches no topic or service of this node{}", hint(from, opened))
        };
        idle.map(words).collect()
    }

    /// The full name of a topic or service before any remapping.
    ///
    /// # Errors
    /// Where `topic` is no name.
    pub(crate) fn expand(&self, topic: &str) -> Result<String, Ros2ArgsError> {
        expand_topic_name(&self.namespace, &self.name, topic)
    }

    /// The full name of a topic or service after namespace and remapping.
    ///
    /// # Errors
    /// Where `topic` is no name.
    pub fn resolve(&self, topic: &str) -> Result<String, Ros2ArgsError> {
        let full = self.expand(topic)?;
        let rule = self.rules.iter().find(|(from, _)| *from == full);
        Ok(rule.map_or(full, |(_, to)| to.clone()))
    }
}

/// Which of the `known` names may be meant by `name`, in words behind others; empty where none is near.
pub(super) fn hint<'a>(name: &str, known: impl IntoIterator<Item = &'a String>) -> String {
    let near = nearest(name, known.into_iter().map(String::as_str));
    near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default()
}

/// Adds an assignment that is for this node; maps inside become dotted names.
fn collect(
    assignment: &ParamAssignment,
    namespace: &str,
    name: &str,
    parameters: &mut Vec<(String, ParameterOverride)>,
    remarks: &mut Vec<String>,
) {
    if let Some(pattern) = &assignment.node_name {
        let full_name = build_node_fqn(namespace, name);
        let matches = pattern == name || ros2args::match_wildcard_pattern(pattern, &full_name);
        if !matches {
            return;
        }
    }
    let key = &assignment.name;
    if let Some(map) = assignment.as_hash() {
        for (inner, value) in map {
            let dotted = format!("{key}.{}", inner.as_str().unwrap_or("?"));
            collect(&ParamAssignment::new_global(dotted, value.clone()), namespace, name, parameters, remarks);
        }
        return;
    }
    let whole = assignment.as_i64().map(|value| ParameterOverride::Number(value as f64));
    let value = assignment
        .as_bool()
        .map(ParameterOverride::Bool)
        .or(whole)
        .or_else(|| assignment.as_f64().map(ParameterOverride::Number))
        .or_else(|| assignment.as_str().map(|text| ParameterOverride::Text(text.to_owned())));
    match value {
        Some(value) => parameters.push((key.clone(), value)),
        None => remarks.push(format!("parameter `{key}` is neither a bool, a number nor text; left out")),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::{Arguments, ParameterOverride};

    fn parse(words: &[&str]) -> Arguments {
        let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
        Arguments::parse(&words, "govtwin").unwrap()
    }

    #[test]
    fn without_arguments_names_are_under_the_root() {
        let arguments = parse(&[]);
        assert_eq!(arguments.full_name(), "/govtwin");
        assert_eq!(arguments.resolve("governor/command").unwrap(), "/governor/command");
        assert_eq!(arguments.resolve("~/log").unwrap(), "/govtwin/log");
    }

    #[test]
    fn namespace_name_and_remapping_apply_in_that_order() {
        let arguments = parse(&[
            "-r",
            "__ns:=/unit2",
            "-r",
            "__node:=servo",
            "-r",
            "governor/command:=/bench/y_pid",
            "-r",
            "govtwin:sim/servo_state:=out",
            "-r",
            "other:governor/esv:=/no",
        ]);
        assert_eq!(arguments.full_name(), "/unit2/servo");
        assert_eq!(arguments.resolve("governor/command").unwrap(), "/bench/y_pid");
        assert_eq!(arguments.resolve("sim/servo_state").unwrap(), "/unit2/out");
        assert_eq!(arguments.resolve("governor/esv").unwrap(), "/unit2/governor/esv");
        assert_eq!(arguments.resolve("~/log").unwrap(), "/unit2/servo/log");
    }

    #[test]
    fn remappings_that_match_nothing_are_told_with_what_may_be_meant() {
        let arguments = parse(&["-r", "governor/comand:=/y", "-r", "sim/servo_state:=out", "-r", "other:a:=b"]);
        assert!(arguments.remarks[0].contains("for a node `other`"), "{:?}", arguments.remarks);
        let opened = ["/governor/command", "/governor/esv", "/sim/servo_state"].map(str::to_owned).into();
        let idle = arguments.idle_remappings(&opened);
        let expected =
            "-r /governor/comand:=/y matches no topic or service of this node; did you mean `/governor/command`?";
        assert_eq!(idle, [expected]);
        assert!(parse(&["-r", "__nod:=x"]).remarks[0].contains("expected __ns or __node"));
    }

    #[test]
    fn parameters_come_from_files_first_and_the_command_line_wins() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        write!(
            file,
            "/**:\n  ros__parameters:\n    hold: 2.5\n    publish_rate: 50\n    qos: {{depth: 3}}\nother:\n  \
             ros__parameters:\n    hold: 9.0\n"
        )
        .unwrap();
        let path = file.path().to_str().unwrap();
        let arguments = parse(&["-p", "publish_rate:=200.0", "--params-file", path, "-p", "on_stale:=hold"]);
        let expected = [
            ("hold".to_owned(), ParameterOverride::Number(2.5)),
            ("publish_rate".to_owned(), ParameterOverride::Number(50.0)),
            ("qos.depth".to_owned(), ParameterOverride::Number(3.0)),
            ("publish_rate".to_owned(), ParameterOverride::Number(200.0)),
            ("on_stale".to_owned(), ParameterOverride::Text("hold".to_owned())),
        ];
        assert_eq!(arguments.parameters, expected);
    }

    #[test]
    fn nonsense_is_refused_with_its_words() {
        let error = Arguments::parse(&["--frobnicate".to_owned()], "govtwin").unwrap_err();
        assert!(error.to_string().contains("--frobnicate"));
        let error = Arguments::parse(&["-r".to_owned(), "__node:=2x".to_owned()], "govtwin").unwrap_err();
        assert!(error.to_string().contains("2x"));
    }
}
