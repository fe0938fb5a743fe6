//! Stamps of the command and of the ESV that are not of one clock: a shift of one of them looks like a fault of the other.

use crate::decision::Decision;
use crate::hypotheses::Explored;
use crate::summary::claimed;
use crate::words::WRONG_DATA;

/// The inputs, each with the delay that takes it back to its time where the clocks are off.
const INPUTS: [(&str, &str); 2] = [("command", "command_delay"), ("ESV", "esv_delay")];

/// An input is in time within this share of the offset of the clocks and this time, s. An ESV that may be up to 3 s late is so by chance in one unit of
/// thirty.
const IN_TIME: (f64, f64) = (0.1, 0.02);

/// Says in a sentence that one of the two inputs is stamped late, where that explains what is named: clocks that are off, and a delay by which the other
/// input is in time.
pub fn late_stamps(explored: &Explored, decision: &Decision) -> Option<String> {
    let effects = claimed(explored, decision).unit().effects;
    let blamed = effects.iter().filter(|effect| decision.blamed.contains(&effect.id.as_str()));
    let size = |id: &str| blamed.clone().find(|effect| effect.id == id)?.values.first().copied();
    let offset_s = size("clock_offset").filter(|offset_s| *offset_s > 0.0)?;
    let in_time_s = IN_TIME.0 * offset_s + IN_TIME.1;
    let [command, esv] = INPUTS.map(|(name, delay)| (name, offset_s - size(delay).unwrap_or(0.0)));
    let is_late = |(late, other): &((&str, f64), (&str, f64))| late.1 > in_time_s && other.1.abs() <= in_time_s;
    let ((late, late_s), (on_time, _)) = [(command, esv), (esv, command)].into_iter().find(is_late)?;
    Some(format!(
        "The {late} is stamped {:.0} ms late, and the {on_time} is not: the plant answers the {late} before it is recorded. {WRONG_DATA} \
         Record both by one clock; if the {late} arrived in time, `--stamp log` reads it when it was recorded.",
        late_s * 1e3
    ))
}
