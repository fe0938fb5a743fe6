//! Whether the spool of a recording reads on the scale of the sheet: the sheet's regulator says how far it moves, and its ports how fast it moves the
//! servomotor.
//!
//! A regulator of another gain moves the servomotor with the spool, and a loss of oil flow leaves the spool where the regulator wants it, as a
//! transducer of another gain does as long as the spool is off its stops. Only what is recorded on another scale shows in both, by factors that cancel.

use govtwin_model::effects::find;
use govtwin_model::frame::Estimate;
use govtwin_model::metrics::Figures;
use govtwin_model::parameters::{ENTRIES, Tolerance, Unit};
use govtwin_model::recording::Recording;
use govtwin_model::replay::{Scores, simulate};
use govtwin_model::signal::{Signal, span};
use govtwin_model::twin::{Cut, Twin};

use super::doubt::Doubt;
use super::time_scale::{DOUBTFUL, MOVED_PU, beginning};

/// A smaller factor may be one of tolerances and faults, unless the sheet states its ports more precisely: that of the two scales from 1 to 2 which is
/// as far from both.
const LEAST: f64 = std::f64::consts::SQRT_2;
/// Ports are off their sheet by so many of its standard deviations at most.
const SIGMAS: f64 = 4.0;
/// From this factor on it is worth a note: gains and ports are known to a tenth.
const NOTED: f64 = 1.15;
/// A spool that is asked to stand nearer to neutral, pu, is off its stops, also where its transducer reads half or twice.
const OFF_STOPS_PU: f64 = 0.4;
/// A step of the spool's offset, pu: that of a transducer that is a little off.
const OFFSET_PU: f64 = 0.01;
/// The squared correlation of the recorded spool with that of the sheet's regulator: less is no matter of scale.
const TOGETHER: f64 = 0.75;

/// What is to be said of a spool that reads on another scale; nothing where it does not, or the recording cannot tell.
pub fn doubt_of_spool(recording: &Recording, unit: &Unit) -> Option<Doubt> {
    let recording = Recording::new("", beginning(recording).to_vec());
    let of = |signal: Signal| recording.frames.iter().map(move |frame| signal.of(&frame.measured));
    if !recording.has_command() || span(of(Signal::ServomotorPosition))? < MOVED_PU {
        return None;
    }
    let asked = simulate(&mut Twin::new(unit).with_cut(Cut::Servomotor), &recording);
    let asked = asked.iter().map(|estimate| Signal::SpoolPosition.of(&estimate.signals));
    let both =
        of(Signal::SpoolPosition).zip(asked).filter(|(read, asked)| read.is_finite() && asked.abs() < OFF_STOPS_PU);
    let [squares, products, read_squares] = both.fold([0.0; 3], |[squares, products, read_squares], (read, asked)| {
        [squares + asked * asked, products + read * asked, read_squares + read * read]
    });
    let factor = products / squares;
    if products * factor < TOGETHER * read_squares || factor.max(1.0 / factor) < NOTED {
        return None;
    }
    let [own, scaled] = [1.0, factor].map(|factor| driven(&recording, unit, factor));
    if (scaled.rmse / own.rmse).powi(2) > DOUBTFUL || scaled.r2 < 1.0 - DOUBTFUL {
        return None;
    }
    let is_far = factor.max(1.0 / factor) >= LEAST.min(within_tolerance(unit));
    let words = format!(
        "{} reads {factor:.2} times what the sheet's regulator asks for, and divided by that it moves the sheet's servomotor as recorded (error from {:.2} % to \
         {:.2} %): {}its channel is scaled (a unit or `range` of an import?), or the stroke of the sheet's spool is another unit's (--params){}",
        Signal::SpoolPosition.id(),
        own.rmse * 100.0,
        scaled.rmse * 100.0,
        if is_far { "" } else { "either " },
        if is_far {
            ""
        } else {
            ", or its regulator and its ports are both off the sheet, which nothing here tells apart"
        },
    );
    Some(if is_far { Doubt::refused(words) } else { Doubt::note(words) })
}

/// The factor that is as far off as the ports of the sheet can be.
fn within_tolerance(unit: &Unit) -> f64 {
    let ports = ENTRIES.iter().position(|entry| entry.key == "main_ports.width_m");
    let tolerance = ports.and_then(|ports| *unit.tolerances.get(ports)?);
    match tolerance {
        Some(Tolerance::Relative(share) | Tolerance::LogNormal(share)) => (SIGMAS * share).exp(),
        _ => f64::INFINITY,
    }
}

/// Figures of the servomotor that the recorded spool drives, divided by a factor and less the offset that suits it best: a transducer may have one beside
/// its scale. It is twice a typical one at most, as a larger one leaves little for a scale to tell. Off its stops the servomotor is linear in it.
fn driven(recording: &Recording, unit: &Unit, factor: f64) -> Figures {
    let with = |offset_pu: f64| {
        let mut changed = recording.clone();
        for frame in &mut changed.frames {
            frame.measured.spool_position_pu = frame.measured.spool_position_pu / factor - offset_pu;
        }
        simulate(&mut Twin::new(unit).with_cut(Cut::Spool), &changed)
    };
    let servomotor = |estimate: &Estimate| Signal::ServomotorPosition.of(&estimate.signals);
    let [without, shifted] = [0.0, OFFSET_PU].map(with);
    let missed = recording.frames.iter().map(|frame| Signal::ServomotorPosition.of(&frame.measured));
    let moved = without.iter().zip(&shifted).map(|(a, b)| (servomotor(a), (servomotor(b) - servomotor(a)) / OFFSET_PU));
    let [products, squares] = missed
        .zip(moved)
        .filter(|(measured, _)| measured.is_finite())
        .fold([0.0; 2], |[products, squares], (measured, (at, slope))| {
            [products + (measured - at) * slope, squares + slope * slope]
        });
    let most = find("lvdt_bias").and_then(|spec| spec.parameters.first()).map_or(0.0, |offset| 2.0 * offset.typical);
    let figures = |estimates: &[Estimate]| Scores::of(recording, estimates).figures(Signal::ServomotorPosition);
    let own = figures(&without);
    if squares <= 0.0 {
        return own;
    }
    let less = figures(&with((products / squares).clamp(-most, most)));
    // At its stops the servomotor is not linear in it, so that none may do better.
    if less.rmse < own.rmse { less } else { own }
}
