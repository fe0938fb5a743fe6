//! The node's wake-ups beside a bare `clock_nanosleep` loop, in the same run on the same core; and how long a
//! command takes from a peer's publication to the first state that knows of it, over loopback.
//!
//! `cargo bench --bench node_lateness -- [SECONDS] [CORE]`: 60 s on the last core by default.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures::StreamExt;
use govtwin_bag::cdr;
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, Interface, ServoState};
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::environment::Environment;
use govtwin_node::policy::NodeInput;
use govtwin_node::realtime::{
    Until, Wishes, claim, lock_memory, monotonic_ns, pause, resident_bytes, sleep_until, wall_ns,
};
use govtwin_node::stats::Stats;
use hdrhistogram::Histogram;

const PERIOD_NS: i64 = 1_000_000;
const DOMAIN: &str = "94";

/// The bare loop: wakes half a period after the node, so that the two do not meet.
fn bare(core: usize, stop: &AtomicBool) -> Stats {
    let _ = claim(Wishes { cpu: Some(core), priority: 80 });
    let mut stats = Stats::default();
    let mut deadline_ns = (monotonic_ns() / PERIOD_NS + 2) * PERIOD_NS + PERIOD_NS / 2;
    while !stop.load(Ordering::Relaxed) {
        sleep_until(deadline_ns);
        let woke_ns = monotonic_ns();
        stats.woke(deadline_ns, woke_ns, woke_ns, PERIOD_NS);
        stats.ticked(&[None; NodeInput::COUNT]);
        deadline_ns += PERIOD_NS;
    }
    stats
}

/// What the peer sent and when, and when it saw which state; all of the wall clock.
#[derive(Default)]
struct Seen {
    sent_ns: BTreeMap<u64, i64>,
    received_ns: BTreeMap<i64, i64>,
}

/// Commands at 100 Hz, each a new value, so that the node's bag tells when it took effect.
fn peer(seconds: u64) -> Seen {
    let environment = Environment::read(|name| (name == "ROS_DOMAIN_ID").then(|| DOMAIN.to_owned())).expect("a domain");
    let mut bus = Bus::open(&environment, Arguments::parse(&[], "bench").expect("a name")).expect("a bus");
    let command = bus.publish("governor/command", GovernorCommand::TYPE_NAME).expect("a topic");
    let esv = bus.publish("governor/esv", EsvState::TYPE_NAME).expect("a topic");
    let pressure = bus.publish("governor/tank_pressure", FluidPressure::TYPE_NAME).expect("a topic");
    let states = bus.subscribe::<ServoState>("sim/servo_state").expect("a topic");
    let until = Until::after(Some(Duration::from_secs(20)));
    while bus.readers_of("/governor/command") == 0 {
        assert!(!until.is_past(), "the node did not come");
        pause(Duration::from_millis(20));
    }
    let stop = AtomicBool::new(false);
    let mut seen = Seen::default();
    std::thread::scope(|scope| {
        let listening = scope.spawn(|| {
            let mut received_ns = BTreeMap::new();
            let stream = states.async_stream();
            futures::pin_mut!(stream);
            futures::executor::block_on(async {
                while let Some(sample) = stream.next().await {
                    let now_ns = wall_ns();
                    if let Some(stamp_ns) = sample.ok().and_then(|(state, _)| state.header.stamp.nanos()) {
                        received_ns.insert(stamp_ns, now_ns);
                    }
                    if stop.load(Ordering::Relaxed) {
                        break;
                    }
                }
            });
            received_ns
        });
        let begin_ns = monotonic_ns();
        for step in 0..i64::try_from(seconds * 100).unwrap_or(i64::MAX) {
            let now_ns = wall_ns();
            let header = Header::at(now_ns);
            let opening = 0.4 + 0.1 * (step as f64 * 0.01).sin() + step as f64 * 1e-9;
            seen.sent_ns.insert(opening.to_bits(), now_ns);
            let _ = command.publish(GovernorCommand { header: header.clone(), opening });
            if step % 5 == 0 {
                let _ =
                    pressure.publish(FluidPressure { header: header.clone(), fluid_pressure: 6.3e6, variance: 0.0 });
            }
            if step % 50 == 0 {
                let _ = esv.publish(EsvState { header, state: EsvState::NORMAL });
            }
            sleep_until(begin_ns + (step + 1) * 10_000_000);
        }
        stop.store(true, Ordering::Relaxed);
        seen.received_ns = listening.join().unwrap_or_default();
    });
    seen
}

/// From publication of a command to its tick, and to reception of the first state of that tick or later.
fn latencies(bag: &Path, seen: &Seen) -> [Histogram<u64>; 2] {
    let new = || Histogram::new_with_bounds(1, 10_000_000_000, 3).expect("constant bounds");
    let (mut to_tick, mut to_state): (Histogram<u64>, Histogram<u64>) = (new(), new());
    for message in govtwin_bag::messages(bag).expect("the node's bag") {
        let message = message.expect("a message");
        if message.topic.name != "/governor/command" {
            continue;
        }
        let command: GovernorCommand = cdr::decode(&message.data).expect("a command");
        let tick_ns = command.header.stamp.nanos().expect("a stamp");
        let Some(sent_ns) = seen.sent_ns.get(&command.opening.to_bits()) else { continue };
        let since_ns = |time_ns: i64| u64::try_from(time_ns - sent_ns).unwrap_or(0);
        to_tick.saturating_record(since_ns(tick_ns));
        if let Some((_, received_ns)) = seen.received_ns.range(tick_ns..).next() {
            to_state.saturating_record(since_ns(*received_ns));
        }
    }
    [to_tick, to_state]
}

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let seconds = numbers.first().copied().unwrap_or(60);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let core = numbers.get(1).map_or(cores - 1, |&core| usize::try_from(core).unwrap_or(0));
    let folder = tempfile::tempdir().expect("a folder");
    let (journal, figures) = (folder.path().join("journal"), folder.path().join("run.json"));
    let mut node = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .env("ROS_DOMAIN_ID", DOMAIN)
        .args(["run", "--publish-rate", "1000", "--cpu", &core.to_string()])
        .args(["--duration", &(seconds + 3).to_string()])
        .args(["--bag".as_ref(), journal.as_os_str(), "--out".as_ref(), figures.as_os_str()])
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("the node starts");
    let _ = lock_memory();
    let stop = AtomicBool::new(false);
    let (stats, seen) = std::thread::scope(|scope| {
        let looping = scope.spawn(|| bare(core, &stop));
        let seen = peer(seconds);
        stop.store(true, Ordering::Relaxed);
        (looping.join().expect("the bare loop ends"), seen)
    });
    node.wait().expect("the node ends");
    let bare = stats.summary(resident_bytes());
    let text = std::fs::read_to_string(&figures).expect("the node's figures");
    let figures: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let node = &figures["loop"];
    let of_node = |name: &str| node["lateness"][name].as_f64().unwrap_or(f64::NAN);

    let mut out = std::io::stdout().lock();
    let mut say = |text: String| drop(out.write_all(text.as_bytes()));
    let mut row = |name: &str, us: [f64; 4]| {
        say(format!("{name:<34}{:>10.1}{:>10.1}{:>10.1}{:>10.1}\n", us[0], us[1], us[2], us[3]));
    };
    row("us: p50, p99, p99.9, max", [50.0, 99.0, 99.9, 100.0]);
    let lateness = bare.lateness;
    row("bare clock_nanosleep, lateness", [lateness.p50_us, lateness.p99_us, lateness.p99_9_us, lateness.max_us]);
    row("node, lateness", ["p50_us", "p99_us", "p99_9_us", "max_us"].map(of_node));
    let [to_tick, to_state] = latencies(&journal, &seen);
    let at = |histogram: &Histogram<u64>| [0.5, 0.99, 0.999, 1.0].map(|q| histogram.value_at_quantile(q) as f64 * 1e-3);
    row("command sent to in force", at(&to_tick));
    row("command sent to state received", at(&to_state));
    say(format!(
        "1 kHz for {seconds} s on core {core}, SCHED_FIFO 80 where granted\n\
         p99.9 of the node is {:.2} times the bare loop's; node: {} ticks, {} overruns, {} skipped, {:.1} MiB resident; \
         bare: {} overruns\n",
        of_node("p99_9_us") / lateness.p99_9_us,
        node["ticks"],
        node["overruns"],
        node["skipped"],
        node["resident_bytes"].as_f64().unwrap_or(f64::NAN) / 1_048_576.0,
        bare.overruns,
    ));
}
