//! What a report on a stage alone says of the plain models beside it.

use super::{html_of, made_up, synthetic};
use crate::diagnosis::answers::leads;
use govtwin_diagnosis::result::{ComparedModel, Diagnosis, ModelParameter, Setup, StageOnly, Verdict};

/// A report on a stage alone, in which a plain model errs half as much as the twin.
fn beside(verdict: Verdict, blamed: &[&str], plain: &str) -> Diagnosis {
    let model = |model: &str, held_out: f64| ComparedModel {
        model: model.into(),
        is_plain: model == plain,
        parameters: vec![ModelParameter { name: "gain", value: 0.25, ends: (0.2, 0.3), unit: "1/s".into() }],
        held_out,
        halves: [held_out; 2],
        pieces: vec![held_out; 4],
    };
    let mut diagnosis = made_up(verdict, blamed);
    diagnosis.setup = Setup::StageFree;
    diagnosis.part = Some(StageOnly {
        sheet: false,
        pieces: 2,
        piece_s: 20.0,
        figures: vec![],
        transducers_pu: 1e-3,
        foreign: None,
        free_run_s: 10.0,
        models: vec![model(blamed.first().copied().unwrap_or_default(), 2e-3), model(plain, 1e-3)],
        plain_wins: None,
        plain_as_good: None,
        driven_by: "spool".into(),
    });
    diagnosis
}

#[test]
fn a_plain_model_that_errs_less_is_given_with_its_parameters() {
    let plain = "integrator with two gains";
    let mut diagnosis = beside(Verdict::Class, &["load", "port_asymmetry"], plain);
    assert_eq!(leads(&diagnosis).len(), 1);
    diagnosis.part.as_mut().unwrap().plain_as_good = Some(plain.into());
    let said = leads(&diagnosis);
    assert!(said.len() == 2 && said[0].contains("cannot distinguish"), "{said:?}");
    for words in
        ["The same law more plainly", "gain 0.250 [0.200, 0.300] 1/s", "0.100 % of the stroke", "(with load) 0.200 %"]
    {
        assert!(said[1].contains(words), "{words}: {said:?}");
    }
    assert!(html_of(&diagnosis, &synthetic()).contains("The same law more plainly"));
}

#[test]
fn beside_a_plain_model_that_wins_nobody_is_sent_to_look_at_a_stage() {
    let mut diagnosis = beside(Verdict::Unknown, &[], "set point with lag");
    assert!(leads(&diagnosis)[0].starts_with("No effect in the catalogue explains the error"));
    diagnosis.part.as_mut().unwrap().plain_wins = Some("set point with lag".into());
    let said = leads(&diagnosis);
    assert!(
        said[0].starts_with("A plain model predicts better") && said[1].starts_with("No fault is named"),
        "{said:?}"
    );
}

#[test]
fn a_sound_stage_without_a_sheet_has_none_that_is_off() {
    let said = leads(&beside(Verdict::NoGap, &[], "integrator")).join(" ");
    assert!(said.contains("equal in both directions explains the movement") && !said.contains("sheet"), "{said}");
}
