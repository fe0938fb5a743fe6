//! Whether the servomotor's position of a recording reads on the scale of its stroke, where the servomotor goes so many times its command.
//!
//! A governor that takes its command so many times moves the servomotor as fast as the sheet says; one whose position is recorded on another scale moves
//! it so many times as fast. The sheet's twin tells which. A command that was scaled in the recording looks like the former, and nothing tells the two.

use govtwin_bag::Followed;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::replay::{Scores, simulate};
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

use super::time_scale::{DOUBTFUL, beginning};

/// A smaller multiple is one of tolerances and of what holds a servomotor off its command.
const LEAST: f64 = 1.1;

/// How many times its command the servomotor goes; none where it does not, or goes by it.
fn multiple(recording: &Recording) -> Option<f64> {
    let mut followed = Followed::default();
    recording.frames.iter().for_each(|frame| followed.take(frame));
    followed.multiple().filter(|multiple| multiple.max(1.0 / multiple) > LEAST)
}

/// A servomotor position that reads so many times what it is.
#[derive(Clone, Copy, Debug)]
pub struct PositionScale {
    ratio: f64,
    /// The servomotor's error where the position is divided by that, and where the command is multiplied, pu.
    scaled_pu: f64,
    gained_pu: f64,
}

/// The variance that a twin leaves of both positions where the command is multiplied and the servomotor's position divided, and the servomotor's error, pu.
fn left(recording: &Recording, unit: &Unit, times: f64, divided: f64) -> (f64, f64) {
    let mut changed = recording.clone();
    for frame in &mut changed.frames {
        frame.inputs.opening_command_pu *= times;
        frame.measured.servomotor_position_pu /= divided;
    }
    let scores = Scores::of(&changed, &simulate(&mut Twin::new(unit), &changed));
    let [servomotor, spool] = Signal::POSITIONS.map(|signal| scores.figures(signal));
    ((1.0 - servomotor.r2) + if spool.r2.is_finite() { 1.0 - spool.r2 } else { 0.0 }, servomotor.rmse * divided)
}

impl PositionScale {
    /// That of a recording; none where the position reads on the scale of its stroke, or the recording cannot tell.
    pub fn of(recording: &Recording, unit: &Unit) -> Option<Self> {
        let recording = Recording::new("", beginning(recording).to_vec());
        let ratio = multiple(&recording).filter(|_| recording.has_command())?;
        Self::scaled_by(ratio, &recording, unit, DOUBTFUL)
    }

    /// The same scale in another recording of the same channel, where that explains it better than the governor's gain does, and than nothing.
    pub fn also_in(self, recording: &Recording, unit: &Unit) -> Option<Self> {
        Self::scaled_by(self.ratio, &Recording::new("", beginning(recording).to_vec()), unit, 1.0)
    }

    /// This scale, where it leaves no more than a share of what the governor's gain leaves, and less than the position as it reads: else something else is
    /// wrong with it.
    fn scaled_by(ratio: f64, recording: &Recording, unit: &Unit, share: f64) -> Option<Self> {
        let left = |times: f64, divided: f64| left(recording, unit, times, divided);
        let ((left_gained, gained_pu), (left_scaled, scaled_pu)) = (left(ratio, 1.0), left(1.0, ratio));
        let is_scaled = left_scaled < share * left_gained.min(2.0) && left_scaled < left(1.0, 1.0).0;
        is_scaled.then_some(Self { ratio, scaled_pu, gained_pu })
    }

    /// What is to be said of it; nothing is concluded from the recording.
    pub fn words(&self) -> String {
        format!(
            "{} goes {:.2} times its command and as many times as fast as the sheet's servomotor with its spool (error of {:.2} % where the position is divided \
             by that, of {:.2} % where the command is multiplied): its channel is scaled (a unit or `range` of an import?), or it is another unit's (--params)",
            Signal::ServomotorPosition.id(),
            self.ratio,
            self.scaled_pu * 100.0,
            self.gained_pu * 100.0
        )
    }
}
