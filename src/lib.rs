//! A digital twin of a hydro-turbine governor's servo system: step it in a loop, replay recordings through it, and find out why a
//! real unit differs from it.
//!
//! A [`Unit`] is a data sheet: parameters, tolerances, transducers and effects beyond the nominal model. [`Twin::new`] builds the simulated
//! servo system of a unit, [`Twin::step`] takes it from [`Frame`] to [`Frame`]. A [`Recording`] is frames in time order; [`replay()`] compares
//! it with the twin, and [`diagnose()`] weighs the [catalogue of effects](CATALOGUE) against all recordings of a unit.
//!
//! ```
//! use govtwin::{EsvState, Frame, Inputs, Recording, Signal, Signals, Twin, reference_unit, replay};
//!
//! // The unit that the program ships, with play of 0.2 % of the stroke between piston and transducer.
//! let unit = reference_unit();
//! let worn = unit.clone().with_effect("backlash", &[("play_pu", 0.002)])?;
//!
//! // 20 s at 100 Hz: the opening command rises from 40 % to 50 %, and the twin of the worn unit answers.
//! let mut twin = Twin::new(&worn);
//! let mut frames: Vec<Frame> = (0..2000)
//!     .map(|row| {
//!         let opening_command_pu = if row < 200 { 0.40 } else { 0.50 };
//!         let inputs = Inputs { opening_command_pu, esv: EsvState::Normal, tank_pressure_pa: 6.0e6, piston_force_n: 0.0 };
//!         Frame { time_ns: row * 10_000_000, inputs, measured: Signals::NONE }
//!     })
//!     .collect();
//! for frame in &mut frames {
//!     frame.measured = twin.step(frame).signals;
//! }
//! assert!((frames[1999].measured.servomotor_position_pu - 0.50).abs() < 0.01);
//!
//! // The same rows through the twin of the data sheet: how far apart are the two?
//! let replayed = replay(&unit, Recording::new("step", frames));
//! let servomotor = replayed.scores.figures(Signal::ServomotorPosition);
//! assert!(servomotor.mae > 1e-5 && servomotor.mae < 2e-3, "MAE {} pu", servomotor.mae);
//! # Ok::<(), govtwin::EffectError>(())
//! ```
//!
//! The folder `examples/` replays a bag, steps a twin in a loop, adds an effect of one's own and diagnoses a unit.
//!
//! # Units, signs, time
//! Positions are in pu of stroke (1 is fully open), pressures in Pa gauge, all else in SI units; a name ends in its unit. What is
//! not measured is NaN. Times are nanoseconds since an epoch that all rows of a recording share. Nothing here reads a clock, prints, or keeps
//! state between calls: the same arguments give the same result to the last bit, whatever the number of threads.
//!
//! # What is stable
//! The items on this page are the library: they change only with a version whose number shows it. The modules below it are public because the program
//! `govtwin`, which is a crate of its own, is made of them; they are hidden from this page and may change with any version. So may fields
//! and variants that this page does not show: enums and results are `#[non_exhaustive]`.
//!
//! # Cargo features
//! A library wants `default-features = false`: no command line, no ROS 2, no laboratory.
//!
//! | feature | default | what it adds |
//! |---|---|---|
//! | `cli` | yes | the program `govtwin`; takes `lab` along |
//! | `lab` | through `cli` | benchmark units with known faults, baselines, the scorer, the comparison of models |
//! | `node` | yes | the twin as a ROS 2 node (Linux) |
//! | `jazzy`, `humble` | `jazzy` | what the node's identity is on the wire; exclusive by nature: where both are on, `jazzy` wins |
//! | `sqlite` | no | bags in rosbag2's sqlite3 storage |
//! | `parquet` | no | tables in Parquet |
//! | `residual` | no | training of learned residuals; LightGBM, compiled from C++ |
//! | `deep` | no | LSTM and TCN beside the trees |
//!
//! All but `jazzy` and `humble` are additive.

#[cfg(all(feature = "node", not(any(feature = "jazzy", feature = "humble"))))]
compile_error!(
    "the feature `node` needs `jazzy` (ROS 2 Iron and later) or `humble`: the node's identity on the wire differs between them"
);

// A unit, and the data sheet that describes it.
pub use govtwin_model::effects::on_unit::EffectError;
pub use govtwin_model::effects::own::OwnError;
pub use govtwin_model::effects::{CATALOGUE, EffectParameter, EffectSpec, Stage};
pub use govtwin_model::parameters::{
    ChannelReading, ChannelReadings, EffectSetting, OwnEffect, OwnParameter, Parameters, Sensor, Sensors, Tolerance,
    Unit,
};
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("unit.yaml");
/// std::fs::write(&path, "oil: {density_kg_m3: {value: 865.0, unit: kg/m3}}\neffects: {backlash: {play_pu: 0.002}}\n")?;
/// let unit = govtwin::load_unit(&path)?;
/// assert_eq!(unit.parameters.oil.density_kg_m3, 865.0);
/// assert_eq!(unit.effects[0].values, [0.002]);
///
/// std::fs::write(&path, "oil: {densty_kg_m3: 865.0}\n")?;
/// assert!(govtwin::load_unit(&path).unwrap_err().to_string().contains("did you mean"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub use govtwin_model::params::load as load_unit;
pub use govtwin_model::params::{FileProblem, Overlay, ParamsError, reference as reference_unit, write as write_unit};

// The row that flows, and recordings of it.
/// ```
/// use govtwin::{Process, ReadOptions, read_bag};
///
/// // As all that is shipped below `bags/`, this was made by a simulator: `bags/ORIGIN.txt` names it.
/// let loaded = read_bag("bags/reference/shutdown_01.mcap".as_ref(), &ReadOptions::default())?;
/// assert_eq!(loaded.recording.process, Process::Shutdown);
/// assert!(loaded.health.is_clean());
///
/// let error = read_bag("bags/nowhere".as_ref(), &ReadOptions::default()).unwrap_err();
/// assert!(error.to_string().contains("bags/nowhere"));
/// # Ok::<(), govtwin::BagError>(())
/// ```
pub use govtwin_bag::read as read_bag;
pub use govtwin_bag::{BagError, Health, Interpolation, Loaded, Positions, ReadOptions, Stream, Topics};
pub use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
pub use govtwin_model::recording::{Process, Recording};
pub use govtwin_model::signal::Signal;

// The twin, and how far it is from what was measured.
pub use govtwin_model::metrics::Figures;
/// ```
/// use govtwin::{ReadOptions, Signal, read_bag, reference_unit, replay};
///
/// let loaded = read_bag("bags/reference/load_increase_01.mcap".as_ref(), &ReadOptions::default())?; // synthetic
/// let replayed = replay(&reference_unit(), loaded.recording);
/// assert_eq!(replayed.estimates.len(), replayed.recording.frames.len());
/// assert!(replayed.scores.figures(Signal::ServomotorPosition).r2 > 0.99);
/// # Ok::<(), govtwin::BagError>(())
/// ```
pub use govtwin_model::replay::replay;
pub use govtwin_model::replay::{Replayed, Scores};
pub use govtwin_model::solver::Method;
pub use govtwin_model::twin::{Cut, Twin};

// Why a unit differs from its twin.
/// ```no_run
/// use govtwin::{DiagnosisSettings, ReadOptions, Verdict, diagnose, diagnosis_text, read_bag, reference_unit};
///
/// let bags = ["startup.mcap", "load_increase.mcap", "load_rejection.mcap"];
/// let read = |bag: &&str| read_bag(bag.as_ref(), &ReadOptions::default()).map(|loaded| loaded.recording);
/// let recordings = bags.iter().map(read).collect::<Result<_, _>>()?;
/// let diagnosis = diagnose(recordings, &reference_unit(), &DiagnosisSettings::default(), &|_, _| ())?;
/// if diagnosis.verdict == Verdict::Named {
///     let ids: Vec<&str> = diagnosis.blamed.iter().map(|effect| effect.id.as_str()).collect();
///     println!("{} explains {:.0} % of the gap", ids.join(" and "), 100.0 * diagnosis.explained_fraction.value);
/// }
/// println!("{}", diagnosis_text(&diagnosis, 100));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub use govtwin_diagnosis::diagnose;
pub use govtwin_diagnosis::result::schema::DiagnosisReport;
pub use govtwin_diagnosis::result::{
    Blame, Diagnosis, Experiment, Fitted, Interval, Ranked, Setup, SignalGap, Verdict,
};
pub use govtwin_diagnosis::{DiagnosisError, DiagnosisSettings};
pub use govtwin_model::provenance::Provenance;
pub use govtwin_pages::diagnosis::{page as diagnosis_page, summary as diagnosis_text};
pub use govtwin_pages::page::Page;

/// The sections of a data sheet, and the table of all its parameters.
///
/// ```
/// use govtwin::sections::ENTRIES;
///
/// let unit = govtwin::reference_unit();
/// let density = ENTRIES.iter().find(|entry| entry.key == "oil.density_kg_m3").expect("oil has a density");
/// assert_eq!((density.get)(&unit.parameters), unit.parameters.oil.density_kg_m3);
/// assert_eq!(density.unit, "kg/m3");
/// ```
pub mod sections {
    pub use govtwin_model::parameters::{
        DistributingValve, ENTRIES, Esv, MainPorts, Oil, ParameterEntry, ProportionalValve, Regulator, Servomotor,
        entry,
    };
}
