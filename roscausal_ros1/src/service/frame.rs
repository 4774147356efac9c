//! The parts of a service connection: a header of `key=value` fields, and frames that begin with their length. Every
//! read ends at a deadline and is bounded.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};
use std::{collections::BTreeMap, net::TcpStream};

/// Longest header.
const LONGEST_HEADER: usize = 1 << 16;
/// Longest question or answer.
const LONGEST_MESSAGE: usize = 64 << 20;

/// The fields of a header.
pub(super) type Fields = BTreeMap<String, String>;

/// A connection of which everything has to be done at some moment.
pub(super) struct Timed<'a> {
    pub(super) stream: &'a TcpStream,
    pub(super) until: Instant,
}

impl Timed<'_> {
    fn left(&self) -> io::Result<Duration> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(io::ErrorKind::TimedOut.into()) } else { Ok(left) }
    }

    /// The next header.
    pub(super) fn header(&mut self) -> io::Result<Fields> {
        let bytes = self.frame(LONGEST_HEADER)?;
        let mut rest = bytes.as_slice();
        let mut fields = Fields::new();
        while !rest.is_empty() {
            let (length, tail) =
                rest.split_first_chunk::<4>().ok_or_else(|| bad("a header that ends early"))?;
            let length = u32::from_le_bytes(*length) as usize;
            let field = tail.get(..length).ok_or_else(|| bad("a header field longer than its header"))?;
            rest = &tail[length..];
            let text = String::from_utf8_lossy(field);
            let (key, value) = text.split_once('=').ok_or_else(|| bad("a header field without '='"))?;
            fields.insert(key.to_owned(), value.to_owned());
        }
        Ok(fields)
    }

    /// The next question, answer or sentence.
    pub(super) fn message(&mut self) -> io::Result<Vec<u8>> {
        self.frame(LONGEST_MESSAGE)
    }

    /// One byte.
    pub(super) fn byte(&mut self) -> io::Result<u8> {
        let mut byte = [0];
        self.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    /// Allocates no more than arrives.
    fn frame(&mut self, longest: usize) -> io::Result<Vec<u8>> {
        let mut length = [0; 4];
        self.read_exact(&mut length)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > longest {
            return Err(bad(&format!("a length of {length} bytes, where {longest} are the most")));
        }
        let mut bytes = Vec::new();
        self.take(length as u64).read_to_end(&mut bytes)?;
        if bytes.len() < length { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(bytes) }
    }
}

impl Read for Timed<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(Some(self.left()?))?;
        let mut stream = self.stream;
        stream.read(into)
    }
}

impl Write for Timed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(Some(self.left()?))?;
        let mut stream = self.stream;
        stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn bad(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_owned())
}

/// A header as bytes.
pub(super) fn header(fields: &[(&str, &str)]) -> Vec<u8> {
    let field = |(key, value): &(&str, &str)| framed(format!("{key}={value}").as_bytes());
    framed(&fields.iter().flat_map(field).collect::<Vec<u8>>())
}

/// A length, and what has that length.
pub(super) fn framed(body: &[u8]) -> Vec<u8> {
    let length = u32::try_from(body.len()).unwrap_or(u32::MAX);
    [&length.to_le_bytes(), body].concat()
}

#[cfg(test)]
mod tests {
    use std::{net::TcpListener, thread};

    use super::*;

    fn pair() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (client, listener.accept().unwrap().0)
    }

    fn soon(stream: &TcpStream) -> Timed<'_> {
        Timed { stream, until: Instant::now() + Duration::from_millis(200) }
    }

    #[test]
    fn a_header_reads_back() {
        let (mut near, far) = pair();
        near.write_all(&header(&[("service", "/a"), ("md5sum", "x=y")])).unwrap();
        let fields = soon(&far).header().unwrap();
        assert_eq!((fields["service"].as_str(), fields["md5sum"].as_str()), ("/a", "x=y"));
    }

    #[test]
    fn hostile_lengths_and_silence_are_errors() {
        for bytes in [
            &[0xff; 8][..],
            &[4, 0, 0, 0, 0xff, 0xff, 0xff, 0x7f],
            &[9, 0, 0, 0, 1],
            &[5, 0, 0, 0, 1, 0, 0, 0, b'x'],
            &[],
        ] {
            let (mut near, far) = pair();
            near.write_all(bytes).unwrap();
            let start = Instant::now();
            assert!(soon(&far).header().is_err(), "{bytes:?}");
            assert!(start.elapsed() < Duration::from_secs(2));
        }
    }

    #[test]
    fn one_byte_at_a_time_does_not_put_the_deadline_off() {
        let (mut near, far) = pair();
        let slow = thread::spawn(move || {
            let _ = near.write_all(&[200, 0, 0, 0]);
            while near.write_all(&[1]).is_ok() {
                thread::sleep(Duration::from_millis(20));
            }
        });
        assert!(soon(&far).header().is_err());
        drop(far);
        slow.join().unwrap();
    }
}
