//! Pictures of an acceptance report: recordings with their twins, and the frequency response.

use super::Drawn;
use crate::ink::Ink;
use crate::picture::{Mark, MarkShape, Panel, Picture};
use govtwin_diagnosis::acceptance::series::Series;
use govtwin_diagnosis::acceptance::summary::AcceptanceSummary;

/// Command and position of a recording, with the twins.
pub(super) fn curves(one: &Drawn) -> Picture {
    let points = |series: &Series, values: &[f64]| {
        series.time_s.iter().zip(values).map(|(t, y)| [*t, 100.0 * y]).collect::<Vec<_>>()
    };
    let errors = |series: &Series| {
        (0..series.len()).map(|i| [series.time_s[i], -100.0 * series.error_pu(i)]).collect::<Vec<_>>()
    };
    let measured = &one.measured;
    let mut position = Panel::new("Servomotor position, %")
        .line(Ink::Command, "command", points(measured, &measured.command_pu))
        .thick_line(Ink::Measured, "measured", points(measured, &measured.position_pu));
    let mut error = Panel::new("Position − command, %")
        .height(110)
        .thick_line(Ink::Measured, "", errors(measured))
        .x_name("time, s");
    if let Some(series) = &one.found {
        position = position.line(Ink::Simulated, "twin as found", points(series, &series.position_pu));
        error = error.line(Ink::Simulated, "", errors(series));
    }
    // Dashes let the twin as found be seen where both run alike.
    if let Some(series) = &one.without {
        position = position.dashed_line(Ink::Good, "twin without the faults", points(series, &series.position_pu));
        error = error.dashed_line(Ink::Good, "", errors(series));
    }
    Picture::stacked(format!("Command and position of {}", measured.name), vec![position, error])
}

/// Gain and phase over frequency.
pub(super) fn response(summary: &AcceptanceSummary) -> Picture {
    let mut gain = Panel::new("Gain").x_name("frequency, Hz").x_decades();
    let mut phase = Panel::new("Phase, °").x_name("frequency, Hz").x_decades();
    // Dashes and hollow dots are the twin's, whoever sees the colours.
    for (ink, label, all, dash) in [
        (Ink::Measured, "measured", &summary.response, 0),
        (Ink::Simulated, "twin, standard test", &summary.twin_response, 1),
    ] {
        if all.is_empty() {
            continue;
        }
        let x = |hz: f64| hz.log10();
        let line = |points| Mark::new(MarkShape::Line(points), ink, label).dashed(dash);
        let dots = |points| Mark::new(MarkShape::Dots(points), ink, "").dashed(dash);
        gain = gain
            .band(
                ink,
                "",
                all.iter()
                    .map(|one| [x(one.frequency_hz), one.gain - one.gain_half, one.gain + one.gain_half])
                    .collect(),
            )
            .mark(line(all.iter().map(|one| [x(one.frequency_hz), one.gain]).collect()))
            .mark(dots(all.iter().map(|one| [x(one.frequency_hz), one.gain]).collect()));
        phase = phase
            .band(
                ink,
                "",
                all.iter()
                    .map(|one| {
                        [x(one.frequency_hz), one.phase_deg - one.phase_half_deg, one.phase_deg + one.phase_half_deg]
                    })
                    .collect(),
            )
            .mark(line(all.iter().map(|one| [x(one.frequency_hz), one.phase_deg]).collect()))
            .mark(dots(all.iter().map(|one| [x(one.frequency_hz), one.phase_deg]).collect()));
    }
    Picture::grid("Frequency response from command to position", 2, vec![gain, phase])
}
