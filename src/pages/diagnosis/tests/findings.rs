//! Nothing is reported as a finding that is none, and open questions are reported as open.

use super::{html_of, made_up};
use crate::diagnosis::summary;
use govtwin_diagnosis::result::{Interval, Verdict};
use govtwin_model::effects::Stage;
use govtwin_model::provenance::Provenance;

#[test]
fn an_explained_fraction_that_says_nothing_is_not_given_as_a_figure() {
    let mut diagnosis = made_up(Verdict::Named, &["backlash"]);
    diagnosis.explained_fraction = Interval { value: 1.0, low: 0.0, high: 1.0 };
    diagnosis.blamed[0].explained_fraction = diagnosis.explained_fraction;
    let text = summary(&diagnosis, usize::MAX);
    assert!(
        text.contains(
            "The fault explains an undetermined share of the squared error that recalibration leaves beyond noise"
        ),
        "{text}"
    );
    assert!(!text.contains("100 %"), "{text}");
    let html = html_of(&diagnosis, &Provenance::default());
    assert!(html.contains("undetermined<") && !html.contains("[0, 100]"));
    let mut several = made_up(Verdict::Named, &["backlash", "lvdt_bias"]);
    several.blamed[1].explained_fraction = diagnosis.explained_fraction;
    let html = html_of(&several, &Provenance::default());
    assert!(html.contains("Alone it explains a share that is undetermined. ") && !html.contains("[0, 100]"));
}

#[test]
fn an_explained_fraction_below_nothing_is_none() {
    let mut diagnosis = made_up(Verdict::Named, &["backlash"]);
    diagnosis.explained_fraction = Interval { value: -0.12, low: -0.77, high: 0.09 };
    let text = summary(&diagnosis, usize::MAX);
    assert!(
        text.contains(
            "On other recordings of the unit, the fault explains nothing of the squared error that recalibration leaves beyond noise."
        ),
        "{text}"
    );
}

#[test]
fn an_open_stage_has_a_second_one_and_a_test_that_settles_little_says_so() {
    let mut open = made_up(Verdict::Unknown, &[]);
    open.stage = Some(Stage::Servomotor);
    open.stages = vec![(Stage::Servomotor, 0.3), (Stage::Spool, 0.2)];
    let text = summary(&open, usize::MAX);
    assert!(text.contains("main ports and servomotor (30 %), then at the control chamber and spool (20 %)"), "{text}");
    let html = html_of(&open, &Provenance::default());
    assert!(html.contains("To distinguish backlash from load: a full stroke. It takes 34 s,"), "{html}");
    open.experiments[0].expected_drop_bits = 0.004;
    open.experiments[0].separates = vec!["none".into(), "load".into()];
    let html = html_of(&open, &Provenance::default());
    assert!(html.contains("No candidate test would settle much; the best one, to find out whether load is present: "));
}

#[test]
fn what_decides_nothing_has_no_probability_and_what_is_no_stage_no_test() {
    for verdict in [Verdict::NotExcited, Verdict::NoSuchUnit] {
        let html = html_of(&made_up(verdict, &[]), &Provenance::default());
        assert!(!html.contains("<dt>most probable"), "{verdict:?}");
        assert_eq!(html.contains("Proposed tests"), verdict == Verdict::NotExcited);
    }
    let text = summary(&made_up(Verdict::NoSuchUnit, &[]), usize::MAX);
    assert!(text.contains("Check which signals were recorded") && !text.contains("a full stroke"), "{text}");
}

#[test]
fn possible_causes_stand_beside_how_often_such_claims_were_right() {
    let text = summary(&made_up(Verdict::Class, &["backlash", "load"]), usize::MAX);
    let counted = crate::diagnosis::claims_like(0.97).is_some();
    assert_eq!(text.contains("On held-out generated units"), counted, "{text}");
}
