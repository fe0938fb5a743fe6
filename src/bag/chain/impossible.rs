//! What cannot be of one machine, and how it is reported.

use super::TURNED;
use super::copies::Filter;
use super::lines::Drawn;
use super::rests::may_be_gain;
use crate::Severity;
use govtwin_model::signal::Signal;

/// What a rest elsewhere than its command may be, beside a channel that is another's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Meant {
    Nothing,
    /// The servomotor goes so many times its command all along.
    Scaled,
    /// The spool stands open, and something holds the servomotor.
    Held {
        spool_pu: f64,
    },
}

/// What cannot be of one machine, with figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Impossible {
    /// Position and command are the same: root mean square apart in so many samples while the command moved, pu, and how many of all are equal to the
    /// last bit.
    Copy { apart_pu: f64, moving: u64, equal: u64, all: u64 },
    /// The position is the command of so long before, s, or the command the position: so many of its changes are equal to the last bit.
    LateCopy { of_position: bool, lag_s: f64, equal: u64, changes: u64 },
    /// The position is the command of so long before, s, or its mean over that, but for noise: root mean square apart in so many samples while that moved, pu.
    Filtered { filter: Filter, over_s: f64, apart_pu: f64, moving: u64 },
    /// A signal lies on straight lines: it was drawn between fewer points.
    Drawn { signal: Signal, drawn: Drawn },
    /// The position jumps from one sample to the next, first by so much, pu, within so long, s, at a time, ns, and so many times.
    Jumps { by_pu: f64, step_s: f64, time_ns: i64, count: u64 },
    /// The servomotor moves away from its command, pu, and so far towards it; whether a governor or its oil may do so.
    Away { away_pu: f64, towards_pu: f64, may_be: bool },
    /// The same, while spool and servomotor go together: the response comes before the command, by so much, s.
    Leads { away_pu: f64, towards_pu: f64, lead_s: f64 },
    /// It opens while tripped, pu, or stands open: position, pu, at a time, ns, so long after the trip, s.
    OpensTripped { by_pu: f64, time_ns: i64 },
    /// It stands open while tripped.
    StandsTripped { position_pu: f64, time_ns: i64, duration_s: f64 },
    /// The spool is fully closing while nothing asks for it and the ESV is said to be normal: from and to which position, pu, the greatest distance to the
    /// command, pu, where the spool is, pu, since when, ns, and for how long, s; whether it was elsewhere before.
    TripsUnsaid {
        from_pu: f64,
        to_pu: f64,
        error_pu: f64,
        spool_pu: f64,
        time_ns: i64,
        duration_s: f64,
        regulated: bool,
    },
    /// Spool or servomotor moves before its command leaves a rest: by so much, s, and pu, at a time, ns, in so many of all such places.
    Precedes { signal: Signal, lead_s: f64, moved_pu: f64, time_ns: i64, onsets: u64, leads: u64 },
    /// All rests are at so many times their commands, which lie between two, pu; what is left, pu.
    Scaled { ratio: f64, least_pu: f64, most_pu: f64, left_pu: f64 },
    /// At rest with an open spool: its mean, pu.
    RestsOpen { spool_pu: f64 },
    /// At rest away from its command.
    RestsElsewhere { position_pu: f64, command_pu: f64, time_ns: i64, duration_s: f64, meant: Meant },
    /// The values are held and jump: signal, jumps, share of the travel.
    Held { signal: Signal, jumps: u64, share: f64, held_s: f64 },
    /// Speed and spool have nothing to do with each other, or go against each other.
    Unrelated { correlation: f64 },
    /// The servomotor's speed goes with the spool of so much later, s, better than with that of its own time.
    SpoolLate { by_s: f64, ahead: f64, correlation: f64 },
    /// And with that of so much earlier, s.
    ServomotorLate { by_s: f64, late: f64, correlation: f64 },
    /// The servomotor is faster than any.
    TooFast { pu_s: f64, time_ns: i64 },
    /// The servomotor runs through its process in no time, s.
    TooShort { duration_s: f64 },
    /// Samples lie too far apart to show a process.
    TooSlow { apart_s: f64 },
}

impl Impossible {
    /// Whether nothing is concluded from the recording, or only said that it may be the data: also machines do what is warned of.
    pub(crate) fn severity(&self) -> Severity {
        match self {
            // A slow logger may be all that there is, and a diagnosis finds the offset of the clocks.
            Self::TooSlow { .. }
            | Self::TooShort { .. }
            | Self::Held { .. }
            | Self::Leads { .. }
            | Self::Jumps { .. }
            | Self::SpoolLate { .. }
            | Self::ServomotorLate { .. }
            | Self::Precedes { .. }
            | Self::Drawn { drawn: Drawn { may_follow: true, .. }, .. }
            | Self::Away { may_be: true, .. }
            | Self::TripsUnsaid { regulated: false, .. }
            | Self::RestsElsewhere { meant: Meant::Scaled | Meant::Held { .. }, .. } => Severity::Warning,
            Self::Scaled { ratio, .. } if may_be_gain(*ratio) => Severity::Warning,
            _ => Severity::Disqualified,
        }
    }

    /// In words, with the way out.
    pub(crate) fn words(&self) -> String {
        match *self {
            Self::Copy { apart_pu, moving, equal, all } => format!(
                "the servomotor position is the command: {equal} of {all} samples are the same to the last bit, and in {moving} while it moves \
                 nothing but noise of {:.2} % is between the two; one of the two channels is wired to the other",
                apart_pu * 100.0
            ),
            Self::LateCopy { of_position, lag_s, equal, changes } => late_copy(of_position, lag_s, equal, changes),
            Self::Filtered { filter, over_s, apart_pu, moving } => filtered((filter, over_s), apart_pu, moving),
            Self::Drawn { signal, drawn } => on_lines(signal, drawn),
            Self::Jumps { by_pu, step_s, time_ns, count } => format!(
                "the servomotor position jumps by {} within {step_s:.3} s and stays there (at {time_ns} ns, {count} times in all), and nothing that oil \
                 moves does: values were held or put in the place of others",
                percent(by_pu)
            ),
            Self::Away { away_pu, towards_pu, may_be } => away(away_pu, towards_pu, may_be),
            Self::Leads { away_pu, towards_pu, lead_s } => format!(
                "the servomotor moves before its command does, by some {lead_s:.2} s, {} of the stroke in all against {} behind it: the stamps of command and measured \
                 state are of two clocks",
                percent(away_pu),
                percent(towards_pu)
            ),
            Self::OpensTripped { by_pu, time_ns } => format!(
                "the servomotor opens by {} while the ESV says shutdown (at {time_ns} ns): is the meaning of the ESV the wrong way round?",
                percent(by_pu)
            ),
            Self::StandsTripped { position_pu, time_ns, duration_s } => format!(
                "the servomotor stands at {} although the ESV has said shutdown for {duration_s:.0} s (at {time_ns} ns): is the meaning of the \
                 ESV the wrong way round?",
                percent(position_pu)
            ),
            Self::TripsUnsaid { from_pu, to_pu, error_pu, spool_pu, time_ns, duration_s, regulated } => format!(
                "the spool stands at {} for {duration_s:.1} s from {time_ns} ns on and the servomotor goes from {} to {}, while its command is up to {} above it \
                 and the ESV says normal: {} the ESV has tripped without its state saying so (another topic's, or not recorded?), or command and measured \
                 state are not of one machine",
                percent(spool_pu),
                percent(from_pu),
                percent(to_pu),
                percent(error_pu),
                if regulated { "either" } else { "either its pilot oil is lost (`chamber_leak`), or" }
            ),
            Self::Precedes { signal, lead_s, moved_pu, time_ns, onsets, leads } => format!(
                "the {} moves before its command does, by {lead_s:.3} s or more, and by {} when the command leaves its rest (at {time_ns} ns), in {leads} of {onsets} \
                 such places: the stamps of command and measured state are of two clocks; `--stamp log` aligns them where they were recorded as \
                 they came",
                if signal == Signal::SpoolPosition { "spool" } else { "servomotor" },
                percent(moved_pu)
            ),
            Self::Scaled { ratio, least_pu, most_pu, left_pu } => format!(
                "the servomotor rests at {ratio:.3} times its command wherever both stand (commands from {} to {}, {:.2} % left): either one of the two channels \
                 is scaled (by a `range` of an import?), or the governor takes its command so (`command_gain`)",
                percent(least_pu),
                percent(most_pu),
                left_pu * 100.0
            ),
            Self::RestsOpen { spool_pu } => format!(
                "the spool stands at {} while servomotor and command rest, and would move it: its neutral is another value (give \
                 `range: [neutral, fully open]` in an import map), or the channel is another's",
                percent(spool_pu)
            ),
            Self::RestsElsewhere { position_pu, command_pu, time_ns, duration_s, meant } => {
                rests_elsewhere([position_pu, command_pu], time_ns, duration_s, meant)
            }
            Self::Held { signal, jumps, share, held_s } => format!(
                "{} is held for {held_s:.2} s again and again and then jumps, {jumps} times, {:.0} % of its travel: its values are newer at the \
                 source than in the recording",
                signal.id(),
                share * 100.0
            ),
            Self::Unrelated { correlation } if correlation < TURNED => format!(
                "the servomotor moves against its spool (correlation of speed and spool {correlation:.2}): one of the two is turned, or time runs \
                 backwards"
            ),
            Self::Unrelated { correlation } => format!(
                "spool and speed of the servomotor have nothing to do with each other (correlation {correlation:.2}): they are of two machines, one of \
                 the channels is another, or the spool's is stuck"
            ),
            Self::SpoolLate { by_s, ahead, correlation } => format!(
                "the servomotor moves before its spool does: its speed goes with the spool of {by_s:.1} s later (correlation {ahead:.3}, at its own time \
                 {correlation:.3}): the two were stamped by two clocks, or one of them late"
            ),
            Self::ServomotorLate { by_s, late, correlation } => format!(
                "the servomotor moves {by_s:.1} s after its spool does (correlation of speed and spool {late:.3} then, {correlation:.3} at one time), and oil moves \
                 at once: either its position is stamped late, or its transducer is slow (`feedback_lag`)"
            ),
            Self::TooFast { pu_s, time_ns } => format!(
                "the servomotor runs {pu_s:.1} strokes each second (at {time_ns} ns), and none does: is time in another unit?"
            ),
            Self::TooShort { duration_s } => format!(
                "the recording lasts {duration_s:.2} s, in which the servomotor moves: is time in another unit?"
            ),
            Self::TooSlow { apart_s } => format!(
                "samples lie {apart_s:.0} s apart while the servomotor moves, and its processes take seconds: is time in another unit?"
            ),
        }
    }
}

fn away(away_pu: f64, towards_pu: f64, may_be: bool) -> String {
    let reason = if may_be {
        "either the governor takes another command (`command_gain`) or its pilot oil is lost (`chamber_leak`), or a channel is scaled or of another \
         machine"
    } else {
        "time runs backwards, the response comes before the command, or one of the two is turned or scaled"
    };
    format!(
        "the servomotor moves away from its command, by {} of the stroke in all and {} towards it: {reason}",
        percent(away_pu),
        percent(towards_pu)
    )
}

fn late_copy(of_position: bool, lag_s: f64, equal: u64, changes: u64) -> String {
    let names = ["the servomotor position", "the command"];
    let [copy, other] = if of_position { [names[1], names[0]] } else { names };
    format!(
        "{copy} is {other} of {lag_s:.2} s before: {equal} of {changes} changed values are the same to the last bit; one of the two channels is \
         wired to the other"
    )
}

fn filtered((filter, over_s): (Filter, f64), apart_pu: f64, moving: u64) -> String {
    let what = match filter {
        Filter::Delay => format!("the command of {over_s:.2} s before"),
        Filter::Mean => format!("the mean of the command over {over_s:.2} s"),
    };
    format!(
        "the servomotor position is {what}: in {moving} samples while that moves nothing but noise of {:.2} % is between the two, and a \
         servomotor, which sums up its flow, follows otherwise; one of the two channels is wired to the other",
        apart_pu * 100.0
    )
}

fn on_lines(signal: Signal, Drawn { lines, samples, may_follow }: Drawn) -> String {
    let otherwise = if may_follow { ", unless it follows a command of as many lines without any noise" } else { "" };
    format!(
        "{} lies exactly on {lines} straight lines, {} samples on each while it moves: it was drawn between the few points that a historian or a slower \
         logger kept{otherwise}, and what it was between them nobody knows; export these points themselves, or what was not compressed",
        signal.id(),
        samples / lines.max(1)
    )
}

fn rests_elsewhere([position_pu, command_pu]: [f64; 2], time_ns: i64, duration_s: f64, meant: Meant) -> String {
    let begin = format!(
        "the servomotor rests at {} for {duration_s:.0} s while its command says {} (from {time_ns} ns on)",
        percent(position_pu),
        percent(command_pu)
    );
    let turned = match position_pu / command_pu {
        ratio if (1.8..2.2).contains(&ratio) => "; the position is doubled, or the governor doubles its command",
        ratio if (0.45..0.55).contains(&ratio) => "; the position is halved, or the governor halves its command",
        _ if (position_pu + command_pu - 1.0).abs() < 0.02 => "; the position is turned, 1 is open",
        _ => "",
    };
    match meant {
        Meant::Nothing => format!("{begin}: a channel is stuck, scaled, or of another machine{turned}"),
        Meant::Scaled => format!(
            "{begin}, and goes as many times its command all along: either one of the two channels is scaled, or the governor takes its command so \
             (`command_gain`)"
        ),
        Meant::Held { spool_pu } => format!(
            "{begin} and the spool stands at {}: either something holds it against that (a stop, `load`, `servo_leak`) or the pilot oil is lost \
             (`chamber_leak`), or a channel is stuck, scaled, or of another machine",
            percent(spool_pu)
        ),
    }
}

fn percent(pu: f64) -> String {
    format!("{:.1} %", pu * 100.0)
}
