//! A part of the chain: how well its models predict free runs, and how much of the verdict they bear.

pub(crate) mod free_runs;
pub(crate) mod left_out;
pub mod stage_figures;

use crate::decision::Decision;
use crate::hypotheses::Explored;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::preparation::{Preparation, StageAlone};
use crate::result::{Setup, StageOnly, Verdict};
use crate::stage_alone::competing_laws::Follows;
use crate::stage_alone::plain_models::PlainKind;
use crate::stage_only::free_runs::Compared;
use crate::stage_only::stage_figures::{sheetless_figures, stage_figures};
use crate::summary::explained_fraction::without_recordings;
use govtwin_model::effects::id_words;
use govtwin_model::frame::Estimate;
use govtwin_model::signal::Signal;

/// Effects on top of the first must all be this probable to be named, with a sheet.
const SURE: f64 = 0.6;
/// The same where everything is fitted freely.
const SURE_IF_FREE: f64 = 0.95;
/// An effect on its own is named from this probability on.
const LEAST_PROBABLE: f64 = 0.5;
/// Without a sheet an effect that explains this share of what the best one does cannot be told from it.
const CLOSE: f64 = 0.9;
/// A stage that leaves no more than this, in squares of what the most flexible law leaves, has no effect that could be named.
const CALM_ENOUGH: f64 = 3.0;
/// Gain in cost that may be chance.
const LEAST_GAIN: f64 = 8.0;

/// The decision as far as a stage on its own bears it, what was taken back in words, and the models in free runs.
///
/// Without a sheet everything is fitted freely, and a piece of a recording starts in a state that nobody measured: a second effect, or the
/// better of two alike, is then easily had. That there is no gap is said only where the transducers account for what is missed on pieces left out.
pub(crate) fn modest(
    problem: &Problem,
    found: &Explored,
    (ready, stage): (&Preparation, &StageAlone),
    decision: Decision,
) -> (Decision, Vec<String>, Compared) {
    if stage.follows != Follows::Sum {
        let compared = Compared::of(ready, stage, &[found.refitted()]);
        if let Some(foreign) = foreign(stage, &compared) {
            return (decision.forced(Verdict::NoSuchUnit), vec![foreign], compared);
        }
    }
    let floor_square = floor_square(problem, ready.setup, stage);
    let (decision, mut said) = careful(problem, found, ready.setup, floor_square, decision);
    let compared = Compared::of(ready, stage, &twins(found, &decision));
    let (decision, withdrawn) = only_predicting(&compared, decision);
    said.extend(withdrawn);
    let (decision, improbable) = only_probable(decision);
    said.extend(improbable);
    if decision.verdict == Verdict::NoGap
        && let Some(missed) = beyond_transducers(problem, found.refitted(), floor_square)
    {
        said.push(missed);
        return (decision.forced(Verdict::Unknown), said, compared);
    }
    (decision, said, compared)
}

/// The recalibrated twin, those with a blamed effect, and the one with all of them at once.
fn twins<'a>(found: &'a Explored, decision: &Decision) -> Vec<&'a FittedModel> {
    let together =
        (decision.verdict == Verdict::Named && decision.blamed.len() > 1).then(|| found.with(&decision.blamed));
    let blamed = decision.blamed.iter().filter_map(|id| found.with(&[id]));
    std::iter::once(found.refitted()).chain(blamed).chain(together.flatten()).collect()
}

/// The decision without names that free runs on held-out pieces do not bear out; what was taken back is said.
fn only_predicting(compared: &Compared, mut decision: Decision) -> (Decision, Vec<String>) {
    let mut said = Vec::new();
    if let Some(alone) = compared.enough_alone(&decision.blamed).filter(|_| decision.verdict == Verdict::Named) {
        let others: Vec<String> = decision.blamed.iter().filter(|id| **id != alone).map(|id| id_words(id)).collect();
        let (others, one) = (others.join(" and "), id_words(alone));
        said.push(format!(
            "Not named: {others}, as the stage with it does not predict both halves better than with {one} alone."
        ));
        decision.blamed = vec![alone];
    }
    let blamed = decision.blamed.clone();
    let sets: Vec<Vec<&'static str>> = match decision.verdict {
        Verdict::Named => vec![blamed],
        Verdict::Class => blamed.into_iter().map(|id| vec![id]).collect(),
        _ => return (decision, said),
    };
    let mut kept = Vec::new();
    for set in sets {
        match compared.against(&set.join(" + ")) {
            None => kept.extend(set),
            Some(why) => {
                let names: Vec<String> = set.iter().map(|id| id_words(id)).collect();
                said.push(format!("Not named: {}, as {why}.", names.join(" and ")));
            }
        }
    }
    if kept.is_empty() {
        return (decision.forced(Verdict::Unknown), said);
    }
    if kept.len() == 1 {
        decision.verdict = Verdict::Named;
    }
    decision.blamed = kept;
    (decision, said)
}

/// The decision without a name, or a class of them, that is less probable than not: what is left of a class may be; says so.
fn only_probable(decision: Decision) -> (Decision, Option<String>) {
    let probability = |id: &str| decision.effects.iter().find(|(spec, _)| spec.id == id).map_or(0.0, |(_, p)| *p);
    let together: f64 = match (decision.verdict, decision.blamed.as_slice()) {
        (Verdict::Named, [only]) => probability(only),
        (Verdict::Class, all) => all.iter().map(|id| probability(id)).sum(),
        _ => return (decision, None),
    };
    if together >= LEAST_PROBABLE {
        return (decision, None);
    }
    let names: Vec<String> = decision.blamed.iter().map(|id| id_words(id)).collect();
    let said = format!("Not named: {}, as the probability is {together:.2}.", names.join(" or "));
    (decision.forced(Verdict::Unknown), Some(said))
}

/// That the recordings are of no such stage, in a sentence, where another law predicts them better, in free runs as well.
fn foreign(stage: &StageAlone, compared: &Compared) -> Option<String> {
    let [sum, spool, nothing] = stage.left.map(|left| format!("{:.1} %", 100.0 * left));
    match stage.follows {
        Follows::Sum => None,
        Follows::Spool { .. } if compared.sums_up() => None,
        Follows::Spool { settles_s } => Some(format!(
            "The position does not integrate the spool position, as a servomotor does, but settles within {settles_s:.2} s to a value set by the \
             spool: on held-out pieces such a law leaves {spool} of the squared movement, the best law of a servomotor {sum}. Is the spool signal a \
             set point, or from another machine?"
        )),
        Follows::Nothing => Some(format!(
            "The spool does not predict the servomotor's movement: on held-out pieces the best law of the spool leaves {sum} of the squared movement, \
             a servomotor that stands or drifts leaves {nothing}. Are both signals from one unit, and is the spool that of the main distributing valve?"
        )),
    }
}

/// Mean square residual of a right model, due to the transducers, in pu squared.
fn floor_square(problem: &Problem, setup: Setup, stage: &StageAlone) -> f64 {
    let seen = stage.seen.transducers.powi(2);
    if setup == Setup::StageFree {
        return seen;
    }
    let of = |recording| problem.floor_square(recording, Signal::ServomotorPosition);
    let sheet = (0..problem.recordings.len()).map(of).sum::<f64>() / problem.recordings.len().max(1) as f64;
    sheet.max(seen)
}

/// The sentence that the residual on pieces left out is larger than the transducers account for.
fn beyond_transducers(problem: &Problem, model: &FittedModel, floor_square: f64) -> Option<String> {
    let mean_square = left_out_square(problem, model);
    is_beyond(problem, mean_square / floor_square).then(|| {
        format!(
            "On held-out pieces the fitted stage has an RMS error of {:.2} % of stroke. The transducers account for {:.2} %, and no effect of the \
             catalogue explains more of the rest than chance would.",
            100.0 * mean_square.sqrt(),
            100.0 * floor_square.sqrt()
        )
    })
}

/// Whether a mean square over the transducers' is more than they account for.
///
/// The residuals of a piece are one draw, as they go together over the whole of it. That they have the transducers' variance is held against a variance of
/// their own by the Bayesian information criterion (Schwarz 1978): with r the ratio of the two, `n (r − 1 − ln r) > ln n`.
fn is_beyond(problem: &Problem, ratio: f64) -> bool {
    let count = problem.recordings.len() as f64;
    ratio > 1.0 && count * (ratio - 1.0 - ratio.ln()) > count.ln()
}

/// Whether so many further effects bring a mean square on pieces left out down by more than the same criterion charges for them.
fn is_better(problem: &Problem, before: f64, after: f64, further: usize) -> bool {
    let count = problem.recordings.len() as f64;
    count * (before / after).ln() > further as f64 * count.ln()
}

/// Whether what is blamed, or a single effect, predicts pieces left out better than the stage without any.
fn predicts_better(problem: &Problem, found: &Explored, decision: &Decision) -> bool {
    let before = left_out_square(problem, found.refitted());
    let blamed: &[&str] = &decision.blamed;
    let sets = std::iter::once(blamed.to_vec()).chain(blamed.iter().map(|id| vec![*id]));
    let models = sets.filter(|set| !set.is_empty()).filter_map(|set| found.with(&set));
    models.into_iter().any(|model| is_better(problem, before, left_out_square(problem, model), model.effects.len()))
}

/// Mean square residual of a model on pieces left out of its fit, each piece with the same weight, in pu squared.
fn left_out_square(problem: &Problem, model: &FittedModel) -> f64 {
    let left_out = without_recordings(problem, model).estimates;
    let of = |(index, estimates): (usize, &Vec<Estimate>)| {
        let squares = problem.squares(index, Signal::ServomotorPosition, estimates)?;
        let finite: Vec<f64> = squares.into_iter().filter(|square| square.is_finite()).collect();
        (!finite.is_empty()).then(|| finite.iter().sum::<f64>() / finite.len() as f64)
    };
    let means: Vec<f64> = left_out.iter().enumerate().filter_map(of).collect();
    means.iter().sum::<f64>() / means.len().max(1) as f64
}

fn careful(
    problem: &Problem,
    found: &Explored,
    setup: Setup,
    floor_square: f64,
    mut decision: Decision,
) -> (Decision, Vec<String>) {
    let is_free = setup == Setup::StageFree;
    let calm = found.refitted().cost() < CALM_ENOUGH * problem.independent_samples() + LEAST_GAIN;
    if is_free && calm && !predicts_better(problem, found, &decision) {
        let blamed = decision.verdict != Verdict::NoGap;
        let words = "The fitted stage leaves little more error than the most flexible law of the spool, and no effect predicts held-out \
                     pieces better.";
        let said = blamed.then(|| words.to_owned());
        return (decision.forced(Verdict::NoGap), said.into_iter().collect());
    }
    let probability = |id: &str| decision.effects.iter().find(|(spec, _)| spec.id == id).map_or(0.0, |(_, p)| *p);
    let sure = if is_free { SURE_IF_FREE } else { SURE };
    let sure_of = |(place, id): &(usize, &&'static str)| *place == 0 || probability(id) >= sure;
    let (kept, doubtful): (Vec<_>, Vec<_>) = decision.blamed.iter().enumerate().partition(sure_of);
    let ids = |some: Vec<(usize, &&'static str)>| some.into_iter().map(|(_, id)| *id).collect::<Vec<_>>();
    let (kept, doubtful) = (ids(kept), ids(doubtful));
    let mut said = Vec::new();
    if decision.verdict == Verdict::Named && !doubtful.is_empty() {
        said.push(format!(
            "Adding {} to {} would fit slightly better, but not enough to name a second effect.",
            doubtful.join(" or "),
            kept.join(", ")
        ));
        decision.blamed = kept;
    }
    if is_free && decision.verdict == Verdict::Named && decision.blamed.len() > 1 {
        said.extend(single_instead(problem, found, floor_square, &mut decision));
    }
    let names = matches!(decision.verdict, Verdict::Named | Verdict::Class);
    if is_free && names && decision.blamed.len() == 1 {
        let competing = near(found);
        if competing.len() > 1 {
            decision.verdict = Verdict::Class;
            decision.blamed = competing;
        }
    }
    if decision.verdict == Verdict::Class {
        said.extend(without_idle(problem, found, &mut decision));
    }
    (decision, said)
}

/// Takes one effect in the place of several where those predict pieces left out no better than a single one does, or where that leaves no more than
/// the transducers account for; says so.
fn single_instead(problem: &Problem, found: &Explored, floor_square: f64, decision: &mut Decision) -> Option<String> {
    let together = left_out_square(problem, found.with(&decision.blamed)?);
    let singles = near(found).into_iter().filter_map(|id| Some((id, left_out_square(problem, found.with(&[id])?))));
    let (best, alone) = singles.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let further = decision.blamed.len() - 1;
    if is_better(problem, alone, together, further) && is_beyond(problem, alone / floor_square) {
        return None;
    }
    let said = format!(
        "{} together predict held-out pieces hardly better than {best} alone, or {best} alone leaves no more than the transducers account for.",
        decision.blamed.join(" and ")
    );
    decision.blamed = vec![best];
    Some(said)
}

/// Leaves those of a class out that predict nothing better on pieces left out; says so.
fn without_idle(problem: &Problem, found: &Explored, decision: &mut Decision) -> Option<String> {
    let missed = |model: &FittedModel| without_recordings(problem, model).costs.iter().sum::<f64>();
    let before = missed(found.refitted());
    let closes = |id: &&'static str| found.with(&[id]).is_none_or(|model| missed(model) < before);
    let (kept, idle): (Vec<_>, Vec<_>) = decision.blamed.iter().copied().partition(closes);
    if idle.is_empty() || kept.is_empty() {
        return None;
    }
    decision.verdict = if kept.len() == 1 { Verdict::Named } else { Verdict::Class };
    decision.blamed = kept;
    Some(format!("{} would fit as well, but does not predict held-out pieces better.", idle.join(" or ")))
}

/// The single effects that explain nearly as much as the best one, best first.
fn near(found: &Explored) -> Vec<&'static str> {
    let before = found.refitted().cost();
    let mut gains: Vec<(&'static str, f64)> = found
        .hypotheses
        .iter()
        .filter_map(|one| match one.model.effects.as_slice() {
            [only] => Some((only.id, before - one.model.cost())),
            _ => None,
        })
        .collect();
    gains.sort_by(|a, b| b.1.total_cmp(&a.1));
    let best = gains.first().map_or(0.0, |(_, gain)| *gain);
    gains.into_iter().filter(|(_, gain)| *gain >= CLOSE * best).take(3).map(|(id, _)| id).collect()
}

/// What a report says of the part.
pub(crate) fn describe(
    (ready, stage): (&Preparation, &StageAlone),
    found: &Explored,
    decision: &Decision,
    compared: Compared,
) -> StageOnly {
    let claimed = match (decision.verdict, decision.blamed.as_slice()) {
        (Verdict::Named, all) => found.with(all),
        (Verdict::Class, [first, ..]) => found.with(&[first]),
        _ => None,
    };
    let piece_s = ready
        .recordings
        .first()
        .map_or(0.0, |piece| piece.samples.len().checked_sub(1).map_or(0.0, |last| piece.time_s(last)));
    let foreign = foreign(stage, &compared);
    let plain_wins = compared.winner().map(|plain| plain.model.clone());
    let model = claimed.unwrap_or_else(|| found.refitted());
    let plain_as_good = compared.as_good(&model.ids().join(" + ")).map(|plain| plain.model.clone());
    // Figures of a law that was just refused would be believed.
    let is_settled = plain_as_good.as_deref().and_then(PlainKind::titled).is_some_and(PlainKind::settles);
    let refused = foreign.is_some() || compared.settles() || is_settled;
    let figures = || {
        if ready.setup != Setup::StageFree {
            return stage_figures(model, &stage.law, &ready.recordings);
        }
        let plain = compared.plain_law(&model.ids().join(" + "));
        sheetless_figures(model, &stage.law, &ready.recordings, plain, stage.held_s)
    };
    let figures = if refused { Vec::new() } else { figures() };
    StageOnly {
        sheet: ready.setup != Setup::StageFree,
        pieces: ready.recordings.len(),
        piece_s,
        figures,
        transducers_pu: stage.seen.transducers,
        foreign,
        free_run_s: compared.free_run_s,
        models: compared.models,
        plain_wins,
        plain_as_good,
        driven_by: compared.drive.to_owned(),
    }
}
