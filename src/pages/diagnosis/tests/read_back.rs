//! A report as it is written is the report that is read back.

use super::{html_of, made_up, synthetic};
use govtwin_diagnosis::model::consistency::Consistency;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::test_script::{CommandShape, TestScript};
use govtwin_diagnosis::result::{
    ComparedModel, Diagnosis, HiddenEffect, ModelParameter, NEXT_TEST, Setup, SheetLimits, SheetValue, StageFigure,
    StageOnly, Transfer, Verdict, sealed,
};
use govtwin_model::signal::Signal;

#[test]
fn a_report_reads_back_as_it_was_written_and_makes_the_same_page() {
    let (pair, nothing) = (&["backlash", "load"][..], &[][..]);
    for (verdict, blamed, setup) in [(Verdict::Named, pair, Setup::Stage), (Verdict::NoGap, nothing, Setup::StageFree)]
    {
        let mut diagnosis = made_up(verdict, blamed);
        let script = TestScript { start_pu: 0.0, shape: CommandShape::Ramp { to_pu: 1.0 }, length_s: 34.0 };
        (diagnosis.experiments[0].script, diagnosis.experiments[0].bag) = (Some(script), Some(NEXT_TEST.to_owned()));
        let hides = vec![HiddenEffect { id: "load".into(), sharper: 1.5 }];
        let (key, tolerance) = ("oil.density_kg_m3".to_owned(), (860.0, 880.0));
        let value = SheetValue { key, unit: "kg/m3", sheet: 870.0, tolerance, information: 0.5, bits: 0.1, hides };
        diagnosis.sheet_limits = Some(SheetLimits { open_bits: 0.2, look_up: None, values: vec![value] });
        diagnosis.transfers =
            vec![Transfer { recording: "one".into(), explained_fraction: diagnosis.explained_fraction }];
        let innovations =
            Consistency { signal: Signal::SpoolPosition, samples: 9, mean_square: 1.1, correlation: f64::NAN };
        diagnosis.consistency = [vec![innovations], vec![]];
        diagnosis.setup = setup;
        diagnosis.part = Some(StageOnly {
            sheet: setup == Setup::Stage,
            pieces: 2,
            piece_s: 20.0,
            figures: vec![StageFigure { id: "gain", title: "gain", unit: "1/s", value: diagnosis.explained_fraction }],
            transducers_pu: 1e-3,
            foreign: None,
            free_run_s: 10.0,
            models: vec![ComparedModel {
                model: "set point with lag".into(),
                is_plain: true,
                parameters: vec![ModelParameter { name: "lag", value: 0.35, ends: (0.3, f64::NAN), unit: "s".into() }],
                held_out: 1e-3,
                halves: [1e-3, 2e-3],
                pieces: vec![1e-3, 2e-3],
            }],
            plain_wins: Some("set point with lag".into()),
            plain_as_good: Some("integrator".into()),
            driven_by: "command".into(),
        });
        let mut report = DiagnosisReport::of(&diagnosis, 1.5);
        report.provenance = Some(synthetic());
        report.evidence.traces = diagnosis.traces.clone();
        let json = report.json();
        let read = DiagnosisReport::read(&json.to_string()).unwrap();
        assert_eq!(read.json(), json);
        assert_eq!(html_of(&read.into(), &synthetic()), html_of(&diagnosis, &synthetic()));
        // What was changed is named, and so is that nobody can tell.
        for section in ["verdict", "digests"] {
            let mut changed = json.clone();
            changed[section] = if section == "verdict" { "unknown".into() } else { serde_json::Value::Null };
            let error = DiagnosisReport::read(&changed.to_string()).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{section}: expected ")), "{error}");
        }
        // One of an older program has the errors of free runs twice, and no intervals of plain models.
        let mut older = json;
        let stage = &mut older["evidence"]["servomotor_stage_only"];
        stage["free_runs"] = serde_json::json!([{ "effects": "", "fitted_on": "first half", "rmse_pu": 1e-3, "held_out_rmse_pu": 2e-3 }]);
        stage["models"][0]["parameters"][0].as_object_mut().unwrap().remove("ci90").unwrap();
        let read: Diagnosis = DiagnosisReport::read(&sealed(older).to_string()).unwrap().into();
        let parameter = &read.part.as_ref().unwrap().models[0].parameters[0];
        assert!(parameter.value == 0.35 && parameter.ends.0.is_nan(), "{parameter:?}");
        assert!(html_of(&read, &synthetic()).contains("lag 0.350 s"), "no interval is made up");
    }
}
