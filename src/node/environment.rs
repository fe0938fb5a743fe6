//! What the environment of a ROS 2 program asks for, and how far this node can follow.

use std::net::{IpAddr, Ipv4Addr, ToSocketAddrs as _};
use std::time::Duration;

use ros2_client::ServiceMapping;

use super::transport;

/// Highest domain whose ports exist.
const LARGEST_DOMAIN: u16 = 232;

/// Lease of a node that does not say otherwise, as Cyclone DDS has it.
pub(crate) const DEFAULT_LEASE: Duration = Duration::from_secs(10);

/// Variables of other middlewares, and what to do instead.
const NOT_READ: [(&str, &str); 5] = [
    ("ROS_DISCOVERY_SERVER", "RustDDS finds peers by multicast, not by a discovery server of Fast DDS"),
    ("CYCLONEDDS_URI", "it configures Cyclone DDS, and this node runs on RustDDS; `--address` chooses networks"),
    (
        "FASTRTPS_DEFAULT_PROFILES_FILE",
        "it configures Fast DDS, and this node runs on RustDDS; `--address` chooses networks",
    ),
    (
        "FASTDDS_DEFAULT_PROFILES_FILE",
        "it configures Fast DDS, and this node runs on RustDDS; `--address` chooses networks",
    ),
    ("RMW_FASTRTPS_USE_QOS_FROM_XML", "it configures Fast DDS, and this node runs on RustDDS; see `qos_overrides`"),
];

/// The distributions of ROS 2 that a build is for: they differ in how long a node's identity is on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distribution {
    /// Humble: 24 bytes.
    Humble,
    /// Iron and later, up to Lyrical: 16 bytes.
    Later,
}

impl Distribution {
    /// That of this build.
    pub const fn of_build() -> Self {
        if cfg!(feature = "jazzy") { Self::Later } else { Self::Humble }
    }

    /// Which they are.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Humble => "ROS 2 Humble",
            Self::Later => "ROS 2 Iron, Jazzy, Kilted and Lyrical",
        }
    }

    /// The name of a distribution that is not one of these.
    fn other_than(self, name: Option<&str>) -> Option<&str> {
        let is_humble = |name: &&str| *name == "humble";
        name.filter(|name| is_humble(name) != (self == Self::Humble))
    }
}

/// An environment that cannot be followed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EnvironmentError {
    /// `ROS_DOMAIN_ID` is not a domain.
    #[error("ROS_DOMAIN_ID is `{0}`: expected a whole number from 0 to {LARGEST_DOMAIN}")]
    Domain(String),
    /// The middleware speaks another protocol than DDS.
    #[error("RMW_IMPLEMENTATION is `{0}`, which does not speak DDS; set it to rmw_fastrtps_cpp or rmw_cyclonedds_cpp")]
    Middleware(String),
    /// Security that must be kept and cannot.
    #[error(
        "ROS_SECURITY_ENABLE=true with ROS_SECURITY_STRATEGY=Enforce asks for DDS Security, which this build does not have; \
         the node does not run without it. Set ROS_SECURITY_STRATEGY=Permissive to run unprotected, or ROS_SECURITY_ENABLE=false"
    )]
    Security,
}

/// The environment, read once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    /// DDS domain.
    pub domain: u16,
    /// Addresses to use; `None` for all.
    pub only_networks: Option<Vec<IpAddr>>,
    /// Hosts to which the node is announced where multicast does not reach.
    pub peers: Vec<IpAddr>,
    /// How callers lay services out on DDS whose vendor does not say it: RustDDS has both layouts.
    pub service_layout: ServiceMapping,
    /// How long peers believe in the node without a sign of life; no variable of the environment says it.
    pub lease: Duration,
    /// What could not be followed, in words.
    pub remarks: Vec<String>,
}

impl Environment {
    /// Reads the environment of this process.
    ///
    /// # Errors
    /// On a domain that does not exist, a middleware that is not DDS, or security that must be enforced.
    pub fn of_process() -> Result<Self, EnvironmentError> {
        Self::read(|name| std::env::var(name).ok())
    }

    /// Reads the environment that `get` describes.
    ///
    /// # Errors
    /// As [`Environment::of_process`].
    pub fn read(get: impl Fn(&str) -> Option<String>) -> Result<Self, EnvironmentError> {
        let set = |name: &str| get(name).map(|value| value.trim().to_owned()).filter(|value| !value.is_empty());
        let mut remarks = Vec::new();
        let domain = match set("ROS_DOMAIN_ID") {
            None => 0,
            Some(text) => match text.parse::<u16>() {
                Ok(domain) if domain <= LARGEST_DOMAIN => domain,
                _ => return Err(EnvironmentError::Domain(text)),
            },
        };
        let localhost = match set("ROS_LOCALHOST_ONLY") {
            // Where both are set the older one counts, as in rcl.
            Some(text) => text == "1",
            None => match set("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref() {
                None | Some("SUBNET" | "SYSTEM_DEFAULT") => false,
                Some("LOCALHOST") => true,
                Some("OFF") => {
                    remarks.push(
                        "ROS_AUTOMATIC_DISCOVERY_RANGE=OFF cannot be followed: RustDDS always discovers; \
                         taken as LOCALHOST"
                            .to_owned(),
                    );
                    true
                }
                Some(other) => {
                    remarks.push(format!(
                        "ROS_AUTOMATIC_DISCOVERY_RANGE is `{other}`: expected SUBNET, LOCALHOST, OFF or \
                         SYSTEM_DEFAULT; taken as SUBNET"
                    ));
                    false
                }
            },
        };
        if localhost {
            remarks.push(
                "local host only: other machines are neither announced to nor listed, but RustDDS still binds its \
                 ports on all addresses; a firewall must keep strangers out"
                    .to_owned(),
            );
        }
        let (mut peers, named) = (Vec::new(), set("ROS_STATIC_PEERS").unwrap_or_default());
        for host in named.split(';').map(str::trim) {
            // Port 0: only the address counts.
            match (host, 0).to_socket_addrs().map(|found| found.map(|one| one.ip()).find(IpAddr::is_ipv4)) {
                _ if host.is_empty() => {}
                Ok(Some(address)) => peers.push(address),
                _ => remarks.push(format!(
                    "ROS_STATIC_PEERS: `{host}` is no IPv4 address or known host; expected addresses or names between `;`"
                )),
            }
        }
        if !peers.is_empty() && !transport::is_repaired() {
            remarks.push("ROS_STATIC_PEERS cannot be followed: RustDDS as published has no list of peers".to_owned());
        }
        let distribution = set("ROS_DISTRO");
        remarks.extend(Distribution::of_build().other_than(distribution.as_deref()).map(|name| {
            let own = Distribution::of_build();
            format!(
                "ROS_DISTRO is {name}, and this program is built for {}: nodes of {name} do not find it in the graph of ROS; \
                 topics and services pass. `govtwin --version` says what a build is for",
                own.words()
            )
        }));
        for (name, meant) in NOT_READ {
            if let Some(value) = set(name) {
                remarks.push(format!("{name}={value} does nothing: {meant}"));
            }
        }
        // As rcl reads them: only these very words switch security on, and enforce it.
        if set("ROS_SECURITY_ENABLE").as_deref() == Some("true") {
            if set("ROS_SECURITY_STRATEGY").as_deref() == Some("Enforce") {
                return Err(EnvironmentError::Security);
            }
            let enclave = set("ROS_SECURITY_ENCLAVE_OVERRIDE").or_else(|| set("ROS_SECURITY_KEYSTORE"));
            let keys = enclave.map(|path| format!(" (keys of {path} are not read)")).unwrap_or_default();
            remarks.push(format!(
                "ROS_SECURITY_ENABLE=true cannot be followed: this build has no DDS Security{keys}; everything is sent and \
                 believed unprotected, and nodes that enforce security are not seen"
            ));
        }
        let service_layout = match set("RMW_IMPLEMENTATION") {
            None => ServiceMapping::Enhanced,
            Some(name) if name.contains("cyclone") => ServiceMapping::Cyclone,
            Some(name) if name.contains("fastrtps") || name.contains("connext") => ServiceMapping::Enhanced,
            Some(name) => return Err(EnvironmentError::Middleware(name)),
        };
        let only_networks = localhost.then(|| vec![IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        Ok(Self { domain, only_networks, peers, service_layout, lease: DEFAULT_LEASE, remarks })
    }
}

#[cfg(test)]
mod tests {
    use ros2_client::ServiceMapping;

    use super::{Environment, EnvironmentError};

    fn read(pairs: &[(&str, &str)]) -> Result<Environment, EnvironmentError> {
        Environment::read(|name| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned()))
    }

    #[test]
    fn nothing_set_is_domain_0_on_all_networks_for_both_middlewares() {
        let environment = read(&[]).unwrap();
        assert_eq!((environment.domain, environment.only_networks), (0, None));
        assert_eq!(environment.service_layout, ServiceMapping::Enhanced);
        assert!(environment.remarks.is_empty());
    }

    #[test]
    fn a_domain_out_of_range_is_refused() {
        assert_eq!(read(&[("ROS_DOMAIN_ID", "42")]).unwrap().domain, 42);
        for bad in ["233", "-1", "x", "1.5"] {
            assert_eq!(read(&[("ROS_DOMAIN_ID", bad)]), Err(EnvironmentError::Domain(bad.to_owned())));
        }
    }

    #[test]
    fn local_host_is_followed_and_its_limit_said() {
        for pair in [("ROS_LOCALHOST_ONLY", "1"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")] {
            let environment = read(&[pair]).unwrap();
            assert!(environment.only_networks.is_some());
            assert!(environment.remarks[0].contains("firewall"));
        }
        let both = read(&[("ROS_LOCALHOST_ONLY", "0"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")]).unwrap();
        assert_eq!(both.only_networks, None);
    }

    #[test]
    fn what_cannot_be_followed_is_said() {
        let named = read(&[("ROS_STATIC_PEERS", "10.0.0.1; 127.0.0.1;nowhere.invalid")]).unwrap();
        assert_eq!(named.peers, ["10.0.0.1", "127.0.0.1"].map(|peer| peer.parse::<std::net::IpAddr>().unwrap()));
        assert!(named.remarks.len() == 1 && named.remarks[0].contains("nowhere.invalid"), "{:?}", named.remarks);
        assert!(read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")]).unwrap().remarks[0].contains("OFF"));
        assert!(matches!(read(&[("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")]), Err(EnvironmentError::Middleware(_))));
    }

    #[test]
    fn what_does_nothing_is_named() {
        for (name, value) in [
            ("ROS_DISCOVERY_SERVER", "10.0.0.1:11811"),
            ("CYCLONEDDS_URI", "file:///cyclone.xml"),
            ("FASTRTPS_DEFAULT_PROFILES_FILE", "/fast.xml"),
            ("ROS_DISTRO", if cfg!(feature = "jazzy") { "humble" } else { "jazzy" }),
        ] {
            let remarks = read(&[(name, value)]).unwrap().remarks;
            assert!(remarks.len() == 1 && remarks[0].contains(name) && remarks[0].contains(value), "{remarks:?}");
        }
        let own = if cfg!(feature = "jazzy") { "jazzy" } else { "humble" };
        assert!(read(&[("ROS_DISTRO", own)]).unwrap().remarks.is_empty());
    }

    #[test]
    fn security_that_cannot_be_kept_is_refused_where_it_must_and_told_where_it_may() {
        let enforced = [("ROS_SECURITY_ENABLE", "true"), ("ROS_SECURITY_STRATEGY", "Enforce")];
        assert_eq!(read(&enforced), Err(EnvironmentError::Security));
        let permissive = read(&[("ROS_SECURITY_ENABLE", "true"), ("ROS_SECURITY_KEYSTORE", "/keys")]).unwrap();
        assert!(permissive.remarks[0].contains("keys of /keys are not read"), "{:?}", permissive.remarks);
        assert!(read(&[("ROS_SECURITY_ENABLE", "false"), enforced[1]]).unwrap().remarks.is_empty());
    }

    #[test]
    fn the_middleware_chooses_the_service_mapping() {
        let mapping = |name| read(&[("RMW_IMPLEMENTATION", name)]).unwrap().service_layout;
        assert_eq!(mapping("rmw_cyclonedds_cpp"), ServiceMapping::Cyclone);
        assert_eq!(mapping("rmw_fastrtps_cpp"), ServiceMapping::Enhanced);
    }
}
