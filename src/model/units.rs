//! Constants and conversions: every number that is not a parameter, with its source.

/// Nanoseconds in one second.
pub const NANOS_PER_SECOND: i64 = 1_000_000_000;

/// The usual tick of a twin, that of the small loop, ns.
pub const TICK_NS: i64 = 1_000_000;

/// Pressure drop below which an orifice is taken as laminar, in Pa.
///
/// The square-root law has an infinite slope at zero drop; real orifices turn laminar there
/// (Merritt 1967, *Hydraulic Control Systems*, section 3.2). 10 kPa puts the fastest time constant
/// of the control chamber at about 0.1 ms and is far below every working pressure drop.
pub(crate) const LAMINAR_PRESSURE_DROP_PA: f64 = 1.0e4;

/// Speed below which friction is viscous, in m/s: the core of every friction law here.
///
/// At 0.2 mm/s the servomotor would need most of an hour for its stroke, and the small loop's noise alone
/// moves the spool faster.
pub(crate) const FRICTION_CORE_M_S: f64 = 2.0e-4;

/// Speed at which friction has fallen by 1/e from its value at rest, in m/s.
///
/// Of the order of 1 mm/s for lubricated steel (Armstrong-Hélouvry et al. 1994, table 2).
pub(crate) const STRIBECK_SPEED_M_S: f64 = 2.0e-3;

/// Standard deviations to either side of an interval that holds 90 % of a normal distribution.
pub const NORMAL_90: f64 = 1.645;

/// Seconds as a whole number of nanoseconds, to the nearest.
#[expect(clippy::cast_possible_truncation, reason = "a float-to-integer cast saturates, which is what a time wants")]
pub fn nanos_from_seconds(seconds_s: f64) -> i64 {
    (seconds_s * 1e9).round() as i64
}

/// Nanoseconds as seconds.
pub fn seconds_from_nanos(nanos_ns: i64) -> f64 {
    nanos_ns as f64 * 1e-9
}
