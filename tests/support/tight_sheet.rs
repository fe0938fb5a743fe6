//! A sheet in which nothing has a tolerance, so that a diagnosis is quick.

use std::fs;
use std::path::Path;

/// Writes `sheet.yaml` into a folder.
pub fn write(folder: &Path) {
    let mut sheet = String::new();
    let mut last = "";
    for (entry, tolerance) in
        govtwin_model::parameters::ENTRIES.iter().zip(govtwin_model::params::reference().tolerances)
    {
        let (section, name) = entry.key.split_once('.').unwrap();
        if tolerance.is_none() || name == "coulomb_friction_n" {
            continue;
        }
        if section != last {
            sheet += &format!("{section}:\n");
            last = section;
        }
        sheet += &format!("  {name}: {{tol: ~}}\n");
    }
    fs::write(folder.join("sheet.yaml"), sheet).unwrap();
}
