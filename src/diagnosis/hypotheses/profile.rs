//! Profiles: every effect at sizes over its whole range on top of a model, with the free parameters following, and the sizes that are worth more.

use crate::estimation::fit::{Effort, Start, fit_all};
use crate::estimation::following::{Displaced, Followed, followed, profile_sizes};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::support::Variant;
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::Unit;

/// Places whose fits show what a unit is like.
const GLANCED: usize = 3;

/// Profiles that promise most are looked at more closely, so many, so many times: what is right in a narrow band of sizes, such as what makes a loop swing
/// just so, lies between the sizes of a grid.
const ZOOMED: usize = 8;
const ZOOMS: usize = 3;

/// A size is hopeless where it promises so many times the cost of the refitted sheet.
const HOPELESS: f64 = 4.0;

/// An effect at one size, or one of the point's own effects taken away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Atom {
    /// The effect of the catalogue with this place, so large.
    Sized {
        /// Place in the catalogue.
        effect: usize,
        /// Size and shape.
        variant: Variant,
    },
    /// The point's own effect with this place, gone.
    Removed {
        /// Place among the point's effects.
        own: usize,
    },
}

/// A place of a profile: an effect at one size, or one of the model's own effects taken away, and where the free parameters stand there.
#[derive(Clone, Debug)]
pub struct ProfilePlace {
    /// What is different from the model.
    pub atom: Atom,
    /// Where it stands.
    pub at: Displaced<FreeParameter>,
    /// Cost there, to first order; infinite where nobody looked.
    pub promised: f64,
}

/// The profiles of all effects of a catalogue that a model lacks, where they are lowest: the sizes that promise most, and the smallest, which shows what
/// could be detected; and the model without each of its own effects.
///
/// The refitted sheet costs `without_effects`.
pub fn profiles(
    problem: &Problem,
    model: &FittedModel,
    catalogue: &[&'static EffectSpec],
    without_effects: f64,
) -> Vec<ProfilePlace> {
    let follow = |places: Vec<ProfilePlace>| -> Vec<ProfilePlace> {
        let displaced: Vec<Displaced<FreeParameter>> = places.iter().map(|place| place.at.clone()).collect();
        let followed = followed(problem, &model.fit.slopes, &displaced);
        let at = |(place, Followed { positions, cost }): (ProfilePlace, Followed)| ProfilePlace {
            at: Displaced { positions, ..place.at },
            promised: cost,
            ..place
        };
        places.into_iter().zip(followed).map(at).collect()
    };
    let mut profiles: Vec<Vec<ProfilePlace>> = Vec::new();
    for place in follow(all(model, catalogue)) {
        match profiles.last_mut() {
            Some(profile) if place.is_beside(&profile[0]) => profile.push(place),
            _ => profiles.push(vec![place]),
        }
    }
    for _ in 0..ZOOMS {
        profiles.sort_by(|a, b| least(a).total_cmp(&least(b)));
        let between = profiles.iter().take(ZOOMED).flat_map(|profile| closer(model, catalogue, profile));
        for place in follow(between.collect()) {
            if let Some(profile) = profiles.iter_mut().find(|profile| place.is_beside(&profile[0])) {
                let at = profile.partition_point(|other| other.size().abs() < place.size().abs());
                profile.insert(at, place);
            }
        }
    }
    let hopeless = HOPELESS * without_effects;
    profiles.into_iter().flat_map(|profile| lowest(profile, hopeless)).collect()
}

/// What the lowest place of a profile promises.
fn least(profile: &[ProfilePlace]) -> f64 {
    profile.iter().map(|place| place.promised).fold(f64::INFINITY, f64::min)
}

/// The lowest place of a profile, and those on either side of it.
fn lowest_place(profile: &[ProfilePlace]) -> Option<(usize, impl Iterator<Item = usize> + use<>)> {
    let best = (0..profile.len()).min_by(|&a, &b| profile[a].promised.total_cmp(&profile[b].promised))?;
    let neighbours = [best.checked_sub(1), (best + 1 < profile.len()).then_some(best + 1)];
    Some((best, neighbours.into_iter().flatten()))
}

/// Sizes half-way, in their logarithm, from the lowest place of a profile to its neighbours.
fn closer(model: &FittedModel, catalogue: &[&'static EffectSpec], profile: &[ProfilePlace]) -> Vec<ProfilePlace> {
    let Some((best, neighbours)) = lowest_place(profile) else { return Vec::new() };
    let Atom::Sized { effect, variant } = profile[best].atom else { return Vec::new() };
    let between = neighbours.filter_map(|other| {
        let size = (profile[other].size() * variant.size).sqrt().copysign(variant.size);
        added(model, catalogue, effect, Variant { size, ..variant })
    });
    between.collect()
}

/// The same sizes on top of another model without effects, whose free parameters stay where they are.
pub fn moved_to(model: &FittedModel, catalogue: &[&'static EffectSpec], places: &[ProfilePlace]) -> Vec<ProfilePlace> {
    let sized = places.iter().filter_map(|place| match place.atom {
        Atom::Sized { effect, variant } => added(model, catalogue, effect, variant),
        Atom::Removed { .. } => None,
    });
    sized.collect()
}

/// The best fit from the places on top of a sheet that promise most: enough to see what a unit is like, not what it costs to the last.
pub fn fitted_best(
    problem: &Problem,
    sheet: &FittedModel,
    catalogue: &[&'static EffectSpec],
    places: &[ProfilePlace],
) -> Option<FittedModel> {
    let mut best: Vec<&ProfilePlace> = places.iter().filter(|place| place.promised.is_finite()).collect();
    best.sort_by(|a, b| a.promised.total_cmp(&b.promised));
    best.truncate(GLANCED);
    let starts = best.iter().map(|place| Start {
        base: &place.at.base,
        coordinates: &place.at.coordinates,
        positions: &place.at.positions,
        effort: Effort::SCOUT,
        known: Some(&sheet.fit.slopes),
    });
    let fits = fit_all(problem, &starts.collect::<Vec<_>>());
    let (place, fit) = best.into_iter().zip(fits).min_by(|a, b| a.1.cost().total_cmp(&b.1.cost()))?;
    let effects = match place.atom {
        Atom::Sized { effect, .. } => vec![catalogue[effect]],
        Atom::Removed { .. } => Vec::new(),
    };
    Some(FittedModel::new(effects, place.at.base.clone(), place.at.coordinates.clone(), fit))
}

impl ProfilePlace {
    /// Size of the effect, in typical ones; 0 where one is taken away.
    fn size(&self) -> f64 {
        match self.atom {
            Atom::Sized { variant, .. } => variant.size,
            Atom::Removed { .. } => 0.0,
        }
    }

    /// Whether both are of one profile: the same effect with the same sign and shape.
    fn is_beside(&self, other: &Self) -> bool {
        match (self.atom, other.atom) {
            (Atom::Sized { effect: a, variant: one }, Atom::Sized { effect: b, variant: other }) => {
                a == b && one.size * other.size > 0.0 && one.further == other.further
            }
            _ => false,
        }
    }
}

/// Places in a profile that are kept: the first, the lowest, and the lower one of its neighbours.
fn lowest(profile: Vec<ProfilePlace>, hopeless: f64) -> Vec<ProfilePlace> {
    let cost = |k: usize| profile[k].promised;
    let mut kept = vec![0];
    if let Some((best, neighbours)) = lowest_place(&profile) {
        let beside = neighbours.min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        kept.extend(std::iter::once(best).chain(beside).filter(|&k| cost(k) < hopeless));
    }
    let kept = |k: &usize| kept.contains(k);
    profile.into_iter().enumerate().filter(|(k, _)| kept(k)).map(|(_, place)| place).collect()
}

/// Every effect that a model lacks at all its sizes and shapes on top of it, size by size, and the model without each of its own effects.
fn all(model: &FittedModel, catalogue: &[&'static EffectSpec]) -> Vec<ProfilePlace> {
    let lacking = catalogue.iter().enumerate().filter(|(_, spec)| !model.has(spec.id));
    let variants =
        lacking.flat_map(|(effect, spec)| variants(spec, &model.base).into_iter().map(move |one| (effect, one)));
    let mut all: Vec<ProfilePlace> =
        variants.filter_map(|(effect, variant)| added(model, catalogue, effect, variant)).collect();
    all.extend((0..model.effects.len()).map(|own| removed(model, own)));
    all
}

/// A model with one more effect; none where the size is out of its range.
fn added(
    model: &FittedModel,
    catalogue: &[&'static EffectSpec],
    effect: usize,
    variant: Variant,
) -> Option<ProfilePlace> {
    let (base, coordinates, positions) = model.with_effect(catalogue[effect], variant)?;
    let columns = (0..model.free_parameters.len()).collect();
    Some(ProfilePlace {
        atom: Atom::Sized { effect, variant },
        at: Displaced { base, coordinates, positions, columns },
        promised: f64::INFINITY,
    })
}

/// A model without one of its effects.
fn removed(model: &FittedModel, own: usize) -> ProfilePlace {
    let kept: Vec<&str> = (0..model.effects.len()).filter(|&k| k != own).map(|k| model.effects[k].id).collect();
    let (base, coordinates, positions) = model.keeping(&kept);
    let place = model.base.effects.len() - model.effects.len() + own;
    let stays =
        |k: &usize| !matches!(model.free_parameters[*k], FreeParameter::Effect { effect, .. } if effect == place);
    let columns = (0..model.free_parameters.len()).filter(stays).collect();
    let at = Displaced { base, coordinates, positions, columns };
    ProfilePlace { atom: Atom::Removed { own }, at, promised: f64::INFINITY }
}

/// Shapes and sizes at which an effect is simulated, profile by profile: those of its range on this unit.
fn variants(spec: &EffectSpec, unit: &Unit) -> Vec<Variant> {
    let further: &[f64] = if spec.parameters.len() > 1 { &[1.0, 0.0] } else { &[1.0] };
    let range = spec.parameters.first().map(|first| FreeParameter::range_of(first, unit));
    let sizes = range.map(profile_sizes).unwrap_or_default();
    further.iter().flat_map(|&further| sizes.iter().map(move |&size| Variant { size, further })).collect()
}
