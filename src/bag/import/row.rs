//! One row of an import: whatever signals have a value at one time.

use govtwin_model::frame::EsvState;

/// What a column or field can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Target {
    /// Guide-vane opening that is asked for, pu.
    OpeningCommand,
    /// Emergency shutdown valve.
    Esv,
    /// Oil pressure of the tank, Pa gauge.
    TankPressure,
    /// Position of the main distributing valve's spool, pu.
    SpoolPosition,
    /// Servomotor position, pu.
    ServomotorPosition,
    /// Position of the proportional valve, pu.
    PilotValvePosition,
    /// Pressure of the control chamber, Pa gauge.
    ControlPressure,
}

impl Target {
    /// All, along the chain.
    pub const ALL: [Self; 7] = [
        Self::OpeningCommand,
        Self::Esv,
        Self::TankPressure,
        Self::SpoolPosition,
        Self::ServomotorPosition,
        Self::PilotValvePosition,
        Self::ControlPressure,
    ];

    /// Its key in maps.
    pub fn id(self) -> &'static str {
        match self {
            Self::OpeningCommand => "opening_command",
            Self::Esv => "esv",
            Self::TankPressure => "tank_pressure",
            Self::SpoolPosition => "spool_position",
            Self::ServomotorPosition => "servomotor_position",
            Self::PilotValvePosition => "pilot_valve_position",
            Self::ControlPressure => "control_pressure",
        }
    }

    /// Its name in words.
    pub fn title(self) -> &'static str {
        match self {
            Self::OpeningCommand => "Opening command",
            Self::Esv => "Emergency shutdown valve",
            Self::TankPressure => "Tank pressure",
            Self::SpoolPosition => "Spool position",
            Self::ServomotorPosition => "Servomotor position",
            Self::PilotValvePosition => "Pilot-valve position",
            Self::ControlPressure => "Control pressure",
        }
    }

    /// Its unit after the import; none of the ESV.
    pub fn unit(self) -> &'static str {
        match self {
            Self::TankPressure | Self::ControlPressure => "Pa",
            Self::Esv => "",
            _ => "pu",
        }
    }

    /// Whether it is a pressure.
    pub fn is_pressure(self) -> bool {
        self.unit() == "Pa"
    }

    /// Its place in a row.
    pub fn place(self) -> usize {
        self as usize
    }
}

/// What is known at one time; NaN where a signal has no value then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportedRow {
    /// The time, ns since 1970, UTC.
    pub time_ns: i64,
    /// Values by [`Target::place`], in their units after the import; of the ESV 1 is normal and 0 is shutdown.
    pub values: [f64; Target::ALL.len()],
}

impl ImportedRow {
    /// A row without values.
    pub fn at(time_ns: i64) -> Self {
        Self { time_ns, values: [f64::NAN; Target::ALL.len()] }
    }

    /// The value of a signal, in its unit; none where it has none.
    pub fn value(&self, target: Target) -> Option<f64> {
        self.values.get(target.place()).copied().filter(|value| !value.is_nan())
    }

    /// The state of the ESV, where the row has it.
    pub fn esv(&self) -> Option<EsvState> {
        let state = |value: f64| if value == 0.0 { EsvState::Shutdown } else { EsvState::Normal };
        self.value(Target::Esv).map(state)
    }

    /// Sets the value of a signal, in its unit.
    pub fn set(&mut self, target: Target, value: f64) {
        self.values[target.place()] = value;
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.values.iter().all(|value| value.is_nan())
    }

    /// Takes the values of another row of the same time, if none of them is there already.
    pub(super) fn merge(&mut self, other: &Self) -> bool {
        let both = self.values.iter().zip(&other.values).any(|(mine, new)| !mine.is_nan() && !new.is_nan());
        let fits = self.time_ns == other.time_ns && !both;
        if fits {
            for (mine, new) in self.values.iter_mut().zip(&other.values).filter(|(_, new)| !new.is_nan()) {
                *mine = *new;
            }
        }
        fits
    }
}
