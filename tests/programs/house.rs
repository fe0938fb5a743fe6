//! The project itself: its rules, documents, dependencies, examples and fuzz targets.

#[path = "../examples.rs"]
mod examples;
#[path = "../fuzz.rs"]
mod fuzz;
#[path = "../outputs.rs"]
mod outputs;
#[path = "../reference_pages.rs"]
mod reference_pages;
#[path = "../slips.rs"]
mod slips;
#[path = "../supply.rs"]
mod supply;
#[path = "../tidy.rs"]
mod tidy;
