//! The reference unit's plant, for tests.

use crate::parameters::{ENTRIES, Parameters};
use crate::plant::Plant;

/// Values of the shipped sheet, in the order of [`ENTRIES`].
const SHEET: &[f64] = &[
    30.0, 8.0, 0.0005, -0.0005, 0.015, -0.015, -1.0, 1.0, 0.0, 0.0, 0.010, 0.001, // regulator
    870.0, 1.0e9, 6.3e6, 0.1e6, // oil
    377.0, 0.75, 1.0, 6.67e-4, 3.5e6, // proportional valve
    2.0e-5, 0.62, // esv
    25.0, 1500.0, 5.0e-3, 2.5e-3, 4.0e4, 0.030, 2.0e-13, 5.0e-4, 0.015, -0.015, 0.012, 0.0,
    9.81, // distributing valve
    0.030, 2.0e-4, // main ports
    0.20, 0.18, 0.60, 0.02, 8000.0, 4.0e5, 4.0e4, 1.5e5, 2.5e5, 0.0, // servomotor
];

/// The reference unit's parameters.
pub fn parameters() -> Parameters {
    assert_eq!(SHEET.len(), ENTRIES.len());
    let mut parameters = Parameters::default();
    for (entry, value) in ENTRIES.iter().zip(SHEET) {
        (entry.set)(&mut parameters, *value);
    }
    parameters
}

/// The reference unit's plant.
pub fn plant() -> Plant {
    Plant::new(&parameters())
}
