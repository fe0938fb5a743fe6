//! What each effect does to the plant, against closed forms: the size of what it is named after.

#[path = "effects/bench.rs"]
mod bench;

use bench::{recording, simulate, with};
use govtwin_model::effects;
use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::plant::Plant;
use govtwin_model::recording::Recording;
use govtwin_model::replay;
use govtwin_model::twin::{Cut, Twin};

const TANK_PA: f64 = 6.3e6;
const RETURN_PA: f64 = 0.1e6;

fn setting(id: &str, values: &[f64]) -> EffectSetting {
    EffectSetting { id: id.to_owned(), values: values.to_vec() }
}

fn plant(id: &str, values: &[f64]) -> Plant {
    let mut plant = Plant::new(&govtwin_model::params::reference().parameters);
    let unit = Unit { effects: vec![setting(id, values)], ..govtwin_model::params::reference() };
    effects::apply(&unit, &mut plant);
    plant
}

/// One row for each hundredth of a second, command and ESV by time.
fn course(seconds: i64, opening_pu: impl Fn(f64) -> f64, trip_s: f64) -> Recording {
    let row = |i: i64| {
        let at_s = i as f64 * 0.01;
        let esv = if at_s < trip_s { EsvState::Normal } else { EsvState::Shutdown };
        let inputs =
            Inputs { opening_command_pu: opening_pu(at_s), esv, tank_pressure_pa: TANK_PA, piston_force_n: 0.0 };
        let start = Signals { servomotor_position_pu: opening_pu(0.0), ..Signals::NONE };
        Frame { time_ns: i * 10_000_000, inputs, measured: if i == 0 { start } else { Signals::NONE } }
    };
    Recording::new("course", (0..seconds * 100).map(row).collect())
}

fn run(effects: &[EffectSetting], recording: &Recording) -> Vec<Estimate> {
    replay::simulate(&mut Twin::new(&with(effects)), recording)
}

fn rests_at(opening_pu: f64) -> Recording {
    course(4, |_| opening_pu, f64::INFINITY)
}

fn ramp(at_s: f64) -> f64 {
    0.2 + 0.05 * (at_s - 1.0).clamp(0.0, 8.0)
}

#[test]
fn a_command_delay_moves_the_answer_in_time() {
    let recording = course(12, ramp, f64::INFINITY);
    let nominal = run(&[], &recording);
    for (delay_s, rows) in [(0.05, 5), (0.2, 20)] {
        let late = run(&[setting("command_delay", &[delay_s])], &recording);
        for (late, nominal) in late[rows..].iter().zip(&nominal) {
            let apart_pu = late.signals.servomotor_position_pu - nominal.signals.servomotor_position_pu;
            assert!(apart_pu.abs() < 1e-9, "{delay_s} s: {apart_pu:e}");
        }
    }
}

#[test]
fn a_command_gain_moves_where_the_servomotor_rests_and_not_how_it_trips() {
    let rest_pu = |gain_ratio: f64, opening_pu: f64| {
        run(&[setting("command_gain", &[gain_ratio])], &rests_at(opening_pu)).pop().unwrap().signals
    };
    for opening_pu in [0.2, 0.8] {
        let reads_pu = rest_pu(1.03, opening_pu).servomotor_position_pu;
        // The dead band is half a thousandth wide.
        assert!((reads_pu - 1.03 * opening_pu).abs() < 1e-3, "{opening_pu}: {reads_pu}");
    }
    // What is asked for in other words is the same movement, a trip too.
    let nominal = course(4, |_| 0.5, 1.0);
    let mut scaled = nominal.clone();
    scaled.frames.iter_mut().for_each(|frame| frame.inputs.opening_command_pu /= 1.25);
    assert_eq!(run(&[setting("command_gain", &[1.25])], &scaled), run(&[], &nominal));
}

#[test]
fn a_clock_offset_is_the_same_recording_with_other_stamps() {
    let recording = recording();
    let nominal = simulate(&[], Cut::None);
    let offset_rows = 7;
    // What the plant did at t stands beside the inputs of 70 ms before: their stamps are late by as much.
    let frames = recording.frames.iter().enumerate().map(|(i, frame)| {
        let inputs = Inputs {
            tank_pressure_pa: frame.inputs.tank_pressure_pa,
            ..recording.frames[i.saturating_sub(offset_rows)].inputs
        };
        Frame { inputs, ..*frame }
    });
    let shifted = Recording::new("shifted", frames.collect());
    let found = run(&[setting("clock_offset", &[0.07])], &shifted);
    // The last inputs have not come yet.
    for (found, nominal) in found.iter().zip(&nominal) {
        let apart_pu = found.signals.spool_position_pu - nominal.signals.spool_position_pu;
        assert!(apart_pu.abs() < 1e-9, "{apart_pu:e} at {}", found.time_ns);
    }
}

#[test]
fn a_slower_cycle_holds_the_demand_longer() {
    let recording = course(12, ramp, f64::INFINITY);
    let changes = |effects: &[EffectSetting]| {
        let ramping = &run(effects, &recording)[200..800];
        ramping.windows(2).filter(|pair| pair[0].spool_command_pu != pair[1].spool_command_pu).count()
    };
    assert!(changes(&[]) > 590);
    let slow = changes(&[setting("regulator_cycle", &[0.05])]);
    assert!((99..=100).contains(&slow), "{slow} demands in 6 s at 60 ms");
}

#[test]
fn the_esv_acts_late_or_slowly() {
    let recording = course(4, |_| 0.5, 1.0);
    let falls_s = |effects: &[EffectSetting]| {
        let estimates = run(effects, &recording);
        let fallen = estimates.iter().find(|estimate| estimate.signals.spool_position_pu < -0.5).unwrap();
        fallen.time_ns as f64 * 1e-9
    };
    let nominal_s = falls_s(&[]);
    assert!((falls_s(&[setting("esv_delay", &[0.3])]) - nominal_s - 0.3).abs() < 1e-9);
    // Linear travel opens half the drain after half the travel: it lags by less than all of it.
    let slow_s = falls_s(&[setting("esv_slow", &[0.3])]) - nominal_s;
    assert!((0.05..0.3).contains(&slow_s), "{slow_s}");
}

#[test]
fn faults_of_the_pilot_valve_have_their_size() {
    let flow = |plant: &Plant, x_p: f64, p: f64| {
        let valve = &plant.proportional_valve;
        valve.flow(valve.opening_pu(x_p), p, TANK_PA, RETURN_PA).m3_s
    };
    let nominal = plant("lvdt_gain", &[1.0]);
    let dead = plant("pv_overlap", &[0.05]);
    assert_eq!(flow(&dead, 0.049, 3e6), 0.0);
    assert!((flow(&dead, 0.25, 3e6) - flow(&nominal, 0.20, 3e6)).abs() < 1e-15);
    let shifted = plant("pv_null_shift", &[0.03]);
    assert_eq!(flow(&shifted, 0.03, 3e6), 0.0);
    let clogged = plant("pilot_filter", &[3.0]);
    for s in [0.1, 1.0] {
        let share = flow(&clogged, s, 3e6) / flow(&nominal, s, 3e6);
        assert!((share - 1.0 / (1.0 + 9.0 * s * s).sqrt()).abs() < 1e-12, "{s}: {share}");
        assert_eq!(flow(&clogged, -s, 3e6), flow(&nominal, -s, 3e6));
    }

    // The amplifier gives no more than its limit, and all that is asked for below.
    let step = course(4, |at_s| if at_s < 1.0 { 0.2 } else { 0.8 }, f64::INFINITY);
    let limited = run(&[setting("current_limit", &[0.4])], &step);
    let greatest_pu = limited.iter().map(|row| row.valve_current_pu).fold(0.0, f64::max);
    assert_eq!(greatest_pu, 0.4);
    let rises_s = |rows: &[Estimate]| {
        let at = |above_pu: f64| rows.iter().position(|row| row.signals.spool_position_pu > above_pu).unwrap() as f64;
        0.01 * (at(0.7) - at(0.1))
    };
    let slower = rises_s(&limited) / rises_s(&run(&[], &step));
    assert!((1.8..3.2).contains(&slower), "{slower} times as long with 0.4 of the current");
    let small = course(4, |at_s| if at_s < 1.0 { 0.2 } else { 0.2005 }, f64::INFINITY);
    assert_eq!(run(&[setting("current_limit", &[0.4])], &small), run(&[], &small));

    // At rest the small loop holds the valve at its null: K2 times the spool's standoff.
    let rest = run(&[setting("pv_null_shift", &[0.03])], &rests_at(0.5)).pop().unwrap();
    let nominal = run(&[], &rests_at(0.5)).pop().unwrap();
    let standoff_pu = rest.signals.spool_position_pu - nominal.signals.spool_position_pu;
    assert!((standoff_pu + 0.03 / 8.0).abs() < 1e-4, "{standoff_pu}");
}

#[test]
fn hysteresis_is_as_wide_as_it_says() {
    let recording = course(12, |at_s| 0.5 + 0.02 * (2.0 * at_s).sin(), f64::INFINITY);
    let estimates = run(&[setting("pv_hysteresis", &[0.06])], &recording);
    // Where the current has held for a while the valve has followed it, to within half the width.
    let (mut behind, mut ahead) = (0.0_f64, 0.0_f64);
    for rows in estimates[100..].windows(3) {
        let current_pu = rows[2].valve_current_pu;
        if rows.iter().all(|row| (row.valve_current_pu - current_pu).abs() < 1e-3) {
            let apart_pu = current_pu - rows[2].signals.pilot_valve_position_pu;
            (behind, ahead) = (behind.max(apart_pu), ahead.max(-apart_pu));
        }
    }
    assert!((0.029..0.031).contains(&behind) && (0.029..0.031).contains(&ahead), "{behind} {ahead}");
}

#[test]
fn forces_and_leaks_of_the_spool_show_in_the_pilot_signals() {
    let signals = |effects: &[EffectSetting]| run(effects, &rests_at(0.5)).pop().unwrap().signals;
    let nominal = signals(&[]);
    let sheet = govtwin_model::params::reference().parameters.distributing_valve;

    let tired = signals(&[setting("spring", &[0.2, 0.005])]);
    let lost_n =
        sheet.spring_stiffness_n_m * (sheet.spring_precompression_m - 0.8 * (sheet.spring_precompression_m - 0.005));
    let lower_pa = nominal.control_pressure_pa - tired.control_pressure_pa;
    assert!((lower_pa - lost_n / sheet.control_area_m2).abs() < 2e3, "{lower_pa}");

    let leaking = signals(&[setting("chamber_leak", &[5e-12])]);
    let lost_m3_s = 5e-12 * (nominal.control_pressure_pa - RETURN_PA);
    let valve = plant("chamber_leak", &[5e-12]).proportional_valve;
    let found_m3_s = valve.flow(leaking.pilot_valve_position_pu, leaking.control_pressure_pa, TANK_PA, RETURN_PA).m3_s;
    let nominal_m3_s =
        valve.flow(nominal.pilot_valve_position_pu, nominal.control_pressure_pa, TANK_PA, RETURN_PA).m3_s;
    assert!((found_m3_s - nominal_m3_s - lost_m3_s).abs() < 0.02 * lost_m3_s, "{found_m3_s} {lost_m3_s}");
}

#[test]
fn backlash_parts_the_reading_from_the_piston_by_half_the_gap() {
    let recording = course(20, |at_s| 0.5 + 0.05 * at_s.sin(), f64::INFINITY);
    let mut twin = Twin::new(&with(&[setting("backlash", &[0.004])]));
    let stroke_m = twin.plant().servomotor.stroke_m;
    let mut widest_pu = 0.0_f64;
    for frame in &recording.frames {
        let reading_pu = twin.step(frame).signals.servomotor_position_pu;
        let apart_pu = reading_pu - twin.state().servomotor_position_m / stroke_m;
        assert!(apart_pu.abs() <= 0.002 + 1e-12);
        widest_pu = widest_pu.max(apart_pu.abs());
    }
    assert!((widest_pu - 0.002).abs() < 1e-12);
}

#[test]
fn a_lagging_transducer_trails_a_ramp_by_its_time_constant() {
    let recording = course(12, ramp, f64::INFINITY);
    let mut twin = Twin::new(&with(&[setting("feedback_lag", &[0.08])]));
    let stroke_m = twin.plant().servomotor.stroke_m;
    let mut trailing_pu = f64::NAN;
    for frame in &recording.frames[..800] {
        let reading_pu = twin.step(frame).signals.servomotor_position_pu;
        trailing_pu = twin.state().servomotor_position_m / stroke_m - reading_pu;
    }
    assert!((trailing_pu - 0.08 * 0.05).abs() < 2e-5, "{trailing_pu}");
}

#[test]
fn a_wrong_transducer_of_the_spool_shows_at_its_stop() {
    let stop_pu =
        |effects: &[EffectSetting]| run(effects, &course(4, |_| 0.5, 1.0)).pop().unwrap().signals.spool_position_pu;
    let nominal_pu = stop_pu(&[]);
    assert!((stop_pu(&[setting("lvdt_bias", &[0.03])]) - nominal_pu - 0.03).abs() < 1e-9);
    assert!((stop_pu(&[setting("lvdt_gain", &[1.08])]) - 1.08 * nominal_pu).abs() < 1e-9);
}

#[test]
fn a_wrong_zero_of_the_servomotors_transducer_shows_where_it_is_shut() {
    let shut_pu = |bias_pu: f64| {
        let trip = course(12, |_| 0.5, 1.0);
        run(&[setting("feedback_bias", &[bias_pu])], &trip).pop().unwrap().signals.servomotor_position_pu
    };
    for bias_pu in [0.01, -0.01] {
        assert!((shut_pu(bias_pu) - shut_pu(0.0) - bias_pu).abs() < 1e-9);
        // Away from the ends the regulator makes the reading what is commanded, and the piston stands off it.
        let mut twin = Twin::new(&with(&[setting("feedback_bias", &[bias_pu])]));
        let stroke_m = twin.plant().servomotor.stroke_m;
        let reading_pu = rests_at(0.5).frames.iter().map(|frame| twin.step(frame)).last().unwrap();
        let reading_pu = reading_pu.signals.servomotor_position_pu;
        assert!((reading_pu - 0.5).abs() < 1e-3, "{reading_pu}");
        assert!((twin.state().servomotor_position_m / stroke_m - reading_pu + bias_pu).abs() < 1e-12);
    }
}

/// Steady speed of the piston at a spool position, m/s.
fn speed_m_s(effects: &[EffectSetting], spool_pu: f64) -> f64 {
    let measured = Signals { spool_position_pu: spool_pu, servomotor_position_pu: 0.5, ..Signals::NONE };
    let inputs =
        Inputs { opening_command_pu: 0.5, esv: EsvState::Normal, tank_pressure_pa: TANK_PA, piston_force_n: 0.0 };
    let mut twin = Twin::new(&with(effects)).with_cut(Cut::Spool);
    let step = |i: i64| twin.step(&Frame { time_ns: i * 10_000_000, inputs, measured });
    (0..100).map(step).last().unwrap().servomotor_velocity_m_s
}

#[test]
fn forces_on_the_piston_change_its_speed_by_the_balance() {
    let p = govtwin_model::params::reference().parameters;
    let (servo, oil) = (p.servomotor, p.oil);
    let (a_o, a_c) = (servo.opening_area_m2, servo.closing_area_m2);
    let conductance = p.esv.discharge_coefficient * p.main_ports.width_m * (2.0 / oil.density_kg_m3).sqrt();
    // P_s A_o − P_t A_c − load − friction = (A_o³ + A_c³) w²/G² + (R A_o³ + R_r A_c³) w² + B w, at mid stroke on average.
    let miss_n = |w: f64, spool_pu: f64, extra_n: f64, losses: [f64; 2]| {
        let g = conductance * (spool_pu * p.distributing_valve.reference_stroke_m - p.main_ports.overlap_m);
        let z_pu = 0.5 + w / servo.stroke_m;
        let drive_n = TANK_PA * a_o
            - RETURN_PA * a_c
            - servo.load_closed_n
            - servo.load_slope_n * z_pu
            - servo.coulomb_friction_n
            - extra_n;
        drive_n
            - (a_o.powi(3) + a_c.powi(3)) / (g * g) * w * w
            - (losses[0] * a_o.powi(3) + losses[1] * a_c.powi(3)) * w * w
            - servo.viscous_damping_n_s_m * w
    };
    for (effects, extra_n, losses) in [
        (vec![], 0.0, [0.0; 2]),
        (vec![setting("servo_friction", &[6e4, 1.0])], 6e4, [0.0; 2]),
        (vec![setting("load", &[0.4])], 0.4 * (servo.load_closed_n + 0.55 * servo.load_slope_n), [0.0; 2]),
        (vec![setting("supply_loss", &[2e9])], 0.0, [2e9, 0.0]),
        (vec![setting("return_loss", &[2e9])], 0.0, [0.0, 2e9]),
    ] {
        let w = speed_m_s(&effects, 0.4);
        let miss = miss_n(w, 0.4, extra_n, losses);
        assert!(w > 0.01 && miss.abs() < 1.5e4, "{effects:?}: {w} m/s leaves {miss} N of 1.2e6");
    }
    let overlap = speed_m_s(&[setting("port_overlap", &[3e-4])], 0.3 + 3e-4 / 0.015);
    assert!((overlap / speed_m_s(&[], 0.3) - 1.0).abs() < 1e-9);
}

#[test]
fn a_loss_in_the_return_line_slows_the_other_direction_more_than_one_in_the_pressure_line() {
    let slows = |id: &str, spool_pu: f64| {
        1.0 - speed_m_s(&[setting(id, &[2e9])], spool_pu) / speed_m_s(&[setting(id, &[0.0])], spool_pu)
    };
    assert!(slows("supply_loss", 0.5) > 1.2 * slows("return_loss", 0.5));
    assert!(slows("return_loss", -0.5) > 1.2 * slows("supply_loss", -0.5));
}

#[test]
fn worn_edges_pass_oil_early_and_are_as_new_far_out() {
    let (new, worn) = (plant("port_wear", &[0.0]).main_ports, plant("port_wear", &[1e-4]).main_ports);
    let h_0 = new.opening_overlap_m;
    // At the edge half the radius, less what the edge of the other direction passes.
    let other_m = 0.5 * ((4.0 * h_0 * h_0 + 1e-8).sqrt() - 2.0 * h_0);
    assert!((worn.travel_m(h_0) - (0.5e-4 - other_m)).abs() < 1e-12);
    assert!((worn.travel_m(5e-3) - new.travel_m(5e-3)).abs() < 1e-6);
    assert_eq!(worn.travel_m(0.0), 0.0);
    assert_eq!(worn.travel_m(-3e-4), -worn.travel_m(3e-4));
    // Within the overlap a new valve is shut.
    let edge_pu = 0.5 * h_0 / govtwin_model::params::reference().parameters.distributing_valve.reference_stroke_m;
    assert!(speed_m_s(&[], edge_pu).abs() < 1e-6 && speed_m_s(&[setting("port_wear", &[1e-4])], edge_pu) > 5e-5);
    assert!(speed_m_s(&[setting("port_wear", &[1e-4])], -edge_pu) < -5e-5);
}

/// Speed of the servomotor, pu/s, and position at each row, of a stage whose recorded spool steps from rest after half a second.
fn stepped(effects: &[EffectSetting], spool_pu: f64) -> Vec<f64> {
    let row = |i: i64| {
        let measured = Signals {
            spool_position_pu: if i < 50 { 0.0 } else { spool_pu },
            servomotor_position_pu: 0.3,
            ..Signals::NONE
        };
        let inputs = Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: TANK_PA,
            piston_force_n: 0.0,
        };
        Frame { time_ns: i * 10_000_000, inputs, measured }
    };
    let recording = Recording::new("step", (0..200).map(row).collect());
    let estimates = replay::simulate(&mut Twin::new(&with(effects)).with_cut(Cut::Spool), &recording);
    estimates.iter().map(|estimate| estimate.signals.servomotor_position_pu).collect()
}

#[test]
fn a_lagging_valve_costs_its_time_constant_of_travel_and_a_full_one_goes_no_faster() {
    let speed = |at: &[f64]| (at[199] - at[180]) / 0.19;
    let nominal = stepped(&[], 0.2);
    let late = stepped(&[setting("valve_lag", &[0.1])], 0.2);
    assert!((speed(&late) / speed(&nominal) - 1.0).abs() < 0.01);
    // Flow is linear in the spool beyond its overlap, which the late valve leaves a little later still.
    let behind_s = (nominal[199] - late[199]) / speed(&nominal);
    assert!((0.095..0.115).contains(&behind_s), "{behind_s} s");
    let full = stepped(&[setting("flow_saturation", &[0.9])], 0.4);
    assert!((speed(&full) / speed(&stepped(&[], 0.1)) - 1.0).abs() < 1e-3);
    assert_eq!(stepped(&[setting("flow_saturation", &[0.5])], 0.4), stepped(&[], 0.4));
}

#[test]
fn a_leaking_piston_creeps_under_its_load() {
    let p = govtwin_model::params::reference().parameters.servomotor;
    let leak = 5e-10;
    let w = speed_m_s(&[setting("servo_leak", &[leak])], 0.0);
    // With the ports shut what leaves one chamber enters the other; unequal areas bring them to one pressure.
    assert!(w < 0.0 && speed_m_s(&[], 0.0).abs() < 1e-6);
    let load_n = p.load_closed_n + 0.5 * p.load_slope_n;
    assert!(w.abs() < leak * load_n / p.closing_area_m2.powi(2), "{w}");
}

#[test]
fn a_cushion_slows_only_the_end_of_closing() {
    let trip = course(12, |_| 0.5, 1.0);
    let speed_at = |effects: &[EffectSetting], opening_pu: f64| {
        let estimates = run(effects, &trip);
        let there = estimates.iter().find(|estimate| estimate.signals.servomotor_position_pu < opening_pu).unwrap();
        there.servomotor_velocity_m_s
    };
    let cushion = [setting("cushion", &[3e8, 0.15])];
    assert_eq!(speed_at(&cushion, 0.2), speed_at(&[], 0.2));
    let share = speed_at(&cushion, 0.01) / speed_at(&[], 0.01);
    assert!((0.2..0.8).contains(&share), "{share}");
}

#[test]
fn cold_oil_warms() {
    let supply = plant("viscosity", &[3.0, 20.0]).supply;
    assert_eq!(supply.viscosity(0.0), 4.0);
    assert!((supply.viscosity(20.0) - 1.0 - 3.0 / std::f64::consts::E).abs() < 1e-12);
    let cold = speed_m_s(&[setting("viscosity", &[3.0, 1e3])], 0.4);
    assert!(cold < 0.99 * speed_m_s(&[], 0.4));
}

#[test]
fn air_friction_and_flow_forces_enter_their_laws() {
    let airy = plant("entrained_air", &[0.03]).spool;
    let share = 0.03 * 101_325.0 * 1.0e9 / (3e6_f64 + 101_325.0).powi(2);
    let nominal = plant("entrained_air", &[0.0]).spool;
    assert!((airy.compliance_m3_pa(0.0, 3e6) / nominal.compliance_m3_pa(0.0, 3e6) - 1.0 - share).abs() < 1e-12);
    let sticky = plant("spool_friction", &[400.0, 1.3]).spool.friction;
    assert!((sticky.force_n(1.0) - 400.0).abs() < 1e-9 && (sticky.size_n(0.0) - 520.0).abs() < 1e-9);
    let ports = plant("flow_force", &[1.0]).main_ports;
    // 2 C_d w cos 69° x Δp, both edges.
    let expected_n = -2.0 * 0.62 * 0.030 * 69.0_f64.to_radians().cos() * 0.005 * (4.3e6 + 2.9e6);
    assert!((ports.flow_force_n(0.005, 2.0e6, 3.0e6, TANK_PA, RETURN_PA) - expected_n).abs() < 1e-9);
    let slow = plant("pv_bandwidth", &[0.4]).proportional_valve;
    assert!((slow.natural_frequency_rad_s - 0.4 * 377.0).abs() < 1e-12);
}
