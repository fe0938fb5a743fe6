//! The trace of searches for hyperparameters, and the surrogate's picture.

use crate::comparison::summary::Searched;
use govtwin_model::number::{fixed, significant};
use govtwin_pages::draw::svg;
use govtwin_pages::ink::Ink;
use govtwin_pages::page::PageBody;
use govtwin_pages::picture::{Mark, MarkShape, Panel, Picture};
use govtwin_pages::table::Table;

/// Shows searches, whose losses have this unit: traces, what they found, and the surrogate along each dimension.
pub fn search_blocks(body: &mut PageBody, searches: &[Searched], unit: &str) {
    if searches.is_empty() {
        return;
    }
    body.figure(
        svg(&traces(searches, unit)),
        "Lines: best cross-validated MAE so far. Dots: single evaluations. Bayesian optimisation and random search have equally many \
         evaluations and the same first points.",
    );
    for search in searches.iter().filter(|search| !search.slices.is_empty()) {
        body.figure(
            svg(&surrogate(search)),
            format!("{}: MAE in {unit} predicted by the Gaussian process along each hyperparameter through the best point (dot), with ±2 standard deviations.", search.id),
        );
    }
    let best = format!("best MAE, {unit}");
    let mut table =
        Table::new().words("search").words("kind").numbers("evaluations").numbers(best).words("hyperparameters");
    for search in searches {
        let Some((point, loss)) = search.best() else { continue };
        let at = search
            .dimensions
            .iter()
            .zip(point)
            .map(|(name, value)| format!("{} {}", name.replace('_', " "), short(*value)));
        let at: Vec<String> = at.collect();
        table.row([
            search.id.to_owned(),
            search.kind.to_owned(),
            search.losses.len().to_string(),
            significant(loss, 3),
            at.join(", "),
        ]);
    }
    body.table(
        table,
        "Best result of each search: MAE over the validation rows of five folds, with its hyperparameters.",
    );
}

/// A hyperparameter; counts have no digits after the point.
fn short(value: f64) -> String {
    if value.fract() == 0.0 { fixed(value, 0) } else { significant(value, 3) }
}

fn numbered(values: &[f64]) -> Vec<[f64; 2]> {
    values.iter().enumerate().map(|(k, value)| [k as f64 + 1.0, *value]).collect()
}

fn traces(searches: &[Searched], unit: &str) -> Picture {
    let mut ids: Vec<&str> = searches.iter().map(|search| search.id).collect();
    ids.dedup();
    let panel = |id: &str| {
        let mut panel = Panel::new(format!("{id}: MAE over the folds, {unit}")).x_name("evaluation").height(190);
        for search in searches.iter().filter(|search| search.id == id) {
            // Dashes and hollow dots distinguish the two without colours.
            let (ink, dash) = if search.kind == "random" { (Ink::Measured, 1) } else { (Ink::Simulated, 0) };
            let best = Mark::new(MarkShape::Line(numbered(&search.best_so_far())), ink, search.kind);
            let each = Mark::new(MarkShape::Dots(numbered(&search.losses)), ink, "");
            panel = panel.mark(best.dashed(dash)).mark(each.dashed(dash));
        }
        panel
    };
    Picture::grid("Searches for hyperparameters", 2, ids.into_iter().map(panel).collect())
}

fn surrogate(search: &Searched) -> Picture {
    let panel = |(name, points): (&&'static str, &Vec<[f64; 4]>)| {
        let band = points.iter().map(|[value, _, low, high]| [*value, *low, *high]).collect();
        let middle = points.iter().map(|[value, middle, ..]| [*value, *middle]).collect();
        let mut panel = Panel::new(*name).height(110).band(Ink::Band, "", band).line(Ink::Simulated, "", middle);
        let known = search.dimensions.iter().position(|dimension| dimension == name);
        if let (Some(index), Some((best, loss))) = (known, search.best()) {
            panel = panel.mark(Mark::new(MarkShape::Dots(vec![[best[index], loss]]), Ink::Alarm, ""));
        }
        panel
    };
    Picture::grid(format!("Surrogate of the search for {}", search.id), 3, search.slices.iter().map(panel).collect())
}
