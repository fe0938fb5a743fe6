//! What a diagnosis says to a person: a few lines, and a page.

use govtwin::diagnosis::outcome::{Diagnosis, Interval, Verdict};

fn percent(interval: Interval) -> String {
    format!("{:.0} % [{:.0}, {:.0}]", 100.0 * interval.value, 100.0 * interval.low, 100.0 * interval.high)
}

/// The verdict in a few lines.
pub fn summary(diagnosis: &Diagnosis) -> String {
    let mut text = format!("verdict: {}\n", diagnosis.verdict.id());
    if let Some(stage) = diagnosis.stage {
        text.push_str(&format!("stage: {}\n", stage.id()));
    }
    for blame in &diagnosis.blamed {
        let values: Vec<String> = blame
            .parameters
            .iter()
            .map(|one| {
                format!(
                    "{} = {:.4} [{:.4}, {:.4}] {}",
                    one.name, one.value.value, one.value.low, one.value.high, one.unit
                )
            })
            .collect();
        text.push_str(&format!(
            "{}: probability {:.2}, {}, closes {} of the gap\n",
            blame.id,
            blame.probability,
            values.join(", "),
            percent(blame.closure)
        ));
    }
    if diagnosis.verdict == Verdict::Unknown {
        if let Some(latent) = diagnosis.latents.first() {
            text.push_str(&format!(
                "a free term on the {} explains {:.0} % of the gap\n",
                latent.place,
                100.0 * latent.explains
            ));
        }
    }
    for one in &diagnosis.experiments {
        text.push_str(&format!("to tell {} apart: {}\n", one.separates.join(" and "), one.test));
    }
    text
}

/// The page.
pub fn page(diagnosis: &Diagnosis) -> anyhow::Result<String> {
    let mut page = govtwin::report::page::Page::new("Diagnosis", diagnosis.verdict.id());
    page.body.paragraph(summary(diagnosis));
    Ok(page.to_html())
}
