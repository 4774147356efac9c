//! Announces the end of a node's DDS participant in a way that every vendor understands.
//!
//! The library says in the content of its message which participant ends. Fast DDS reads that only from the key
//! hash among the parameters of the message (RTPS 2.5, section 9.6.4.8). Without it, Fast DDS would list the node's
//! topics until its lease ends.

use std::net::{Ipv4Addr, UdpSocket};

use nix::{ifaddrs::getifaddrs, net::if_::InterfaceFlags};

use crate::rcl::Network;

/// Number of participants on this machine that are notified one by one, because `lo` often has no multicast.
const PARTICIPANTS: u16 = 120;
/// Where participants announce themselves (RTPS 2.5, section 9.6.1.4).
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// A sequence number above that of any earlier announcement, so that none counts as newer.
const LAST: u64 = 1 << 30;

/// Tells the network that the participant with this GUID has ended. A failure to send is ignored: the participant is
/// then listed until its lease ends.
pub(crate) fn send(guid: [u8; 16], network: Network) {
    let message = message(guid);
    // In high domains the ports of the last participants, or all, do not exist.
    let Some(base) = network.domain_id.checked_mul(250).and_then(|ports| ports.checked_add(7400)) else {
        return;
    };
    let neighbours = (0..PARTICIPANTS).filter_map(|id| base.checked_add(10 + 2 * id));
    tell(&message, Ipv4Addr::LOCALHOST, neighbours.map(|port| (Ipv4Addr::LOCALHOST, port)));
    let interfaces = if network.localhost_only { Vec::new() } else { multicast_interfaces() };
    interfaces.into_iter().for_each(|own| tell(&message, own, [(GROUP, base)]));
}

/// Sends from one of this machine's addresses.
fn tell(message: &[u8], from: Ipv4Addr, to: impl IntoIterator<Item = (Ipv4Addr, u16)>) {
    let Ok(socket) = UdpSocket::bind((from, 0)) else { return };
    for address in to {
        let _ = socket.send_to(message, address);
    }
}

/// A socket that is bound to one of these addresses sends multicast on that interface.
fn multicast_interfaces() -> Vec<Ipv4Addr> {
    let wanted = InterfaceFlags::IFF_UP | InterfaceFlags::IFF_MULTICAST;
    let interfaces = getifaddrs().into_iter().flatten().filter(|interface| interface.flags.contains(wanted));
    interfaces.filter_map(|interface| Some(interface.address?.as_sockaddr_in()?.ip())).collect()
}

/// A `Data` submessage without content from the participant's announcer: this key is disposed and unregistered.
fn message(guid: [u8; 16]) -> Vec<u8> {
    let mut data = vec![0, 0, 16, 0]; // octets to the parameters
    data.extend([0, 1, 0, 0xc7, 0, 1, 0, 0xc2]); // SPDP reader and writer
    data.extend(((LAST >> 32) as u32).to_le_bytes());
    data.extend((LAST as u32).to_le_bytes());
    data.extend([0x70, 0, 16, 0]); // key hash
    data.extend(guid);
    data.extend([0x71, 0, 4, 0, 0, 0, 0, 3]); // status: disposed, unregistered
    data.extend([1, 0, 0, 0]); // end of the parameters
    let header = [b"RTPS", &[2, 4, 1, 18][..], &guid[..12]].concat(); // version 2.4, vendor RustDDS
    let submessage = [0x15, 0b11, data.len() as u8, 0]; // Data, little endian, with parameters
    [&header[..], &submessage, &data].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everybody_on_this_machine_hears_it() {
        let domain_id = 97;
        let ports = [7400 + 250 * domain_id + 10 + 2 * 3, 7400 + 250 * domain_id + 10 + 2 * 119];
        let listeners = ports.map(|port| UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).unwrap());
        let guid = [7; 16];
        send(guid, Network { domain_id, localhost_only: true });
        for listener in listeners {
            listener.set_read_timeout(Some(std::time::Duration::from_secs(5))).unwrap();
            let mut buffer = [0; 200];
            let length = listener.recv(&mut buffer).unwrap();
            assert_eq!(&buffer[..4], b"RTPS");
            assert_eq!(buffer[8..20], guid[..12]);
            // the submessage's length says where the message ends
            assert_eq!(length, 24 + usize::from(buffer[22]));
            assert!(buffer[..length].windows(16).any(|window| window == guid));
        }
    }
}
