//! `govtwin play`: a recording over DDS, with its timing.

use std::path::PathBuf;

use anyhow::bail;
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::player::tape::Tape;
use govtwin_node::player::{PATIENCE, PlayOptions, Played, Player, Stamps};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::choice::{Choice, choice};
use super::network::{NetworkArgs, within};
use super::output;
use super::run::{duration, stop_on_signals};
use crate::commands::{Outcome, number};

/// Arguments of `govtwin play`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Recording: a bag folder or an MCAP file.
    #[arg(value_name = "BAG")]
    bag: PathBuf,
    /// Speed of playback; 2 is twice as fast.
    #[arg(long = "speed", alias = "rate", value_name = "FACTOR", default_value_t = 1.0, value_parser = number)]
    speed: f64,
    /// Start again at the end, until stopped.
    #[arg(long = "loop")]
    repeat: bool,
    /// Publish the time of the recording on `/clock`.
    ///
    /// It is published HZ times per second of the recording (100 if HZ is not given), and before each message. A tick
    /// goes out once reliable subscribers have acknowledged the messages before it, or have not within 1 s.
    #[arg(long = "clock", value_name = "HZ", num_args = 0..=1, default_missing_value = "100", require_equals = true, value_parser = number)]
    clock_hz: Option<f64>,
    /// Stamps of the messages: `now` as if they were recorded now, `recorded` as they stand in the recording [default: now,
    /// with --clock recorded].
    #[arg(long, value_parser = choice(STAMPS), value_name = "WHICH")]
    stamps: Option<Stamps>,
    /// Publish only these topics, by their names in the recording.
    #[arg(long, value_name = "TOPIC", num_args = 1..)]
    topics: Vec<String>,
    /// Publish only the first seconds of the recording, s.
    #[arg(long = "duration", value_name = "S", value_parser = number)]
    duration_s: Option<f64>,
    /// Longest time to wait for a subscriber, s; 0 starts at once.
    #[arg(long = "wait", value_name = "S", default_value_t = 10.0, value_parser = number)]
    wait_s: f64,
    #[command(flatten)]
    network: NetworkArgs,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
    /// ROS 2 arguments: `-r FROM:=TO`, `-r __ns:=/NAME`.
    #[arg(long = "ros-args", num_args = 0.., allow_hyphen_values = true, value_terminator = "--", value_name = "ARGS")]
    ros: Vec<String>,
}

const HELP: &str = "\
Every topic is published byte by byte as recorded, of any type, but for the stamp of a header at the
beginning of a message: with the machine's clock it is fresh, with --clock the recorded one. Topics
that cannot be played are reported; with --clock, these include a recorded `/clock`.

Examples:
  govtwin play bags/reference/load_rejection_01.mcap --clock
  govtwin play bags/reference/startup_01.mcap --topics /governor/command --loop
  govtwin play diagnosis/case_03/next_test.mcap    # the next test that `diagnose` proposes

Exit codes: 0 played, 1 not possible, 2 wrong usage, 3 played, but samples were lost or, with --clock,
not acknowledged.";

/// Which stamps messages have.
const STAMPS: [Choice<Stamps>; 2] = [
    ("now", "As if the recording were made now", Stamps::Now),
    ("recorded", "As they stand in the recording", Stamps::Recorded),
];

/// Plays a recording to its end, or until a signal.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    within("--speed", args.speed, 1e-3..=1e3, "")?;
    args.clock_hz.map_or(Ok(()), |hz| within("--clock", hz, 0.1..=10_000.0, " Hz"))?;
    let wait = duration(Some(args.wait_s), "--wait")?.unwrap_or_default();
    let stamps = args.stamps.unwrap_or(if args.clock_hz.is_some() { Stamps::Recorded } else { Stamps::Now });
    let options = PlayOptions { speed_ratio: args.speed, repeat: args.repeat, clock_hz: args.clock_hz, wait, stamps };
    let length = duration(args.duration_s, "--duration")?;
    let (tape, warnings) = Tape::open(args.bag.clone(), args.topics.clone(), length)?;
    for warning in &warnings {
        output::warn(&warning.to_string());
    }
    let Some(tape) = tape else { bail!("{}: nothing to play{}", args.bag.display(), none_of(&args.topics)) };
    let environment = args.network.environment()?;
    output::warn_all(&environment.remarks);
    let stop = stop_on_signals()?;
    let mut bus = Bus::open(&environment, Arguments::parse(&args.ros, "govtwin_play")?)?;
    let player = Player::open(&mut bus, &tape, &options)?;
    output::warn_all(bus.arguments().remarks.iter().chain(&bus.idle_arguments()));
    for (topic, reason) in &player.left_out {
        output::warn(&format!("{topic} is not played: {reason}"));
    }
    if !options.wait.is_zero() && !player.wait(&bus, &options, &stop) {
        output::warn(&format!("nobody listened within {} s; playing all the same", args.wait_s));
    }
    let (first_ns, last_ns) = tape.span_ns();
    let bar = ProgressBar::new(u64::try_from((last_ns - first_ns) / 1_000_000).unwrap_or(0));
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {msg} {percent}%, {eta} left") {
        bar.set_style(style);
    }
    let played = player.play(&tape, &options, &stop, &mut |time_s| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a time in a recording, in ms")]
        bar.set_position((time_s * 1e3) as u64);
        bar.set_message(format!("{time_s:.1} s"));
    })?;
    bar.finish_and_clear();
    drop(player);
    drop(bus);
    output::print(&if args.json { format!("{:#}\n", figures(&played)) } else { text(&played) })?;
    for (topic, ticks) in &played.unacknowledged {
        output::warn(&format!(
            "{topic}: {ticks} ticks of /clock went out before all subscribers had acknowledged what was published, within {} s; \
             whoever follows the clock may have had it late",
            PATIENCE.as_secs_f64()
        ));
    }
    let all_arrived = played.lost == 0 && played.unacknowledged.is_empty();
    Ok(if all_arrived { Outcome::Ok } else { Outcome::Warnings })
}

fn none_of(topics: &[String]) -> String {
    if topics.is_empty() { String::new() } else { format!(" on {}", topics.join(", ")) }
}

fn figures(played: &Played) -> serde_json::Value {
    json!({
        "schema": "govtwin-play/1", "messages": played.messages, "lost": played.lost, "passes": played.passes,
        "unacknowledged": played.unacknowledged, "worst_delay_s": played.worst_delay_s,
    })
}

fn text(played: &Played) -> String {
    let mut text = String::new();
    for (topic, count) in &played.messages {
        text.push_str(&format!("{topic:<24}{count:>8} published\n"));
    }
    let (lost, passes, delay_ms) = (played.lost, played.passes, played.worst_delay_s * 1e3);
    text.push_str(&format!("{lost} samples lost; passes: {passes}; largest delay: {delay_ms:.1} ms\n"));
    text
}
