//! Hostile content of chunks and of compressed files, packed as it should be: with the right sizes and checksums.

use std::io::Write;

use super::{data, target};

/// A record of an MCAP file.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

/// An MCAP file of one chunk with these records, which is closed without a summary.
fn mcap_file(records: &[u8], compression: &str) -> Vec<u8> {
    let packed = match compression {
        "zstd" => zstd::encode_all(records, 1).expect("it is packed"),
        "lz4" => lz4_of(records),
        _ => records.to_vec(),
    };
    let chunk = [
        &[0; 16],
        &(records.len() as u64).to_le_bytes()[..],
        &crc32fast::hash(records).to_le_bytes(),
        &text(compression),
        &(packed.len() as u64).to_le_bytes(),
        &packed,
    ];
    let header = [text("ros2"), text("test")].concat();
    let magic = b"\x89MCAP0\r\n";
    [
        &magic[..],
        &record(1, &header),
        &record(6, &chunk.concat()),
        &record(15, &[0; 4]),
        &record(2, &[0; 20]),
        magic,
    ]
    .concat()
}

fn lz4_of(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).expect("an encoder");
    encoder.write_all(bytes).expect("it is packed");
    let (packed, ended) = encoder.finish();
    ended.expect("it ends");
    packed
}

/// The records of the first chunk of an uncompressed MCAP file.
fn mcap_records(file: &[u8]) -> Vec<u8> {
    let mut rest = &file[8..];
    while let Some(([opcode, length @ ..], more)) = rest.split_first_chunk::<9>() {
        let (body, after) = more.split_at(u64::from_le_bytes(*length) as usize);
        if *opcode == 6 {
            // start, end, size, checksum, an empty compression, size
            return body[8 + 8 + 8 + 4 + 4 + 8..].to_vec();
        }
        rest = after;
    }
    unreachable!("the file has a chunk")
}

/// `length name=value` for each field of a bag's record, with the length of all.
fn fields(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| {
        let content = [name.as_bytes(), b"=", value].concat();
        [&(content.len() as u32).to_le_bytes()[..], &content].concat()
    };
    let all: Vec<u8> = fields.iter().flat_map(field).collect();
    [&(all.len() as u32).to_le_bytes()[..], &all].concat()
}

/// A bag of one chunk with these records, which was never closed.
fn bag_file(records: &[u8], compression: &str) -> Vec<u8> {
    let packed = match compression {
        "lz4" => lz4_of(records),
        "bz2" => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            encoder.write_all(records).expect("it is packed");
            encoder.finish().expect("it ends")
        }
        _ => records.to_vec(),
    };
    let size = (records.len() as u32).to_le_bytes();
    let chunk = fields(&[("op", b"\x05"), ("compression", compression.as_bytes()), ("size", &size)]);
    let header =
        fields(&[("op", b"\x03"), ("index_pos", &[0; 8]), ("conn_count", &[0; 4]), ("chunk_count", &[0; 4])]);
    let length = (packed.len() as u32).to_le_bytes();
    [b"#ROSBAG V2.0\n", &header[..], &[0; 4], &chunk, &length, &packed].concat()
}

/// The records of the first chunk of an uncompressed bag.
fn bag_records(file: &[u8]) -> Vec<u8> {
    let mut rest = &file[13..];
    let mut block = || {
        let (length, more) = rest.split_first_chunk().expect("a block");
        let (block, after) = more.split_at(u32::from_le_bytes(*length) as usize);
        rest = after;
        block
    };
    loop {
        let (header, content) = (block(), block());
        if header.windows(4).any(|part| part == b"op=\x05") {
            return content.to_vec();
        }
    }
}

#[test]
fn hostile_records_in_a_whole_chunk_of_an_mcap_file_are_refused_or_read() {
    let seed = mcap_records(&data("ros2_plain.mcap"));
    let tokens: [&[u8]; 4] = [b"\x05", b"\x04", b"\x03", b"\x05\x16\0\0\0\0\0\0\0"];
    target("mcap_chunk", vec![seed], &tokens, 200, |input, read| {
        for compression in ["", "zstd", "lz4"] {
            read(&mcap_file(input, compression));
        }
    });
}

#[test]
fn hostile_records_in_a_whole_chunk_of_a_bag_are_refused_or_read() {
    let seed = bag_records(&data("plain.bag"));
    let tokens: [&[u8]; 4] = [b"op=\x02", b"op=\x07", b"conn=", b"time="];
    target("bag_chunk", vec![seed], &tokens, 2000, |input, read| {
        read(&bag_file(input, "none"));
        read(&bag_file(input, "lz4"));
        // The encoder itself takes more than a short input may.
        if input.len() > 1000 {
            read(&bag_file(input, "bz2"));
        }
    });
}

#[test]
fn a_hostile_recording_in_a_whole_compressed_file_is_refused_or_read() {
    let seeds = ["ros2_db3/ros2_db3.db3", "unchunked.mcap", "ros2_plain.mcap"].map(data);
    let tokens: [&[u8]; 3] = [b"\x28\xb5\x2f\xfd", b"CREATE VIEW ", b"\x05\x16\0\0\0\0\0\0\0"];
    target("packed_payload", seeds.to_vec(), &tokens, 200, |input, read| {
        read(&zstd::encode_all(input, 1).expect("it is packed"));
    });
}
