//! A made-up diagnosis on paper, with names that would break a careless page.

use super::{page, summary};
use govtwin_diagnosis::hypotheses::table::EvidenceTable;
use govtwin_diagnosis::model::discrepancy::Curve;
use govtwin_diagnosis::result::{
    Blame, Breakdown, BreakdownPart, ChannelReport, DetectableSize, Diagnosis, DiscrepancyTerm, Experiment, Fitted,
    Interval, LargestError, Ranked, Remainder, Setup, SignalGap, StageTest, Trace, Tried, Verdict,
};
use govtwin_diagnosis::words::WRONG_DATA;
use govtwin_model::effects::Stage;
use govtwin_model::provenance::{Provenance, RecordingGiven};
use govtwin_model::recording::Process;
use govtwin_model::signal::Signal;

mod findings;
mod plain;
mod read_back;

fn play() -> Fitted {
    Fitted {
        name: "play_pu".into(),
        unit: "pu",
        value: Interval { value: 0.004_2, low: 0.004_0, high: 0.004_4 },
        sheet: 0.0,
        position: 2.1,
        information: 1.0,
        at_bound: false,
    }
}

fn made_up(verdict: Verdict, blamed: &[&str]) -> Diagnosis {
    let unit = govtwin_model::params::reference();
    let explained_fraction = Interval { value: 0.88, low: 0.84, high: 0.91 };
    let blame = |id: &&str| Blame {
        last_in: None,
        shapley: None,
        id: (*id).to_owned(),
        stage: Stage::Servomotor,
        probability: 0.97,
        parameters: vec![play()],
        explained_fraction,
    };
    let time_s: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
    let level = |value: f64| vec![value; time_s.len()];
    let part = |name: &str, share| BreakdownPart {
        name: name.into(),
        samples: 100,
        refitted: share,
        with_effects: 0.1 * share,
    };
    Diagnosis {
        verdict,
        stage: match verdict {
            Verdict::Unknown => Some(Stage::Sensor),
            _ => (!blamed.is_empty()).then_some(Stage::Servomotor),
        },
        stages: vec![(Stage::Servomotor, 0.98), (Stage::Spool, 0.02)],
        ranking: [("backlash", 0.97), ("unknown", 0.02)]
            .map(|(id, probability)| Ranked { id: id.into(), probability })
            .into(),
        gap: vec![SignalGap {
            signal: Signal::ServomotorPosition,
            noise_floor: 3.0e-4,
            delivered: 4.0e-3,
            refitted: 2.0e-3,
            with_effects: 7.0e-4,
        }],
        explained_fraction,
        regret: None,
        remainder: matches!(verdict, Verdict::Named | Verdict::Class | Verdict::Unknown).then(|| Remainder {
            beside: vec!["backlash".into()],
            explained: explained_fraction,
            share: 0.12,
            something_else: 0.2,
            chi_square: 2.5,
            stage: Some(Stage::Supply),
            largest: Some(LargestError {
                recording: "one".into(),
                signal: Signal::ServomotorPosition,
                from_s: 7.5,
                to_s: 9.5,
                rms: 2.0e-3,
                share: 0.4,
            }),
        }),
        experiments: vec![Experiment {
            separates: vec!["backlash".into(), "load".into()],
            test: "a full stroke".into(),
            separation: 41.0,
            expected_drop_bits: 0.17,
            at_most_bits: 0.19,
            entropy_bits: 0.2,
            bits_per_minute: 0.3,
            length_s: 34.0,
            trips: 0,
            unit_state: "Unit at standstill".into(),
            records: Signal::POSITIONS.to_vec(),
            rate_hz: 100.0,
            script: None,
            bag: None,
        }],
        entropy_bits: 0.2,
        refitted: unit.clone(),
        fitted: unit,
        parameters: vec![Fitted { name: "regulator.position_gain".into(), unit: "1", ..play() }],
        channels: vec![ChannelReport {
            recording: "<b>one</b>".into(),
            signal: Signal::ServomotorPosition,
            samples: 200,
            rate_hz: 10.0,
            step: 1e-4,
            noise: f64::NAN,
            troubles: vec![],
        }],
        detectable_sizes: vec![DetectableSize {
            id: "load",
            parameter: "extra_ratio",
            unit: "1",
            smallest: f64::INFINITY,
            with_known_sheet: f64::INFINITY,
            typical: 0.2,
        }],
        sheet_limits: None,
        ambiguous_pairs: vec![("backlash".into(), "load".into(), 0.98)],
        breakdowns: vec![Breakdown {
            signal: Signal::ServomotorPosition,
            by: "phase",
            parts: vec![part("stands", 0.3), part("moves", 0.7)],
        }],
        stage_tests: vec![StageTest {
            zero_error_pu: 0.0,
            stage: "the whole chain",
            signal: Signal::ServomotorPosition,
            rmse: 2.0e-3,
            excess: 9.0,
        }],
        discrepancy_terms: vec![DiscrepancyTerm {
            place: "servomotor transducer",
            stage: Stage::Sensor,
            unit: "pu",
            explains: 0.83,
            curves: vec![Curve {
                against: "servomotor position, pu",
                points: vec![(0.0, -1e-3), (1.0, 1e-3)],
                named: vec![],
            }],
        }],
        tried: vec![Tried {
            ids: vec!["backlash".into()],
            gain: 1234.0,
            held_out_gain: f64::NAN,
            parameters: vec![play()],
        }],
        transfers: Vec::new(),
        sets: vec![(vec!["backlash".into()], 0.9)],
        table: EvidenceTable::default(),
        consistency: [Vec::new(), Vec::new()],
        samples: 100,
        traces: vec![Trace {
            name: "<b>one</b> & only".into(),
            process: Process::Startup,
            signals: vec![(Signal::ServomotorPosition, [level(0.5), level(0.49), level(0.495), level(0.499)])],
            time_s: time_s.clone(),
        }],
        blamed: blamed.iter().map(blame).collect(),
        part: None,
        setup: Setup::Chain,
        notes: vec!["x < y.".into()],
        simulations: 7,
    }
}

/// Made of one recording with a stated origin.
fn synthetic() -> Provenance {
    let origin = Some("Synthetic data.".to_owned());
    Provenance {
        recordings: vec![RecordingGiven { origin, synthetic: true, ..RecordingGiven::default() }],
        ..Provenance::default()
    }
}

/// The page as text, in which units may stand on another line than their numbers.
fn html_of(diagnosis: &Diagnosis, made: &Provenance) -> String {
    page(diagnosis, made).to_html().replace('\u{a0}', " ")
}

#[test]
fn the_page_says_the_verdict_and_holds_all_it_needs() {
    let html = html_of(&made_up(Verdict::Named, &["backlash"]), &synthetic());
    assert!(
        html.contains("Play between the servomotor&#39;s piston")
            || html.contains("Play between the servomotor's piston")
    );
    assert!(html.contains("play 0.42 % [0.40, 0.44]"));
    assert!(html.contains(
        "On other recordings of the unit, the fault explains 88 % [84, 91] of the squared error that recalibration leaves beyond noise."
    ));
    // Cause, how sure, error, what next, in this order and before everything else.
    let at = |words: &str| html.find(words).unwrap_or_else(|| panic!("{words}"));
    let order = ["<dt>Cause<", "<dt>How sure<", "<dt>Error<", "<dt>What next<", "key-figures\"", "<h2"].map(at);
    assert!(order.is_sorted(), "{order:?}");
    assert!(html.contains("Symptom: compared with a twin without it, the real reading starts late"));
    assert!(html.contains("Synthetic data.") && html.contains("x &lt; y."));
    assert!(html.contains("&lt;b&gt;one&lt;/b&gt; &amp; only") && !html.contains("<b>one"));
    assert!(html.contains("<svg"));
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http") && !outside.contains("<script") && !outside.contains("src="));
}

#[test]
fn every_verdict_has_a_sentence_of_its_own() {
    let cases: [(Verdict, &[&str], &str); 7] = [
        (Verdict::Named, &["backlash"], "Play between"),
        (Verdict::Named, &["backlash", "load"], "Two faults act at once: backlash and load"),
        (Verdict::Class, &["backlash", "load"], "Backlash or load; these recordings cannot distinguish them."),
        (
            Verdict::Unknown,
            &[],
            "No effect in the catalogue explains the error: look first at the transducers and clocks; ",
        ),
        (Verdict::NoGap, &[], "No fault found; the data sheet is off: regulator position gain"),
        (Verdict::NotExcited, &[], "do not move the unit enough for a verdict"),
        (Verdict::NoSuchUnit, &[], "not of a servomotor stage driven by this spool"),
    ];
    for (verdict, blamed, expected) in cases {
        let diagnosis = made_up(verdict, blamed);
        let text = summary(&diagnosis, usize::MAX);
        assert!(text.contains(expected), "{text}");
        assert!(text.contains(&format!("verdict      {}\n", verdict.id())), "{text}");
        let html = html_of(&diagnosis, &Provenance::default());
        assert!(html.contains(expected), "{verdict:?}");
        // The quality of the fit is given in figures.
        assert!(!text.contains("they fit"), "{text}");
    }
}

#[test]
fn wrong_recordings_come_before_any_stage() {
    let mut diagnosis = made_up(Verdict::Unknown, &[]);
    diagnosis.notes = vec![format!("The command is stamped 250 ms late. {WRONG_DATA} Record both by one clock.")];
    let text = summary(&diagnosis, usize::MAX);
    assert!(text.starts_with(&diagnosis.notes[0]), "{text}");
    assert!(text.contains("before the recordings are right"), "{text}");
    let html = html_of(&diagnosis, &Provenance::default());
    assert_eq!(html.matches("Record both by one clock").count(), 1);
    for text in [text, html] {
        assert!(!text.contains("look first at") && !text.contains("Nearest in the catalogue"), "{text}");
    }
}

#[test]
fn something_unknown_is_looked_for_where_and_when_the_page_places_it() {
    let mut diagnosis = made_up(Verdict::Unknown, &[]);
    diagnosis.traces[0].name = "one".into();
    diagnosis.discrepancy_terms[0].explains = 0.4;
    let text = summary(&diagnosis, usize::MAX);
    assert!(text.contains("look first at the transducers and clocks; it is largest in one at "), "{text}");
    assert!(
        text.contains("A discrepancy term on the servomotor transducer would explain 40 % of the error beyond noise"),
        "{text}"
    );
    for (stage, explains) in [(Stage::Sensor, 0.01), (Stage::Spool, 0.4)] {
        (diagnosis.stage, diagnosis.discrepancy_terms[0].explains) = (Some(stage), explains);
        assert!(!summary(&diagnosis, usize::MAX).contains("discrepancy term"));
    }
    // The nearest cause with what speaks against it, from the diagnosis's own note or from the ranking.
    let page_of = |diagnosis: &Diagnosis| html_of(diagnosis, &Provenance::default());
    assert!(
        page_of(&diagnosis)
            .contains("Nearest in the catalogue: backlash, fitted play 0.42 % [0.40, 0.44]. Its probability is ")
    );
    let nearest = "Nearest in the catalogue: servo_friction and load. It leaves more than a right one; servomotor.load_closed_n is 6.0 tolerances off.";
    diagnosis.notes.push(nearest.into());
    diagnosis.notes.push("oil.bulk_modulus_pa was fitted to the end of its range.".into());
    let page = page_of(&diagnosis);
    assert!(page.contains("<p>Nearest in the catalogue: servo friction and load. It leaves"));
    assert!(
        page.contains("; servomotor load closed is 6.0 tolerances") && page.contains(">oil bulk modulus was fitted")
    );
}

#[test]
fn a_sound_unit_is_told_what_recalibration_found_and_no_place() {
    let mut diagnosis = made_up(Verdict::NoGap, &[]);
    let overlap = Fitted { name: "main_ports.overlap_m".into(), unit: "m", sheet: 2.0e-4, position: -2.04, ..play() };
    let value = Interval { value: 1.68e-4, low: 1.6e-4, high: 1.7e-4 };
    diagnosis.parameters = vec![Fitted { value, ..overlap.clone() }];
    let text = summary(&diagnosis, usize::MAX);
    assert!(
        text.starts_with(
            "No fault found; the data sheet is off: main ports overlap 0.168 mm instead of 0.200 mm (\u{2212}2.0 σ). \
             The remaining RMS error is 6.7 times noise alone in the servomotor position."
        ),
        "{text}"
    );
    let html = html_of(&diagnosis, &Provenance::default());
    assert!(!html.contains("probability of the stage, %"), "no stage of an error that is not there");
    assert!(!html.contains("by more than three standard deviations"));
    diagnosis.parameters[0].position = -3.4;
    let html = html_of(&diagnosis, &Provenance::default());
    assert!(html.contains("by more than three standard deviations") && html.contains(">main ports: overlap<"));
    assert!(html.contains(">main_ports.overlap_m<"), "the key beside it, to be looked up in the sheet");
    diagnosis.parameters[0].position = 0.3;
    assert!(summary(&diagnosis, usize::MAX).starts_with("No fault found, and the data sheet is right"));
    diagnosis.setup = Setup::AssumedSheet;
    assert!(summary(&diagnosis, usize::MAX).starts_with("No fault found, and the assumed sheet is right"));
    // Only claims on whole chains with a data sheet were counted.
    assert!(!summary(&diagnosis, usize::MAX).contains("held-out generated"));
    assert!(html_of(&diagnosis, &Provenance::default()).contains("Assumed sheet: estimated from the recordings"));
}

#[test]
fn one_recording_alone_confirms_nothing() {
    let mut diagnosis = made_up(Verdict::Named, &["backlash"]);
    let text = summary(&diagnosis, usize::MAX);
    assert!(text.contains("(not confirmed: based on one recording)"), "{text}");
    let html = html_of(&diagnosis, &Provenance::default());
    assert!(html.contains("not confirmed</dd>") && html.contains("this confirms or refutes the cause"));
    let second = diagnosis.traces[0].clone();
    diagnosis.traces.push(second);
    assert!(!summary(&diagnosis, usize::MAX).contains("not confirmed"));
}

#[test]
fn an_effect_without_a_file_is_called_by_its_id() {
    assert!(summary(&made_up(Verdict::Named, &["my_own_term"]), usize::MAX).starts_with("my own term: play 0.42 %"));
}

#[test]
fn a_named_effect_that_leaves_something_unknown_says_so() {
    let words = "nother cause outside the catalogue is probable (97 %)";
    for (probability, said) in [(0.97, true), (0.3, false)] {
        let mut diagnosis = made_up(Verdict::Named, &["backlash", "load"]);
        diagnosis.ranking[1].probability = probability;
        assert_eq!(summary(&diagnosis, usize::MAX).contains(words), said);
        assert_eq!(html_of(&diagnosis, &Provenance::default()).contains(words), said);
    }
}

/// What the causes leave stands beside what they explain, on the page and in the terminal, also where nothing has a name.
#[test]
fn what_remains_is_said_with_its_place() {
    for (verdict, blamed) in [(Verdict::Named, &["backlash"][..]), (Verdict::Unknown, &[])] {
        let diagnosis = made_up(verdict, blamed);
        for text in [html_of(&diagnosis, &synthetic()), summary(&diagnosis, usize::MAX)] {
            for said in ["12 %", "7.5 to 9.5 s", "oil supply"] {
                assert!(text.contains(said), "{verdict:?}: {said}");
            }
        }
    }
    assert!(!summary(&made_up(Verdict::NoGap, &[]), usize::MAX).contains("9.5 s"));
}
