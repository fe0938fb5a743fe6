//! The twin along one bag, and what drives it between the rows.

use govtwin_bag::{BagError, Health, Interpolation, Loaded};
use govtwin_correction::row::RateOfInputs;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::{Recording, SLOW_NS};
use govtwin_model::replay::between::trips_amid;
use govtwin_model::replay::trips::place_trips;
use govtwin_model::replay::{Replayed, is_measured};
use govtwin_model::twin::Twin;
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

use super::residual::Driven;
use super::{Args, options, rows};
use crate::commands::bags::Bag;

/// A bag along which the twin ran.
pub(super) struct Followed {
    pub replayed: Replayed,
    pub health: Health,
    /// How the time between slow rows was filled.
    pub between: Option<String>,
}

/// A twin, and how bags are read for it.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    pub args: &'a Args,
    pub unit: &'a Unit,
    pub twin: &'a Twin,
    /// All rows are kept: something else runs along them again.
    pub whole: bool,
}

impl Way<'_> {
    /// Runs the twin along a bag as its rows come, inputs held.
    pub fn hold(self, bag: &Bag) -> anyhow::Result<Followed> {
        let twin = &mut self.twin.clone();
        let (replayed, health) = if self.whole {
            let (recording, health) = self.load(bag, Interpolation::Hold)?;
            (Replayed::new(twin, recording), health)
        } else {
            rows::replay(&bag.path, &bag.name, &options(self.args, Interpolation::Hold, self.unit), twin)?
        };
        Ok(Followed { replayed, health, between: None })
    }

    /// The same as the twin is to be driven, of what [`Self::hold`] found, if it has run.
    pub fn drive(self, bag: &Bag, driven: Driven, held: Option<Followed>) -> anyhow::Result<Followed> {
        let period_ns = nanos_from_seconds(self.unit.parameters.regulator.large_loop_period_s).max(1);
        if driven == Driven::By(RateOfInputs::Linear) {
            let (mut recording, health) = self.load(bag, Interpolation::Linear { period_ns })?;
            trips_amid(&mut recording);
            return Ok(Followed { replayed: self.along(recording), health, between: None });
        }
        let held = held.map_or_else(|| self.hold(bag), Ok)?;
        let row_ns = held.replayed.row_ns();
        if driven != Driven::AsRecorded || row_ns <= SLOW_NS {
            return Ok(held);
        }
        let slow = format!("rows come every {:.2} s", seconds_from_nanos(row_ns));
        match self.load(bag, Interpolation::Sharp { period_ns }) {
            Ok((mut recording, health)) => {
                let trips = trips(&place_trips(self.twin, &mut recording));
                let between = Some(format!("{slow}: between them the twin's inputs run straight{trips}"));
                Ok(Followed { replayed: self.along(recording), health, between })
            }
            // Held inputs need no rows between.
            Err(BagError::TooManyRows { .. }) => {
                let between = Some(format!("{slow}, too many to fill the time between: the twin's inputs hold there"));
                Ok(Followed { between, ..held })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The twin along rows of which some were added: they are none of the recording's.
    fn along(self, recording: Recording) -> Replayed {
        let mut replayed = Replayed::new(&mut self.twin.clone(), recording);
        replayed.rows = replayed.recording.frames.iter().filter(|frame| is_measured(frame)).count();
        replayed
    }

    fn load(self, bag: &Bag, interpolation: Interpolation) -> Result<(Recording, Health), BagError> {
        let Loaded { recording, health } = govtwin_bag::read(&bag.path, &options(self.args, interpolation, self.unit))?;
        Ok((Recording { name: bag.name.clone(), ..recording }, health))
    }
}

/// A trip that is set by less stands where it stood, ns.
const WORTH_TELLING_NS: i64 = 5_000_000;

/// How trips were set.
fn trips(earlier_ns: &[i64]) -> String {
    let moved = earlier_ns.iter().filter(|ns| **ns >= WORTH_TELLING_NS);
    let Some(most_ns) = moved.clone().max() else { return String::new() };
    let all = match moved.count() {
        1 => "a trip was set".to_owned(),
        count => format!("{count} trips were set up to"),
    };
    format!(", and {all} {:.2} s before its row, as the unit moved", seconds_from_nanos(*most_ns))
}
