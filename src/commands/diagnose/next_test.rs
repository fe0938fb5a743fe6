//! The next test as a script that `govtwin play` sends: command, ESV and tank pressure.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use govtwin_bag::msg;
use govtwin_bag::{InMemory, Qos, Topics};
use govtwin_diagnosis::result::test_script::TestScript;
use govtwin_diagnosis::result::{Diagnosis, Experiment};
use govtwin_model::frame::EsvState;
use govtwin_model::parameters::Parameters;

/// Rows between two messages of ESV and tank pressure where the ESV does not change.
const SLOW_ROWS: usize = 10;

/// The best test as an MCAP file; none where no test can be sent.
pub fn file(diagnosis: &Diagnosis, path: &Path, sheet: &Parameters) -> anyhow::Result<Option<Vec<u8>>> {
    let Some((best, script)) = diagnosis.experiments.first().and_then(|one| Some((one, one.script.as_ref()?))) else {
        return Ok(None);
    };
    written(best, script, path, sheet).map(Some).with_context(|| format!("cannot write {}", path.display()))
}

/// Log times begin at 0; messages carry no stamp, so that whoever records them dates them like what the governor answers.
fn written(best: &Experiment, script: &TestScript, path: &Path, sheet: &Parameters) -> anyhow::Result<Vec<u8>> {
    let topics = Topics::default();
    let mut bag = InMemory::new(path)?;
    let about = [
        ("synthetic", "true".to_owned()),
        ("script", "true".to_owned()),
        ("generator", format!("govtwin {} diagnose", env!("CARGO_PKG_VERSION"))),
        ("test", best.test.clone()),
        ("unit_state", best.unit_state.clone()),
        ("trips", best.trips.to_string()),
        ("note", "commands to send, nothing measured; times begin at 0 and messages carry no stamp".to_owned()),
    ];
    bag.describe("govtwin", about.map(|(key, value)| (key.to_owned(), value)).into_iter().collect::<BTreeMap<_, _>>())?;
    let header = || msg::Header::at(0);
    let mut before: Option<EsvState> = None;
    for (row, frame) in script.frames(sheet.oil.tank_pressure_pa).iter().enumerate() {
        let inputs = &frame.inputs;
        if before != Some(inputs.esv) || row % SLOW_ROWS == 0 {
            let message = msg::EsvState::of(0, inputs.esv);
            bag.write(&topics.esv, Qos::DEFAULT, frame.time_ns, &message)?;
            before = Some(inputs.esv);
        }
        if row % SLOW_ROWS == 0 {
            let message =
                msg::FluidPressure { header: header(), fluid_pressure: inputs.tank_pressure_pa, variance: 0.0 };
            bag.write(&topics.tank_pressure, Qos::SENSOR, frame.time_ns, &message)?;
        }
        let message = msg::GovernorCommand { header: header(), opening: inputs.opening_command_pu };
        bag.write(&topics.command, Qos::DEFAULT, frame.time_ns, &message)?;
    }
    Ok(bag.finish()?)
}
