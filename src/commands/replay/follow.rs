//! The twin along one bag, and what drives it between the rows.

use govtwin_bag::{BagError, Health, Interpolation, Loaded};
use govtwin_correction::row::RateOfInputs;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::{Recording, SLOW_NS};
use govtwin_model::replay::Replayed;
use govtwin_model::replay::between::trips_amid;
use govtwin_model::replay::trips::place_trips;
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

/// Runs the twin of a unit along a bag.
pub(super) fn follow(
    args: &Args,
    bag: &Bag,
    driven: Driven,
    (mut twin, unit): (Twin, &Unit),
    whole: bool,
) -> anyhow::Result<Followed> {
    let period_ns = nanos_from_seconds(unit.parameters.regulator.large_loop_period_s).max(1);
    let load = |interpolation| {
        let Loaded { recording, health } = govtwin_bag::read(&bag.path, &options(args, interpolation, unit))?;
        Ok::<_, BagError>((Recording { name: bag.name.clone(), ..recording }, health))
    };
    let (replayed, health) = if driven == Driven::By(RateOfInputs::Linear) {
        let (mut recording, health) = load(Interpolation::Linear { period_ns })?;
        trips_amid(&mut recording);
        (Replayed::new(&mut twin, recording), health)
    } else if whole {
        let (recording, health) = load(Interpolation::Hold)?;
        (Replayed::new(&mut twin, recording), health)
    } else {
        rows::replay(&bag.path, &bag.name, &options(args, Interpolation::Hold, unit), &mut twin)?
    };
    let row_ns = replayed.row_ns();
    if driven != Driven::AsRecorded || row_ns <= SLOW_NS {
        return Ok(Followed { replayed, health, between: None });
    }
    let slow = format!("rows come every {:.2} s", seconds_from_nanos(row_ns));
    match load(Interpolation::Sharp { period_ns }) {
        Ok((mut recording, health)) => {
            let trips = match place_trips(&twin, &mut recording).as_slice() {
                [] => String::new(),
                earlier_ns => {
                    let most_s = seconds_from_nanos(earlier_ns.iter().copied().max().unwrap_or(0));
                    format!(
                        ", and {} set up to {most_s:.2} s before its row, as the unit moved",
                        trips(earlier_ns.len())
                    )
                }
            };
            let between = Some(format!("{slow}: between them the twin's inputs run straight{trips}"));
            Ok(Followed { replayed: Replayed::new(&mut twin, recording), health, between })
        }
        // Held inputs need no rows between.
        Err(BagError::TooManyRows { .. }) => {
            let between = Some(format!("{slow}, too many to fill the time between: the twin's inputs hold there"));
            Ok(Followed { replayed, health, between })
        }
        Err(error) => Err(error.into()),
    }
}

fn trips(count: usize) -> String {
    if count == 1 { "its trip was".to_owned() } else { format!("{count} trips were each") }
}
