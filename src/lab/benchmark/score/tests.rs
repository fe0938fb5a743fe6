//! Scores of made-up reports.

use super::*;
use crate::battery::{Label, TrueFault};
use crate::benchmark::scored_report::tests::row;
use govtwin_diagnosis::hypotheses::table::EvidenceTable;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Blame, Fitted, Interval, Ranked, Verdict};
use govtwin_model::effects::{Stage, find};

fn truth(id: &str, stage: Stage) -> TrueFault {
    TrueFault { id: id.into(), stage, size: 1.0, unit: "1".into(), meaning: String::new() }
}

/// A case: true ids, listed, strength, verdict, stage of the verdict, named ids with a probability each.
fn case(
    truths: &[&str],
    listed: bool,
    strength: f64,
    verdict: &str,
    stage: &str,
    blamed: &[(&str, f64)],
) -> ScoredUnit {
    let share = |low, high| Interval { value: 1.0, low, high };
    let said = |word: &str| if verdict == word { 0.95 } else { 0.01 };
    let ranking = blamed.iter().copied().chain([("unknown", said("unknown")), ("none", said("no_gap"))]);
    let size = Fitted {
        name: "size".into(),
        unit: "1",
        value: share(0.9, 1.2),
        sheet: 0.0,
        position: 1.0,
        information: 1.0,
        at_bound: false,
    };
    let verdict = Verdict::with_id(verdict).unwrap();
    let mut report = DiagnosisReport::of_verdict(verdict);
    report.location.stage = Stage::with_id(stage);
    report.effects = blamed
        .iter()
        .map(|(id, p)| Blame { parameters: vec![size.clone()], ..Blame::unsized_effect(find(id).unwrap(), *p) })
        .collect();
    report.ranking = ranking.map(|(id, probability)| Ranked { id: id.into(), probability }).collect();
    report.gap.explained_fraction = share(0.8, 0.95);
    report.seconds = Some(10.0);
    ScoredUnit {
        report,
        label: Label {
            name: String::new(),
            effects: truths.iter().map(|id| truth(id, Stage::Servomotor)).collect(),
            listed,
            strength_ratio: strength,
            rate_hz: 100.0,
            mismatch: 1.0,
        },
        realised_fraction: Some(0.9),
        expected_log_bayes_factor: None,
    }
}

fn hand_made() -> Vec<ScoredUnit> {
    vec![
        case(&[], true, 0.0, "no_gap", "", &[]),
        case(&[], true, 0.0, "named", "esv", &[("esv_slow", 0.8)]),
        case(&["backlash"], true, 9.0, "named", "servomotor", &[("backlash", 0.9)]),
        case(&["load"], true, 4.0, "class", "servomotor", &[("servo_leak", 0.5), ("load", 0.4)]),
        case(&["load"], true, 1.0, "no_gap", "", &[]),
        case(&["load", "backlash"], true, 9.0, "named", "servomotor", &[("load", 0.9), ("backlash", 0.8)]),
        case(&["load", "backlash"], true, 9.0, "named", "servomotor", &[("load", 0.9)]),
        case(&["surge"], false, 9.0, "unknown", "servomotor", &[]),
        case(&["cushion"], false, f64::NAN, "named", "supply", &[("supply_loss", 0.6)]),
    ]
}

#[test]
fn measures_are_those_counted_by_hand() {
    let score = score(&hand_made());
    let of = |id: &str| score.measures.iter().find(|measure| measure.id == id).unwrap();
    for (id, hits, cases) in [
        ("false_alarm", 1, 2),
        ("detection", 6, 6),
        ("single_first", 1, 3),
        ("single_first_visible", 1, 2),
        ("single_in_class", 2, 3),
        ("single_in_class_visible", 2, 2),
        ("stage", 5, 7),
        ("stage_visible", 5, 6),
        ("pair_both", 1, 2),
        ("pair_one", 2, 2),
        ("unknown", 1, 2),
        ("unknown_stage", 1, 1),
        ("false_unknown", 0, 7),
        ("made_up", 1, 4),
        ("closure_coverage", 6, 6),
        ("size_coverage", 2, 2),
    ] {
        assert_eq!(of(id).measured, Measured::share(hits, cases), "{id}");
    }
    assert!((of("probability").measured.value - (0.9 + 0.4 + 0.0) / 3.0).abs() < 1e-12);
    let mut open = case(&["backlash"], true, 9.0, "named", "servomotor", &[("backlash", 0.9)]);
    assert_eq!(open.explained_fraction_is_covered(), Some(true));
    open.report.gap.explained_fraction = Interval { value: 0.5, low: 0.0, high: 1.0 };
    assert_eq!(open.explained_fraction_is_covered(), None, "what says nothing is no claim");
    assert_eq!(of("seconds").measured.value, 10.0);
    assert_eq!(of("false_alarm").reached, Some(false));
    assert_eq!(of("detection").reached, Some(true));
    assert_eq!(of("stage_visible").reached, None);
}

#[test]
fn a_name_too_many_is_a_miss_and_a_class_is_one_effect() {
    let named = |blamed: &[(&str, f64)]| case(&["backlash"], true, 9.0, "named", "servomotor", blamed);
    let more = named(&[("backlash", 0.9), ("viscosity", 0.6), ("load", 0.6)]);
    assert!(more.makes_up() && more.missed() && more.hidden().next().is_none());
    assert!(!named(&[("backlash", 0.9)]).missed());
    let class = |truths: &[&str]| case(truths, true, 9.0, "class", "servomotor", &[("load", 0.5), ("backlash", 0.4)]);
    assert!(!class(&["backlash"]).missed() && !class(&["backlash"]).makes_up());
    let pair = class(&["load", "backlash"]);
    assert!(pair.missed() && pair.hidden().map(|truth| truth.id.as_str()).eq(["backlash"]));
    let of = |cases: &[ScoredUnit], id: &str| score(cases).measures.iter().find(|row| row.id == id).unwrap().measured;
    assert_eq!(of(&[more, class(&["load"])], "made_up"), Measured::share(1, 1));
    assert_eq!(of(std::slice::from_ref(&pair), "pair_both"), Measured::share(0, 1));
    assert_eq!(of(&[pair], "pair_one"), Measured::share(1, 1));
}

#[test]
fn a_miss_lies_with_information_search_verdict_or_model() {
    // A right model of a thousand independent samples costs 640.
    let table = |left: f64, truth: f64| EvidenceTable {
        samples: 1000.0,
        rows: vec![row(&["load"], 640.0 + left), row(&["backlash"], 640.0 + truth), row(&[], 1640.0)],
        ..EvidenceTable::default()
    };
    let named = |expected_log_bayes_factor, table: EvidenceTable| {
        let mut case = case(&["backlash"], true, 9.0, "named", "servomotor", &[("load", 0.9)]);
        (case.expected_log_bayes_factor, case.report.evidence.table) = (expected_log_bayes_factor, table);
        case
    };
    let regretted = |reached: f64| {
        let mut case = named(Some(500.0), table(300.0, 500.0));
        let regret = serde_json::json!({"effects": ["backlash"], "found": 1140.0, "reached": reached});
        case.report.evidence.regret = serde_json::from_value(regret).unwrap();
        case
    };
    assert_eq!(named(Some(5.0), table(300.0, 500.0)).missed_by(), Some(MissedBy::Information));
    assert_eq!(named(Some(500.0), table(3.0, 500.0)).missed_by(), Some(MissedBy::Information));
    assert_eq!(named(Some(500.0), table(300.0, 500.0)).missed_by(), Some(MissedBy::Model));
    assert_eq!(named(None, table(300.0, 100.0)).missed_by(), Some(MissedBy::Verdict));
    assert_eq!(regretted(800.0).missed_by(), Some(MissedBy::Search));
    assert_eq!(regretted(1139.0).missed_by(), Some(MissedBy::Model));
    let more = &[("load", 0.9), ("backlash", 0.9)];
    let mut made_up = case(&["backlash"], true, 9.0, "named", "servomotor", more);
    assert_eq!(made_up.missed_by(), None, "nothing is known without a table");
    made_up.report.evidence.table = table(300.0, 3.0);
    assert_eq!(made_up.missed_by(), Some(MissedBy::Verdict));
    // What no catalogue lists leads wherever it can be seen.
    let mut outside = case(&["backlash"], false, 9.0, "named", "servomotor", &[("load", 0.9)]);
    outside.report.evidence.table = table(300.0, 500.0);
    assert_eq!(outside.missed_by(), Some(MissedBy::Verdict));
    let right = case(&["backlash"], true, 9.0, "named", "servomotor", &[("backlash", 0.9)]);
    let score = score(&[
        named(Some(5.0), table(300.0, 500.0)),
        regretted(800.0),
        named(None, table(300.0, 100.0)),
        named(None, table(300.0, 500.0)),
        right,
    ]);
    let misses = |id: &str| score.measures.iter().find(|measure| measure.id == id).unwrap().misses;
    assert_eq!(misses("single_first"), Some(Misses { all: 4, by: [1, 1, 1, 1] }));
    assert_eq!((misses("stage"), misses("pair_both"), misses("seconds")), (None, None, None));
    let all = hand_made();
    let missed: Vec<bool> = all.iter().map(ScoredUnit::missed).collect();
    assert_eq!(missed, [false, true, false, false, true, false, true, false, true]);
    assert_eq!(all.iter().filter_map(ScoredUnit::missed_by).count(), 0, "nothing is known of them");
}

#[test]
fn a_triple_is_scored_like_a_pair_and_not_as_one() {
    let of = |blamed: &[&str], verdict: &str| {
        let blamed: Vec<(&str, f64)> = blamed.iter().map(|id| (*id, 0.9)).collect();
        case(&["load", "backlash", "viscosity"], true, 9.0, verdict, "servomotor", &blamed)
    };
    let all = [
        of(&["load", "backlash", "viscosity"], "named"),
        of(&["viscosity", "cushion"], "named"),
        of(&["cushion"], "named"),
        of(&["load", "backlash", "viscosity"], "class"),
    ];
    let missed: Vec<bool> = all.iter().map(ScoredUnit::missed).collect();
    assert_eq!(missed, [false, true, true, true]);
    assert_eq!(all[3].hidden().count(), 2, "a class is one effect");
    let score = score(&all);
    let measured = |id: &str| score.measures.iter().find(|row| row.id == id).unwrap().measured;
    assert_eq!(measured("triple_all"), Measured::share(1, 4));
    assert_eq!(measured("triple_one"), Measured::share(3, 4));
    assert_eq!(measured("made_up"), Measured::share(2, 3));
    for id in ["pair_both", "pair_one", "single_first", "probability"] {
        assert_eq!(measured(id).cases, 0, "{id}");
    }
    assert_eq!((measured("stage").cases, measured("detection").cases), (4, 4));
    assert!(score.confusion.truths.is_empty());
}

#[test]
fn the_confusion_counts_every_unit_but_pairs_once() {
    let confusion = score(&hand_made()).confusion;
    assert_eq!(confusion.truths, ["none", "backlash", "load", "outside"]);
    assert_eq!(confusion.words, ["none", "backlash", "esv_slow", "servo_leak", "supply_loss", "unknown"]);
    assert_eq!(confusion.counts.iter().flatten().sum::<usize>(), 7);
    assert_eq!(confusion.counts[2], [1, 0, 0, 1, 0, 0]);
}

#[test]
fn reliability_asks_what_was_so() {
    // Of "none" at 0.95 one of two was so, of "unknown" at 0.95 the one; of the effects at 0.9 all three. Of nine units two are sound, and each of
    // these counts as 3.5 others.
    let bins = score(&hand_made()).reliability;
    let last = bins.last().unwrap();
    let so = [(true, 3.5), (false, 1.0), (true, 1.0), (true, 1.0), (true, 1.0), (true, 1.0)];
    assert_eq!(last.was, Measured::weighted(&so));
    assert!((last.stated_probability - (5.5 * 0.95 + 3.0 * 0.9) / 8.5).abs() < 1e-12);
}

#[test]
fn nothing_scored_is_no_number() {
    for measure in score(&[]).measures {
        assert!(measure.measured.value.is_nan() && measure.reached.is_none(), "{}", measure.id);
    }
}
