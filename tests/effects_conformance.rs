//! What every effect of the catalogue must hold: neutral is identity, finite over its range, reset and clone repeat it.

#[path = "effects/bench.rs"]
mod bench;

use bench::{farthest, manoeuvre, recording, simulate, typical, with};
use govtwin_model::effects::{CATALOGUE, EffectSpec, Stage};
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::EffectSetting;
use govtwin_model::recording::Recording;
use govtwin_model::replay;
use govtwin_model::twin::{Cut, Twin};
use proptest::prelude::{ProptestConfig, any, proptest};

/// The ids that reports and parameter files may count on, by stage.
const CONTRACT: &[(Stage, &[&str])] = &[
    (Stage::Regulator, &["command_delay", "command_gain", "regulator_cycle"]),
    (
        Stage::PilotValve,
        &["pv_overlap", "pv_null_shift", "pv_hysteresis", "pv_bandwidth", "pilot_filter", "current_limit"],
    ),
    (Stage::Esv, &["esv_delay", "esv_slow"]),
    (Stage::Spool, &["spool_friction", "entrained_air", "chamber_leak", "spring", "flow_force", "viscosity"]),
    (Stage::Servomotor, &["port_overlap", "port_wear", "backlash", "servo_friction", "servo_leak", "cushion", "load"]),
    (Stage::Supply, &["supply_loss", "return_loss"]),
    (Stage::Sensor, &["lvdt_gain", "lvdt_bias", "feedback_bias", "feedback_lag", "clock_offset"]),
];

fn setting(spec: &EffectSpec, value: impl Fn(usize) -> f64) -> EffectSetting {
    EffectSetting { id: spec.id.to_owned(), values: (0..spec.parameters.len()).map(value).collect() }
}

fn neutral(spec: &EffectSpec) -> EffectSetting {
    setting(spec, |k| spec.parameters[k].neutral)
}

fn is_finite(estimate: &Estimate) -> bool {
    let s = &estimate.signals;
    [
        s.spool_position_pu,
        s.servomotor_position_pu,
        s.pilot_valve_position_pu,
        s.control_pressure_pa,
        estimate.spool_velocity_m_s,
        estimate.servomotor_velocity_m_s,
        estimate.opening_chamber_pressure_pa,
        estimate.closing_chamber_pressure_pa,
        estimate.valve_current_pu,
    ]
    .into_iter()
    .all(f64::is_finite)
}

#[test]
fn the_contract_is_kept() {
    let ids: Vec<(Stage, &str)> = CATALOGUE.iter().map(|spec| (spec.stage, spec.id)).collect();
    for (stage, wanted) in CONTRACT {
        for id in *wanted {
            assert!(ids.contains(&(*stage, *id)), "{id} is missing, or not in stage {}", stage.id());
        }
    }
    assert!(ids.is_sorted_by_key(|(stage, _)| *stage), "the catalogue follows the chain");
}

/// Files of the catalogue's folder that are no effects.
const NO_EFFECTS: [&str; 3] = ["own.rs", "on_unit.rs", "scaling.rs"];

#[test]
fn every_file_is_registered_once() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/model/effects");
    let mut files: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file() && !NO_EFFECTS.iter().any(|name| path.ends_with(name)))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut ids: Vec<&str> = CATALOGUE.iter().map(|spec| spec.id).collect();
    ids.sort_unstable();
    assert_eq!(files, ids);
}

#[test]
fn heads_are_complete() {
    for spec in CATALOGUE {
        let head: Vec<&str> = spec.source.lines().map_while(|line| line.strip_prefix("//!")).map(str::trim).collect();
        let text = head.join(" ");
        let id = spec.id;
        assert!(head[0].len() > 30 && head[0].ends_with(['.', ':']) || !head[1].is_empty(), "{id}: first a sentence");
        assert!(text.contains("Without it "), "{id}: what the gap looks like");
        assert!(text.contains("Limits: "), "{id}: limits");
        assert!(text.contains("| symbol | meaning | unit |"), "{id}: symbols with units");
        let year = |word: &str| word.len() == 4 && word.parse::<u32>().is_ok_and(|year| (1900..2030).contains(&year));
        let words = text.split(|c: char| !c.is_alphanumeric());
        assert!(words.clone().any(year) || text.contains("ASTM"), "{id}: a source with its year");
        assert!(text.contains('`'), "{id}: an equation");
        for parameter in spec.parameters {
            assert!(text.contains(&format!("`{}`", parameter.name)), "{id}: {} is not in the table", parameter.name);
        }
    }
}

#[test]
fn parameters_have_sound_ranges() {
    for spec in CATALOGUE {
        assert!((1..=3).contains(&spec.parameters.len()), "{}", spec.id);
        for p in spec.parameters {
            let what = format!("{}.{}", spec.id, p.name);
            assert!(p.min < p.max && p.min.is_finite() && p.max.is_finite(), "{what}");
            assert!((p.min..=p.max).contains(&p.neutral) && (p.min..=p.max).contains(&p.typical), "{what}");
            // Their distance is the scale of every search.
            assert_ne!(p.neutral, p.typical, "{what}");
            assert!(p.doc.len() > 15 && !p.doc.ends_with('.'), "{what}");
            let unit = match p.unit {
                "1" if p.name.ends_with("_share") => "share",
                "1" if p.name.ends_with("_excess") => "excess",
                "1" => "ratio",
                "m3/(s Pa)" => "m3_s_pa",
                "N s2/m2" => "n_s2_m2",
                "Pa s2/m6" => "pa_s2_m6",
                "N" => "n",
                other => other,
            };
            assert!(p.name.ends_with(&format!("_{unit}")), "{what} is in {}", p.unit);
        }
    }
}

#[test]
fn neutral_is_identity_to_the_last_bit() {
    for cut in [Cut::None, Cut::Servomotor, Cut::Spool] {
        let nominal = simulate(&[], cut);
        for spec in CATALOGUE {
            assert!(simulate(&[neutral(spec)], cut) == nominal, "{} with its neutral values, {cut:?}", spec.id);
        }
        let all: Vec<EffectSetting> = CATALOGUE.iter().map(neutral).collect();
        assert!(simulate(&all, cut) == nominal, "all effects with their neutral values, {cut:?}");
    }
}

#[test]
fn typical_faults_show() {
    // Behind a recorded valve signal there is nothing to see of a simulated spool.
    let cut =
        |spec: &EffectSpec| if ["valve_lag", "flow_saturation"].contains(&spec.id) { Cut::Spool } else { Cut::None };
    for spec in CATALOGUE {
        let here = typical(spec);
        let nominal = simulate(&[], cut(spec));
        let faulty = simulate(std::slice::from_ref(&here), cut(spec));
        assert!(farthest(&nominal, &faulty) > 1e-4, "{} at its typical size", spec.id);
        // Each parameter counts, not only the first.
        for k in 0..spec.parameters.len() {
            let p = &spec.parameters[k];
            let mut other = here.clone();
            other.values[k] = if p.typical == p.max { 0.5 * (p.typical + p.min) } else { 0.5 * (p.typical + p.max) };
            assert!(farthest(&faulty, &simulate(&[other], cut(spec))) > 1e-4, "{}.{}", spec.id, p.name);
        }
    }
}

#[test]
fn corners_of_the_range_are_finite() {
    for spec in CATALOGUE {
        for corner in 0..1_u32 << spec.parameters.len() {
            let at = |k: usize| {
                let p = &spec.parameters[k];
                if corner >> k & 1 == 0 { p.min } else { p.max }
            };
            for cut in [Cut::None, Cut::Servomotor, Cut::Spool] {
                let run = simulate(&[setting(spec, at)], cut);
                assert!(run.iter().all(is_finite), "{} at corner {corner}, {cut:?}", spec.id);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Any three effects at once, anywhere in their ranges.
    #[test]
    fn effects_combine(seeds in any::<[u64; 3]>(), shares in any::<[u16; 9]>()) {
        let settings: Vec<EffectSetting> = seeds.iter().enumerate().map(|(i, seed)| {
            let spec = &CATALOGUE[usize::try_from(seed % CATALOGUE.len() as u64).unwrap()];
            setting(spec, |k| {
                let p = &spec.parameters[k];
                p.min + (p.max - p.min) * f64::from(shares[3 * i + k]) / f64::from(u16::MAX)
            })
        }).collect();
        let run = simulate(&settings, Cut::None);
        assert!(run.iter().all(is_finite), "{settings:?}");
    }
}

#[test]
fn the_order_of_the_list_does_not_matter() {
    let mut all: Vec<EffectSetting> = CATALOGUE.iter().map(typical).collect();
    let forwards = simulate(&all, Cut::None);
    all.reverse();
    assert!(simulate(&all, Cut::None) == forwards);
}

#[test]
fn reset_and_clone_repeat_the_run() {
    let recording = recording();
    let (first_half, second_half) = recording.frames.split_at(recording.frames.len() / 2);
    for spec in CATALOGUE {
        let mut twin = Twin::new(&with(&[typical(spec)]));
        let once = replay::simulate(&mut twin, &recording);
        twin.reset();
        twin.reset();
        assert!(replay::simulate(&mut twin, &recording) == once, "{} after a reset", spec.id);

        twin.reset();
        for frame in first_half {
            let _ = twin.step(frame);
        }
        let mut copy = twin.clone();
        for frame in second_half {
            assert!(twin.step(frame) == copy.step(frame), "{} and its clone", spec.id);
        }
    }
}

#[test]
fn the_manoeuvre_holds_all_four_processes() {
    let spans = manoeuvre();
    let mut seen: Vec<_> = spans.iter().map(|(name, frames)| Recording::new(*name, frames.clone()).process).collect();
    seen.sort_unstable();
    assert_eq!(seen, govtwin_model::recording::Process::ALL);
}
