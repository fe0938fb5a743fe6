//! A node and its peers on this machine, for tests.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use govtwin_model::params;
use govtwin_node::arguments::Arguments;
use govtwin_node::environment::Environment;
use govtwin_node::live::{NodeResidual, RunOptions};
use govtwin_node::realtime::Wishes;
use govtwin_node::settings::NodeSettings;

/// A domain of its own, each time, so that tests that run beside this one are not heard.
pub fn environment() -> Environment {
    static FURTHER: AtomicU32 = AtomicU32::new(0);
    let domain = 101 + (std::process::id() + FURTHER.fetch_add(1, Ordering::Relaxed)) % 100;
    Environment::read(|name| match name {
        "ROS_DOMAIN_ID" => Some(domain.to_string()),
        "ROS_LOCALHOST_ONLY" => Some("1".to_owned()),
        _ => None,
    })
    .unwrap()
}

/// The shipped unit as a node, without a bag and until it is stopped.
pub fn options(environment: &Environment, words: &[&str]) -> RunOptions {
    let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
    RunOptions {
        arguments: Arguments::parse(&words, "govtwin").unwrap(),
        environment: environment.clone(),
        unit: params::reference(),
        map: None,
        residual: NodeResidual::None,
        adapt: false,
        settings: NodeSettings { wishes: Wishes::default(), ..NodeSettings::default() },
        read_only: false,
        commanders: String::new(),
        duration: None,
        bag: None,
    }
}

/// Waits until a condition holds, at most 30 s.
pub fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let until = Instant::now() + Duration::from_secs(30);
    while !condition() {
        assert!(Instant::now() < until, "{what}: waited 30 s in vain");
        std::thread::sleep(Duration::from_millis(10));
    }
}
