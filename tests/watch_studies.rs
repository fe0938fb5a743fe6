//! Studies of a watched unit, which CI does not run: when a fault that grows is noticed, and how often a warning is false.
//!
//!     cargo test --release --test product -- --ignored --nocapture watch_studies
//!
//! All recordings are synthetic.
#![cfg(feature = "cli")]

use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_diagnosis::trend::{SizeEstimate, chart};
use govtwin_diagnosis::watch::cut::Cutter;
use govtwin_diagnosis::watch::history::{self, ProcessEntry};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::frame::Frame;
use govtwin_model::parameters::EffectSetting;
use govtwin_model::recording::Process;
use govtwin_model::units::nanos_from_seconds;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;

/// Processes between two false warnings of one size.
const BETWEEN: f64 = 1000.0;
/// Processes of a month: four a day.
const MONTH: usize = 120;

/// Processes of one machine, half an hour apart, whose extra overlap is as told by hours, m.
fn operation(seed: u64, count: u64, overlap_m: impl Fn(f64) -> f64) -> Vec<Frame> {
    let mut all: Vec<Frame> = vec![];
    for number in 0..count {
        let mut unit = generate::spread(&govtwin_model::params::reference(), seed);
        unit.effects =
            vec![EffectSetting { id: "port_overlap".to_owned(), values: vec![overlap_m(0.5 * number as f64)] }];
        let process = Process::ALL[number as usize % 4];
        // The seed decides the course of a process too; the machine stays the same, as it is drawn above.
        let scenario =
            Scenario { unit, process, rate_hz: 50.0, duration_s: 60.0, rich: false, seed: 1000 * seed + number };
        let frames = generate::recording(&scenario).frames;
        let offset_ns = nanos_from_seconds(1800.0 * number as f64) - frames[0].time_ns;
        all.extend(frames.iter().map(|frame| Frame { time_ns: frame.time_ns + offset_ns, ..*frame }));
    }
    all
}

fn hour(entry: &ProcessEntry) -> f64 {
    entry.time_ns as f64 / 3.6e12
}

/// The history, process by process, as `govtwin watch` enters it.
fn watched(frames: &[Frame]) -> Vec<ProcessEntry> {
    let mut cutter = Cutter::default();
    let mut cuts: Vec<_> = frames.iter().filter_map(|frame| cutter.row(frame)).collect();
    cuts.extend(cutter.end());
    // A few effects alone: what is studied is the course of a size, and each process is diagnosed in seconds.
    let mut settings = DiagnosisSettings::default();
    settings.catalogue.retain(|spec| ["port_overlap", "servo_friction", "supply_loss"].contains(&spec.id));
    let mut entries: Vec<ProcessEntry> = vec![];
    for cut in cuts {
        let (time_ns, process) = (cut.recording.frames[0].time_ns, cut.recording.process);
        let followed = history::followed(&entries);
        let said = diagnose(vec![cut.recording], &govtwin_model::params::reference(), &settings, &|_, _| ());
        let (verdict, sizes) = match &said {
            Ok(said) => (said.verdict.id(), history::sizes(said, &followed)),
            Err(_) => ("not_diagnosed", vec![]),
        };
        entries.push(ProcessEntry {
            schema: history::SCHEMA.to_owned(),
            digest: cut.digest,
            bag: "day".to_owned(),
            synthetic: true,
            origin: None,
            time_ns,
            duration_s: 0.0,
            process: process.id().to_owned(),
            verdict: verdict.to_owned(),
            explained_fraction: None,
            sizes,
            notes: vec![],
            warnings: vec![],
            program: String::new(),
        });
        let courses = history::courses(&entries, BETWEEN);
        let warnings: Vec<String> = courses.iter().filter_map(history::Course::warning).collect();
        let last = entries.last().unwrap();
        let sizes: Vec<String> = last
            .sizes
            .iter()
            .map(|size| format!("{} {:.3e} [{:.3e}, {:.3e}]", size.effect, size.value, size.ci90[0], size.ci90[1]))
            .collect();
        println!(
            "{:5.1} h {:14} {:12} {} {}",
            hour(last),
            last.process,
            last.verdict,
            sizes.join(", "),
            warnings.join("; ")
        );
    }
    entries
}

#[test]
#[ignore = "diagnoses 48 processes: minutes of a free processor"]
fn a_day_with_a_fault_that_grows() {
    let grows = watched(&operation(7, 48, |hour| 2e-4 + 2e-5 * (hour - 8.0).max(0.0)));
    let courses = history::courses(&grows, BETWEEN);
    let overlap =
        courses.iter().find(|course| course.effect == "port_overlap").expect("the fault is named at least once");
    let noticed = overlap.points.iter().position(|point| point.alarm).expect("the growth is noticed");
    let entry = &grows[overlap.entries[noticed]];
    println!("noticed at {:.1} h, size {:.3e} m", hour(entry), overlap.estimates[noticed].size);
    assert!(hour(entry) > 8.0, "not before it begins");
}

/// How often a chart of these estimates in random orders raises an alarm.
fn false_months(estimates: &[SizeEstimate], seed: u64) -> f64 {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut estimates = estimates.to_vec();
    let orders = 1000;
    let alarms = (0..orders)
        .filter(|_| {
            estimates.shuffle(&mut random);
            chart(&estimates, BETWEEN).iter().any(|point| point.alarm)
        })
        .count();
    alarms as f64 / f64::from(orders)
}

#[test]
#[ignore = "diagnoses a month of 120 processes: ten minutes of a free processor"]
fn a_month_without_growth() {
    let still = watched(&operation(8, MONTH as u64, |_| 2e-4));
    for course in history::courses(&still, BETWEEN) {
        let warned = course.points.iter().position(|point| point.alarm);
        let one = course.estimates.iter().map(|one| SizeEstimate { group: 0, ..*one }).collect::<Vec<_>>();
        let once = chart(&one, BETWEEN).iter().position(|point| point.alarm);
        println!(
            "{} {}: {} estimates; warned at {warned:?}, by one chart for all kinds at {once:?}; random orders with a false warning: {:.1} %, by one chart {:.1} %",
            course.effect,
            course.parameter,
            course.estimates.len(),
            100.0 * false_months(&course.estimates, 1),
            100.0 * false_months(&one, 1),
        );
    }
}

/// What scatters about a size where nothing moves, in standard deviations that the interval states.
#[derive(Clone, Copy, Debug)]
enum Scatter {
    /// Normal numbers.
    Normal,
    /// Nine in ten are a tenth as far as the others.
    TwoWidths,
    /// Student's distribution with two degrees of freedom: no variance.
    Student2,
    /// Normal numbers that end at a bound near their middle.
    Bound,
    /// Exponential numbers.
    Skew,
}

/// Estimates of a size of 5 in four groups in turn, which differ in level and scatter, moved by `shift` of a deviation from `moved` on.
fn scattered(scatter: Scatter, seed: u64, count: usize, moved: usize, shift: f64) -> Vec<SizeEstimate> {
    use rand::RngExt as _;
    use rand_distr::{Distribution as _, Exp1, StandardNormal, StudentT};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let student = StudentT::new(2.0).unwrap();
    let of = |i: usize| {
        let group = i % 4;
        let sd = (1.0 + group as f64) * random.random_range(0.5..2.0);
        let normal: f64 = StandardNormal.sample(&mut random);
        let number = match scatter {
            Scatter::Normal => normal,
            Scatter::TwoWidths => normal * if random.random_bool(0.1) { 10.0 } else { 1.0 },
            Scatter::Student2 => student.sample(&mut random),
            Scatter::Bound => normal.max(-0.2),
            Scatter::Skew => {
                let number: f64 = Exp1.sample(&mut random);
                number
            }
        };
        let shift = if i >= moved { shift } else { 0.0 };
        let size = 5.0 + group as f64 + sd * (number + shift);
        SizeEstimate { size, low: size - 1.645 * sd, high: size + 1.645 * sd, group }
    };
    (0..count).map(of).collect()
}

#[test]
#[ignore = "charts 10,000 courses: minutes of a free processor"]
fn false_alarms_and_delays_whatever_the_scatter() {
    use rayon::prelude::{IntoParallelIterator as _, ParallelIterator as _};
    const MONTHS: usize = 600;
    for scatter in [Scatter::Normal, Scatter::TwoWidths, Scatter::Student2, Scatter::Bound, Scatter::Skew] {
        let alarms = |length: usize| {
            let first = |seed: u64| {
                chart(&scattered(scatter, seed, length, length, 0.0), BETWEEN).iter().position(|one| one.alarm)
            };
            (0..MONTHS as u64).into_par_iter().filter_map(first).collect::<Vec<usize>>()
        };
        let long = alarms(4000);
        // Of a course that lasts T on average: alarms over the estimates that were charted until then.
        let charted = |alarms: &[usize], length: usize| alarms.iter().sum::<usize>() + (MONTHS - alarms.len()) * length;
        let month = alarms(MONTH);
        let rate = |alarms: &[usize], length| charted(alarms, length) as f64 / alarms.len().max(1) as f64;
        let delays: Vec<String> = [1.0, 2.0, 3.0]
            .map(|shift| {
                let mut behind: Vec<usize> = (0..MONTHS as u64)
                    .into_par_iter()
                    .map(|seed| {
                        let points = chart(&scattered(scatter, seed, 200, 40, shift), BETWEEN);
                        points[40..].iter().position(|one| one.alarm).map_or(999, |at| at + 1)
                    })
                    .collect();
                behind.sort_unstable();
                behind[MONTHS / 2].to_string()
            })
            .to_vec();
        println!(
            "{scatter:?}: one false alarm in {:.0} estimates; in the first {MONTH} one in {:.0}; a jump by 1, 2, 3 deviations after 40 estimates is seen by the {} th behind it",
            rate(&long, 4000),
            rate(&month, MONTH),
            delays.join(", "),
        );
    }
}
