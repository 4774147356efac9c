//! The ROS 2 distributions that this program is built for: iron and all later ones (feature `jazzy`, the default), or humble and
//! those before (feature `humble`).
//!
//! They differ on the wire in one message, `rmw_dds_common/ParticipantEntitiesInfo`, by which nodes are listed: an identifier
//! (`rmw_dds_common/Gid`) is `char[24] data` until humble and `uint8[16] data` since iron. Topics, services and parameters are the
//! same. The message is made by `ros2-client`, whose features choose the length; here is what must be known of it.

use ros2_client::gid::GID_LENGTH;

#[cfg(not(any(feature = "jazzy", feature = "humble")))]
compile_error!(
    "name the ROS 2 distribution: --features jazzy (iron and all later ones) or --features humble (and those before)"
);

/// Distributions whose identifiers have 24 bytes.
const EARLY: [&str; 3] = ["humble", "galactic", "foxy"];

/// What to tell where `ROS_DISTRO` is one that this program is not built for.
pub(crate) fn mismatch(ros_distro: &str) -> Option<String> {
    let (is_early, built_early) = (EARLY.contains(&ros_distro), GID_LENGTH == 24);
    let (built_for, feature) = match built_early {
        true => ("humble and those before", "jazzy"),
        false => ("iron and all later ones", "humble"),
    };
    (is_early != built_early).then(|| {
        format!(
            "ROS_DISTRO is {ros_distro}, but this program is built for {built_for}: topics work, but nodes are not listed by name. \
             Build it in a shell of {ros_distro} with colcon, or with cargo and --no-default-features --features \
             {feature},hrisim,dashboard"
        )
    })
}

#[cfg(test)]
mod tests {
    use ros2_client::{
        Gid, NodeName,
        entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo},
    };
    use rustdds::{GUID, no_key::SerializerAdapter, serialization::CDRSerializerAdapter};

    use super::*;

    /// `rmw_dds_common/ParticipantEntitiesInfo` in CDR, little-endian, as its definition says: `Gid gid`, then
    /// `NodeEntitiesInfo[] node_entities_info_seq`, each with `string<256> node_namespace`, `string<256> node_name`,
    /// `Gid[] reader_gid_seq` and `Gid[] writer_gid_seq`. Numbers of elements are aligned to 4 bytes.
    fn by_definition(length: usize, participant: [u8; 16], reader: [u8; 16]) -> Vec<u8> {
        let gid = |bytes: [u8; 16]| [&bytes[..], &[0; 8][..length - 16]].concat();
        let text = |text: &str| {
            let mut bytes = [&(text.len() as u32 + 1).to_le_bytes()[..], text.as_bytes(), &[0]].concat();
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            bytes
        };
        let number = |number: u32| number.to_le_bytes().to_vec();
        let parts =
            [gid(participant), number(1), text("/lab"), text("robot"), number(1), gid(reader), number(0)];
        parts.concat()
    }

    #[test]
    fn the_message_of_discovery_has_the_layout_of_the_distribution() {
        let participant: [u8; 16] = std::array::from_fn(|i| i as u8 + 1);
        let reader: [u8; 16] = std::array::from_fn(|i| i as u8 + 101);
        let mut node = NodeEntitiesInfo::new(NodeName::new("/lab", "robot").expect("is a name"));
        node.add_reader(Gid::from(GUID::from_bytes(reader)));
        let message = ParticipantEntitiesInfo::new(Gid::from(GUID::from_bytes(participant)), vec![node]);
        let length = if cfg!(feature = "jazzy") { 16 } else { 24 };
        let bytes = CDRSerializerAdapter::<ParticipantEntitiesInfo>::to_bytes(&message).expect("bytes");
        assert_eq!(bytes.as_ref(), by_definition(length, participant, reader));
    }

    #[test]
    fn a_distribution_with_another_layout_is_told_with_the_way_out() {
        let (same, other) = match cfg!(feature = "jazzy") {
            true => (["iron", "jazzy", "kilted", "rolling"], ["humble", "galactic", "foxy"]),
            false => (["humble", "galactic", "foxy", "humble"], ["iron", "jazzy", "kilted"]),
        };
        assert!(same.iter().all(|distro| mismatch(distro).is_none()));
        for distro in other {
            let told = mismatch(distro).expect("another layout");
            assert!(told.contains(distro) && told.contains("--features"), "{told}");
        }
    }
}
