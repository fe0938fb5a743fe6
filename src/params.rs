//! Parameter files: the only place that knows YAML.
