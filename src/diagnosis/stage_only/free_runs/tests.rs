//! When free runs bear a name out.

use super::*;

fn model(name: &str, is_plain: bool, pieces: [f64; 6]) -> ComparedModel {
    let rms = |some: &[f64]| (some.iter().map(|one| one * one).sum::<f64>() / some.len() as f64).sqrt();
    let gain = ModelParameter { name: GAIN_BELOW, value: 1.0, ends: (1.0, 1.0), unit: String::new() };
    ComparedModel {
        model: name.to_owned(),
        is_plain,
        parameters: if name == PlainKind::TwoGains.title() { vec![gain] } else { Vec::new() },
        held_out: rms(&pieces),
        halves: [rms(&pieces[..3]), rms(&pieces[3..])],
        pieces: pieces.to_vec(),
    }
}

fn compared(models: Vec<ComparedModel>) -> Compared {
    Compared { models, ..Compared::default() }
}

#[test]
fn a_plain_model_wins_in_both_halves_and_beyond_the_spread() {
    let twins =
        || vec![model("", false, [3.0, 3.2, 2.9, 3.1, 3.0, 3.3]), model("load", false, [2.0, 2.2, 1.9, 2.1, 2.0, 2.3])];
    let winner = |pieces: [f64; 6]| {
        let plain = model("integrator", true, pieces);
        compared(twins().into_iter().chain([plain]).collect()).winner().is_some()
    };
    assert!(winner([1.0, 1.1, 0.9, 1.0, 1.0, 1.2]));
    // Better than the recalibrated twin alone, by a hair, in one half, or in one piece of many.
    assert!(!winner([2.5, 2.5, 2.5, 2.5, 2.5, 2.5]));
    assert!(!winner([1.95, 2.15, 1.85, 2.05, 1.95, 2.25]));
    assert!(!winner([0.5, 0.5, 0.5, 2.5, 2.5, 2.5]));
    assert!(!winner([2.0, 0.1, 1.9, 2.1, 2.2, 2.1]));
    assert!(compared(twins()).winner().is_none(), "nothing plain was run");
}

#[test]
fn a_law_of_the_set_point_is_given_where_a_loop_predicts_no_better() {
    let found = |is_loop: bool, pieces: [f64; 6]| {
        let twins = [model("", false, [3.0; 6]), model("load", false, [1.0, 1.1, 0.9, 1.0, 1.1, 0.9])];
        let models = twins.into_iter().chain([model(PlainKind::SetPoint.title(), true, pieces)]).collect();
        let compared = Compared { is_loop, free_run_s: 1.0, ..compared(models) };
        (compared.as_good("load").is_some(), compared.against("load").is_some())
    };
    assert_eq!(found(true, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]), (true, true));
    assert_eq!(found(true, [1.2, 1.1, 1.2, 1.2, 1.2, 1.2]), (false, false), "the stage says more of the loop");
    assert_eq!(found(false, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]), (false, true), "no loop, but nothing speaks for a load");
}

#[test]
fn a_plain_model_of_the_stages_own_law_is_given_where_it_errs_less() {
    let twin = [3.0, 0.9, 1.0, 1.1, 0.9, 3.0];
    let given = |kind: PlainKind, pieces: [f64; 6]| {
        let models = vec![model("load", false, twin), model(kind.title(), true, pieces)];
        compared(models).as_good("load").is_some()
    };
    let less = [1.0, 1.0, 1.1, 1.0, 1.0, 1.0];
    assert!(given(PlainKind::DeadZone, less), "too uneven to win, but less in all");
    assert!(!given(PlainKind::Lag, less), "another law");
    assert!(!given(PlainKind::DeadZone, twin) && !given(PlainKind::DeadZone, [0.1, 0.1, 0.1, 3.1, 3.1, 3.1]));
    assert!(given(PlainKind::DeadZone, [1.0, 1.0, 1.0, 2.5, 0.4, 2.5]), "the twin fails in one half");
    let outright = vec![model("load", false, [3.0; 6]), model("integrator", true, [1.0, 1.1, 0.9, 1.0, 1.1, 0.9])];
    assert!(compared(outright).as_good("load").is_none(), "it wins");
}

#[test]
fn a_name_stands_where_the_free_runs_bear_it_out() {
    let against = |with: [f64; 6], plain: Option<(PlainKind, [f64; 6])>| {
        let mut models = vec![model("", false, [1.0; 6]), model("load", false, with)];
        models.extend(plain.map(|(kind, pieces): (PlainKind, _)| model(kind.title(), true, pieces)));
        compared(models).against("load").is_some()
    };
    assert!(!against([0.2; 6], None));
    assert!(against([0.1, 0.1, 0.1, 1.1, 1.1, 1.1], None), "one half alone");
    let better = [0.05, 0.06, 0.05, 0.06, 0.05, 0.06];
    for kind in PlainKind::all() {
        // A gain each way is what a load does.
        assert_eq!(against([0.2; 6], Some((kind, better))), kind != PlainKind::TwoGains, "{kind:?}");
        assert!(against([0.6; 6], Some((kind, better))), "{kind:?} closes much more");
        assert!(!against(better, Some((kind, [0.2; 6]))), "{kind:?}");
    }
    // Too uneven to win.
    let uneven = [0.02, 0.19, 0.19, 0.19, 0.19, 0.02];
    assert!(against([0.2; 6], Some((PlainKind::DeadZone, uneven))));
    assert!(!against([0.2; 6], Some((PlainKind::TwoGains, uneven))));
    assert!(compared(Vec::new()).against("load").is_none(), "what was not run says nothing");
}

#[test]
fn a_further_effect_is_named_where_both_halves_need_it() {
    let enough = |together: [f64; 6]| {
        let one = |name, pieces| model(name, false, pieces);
        let models = vec![one("load", [0.5; 6]), one("port_wear", [0.9; 6]), one("load + port_wear", together)];
        compared(models).enough_alone(&["port_wear", "load"])
    };
    assert_eq!(enough([0.4; 6]), None);
    assert_eq!(enough([0.1, 0.1, 0.1, 0.5, 0.5, 0.5]), Some("load"), "one half alone");
    assert!(compared(Vec::new()).enough_alone(&["load", "port_wear"]).is_none(), "what was not run says nothing");
}
