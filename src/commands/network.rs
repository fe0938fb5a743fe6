//! Which networks a node uses, and how it stays known on them: options that every command on DDS has.

use std::net::IpAddr;
use std::ops::RangeInclusive;
use std::time::Duration;

use govtwin_node::environment::Environment;

use crate::commands::{expect, number};

/// The options.
#[derive(Debug, clap::Args)]
pub struct NetworkArgs {
    /// Time after which other nodes drop this node if they hear nothing from it, s.
    ///
    /// The node announces itself five times in this time.
    #[arg(long = "lease", value_name = "S", default_value_t = 10.0, value_parser = number)]
    lease_s: f64,
    /// Addresses of this machine whose networks are used; without them, all networks.
    ///
    /// The node is announced, and looks for others, on these networks alone. Ports are still bound on all addresses.
    #[arg(long = "address", value_name = "IP", num_args = 1..)]
    addresses: Vec<IpAddr>,
}

impl NetworkArgs {
    /// The environment of this process with these options.
    pub fn environment(&self) -> anyhow::Result<Environment> {
        environment(self.lease_s, &self.addresses)
    }
}

/// Refuses a value outside of the range that its option takes; the unit stands behind the range.
pub fn within(option: &str, value: f64, range: RangeInclusive<f64>, unit: &str) -> anyhow::Result<()> {
    let (low, high) = range.into_inner();
    expect((low..=high).contains(&value), || format!("{option} is {value}: expected {low} to {high}{unit}"))
}

/// The environment of this process with this lease, s, on the networks of these addresses; on all where there are none.
pub fn environment(lease_s: f64, addresses: &[IpAddr]) -> anyhow::Result<Environment> {
    within("--lease", lease_s, 1.0..=3600.0, " s")?;
    let environment = Environment::of_process()?;
    let only_networks = if addresses.is_empty() { environment.only_networks.clone() } else { Some(addresses.to_vec()) };
    Ok(Environment { lease: Duration::from_secs_f64(lease_s), only_networks, ..environment })
}
