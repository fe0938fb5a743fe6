//! What the product does, from outside: bags, imports, twin, fits, diagnoses, pages, commands.

#[path = "../acceptance.rs"]
mod acceptance;
#[path = "../acceptance_tables.rs"]
mod acceptance_tables;
#[path = "../accuracy.rs"]
mod accuracy;
#[path = "../bag.rs"]
mod bag;
#[path = "../battery.rs"]
mod battery;
#[path = "../blind.rs"]
mod blind;
#[path = "../cli.rs"]
mod cli;
#[path = "../diagnosis.rs"]
mod diagnosis;
#[path = "../diagnosis_independent.rs"]
mod diagnosis_independent;
#[path = "../diagnosis_inputs.rs"]
mod diagnosis_inputs;
#[path = "../diagnosis_stage.rs"]
mod diagnosis_stage;
#[path = "../effects_conformance.rs"]
mod effects_conformance;
#[path = "../effects_signatures.rs"]
mod effects_signatures;
#[path = "../faults.rs"]
mod faults;
#[path = "../fit.rs"]
mod fit;
#[path = "../fit_cli.rs"]
mod fit_cli;
#[path = "../fleet.rs"]
mod fleet;
#[path = "../generate.rs"]
mod generate;
#[path = "../hostile.rs"]
mod hostile;
#[path = "../import.rs"]
mod import;
#[path = "../lanes.rs"]
mod lanes;
#[path = "../long.rs"]
mod long;
#[path = "../msg_cdr.rs"]
mod msg_cdr;
#[path = "../msg_definition.rs"]
mod msg_definition;
#[path = "../next_test.rs"]
mod next_test;
#[path = "../no_sheet.rs"]
mod no_sheet;
#[path = "../params.rs"]
mod params;
#[path = "../physics.rs"]
mod physics;
#[path = "../reference.rs"]
mod reference;
#[path = "../replay.rs"]
mod replay;
#[path = "../report_made.rs"]
mod report_made;
#[path = "../residual.rs"]
mod residual;
#[path = "../residual_adapt.rs"]
mod residual_adapt;
#[path = "../residual_inloop.rs"]
mod residual_inloop;
#[path = "../residual_ladder.rs"]
mod residual_ladder;
#[path = "../residual_months.rs"]
mod residual_months;
#[path = "../sheet.rs"]
mod sheet;
#[path = "../solver.rs"]
mod solver;
#[path = "../stage_alone.rs"]
mod stage_alone;
#[path = "../stage_models.rs"]
mod stage_models;
#[path = "../stage_properties.rs"]
mod stage_properties;
#[path = "../watch.rs"]
mod watch;
#[path = "../watch_studies.rs"]
mod watch_studies;
#[path = "../writers.rs"]
mod writers;
