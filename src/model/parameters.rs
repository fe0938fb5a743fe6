//! The plant's parameters as named, dimensioned numbers, and a flat table of them for files and fits.

mod channels;

pub use channels::{ChannelReading, ChannelReadings};

/// One row of the table: the place of a parameter, its unit, and the range that physics allows.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ParameterEntry {
    /// Section and name as parameter files write them, such as `oil.density_kg_m3`.
    pub key: &'static str,
    /// Unit, `1` where there is none.
    pub unit: &'static str,
    /// Smallest value that makes physical sense.
    pub min: f64,
    /// Largest value that makes physical sense.
    pub max: f64,
    /// What it is.
    pub doc: &'static str,
    /// Reads it.
    pub get: fn(&Parameters) -> f64,
    /// Writes it, unchecked.
    pub set: fn(&mut Parameters, f64),
}

macro_rules! parameters {
    ($( $(#[doc = $sdoc:literal])* $section:ident: $Section:ident {
        $( $(#[doc = $doc:literal])* $field:ident [$unit:literal] $min:literal ..= $max:literal ),* $(,)?
    })*) => {
        $( $(#[doc = $sdoc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct $Section { $( $(#[doc = $doc])* pub $field: f64, )* } )*

        /// All parameters of the plant, by section. SI units, gauge pressures.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct Parameters { $( $(#[doc = $sdoc])* pub $section: $Section, )* }

        /// Every parameter, in the order of the data sheet.
        pub const ENTRIES: &[ParameterEntry] = &[ $( $( ParameterEntry {
            key: concat!(stringify!($section), ".", stringify!($field)),
            unit: $unit, min: $min, max: $max,
            doc: concat!($($doc),*),
            get: |p| p.$section.$field,
            set: |p, value| p.$section.$field = value,
        }, )* )* ];
    };
}

parameters! {
    /// The discrete regulator with its two loops.
    regulator: Regulator {
        /// Gain of the large loop `K1`: pu of spool per pu of servomotor error.
        position_gain ["1"] 0.1 ..= 500.0,
        /// Gain of the small loop `K2`: pu of valve current per pu of spool error.
        spool_gain ["1"] 0.1 ..= 200.0,
        /// Upper edge of the dead band `Z_u` on the servomotor error.
        deadband_upper_pu ["pu"] 0.0 ..= 0.1,
        /// Lower edge of the dead band `Z_l` on the servomotor error.
        deadband_lower_pu ["pu"] -0.1 ..= 0.0,
        /// Compensation `C_p` that jumps the spool over the port overlap when opening.
        compensation_positive_pu ["pu"] 0.0 ..= 0.2,
        /// Compensation `C_n` that jumps the spool over the port overlap when closing.
        compensation_negative_pu ["pu"] -0.2 ..= 0.0,
        /// Least spool demand.
        spool_command_min_pu ["pu"] -2.0 ..= 0.0,
        /// Greatest spool demand.
        spool_command_max_pu ["pu"] 0.0 ..= 2.0,
        /// Position reference `y_r` of the spool.
        spool_reference_pu ["pu"] -0.5 ..= 0.5,
        /// Current reference `I_r` of the proportional valve.
        current_reference_pu ["pu"] -0.5 ..= 0.5,
        /// Period of the large loop.
        large_loop_period_s ["s"] 0.0001 ..= 1.0,
        /// Period of the small loop.
        small_loop_period_s ["s"] 0.0001 ..= 0.1,
    }
    /// The oil and its supply.
    oil: Oil {
        /// Density.
        density_kg_m3 ["kg/m3"] 500.0 ..= 1500.0,
        /// Effective bulk modulus.
        bulk_modulus_pa ["Pa"] 1.0e8 ..= 3.0e9,
        /// Nominal pressure of the tank; recordings measure it.
        tank_pressure_pa ["Pa"] 5.0e5 ..= 5.0e7,
        /// Pressure of the return line.
        return_pressure_pa ["Pa"] 0.0 ..= 5.0e6,
    }
    /// The proportional (pilot) valve.
    proportional_valve: ProportionalValve {
        /// Natural frequency of the spool's position loop.
        natural_frequency_rad_s ["rad/s"] 5.0 ..= 5000.0,
        /// Damping ratio of the spool's position loop.
        damping_ratio ["1"] 0.05 ..= 5.0,
        /// Stroke per current `K`.
        gain_pu ["1"] 0.1 ..= 10.0,
        /// Rated flow over one edge at full stroke `Q_n`.
        rated_flow_m3_s ["m3/s"] 1.0e-6 ..= 0.1,
        /// Pressure drop over one edge at the rated flow.
        rated_pressure_drop_pa ["Pa"] 1.0e5 ..= 2.0e7,
    }
    /// The emergency shutdown valve.
    esv: Esv {
        /// Area of the drain `A_e`.
        drain_area_m2 ["m2"] 1.0e-7 ..= 1.0e-2,
        /// Discharge coefficient `C_d`, of the drain and of the main ports.
        discharge_coefficient ["1"] 0.3 ..= 1.0,
    }
    /// The main distributing valve's spool and its control chamber.
    distributing_valve: DistributingValve {
        /// Moving mass `m`.
        spool_mass_kg ["kg"] 0.1 ..= 1000.0,
        /// Viscous damping `B`.
        viscous_damping_n_s_m ["N s/m"] 0.0 ..= 1.0e6,
        /// Area of the control chamber `A_ctrl`.
        control_area_m2 ["m2"] 1.0e-5 ..= 1.0,
        /// Area of the constant-pressure chamber `A_cons`.
        constant_pressure_area_m2 ["m2"] 1.0e-5 ..= 1.0,
        /// Stiffness of the centring spring `k`.
        spring_stiffness_n_m ["N/m"] 0.0 ..= 1.0e8,
        /// Pre-compression of the centring spring `delta_0`.
        spring_precompression_m ["m"] 0.0 ..= 1.0,
        /// Leakage coefficient of the control chamber `C_l`.
        leakage_m3_s_pa ["m3/(s Pa)"] 0.0 ..= 1.0e-9,
        /// Volume of the control chamber and its line at neutral `V_0`.
        control_volume_m3 ["m3"] 1.0e-6 ..= 1.0,
        /// Stroke that counts as 1 pu of spool position.
        reference_stroke_m ["m"] 1.0e-4 ..= 1.0,
        /// Stop on the closing side.
        stroke_min_m ["m"] -1.0 ..= 0.0,
        /// Stop on the opening side.
        stroke_max_m ["m"] 0.0 ..= 1.0,
        /// Yield of the stops under force; 0 where they are taken as rigid.
        stop_compliance_m_n ["m/N"] 0.0 ..= 1.0e-6,
        /// Gravity along the spool, + towards opening.
        gravity_m_s2 ["m/s2"] -10.0 ..= 10.0,
    }
    /// The main ports between spool and servomotor.
    main_ports: MainPorts {
        /// Width of the rectangular window, per edge.
        width_m ["m"] 1.0e-5 ..= 5.0,
        /// Overlap `h_0`, each side of neutral.
        overlap_m ["m"] 0.0 ..= 0.01,
    }
    /// The guide-vane servomotor and its load.
    servomotor: Servomotor {
        /// Piston area on the opening side.
        opening_area_m2 ["m2"] 1.0e-4 ..= 20.0,
        /// Piston area on the closing side.
        closing_area_m2 ["m2"] 1.0e-4 ..= 20.0,
        /// Full stroke `S`.
        stroke_m ["m"] 0.01 ..= 5.0,
        /// Dead volume, each side.
        dead_volume_m3 ["m3"] 1.0e-6 ..= 10.0,
        /// Guide-vane ring and piston, referred to the piston.
        moving_mass_kg ["kg"] 1.0 ..= 1.0e10,
        /// Viscous damping.
        viscous_damping_n_s_m ["N s/m"] 0.0 ..= 1.0e10,
        /// Coulomb friction.
        coulomb_friction_n ["N"] 0.0 ..= 1.0e7,
        /// Guide-vane load towards closing at Y = 0.
        load_closed_n ["N"] -1.0e8 ..= 1.0e8,
        /// Load added at Y = 1, linear in between.
        load_slope_n ["N"] -1.0e8 ..= 1.0e8,
        /// Yield of the end stops under force; 0 where they are taken as rigid.
        stop_compliance_m_n ["m/N"] 0.0 ..= 1.0e-6,
    }
}

/// The entry with this key.
pub fn entry(key: &str) -> Option<&'static ParameterEntry> {
    ENTRIES.iter().find(|entry| entry.key == key)
}

/// How much one unit of a type differs from the next: the prior of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Standard deviation as a share of the value.
    Relative(f64),
    /// Standard deviation in the parameter's unit.
    Absolute(f64),
    /// Standard deviation of the natural logarithm.
    LogNormal(f64),
}

/// White noise and quantisation of one transducer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensor {
    /// One standard deviation, in the signal's unit.
    pub noise: f64,
    /// Least step, in the signal's unit.
    pub step: f64,
}

/// One transducer of [`Sensors`], for files and tables.
pub struct SensorEntry {
    /// Name of the signal, with its unit suffix.
    pub name: &'static str,
    /// Unit of noise and step.
    pub unit: &'static str,
    /// Largest noise or step that makes sense.
    pub max: f64,
    /// Reads it.
    pub get: fn(&Sensors) -> Sensor,
    /// Writes it, unchecked.
    pub set: fn(&mut Sensors, Sensor),
}

macro_rules! sensors {
    ($($(#[$doc:meta])* $field:ident [$unit:literal] $max:literal,)*) => {
        /// The transducers of the servo system.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct Sensors {
            $($(#[$doc])* pub $field: Sensor,)*
        }

        /// Every transducer, in order.
        pub const SENSOR_ENTRIES: &[SensorEntry] = &[$(SensorEntry {
            name: stringify!($field),
            unit: $unit,
            max: $max,
            get: |sensors| sensors.$field,
            set: |sensors, sensor| sensors.$field = sensor,
        }),*];
    };
}

sensors! {
    /// Spool position, pu.
    spool_position_pu ["pu"] 0.2,
    /// Servomotor position, pu.
    servomotor_position_pu ["pu"] 0.2,
    /// Pilot-valve position, pu.
    pilot_valve_position_pu ["pu"] 0.2,
    /// Tank pressure, Pa.
    tank_pressure_pa ["Pa"] 1.0e6,
    /// Control-chamber pressure, Pa.
    control_pressure_pa ["Pa"] 1.0e6,
}

/// An effect switched on, with its parameters in the order of its specification.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectSetting {
    /// The effect's id in the catalogue.
    pub id: String,
    /// Its parameters, in the order and the units of its specification. Those that are left out at the end are neutral, and further
    /// ones are ignored, so that a setting cannot be too short; [`Unit::with_effect`] sets them by their names.
    pub values: Vec<f64>,
}

/// A term with an expression in the state: an effect that a unit's owner adds to the catalogue.
///
/// [`Unit::with_own_effect`] checks it; `docs/own_effect.md` lists points, names and functions, and `examples/own_effect.rs` holds a whole one.
///
/// ```
/// use govtwin_model::parameters::{OwnEffect, OwnParameter};
///
/// let leak = OwnEffect {
///     id: "drain_leak".to_owned(),
///     doc: "A leak of the control chamber to the drain".to_owned(),
///     at: "chamber_flow_m3_s".to_owned(),
///     stage: String::new(),
///     expression: "-a*control_pressure_pa".to_owned(),
///     parameters: vec![OwnParameter {
///         name: "a".to_owned(),
///         unit: "m3/(s Pa)".to_owned(),
///         neutral: 0.0,
///         min: 0.0,
///         max: 2.0e-10,
///         typical: 5.0e-12,
///         doc: "leakage coefficient".to_owned(),
///     }],
/// };
/// let unit = govtwin_model::params::reference().with_own_effect(leak)?.with_effect("drain_leak", &[("a", 5.0e-12)])?;
/// assert_eq!(unit.effects[0].values, [5.0e-12]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct OwnEffect {
    /// Its id, unlike all of the catalogue's.
    pub id: String,
    /// What it is, in a sentence.
    pub doc: String,
    /// Id of the point of the chain to whose signal it adds.
    pub at: String,
    /// Id of the stage in which it sits; empty for the stage of its point.
    pub stage: String,
    /// What it adds, in the unit of its point.
    pub expression: String,
    /// Its parameters.
    pub parameters: Vec<OwnParameter>,
}

/// One parameter of an [`OwnEffect`].
#[derive(Clone, Debug, PartialEq)]
pub struct OwnParameter {
    /// Name in files and in the expression.
    pub name: String,
    /// Unit, `1` where there is none.
    pub unit: String,
    /// Value at which the effect vanishes exactly, in the parameter's unit.
    pub neutral: f64,
    /// Smallest value that makes physical sense, in the parameter's unit.
    pub min: f64,
    /// Largest value that makes physical sense, in the parameter's unit.
    pub max: f64,
    /// Value of a moderate fault, in the parameter's unit.
    pub typical: f64,
    /// What it is.
    pub doc: String,
}

/// A unit: its data sheet, and what its owner added to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Values of all parameters.
    pub parameters: Parameters,
    /// Tolerances, one for each of [`ENTRIES`]; `None` where the sheet gives none.
    pub tolerances: Vec<Option<Tolerance>>,
    /// Transducers.
    pub sensors: Sensors,
    /// Effects beyond the nominal model.
    pub effects: Vec<EffectSetting>,
    /// Effects of the owner's, beside those of the catalogue; [`Unit::effects`] switches them on.
    pub own_effects: Vec<OwnEffect>,
    /// How its positions are recorded, where not in pu.
    pub recorded: ChannelReadings,
}
