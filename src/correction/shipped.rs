//! The residual that ships with the program: that of the reference unit.

use super::model::{Model, fingerprint};
use govtwin_files::digest::sha256;
use govtwin_model::parameters::Unit;
use govtwin_model::provenance::FileUsed;

/// What reports call it.
pub const NAME: &str = "reference_unit.residual (shipped)";

const TEXT: &str = include_str!("../../params/reference_unit.residual");

/// The shipped residual, if it was trained for this unit: the digest in it is that of all parameters and effects.
pub fn of(unit: &Unit) -> Option<Model> {
    Model::from_text(TEXT).ok().filter(|model| model.twin == fingerprint(unit))
}

/// Size and digest of its file.
pub fn file() -> FileUsed {
    FileUsed { path: NAME.to_owned(), bytes: TEXT.len() as u64, sha256: sha256(TEXT) }
}

#[cfg(test)]
mod tests {
    use super::of;

    #[test]
    fn the_shipped_residual_is_of_the_reference_unit_and_of_no_other() {
        let mut unit = govtwin_model::params::reference();
        assert!(of(&unit).is_some());
        unit.parameters.oil.tank_pressure_pa += 1.0;
        assert_eq!(of(&unit), None);
    }
}
