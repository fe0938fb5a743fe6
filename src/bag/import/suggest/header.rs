//! Ranges in headers as a proposal takes them: the values of a position at its ends, or those of a transmitter's current.

use super::column::SuggestedColumn;
use super::propose::{rounded, stands_half_way};
use crate::import::convert::{plain, pressure, share};
use crate::import::map::SignalMap;
use crate::import::row::Target;
use crate::import::stated_range::{StatedRange, ranges};

/// A current of a transmitter, sound or not, mA; what measures farther hardly stays within.
const CURRENT_MA: std::ops::RangeInclusive<f64> = 3.6..=21.0;

/// Gives a position the range of its header that holds its values, and asks; false where the header states none, a share of the stroke, or several that
/// hold them.
pub(super) fn position(signal: &mut SignalMap, column: &SuggestedColumn, open: &mut Vec<String>) -> bool {
    let stated = ranges(&column.name);
    let holding: Vec<&StatedRange<'_>> = stated.iter().filter(|range| range.holds(column.range.ends())).collect();
    let id = signal.target.id();
    let [least, most] = column.range.ends().map(rounded);
    let [range] = holding[..] else {
        if !stated.is_empty() {
            let all: Vec<String> = stated.iter().map(ToString::to_string).collect();
            let (all, how) = (all.join(" and "), if holding.is_empty() { "outside" } else { "in several" });
            open.push(format!(
                "{id}: its header states {all}, and its values, {least} to {most}, lie {how} of these: say with `unit` and `range` what they are"
            ));
        }
        return false;
    };
    if share(range.unit).is_some() {
        range.unit.clone_into(&mut signal.unit);
        return range.unit != column.unit;
    }
    let one_sided = matches!(signal.target, Target::OpeningCommand | Target::ServomotorPosition);
    let [low, high] = range.ends;
    // Where another range says what the ends mean, neutral is its zero.
    let zero = stated.iter().find(|other| *other != range && other.ends[0] * other.ends[1] < 0.0);
    let neutral = match zero {
        Some(meant) => low + (high - low) * meant.ends[0] / (meant.ends[0] - meant.ends[1]),
        None if low * high < 0.0 => 0.0,
        None if plain(range.unit) == "ma" || stands_half_way(column, high) => f64::midpoint(low, high),
        None => low,
    };
    range.unit.clone_into(&mut signal.unit);
    signal.conversion.range = Some([if one_sided { low } else { neutral }, high]);
    let meant = if one_sided { "closed and open" } else { "at neutral and at full stroke" };
    open.push(format!(
        "{id}: its header states {range}, by which `range` holds the values {meant}; replace them where they are others"
    ));
    true
}

/// What to ask of a pressure whose values may be the current of a transmitter for the range of its header.
pub(super) fn may_be_current(target: Target, column: &SuggestedColumn) -> Option<String> {
    let stated = ranges(&column.name);
    let range = stated.iter().rev().find(|range| pressure(range.unit).is_some())?;
    let [low, high] = range.ends;
    let is_current = column.range.ends().iter().all(|end| CURRENT_MA.contains(end)) && high > 2.0 * CURRENT_MA.end();
    is_current.then(|| {
        format!(
            "{}: its header states {range}, and its values, up to {}, may be the current of a transmitter; if so, give `range: [4, 20], to: [{low}, \
             {high}]`",
            target.id(),
            rounded(column.range.ends()[1])
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::propose::signal;
    use super::*;
    use crate::import::source::channel::ChannelValue;

    #[test]
    fn a_position_takes_the_range_of_its_header_that_holds_its_values() {
        const SPOOL: &str = "Spool 4-20 mA = -10..10 mm";
        for (name, target, values, unit, range, asked) in [
            (
                "Guide vane [0..250 mm]",
                Target::ServomotorPosition,
                [10.0, 180.0],
                "mm",
                Some([0.0, 250.0]),
                "states 0..250 mm",
            ),
            (
                "Guide vane [0..250 mm]",
                Target::ServomotorPosition,
                [10.0, 400.0],
                "mm",
                Some([10.0, 400.0]),
                "lie outside",
            ),
            ("Servo (0-100 %)", Target::ServomotorPosition, [10.0, 60.0], "%", None, ""),
            ("Servo 0-100 % (4-20 mA)", Target::ServomotorPosition, [30.0, 60.0], "%", None, ""),
            (SPOOL, Target::SpoolPosition, [-8.0, 9.0], "mm", Some([0.0, 10.0]), "states -10..10 mm"),
            (SPOOL, Target::SpoolPosition, [4.5, 19.0], "mA", Some([12.0, 20.0]), "states 4..20 mA"),
            (SPOOL, Target::SpoolPosition, [4.5, 9.0], "mm", Some([0.0, 9.0]), "lie in several"),
        ] {
            let mut column = SuggestedColumn::new(name, "");
            for (k, value) in (0..40).map(|k| (k, values[usize::from(k > 20)] + f64::from(k % 3) * 0.01)) {
                column.take(i64::from(k) * 1_000_000_000, ChannelValue::Number(value));
            }
            let mut open = vec![];
            let found = signal(target, &column, false, false, None, &mut open);
            assert_eq!(
                (found.unit.as_str(), found.conversion.range.is_some()),
                (unit, range.is_some()),
                "{name} {open:?}"
            );
            let near = |(found, expected): (f64, f64)| (found - expected).abs() < 0.05;
            let pairs = found.conversion.range.into_iter().flatten().zip(range.into_iter().flatten());
            assert!(pairs.into_iter().all(near), "{name}: {:?}", found.conversion.range);
            assert!(open.join("\n").contains(asked) && open.is_empty() == asked.is_empty(), "{name}: {open:?}");
        }
    }

    #[test]
    fn a_pressure_that_may_be_a_current_is_asked_about() {
        for (values, asked) in [([10.2, 10.4], true), ([62.0, 64.0], false)] {
            let mut column = SuggestedColumn::new("p tank [0..160 bar]", "");
            values.into_iter().for_each(|value| column.take(0, ChannelValue::Number(value)));
            assert_eq!(column.unit, "bar");
            assert_eq!(may_be_current(Target::TankPressure, &column).is_some(), asked, "{values:?}");
        }
    }
}
