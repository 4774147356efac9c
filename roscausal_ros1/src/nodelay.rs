//! Messages leave at once.
//!
//! rosrust leaves Nagle's algorithm on (RFC 896): a small message waits until the one before it is acknowledged, which
//! a subscriber on Linux does after up to 40 ms (RFC 1122, section 4.2.3.2). It hands out none of its sockets, so they
//! are looked up among all sockets of this process, which Linux lists in `/proc/self/fd`. A connection inherits the
//! option from the socket that accepted it: one look after a publisher is made serves all its later subscribers, and
//! another each second serves those that were faster.

use std::fs::{self, DirEntry};
use std::os::fd::{BorrowedFd, OwnedFd, RawFd};
use std::{io, net::TcpStream};

/// Sets `TCP_NODELAY` on every TCP socket of this process.
pub(crate) fn send_at_once() {
    let Ok(files) = fs::read_dir("/proc/self/fd") else { return };
    for socket in files.flatten().filter_map(|file| socket_of(&file)) {
        // What is not a TCP socket refuses.
        let _ = TcpStream::from(socket).set_nodelay(true);
    }
}

/// A second handle of an open file, if that is a socket.
fn socket_of(file: &DirEntry) -> Option<OwnedFd> {
    let target = fs::read_link(file.path()).ok()?;
    let number = file.file_name().to_str()?.parse().ok()?;
    if target.to_str()?.starts_with("socket:") { duplicate(number).ok() } else { None }
}

#[allow(unsafe_code, reason = "rosrust's sockets can be had by their numbers alone")]
fn duplicate(number: RawFd) -> io::Result<OwnedFd> {
    // SAFETY: the number is borrowed for one system call, which owns what it gives. If another thread closes the file
    // before, the call fails, or duplicates the file that has the number now: as good a socket, or one that refuses.
    unsafe { BorrowedFd::borrow_raw(number) }.try_clone_to_owned()
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn connections_of_before_and_after_send_at_once() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let connect = || {
            let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            (client, listener.accept().unwrap().0)
        };
        let (_client, before) = connect();
        assert!(!before.nodelay().unwrap());
        send_at_once();
        let (_other, after) = connect();
        assert!(before.nodelay().unwrap() && after.nodelay().unwrap());
    }
}
