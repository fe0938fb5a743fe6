//! How positions are recorded: scale, zero and sign of a unit's channels, and its clock.

/// How one channel is read: `pu = recorded × scale + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelReading {
    /// Pu for each unit of what is recorded; below 0 where the channel is turned round.
    pub scale_pu: f64,
    /// Position where 0 is recorded, pu.
    pub offset_pu: f64,
}

impl Default for ChannelReading {
    /// Recorded in pu.
    fn default() -> Self {
        Self { scale_pu: 1.0, offset_pu: 0.0 }
    }
}

impl ChannelReading {
    /// A channel that reads 0 pu at one recorded value and 1 pu at another.
    pub fn between(zero: f64, one: f64) -> Self {
        let scale_pu = 1.0 / (one - zero);
        Self { scale_pu, offset_pu: -zero * scale_pu }
    }

    /// What a recorded value means, pu.
    pub fn position_pu(&self, recorded: f64) -> f64 {
        recorded * self.scale_pu + self.offset_pu
    }

    /// What is recorded at a position.
    pub fn recorded(&self, position_pu: f64) -> f64 {
        (position_pu - self.offset_pu) / self.scale_pu
    }
}

/// What a unit may have recorded in units of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelReadings {
    /// The spool's position.
    pub spool_position: ChannelReading,
    /// The servomotor's position.
    pub servomotor_position: ChannelReading,
    /// Seconds of the unit for each second recorded: a stage of unknown size is one of a usual speed on a clock of its own.
    pub clock_ratio: f64,
}

impl Default for ChannelReadings {
    /// Recorded in pu and seconds.
    fn default() -> Self {
        Self {
            spool_position: ChannelReading::default(),
            servomotor_position: ChannelReading::default(),
            clock_ratio: 1.0,
        }
    }
}

impl ChannelReadings {
    /// What 1 of the unit is by the clock of the recordings: seconds are theirs, all else is the unit's.
    #[must_use]
    pub fn of_unit(&self, unit: &str) -> f64 {
        if unit == "s" { 1.0 / self.clock_ratio } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_goes_there_and_back() {
        let volts = ChannelReading::between(5.0, -3.0);
        assert_eq!((volts.position_pu(5.0), volts.position_pu(-3.0)), (0.0, 1.0));
        assert!((volts.recorded(volts.position_pu(1.7)) - 1.7).abs() < 1e-12);
    }
}
