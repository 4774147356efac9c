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

/// Bytes of an identifier.
fn gid_length(ros_distro: &str) -> usize {
    if EARLY.contains(&ros_distro) { 24 } else { 16 }
}

/// What to tell where `ROS_DISTRO` is one that this program is not built for.
pub(crate) fn mismatch(ros_distro: &str) -> Option<String> {
    let (built_for, feature) = match GID_LENGTH {
        24 => ("humble and those before", "jazzy"),
        _ => ("iron and all later ones", "humble"),
    };
    (gid_length(ros_distro) != GID_LENGTH).then(|| {
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

    /// The message of ros2-client with identifiers of this many bytes: its fields in its order. The features choose one length for a
    /// whole build; here are both.
    macro_rules! message {
        ($layout:ident, $length:literal) => {
            mod $layout {
                #[derive(serde::Serialize)]
                pub(super) struct Gid([u8; $length]);
                #[derive(serde::Serialize)]
                pub(super) struct Node {
                    pub(super) node_namespace: String,
                    pub(super) node_name: String,
                    pub(super) reader_gid_seq: Vec<Gid>,
                    pub(super) writer_gid_seq: Vec<Gid>,
                }
                #[derive(serde::Serialize)]
                pub(super) struct Info {
                    pub(super) gid: Gid,
                    pub(super) node_entities_info_seq: Vec<Node>,
                }

                use rustdds::no_key::SerializerAdapter as _;

                pub(super) fn bytes(participant: [u8; 16], reader: [u8; 16]) -> Vec<u8> {
                    let gid =
                        |guid: [u8; 16]| Gid(std::array::from_fn(|i| guid.get(i).copied().unwrap_or(0)));
                    let node = Node {
                        node_namespace: "/lab".into(),
                        node_name: "robot".into(),
                        reader_gid_seq: vec![gid(reader)],
                        writer_gid_seq: Vec::new(),
                    };
                    let info = Info { gid: gid(participant), node_entities_info_seq: vec![node] };
                    super::CDRSerializerAdapter::<Info>::to_bytes(&info).expect("bytes").to_vec()
                }
            }
        };
    }
    message!(early, 24);
    message!(late, 16);

    #[test]
    fn the_message_of_discovery_has_the_layout_of_humble_and_of_all_later_distributions_in_one_build() {
        let participant: [u8; 16] = std::array::from_fn(|i| i as u8 + 1);
        let reader: [u8; 16] = std::array::from_fn(|i| i as u8 + 101);
        let of = |distro: &str| match gid_length(distro) {
            24 => early::bytes(participant, reader),
            _ => late::bytes(participant, reader),
        };
        for (distro, length) in [("humble", 24), ("jazzy", 16), ("kilted", 16), ("lyrical", 16)] {
            assert_eq!(of(distro), by_definition(length, participant, reader), "{distro}");
        }
    }

    #[test]
    fn the_message_of_discovery_has_the_layout_of_the_distribution() {
        let participant: [u8; 16] = std::array::from_fn(|i| i as u8 + 1);
        let reader: [u8; 16] = std::array::from_fn(|i| i as u8 + 101);
        let mut node = NodeEntitiesInfo::new(NodeName::new("/lab", "robot").expect("is a name"));
        node.add_reader(Gid::from(GUID::from_bytes(reader)));
        let message = ParticipantEntitiesInfo::new(Gid::from(GUID::from_bytes(participant)), vec![node]);
        let (length, same) = match cfg!(feature = "jazzy") {
            true => (16, late::bytes(participant, reader)),
            false => (24, early::bytes(participant, reader)),
        };
        let bytes = CDRSerializerAdapter::<ParticipantEntitiesInfo>::to_bytes(&message).expect("bytes");
        assert_eq!(bytes.as_ref(), by_definition(length, participant, reader));
        assert_eq!(bytes.as_ref(), same);
    }

    #[test]
    fn a_distribution_with_another_layout_is_told_with_the_way_out() {
        let (same, other) = match cfg!(feature = "jazzy") {
            true => (["iron", "jazzy", "kilted", "lyrical"], ["humble", "galactic", "foxy"]),
            false => (["humble", "galactic", "foxy", "humble"], ["iron", "jazzy", "kilted"]),
        };
        assert!(same.iter().all(|distro| mismatch(distro).is_none()));
        for distro in other {
            let reported = mismatch(distro).expect("another layout");
            assert!(reported.contains(distro) && reported.contains("--features"), "{reported}");
        }
    }
}
