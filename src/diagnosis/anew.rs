//! Single effects of a stage without a sheet fitted anew from where the plain law has it.
//!
//! Refitted without an effect, a stage may end far from its dead band and zero to make up for what it lacks, and effects that are added there then
//! stay behind that ridge.

use crate::diagnosis::evidence::Shared;
use crate::diagnosis::explore::Explored;
use crate::diagnosis::explorer::{Hypothesis, LAW_ERROR, RARITY, kappa};
use crate::diagnosis::model::Model;
use crate::diagnosis::support::{Placed, Variant, with_effect};
use crate::effects::EffectSpec;
use crate::tuning::bench::Bench;
use crate::tuning::fit::{Effort, Start, fit_all};

/// Sizes from which an effect starts, in typical ones.
const SIZES: [f64; 3] = [1.0, -1.0, 0.2];

/// Fits every single effect from the unfitted stage as well, and keeps what is better.
pub fn singles(found: &mut Explored, bench: &Bench, sheet: &Model, catalogue: &[&'static EffectSpec]) {
    let places: Vec<(usize, Placed)> = catalogue
        .iter()
        .enumerate()
        .flat_map(|(effect, spec)| {
            let of = move |size| with_effect(sheet, spec, Variant { size, further: 1.0 });
            SIZES.into_iter().filter_map(of).map(move |placed| (effect, placed))
        })
        .collect();
    let starts: Vec<Start<'_>> = places
        .iter()
        .map(|(_, (base, knobs, positions))| Start { base, knobs, positions, effort: Effort::FULL, known: None })
        .collect();
    let fits = fit_all(bench, &starts);
    drop(starts);
    let shared = Shared::new(bench, &found.discrepancy, found.refitted().cost());
    for ((effect, (base, knobs, _)), fit) in places.into_iter().zip(fits) {
        let known = found.hypotheses.iter().position(|one| one.effects == [effect]);
        if known.is_some_and(|place| found.hypotheses[place].model.cost() <= fit.cost()) {
            continue;
        }
        let model = Model::new(vec![catalogue[effect]], base, knobs, fit);
        let normal = shared.normal(&model);
        let log_evidence = normal.at(kappa(bench), LAW_ERROR) - RARITY;
        let anew = Hypothesis { effects: vec![effect], model, normal, log_evidence, refined: true };
        match known {
            Some(place) => found.hypotheses[place] = anew,
            None => found.hypotheses.push(anew),
        }
    }
    found.hypotheses.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
}
