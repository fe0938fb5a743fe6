//! Maps of `govtwin import` for the commands that listen on DDS.

use std::path::{Path, PathBuf};

use govtwin_bag::import::{Map, MappedField};
use govtwin_node::bus_map::BusMap;

use super::output::warn;

/// Reads a map, and says what of it does nothing on a bus.
pub fn load(path: &Path) -> anyhow::Result<Map> {
    let map = Map::load(path)?;
    if map.resample_hz.is_some() {
        let path = path.display();
        warn(&format!("{path}: `resample` does nothing on a bus: samples are taken as they come"));
    }
    Ok(map)
}

/// The map by which a node hears its inputs.
pub fn for_node(path: Option<&Path>, definitions: &[PathBuf], adapts: bool) -> anyhow::Result<Option<BusMap>> {
    let Some(path) = path else { return Ok(None) };
    Ok(Some(BusMap::new(load(path)?, path, definitions, adapts)?))
}

/// A map by which topics are recorded, and its fields.
pub fn for_recording(path: &Path) -> anyhow::Result<(Map, Vec<MappedField>)> {
    let map = load(path)?;
    let fields = map.heard(path)?;
    Ok((map, fields))
}
