//! Which RustDDS the program was built on: the published release, or the repaired copy below `vendor/`.
//!
//! Cargo takes the repaired copy for every build from this project's own sources. Built as a dependency of another
//! package, or from a registry, the program gets the published release, whose defects are described in
//! `docs/upstream`. Both must compile, so what only the copy has stands here once more as a trait: where a
//! type has an item of that name itself, Rust takes that one.

use std::net::IpAddr;
use std::time::Duration;

use rustdds::{DomainParticipant, DomainParticipantBuilder, GUID};

/// What stands in for the repaired copy's items where the release lacks them.
trait Published: Sized {
    const CHANGES: &'static str = "RustDDS as published: large service replies are malformed, peers that were away for \
                                   longer than their lease are lost, a hostile packet can exhaust memory";

    fn lease_duration(self, _lease: Duration) -> Self {
        self
    }

    fn initial_peers(self, _hosts: Vec<IpAddr>) -> Self {
        self
    }
}

impl Published for DomainParticipantBuilder {}

/// The same for participants.
trait Silent {
    fn set_user_data(&self, _dds_topic: &str, _user_data: Vec<u8>) {}
}

impl Silent for DomainParticipant {}

/// The part of an id that all endpoints of a participant share.
pub(super) type Participant = [u8; 12];

/// The participant of an endpoint.
pub(super) fn participant_of(endpoint: impl Into<GUID>) -> Participant {
    let [participant @ .., _, _, _, _] = endpoint.into().to_bytes();
    participant
}

/// Lets the endpoints of a topic that are opened from now on announce the hash of its type, as those of Iron and later do, and, where they are
/// of a service, the hash of that service, as those of Kilted and later do; the release of RustDDS cannot.
pub(super) fn announce_hash(participant: &DomainParticipant, dds_topic: &str, hash: &str, of_service: Option<&str>) {
    let of_service = of_service.map(|hash| format!("sertypehash={hash};")).unwrap_or_default();
    let user_data = format!("typehash={hash};{of_service}").into_bytes();
    if is_repaired() {
        participant.set_user_data(dds_topic, user_data);
    } else {
        Silent::set_user_data(participant, dds_topic, user_data);
    }
}

/// The transport in words, for `--version` and for the first words of a node.
pub const DESCRIPTION: &str = DomainParticipantBuilder::CHANGES;

/// Whether the transport is the repaired copy.
pub(crate) fn is_repaired() -> bool {
    DESCRIPTION != <DomainParticipantBuilder as Published>::CHANGES
}

/// The builder with this lease: how long peers believe in the node without a sign of life. The release's 50 s are fixed.
pub(super) fn with_lease(builder: DomainParticipantBuilder, lease: Duration) -> DomainParticipantBuilder {
    if is_repaired() { builder.lease_duration(lease) } else { Published::lease_duration(builder, lease) }
}

/// The builder with hosts to which the node is announced where multicast does not reach; the release has no such list.
pub(super) fn with_peers(builder: DomainParticipantBuilder, hosts: Vec<IpAddr>) -> DomainParticipantBuilder {
    if is_repaired() { builder.initial_peers(hosts) } else { Published::initial_peers(builder, hosts) }
}

#[cfg(test)]
mod tests {
    use super::{DESCRIPTION, is_repaired};

    #[test]
    fn this_project_builds_on_the_repaired_copy() {
        assert!(is_repaired(), "{DESCRIPTION}");
    }
}
