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
        .thick_line("measured", points(measured, &measured.position_pu));
    let mut error = Panel::new("Position − command, %").height(110).thick_line("", errors(measured)).x_name("time, s");
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
        // Value and half width of its interval over the frequency.
        let drawn = |panel: Panel, values: Vec<[f64; 3]>| {
            let points: Vec<_> = values.iter().map(|[x, value, _]| [*x, *value]).collect();
            panel
                .band(ink, "", values.iter().map(|[x, value, half]| [*x, value - half, value + half]).collect())
                .mark(Mark::new(MarkShape::Line(points.clone()), ink, label).dashed(dash))
                .mark(Mark::new(MarkShape::Dots(points), ink, "").dashed(dash))
        };
        gain = drawn(gain, all.iter().map(|one| [one.frequency_hz.log10(), one.gain, one.gain_half]).collect());
        phase =
            drawn(phase, all.iter().map(|one| [one.frequency_hz.log10(), one.phase_deg, one.phase_half_deg]).collect());
    }
    Picture::grid("Frequency response from command to position", 2, vec![gain, phase])
}
