//! NumPy files: `.npy` (one array) and `.npz` (several, by name). The format is NumPy Enhancement Proposal 1.
//!
//! Why not a library: `npyz` 0.9 brings a parser generator for the one line of a header, and for `.npz` a version of `zip` with
//! ciphers and bzip2.
//!
//! An array of one dimension is a column of its name; one of two dimensions gives a column for each of its columns (`x_0`, `x_1`),
//! named by an array of as many words if there is one; one with fields gives a column for each field.

use std::io::Cursor;

use super::{
    super::{columns::check_count, time},
    Column,
};
use crate::{ensure, memory::Memory};

/// A longer header is none, bytes; NumPy itself reads 10 000.
const LONGEST_HEADER: usize = 1 << 20;

/// An array: its shape, and the columns of its values in the order of rows.
struct Array {
    shape: Vec<usize>,
    /// One for each field; a single one without a name for an array without fields.
    fields: Vec<(String, Column)>,
}

/// The columns of a `.npy` file.
pub(super) fn array_file(bytes: &[u8], memory: Memory) -> Result<Vec<(String, Column)>, String> {
    Ok(columns_of("x", array(bytes, memory)?, &[]))
}

/// The columns of a `.npz` file; `None` if the ZIP archive holds no array.
pub(super) fn archive(bytes: &[u8], memory: Memory) -> Option<Result<Vec<(String, Column)>, String>> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).ok()?;
    let names = archive.file_names().filter_map(|name| Some(name.ok()?.into_owned()));
    let names: Vec<String> = names.filter(|name| name.ends_with(".npy")).collect();
    if names.is_empty() {
        return None;
    }
    let (mut arrays, mut whole) = (Vec::new(), 0_u64);
    for file in names {
        let name = file.trim_end_matches(".npy").to_owned();
        let read = archive
            .by_name(&file)
            .map_err(|error| error.to_string())
            .and_then(|entry| memory.unpack(entry, bytes.len() as u64).map_err(|error| error.to_string()));
        let found = read.and_then(|unpacked| {
            let array = array(&unpacked, memory)?;
            // Members may lie over each other.
            whole += array.fields.iter().map(|(_, column)| column.bytes()).sum::<u64>();
            memory.check_growth(whole, bytes.len() as u64).map(|()| array)
        });
        match found {
            Ok(array) => arrays.push((name, array)),
            Err(reason) => return Some(Err(format!("array '{name}': {reason}"))),
        }
    }
    Some(joined(arrays))
}

/// The columns of all arrays, which must have as many rows each. Words that name columns, and single numbers, are none.
fn joined(arrays: Vec<(String, Array)>) -> Result<Vec<(String, Column)>, String> {
    let names: Vec<Vec<String>> = arrays.iter().filter_map(|(_, array)| array.words()).collect();
    let is_name_list = |array: &Array| {
        array.words().is_some_and(|words| {
            arrays.iter().any(|(_, other)| other.shape.len() == 2 && other.shape.get(1) == Some(&words.len()))
        })
    };
    let keep: Vec<bool> =
        arrays.iter().map(|(_, array)| !array.shape.is_empty() && !is_name_list(array)).collect();
    let mut columns = Vec::new();
    let mut rows: Option<(String, usize)> = None;
    for ((name, array), _) in arrays.into_iter().zip(keep).filter(|(_, keep)| *keep) {
        let own = array.shape.first().copied().unwrap_or(0);
        match &rows {
            Some((other, rows)) if *rows != own => {
                return Err(format!(
                    "array '{name}' has {own} rows, array '{other}' has {rows}; save the arrays of one recording with as many rows each"
                ));
            }
            Some(_) => {}
            None => rows = Some((name.clone(), own)),
        }
        columns.extend(columns_of(&name, array, &names));
    }
    if columns.is_empty() { Err("it has no array of one or two dimensions".into()) } else { Ok(columns) }
}

impl Array {
    /// The words of a list of words without gaps.
    fn words(&self) -> Option<Vec<String>> {
        match (self.shape.len(), self.fields.as_slice()) {
            (1, [(_, Column::Words(words))]) => words.iter().cloned().collect(),
            _ => None,
        }
    }
}

/// An array as columns: its fields, or else those of the array.
fn columns_of(name: &str, array: Array, names: &[Vec<String>]) -> Vec<(String, Column)> {
    if array.fields.first().is_some_and(|(field, _)| !field.is_empty()) {
        return array.fields;
    }
    let Some((_, values)) = array.fields.into_iter().next() else { return Vec::new() };
    let width = match array.shape.as_slice() {
        [_] => return vec![(name.to_owned(), values)],
        [_, width] => *width,
        shape => return vec![(name.to_owned(), Column::Other(format!("an array of shape {shape:?}")))],
    };
    let own = names.iter().find(|names| names.len() == width);
    let title = |column: usize| own.map_or_else(|| format!("{name}_{column}"), |names| names[column].clone());
    let every = |column: usize| match &values {
        Column::Numbers(all) => Column::Numbers(all.iter().skip(column).step_by(width).copied().collect()),
        Column::Times(all) => Column::Times(all.iter().skip(column).step_by(width).copied().collect()),
        Column::Words(all) => Column::Words(all.iter().skip(column).step_by(width).cloned().collect()),
        Column::Other(what) => Column::Other(what.clone()),
    };
    (0..width).map(|column| (title(column), every(column))).collect()
}

/// One array: a header in Python's words, then the values.
fn array(bytes: &[u8], memory: Memory) -> Result<Array, String> {
    let short = || "the NumPy file is cut off".to_owned();
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("this is not a NumPy array")?;
    let (length, start): (usize, usize) = match rest {
        [1, _, a, b, ..] => (usize::from(u16::from_le_bytes([*a, *b])), 4),
        [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 6),
        _ => return Err(short()),
    };
    ensure(length <= LONGEST_HEADER, || format!("the header of the NumPy file claims {length} bytes"))?;
    let header = rest.get(start..start + length).ok_or_else(short)?;
    let header = std::str::from_utf8(header).map_err(|_| "the header of the NumPy file is not text")?;
    let values = rest.get(start + length..).ok_or_else(short)?;
    let (kinds, fortran, shape) = described(header)?;
    let count =
        shape.iter().try_fold(1_usize, |product, side| product.checked_mul(*side)).ok_or_else(short)?;
    ensure(shape.first() != Some(&0), || "it has no rows; rows of numbers are needed")?;
    let width: usize = kinds.iter().map(|(_, kind)| kind.bytes).sum();
    ensure(width.checked_mul(count).is_some_and(|needed| needed <= values.len()), short)?;
    // From here on there are as many values as the shape says.
    check_count(if let [_, columns] = shape[..] { columns } else { kinds.len() })?;
    let cells = (count as u64).saturating_mul(kinds.iter().map(|(_, kind)| kind.in_memory()).sum());
    memory.check((bytes.len() as u64).saturating_add(cells))?;
    let place = |at: usize| match (fortran, shape.as_slice()) {
        (true, &[rows, columns]) => (at % columns) * rows + at / columns,
        _ => at,
    };
    let mut offset = 0;
    let mut fields = Vec::new();
    for (name, kind) in kinds {
        let cell = |at: usize| &values[place(at) * width + offset..][..kind.bytes];
        fields.push((name, kind.column((0..count).map(cell))));
        offset += kind.bytes;
    }
    Ok(Array { shape, fields })
}

/// How a value is stored.
struct Kind {
    big_endian: bool,
    /// `f`, `i`, `u`, `b`, `U`, `S`, `M`.
    letter: char,
    bytes: usize,
    /// Units of a stamp in a second.
    per_second: f64,
}

impl Kind {
    /// `<f8`, `|b1`, `>i4`, `<U12`, `<M8[ns]`.
    fn parse(text: &str) -> Result<Self, String> {
        let unknown =
            || format!("values of type '{text}' are not read; convert them to float64 (array.astype(float))");
        let mut letters = text.chars();
        let order = letters.next().ok_or_else(unknown)?;
        let letter = letters.next().filter(|letter| "fiubUSM".contains(*letter)).ok_or_else(unknown)?;
        let rest = letters.as_str();
        let (size, unit) =
            rest.split_once('[').map_or((rest, ""), |(size, unit)| (size, unit.trim_end_matches(']')));
        let size: usize = size.parse().map_err(|_| unknown())?;
        let known = match letter {
            'f' => matches!(size, 2 | 4 | 8),
            'i' | 'u' => matches!(size, 1 | 2 | 4 | 8),
            'b' => size == 1,
            'M' => size == 8,
            _ => (1..=1 << 16).contains(&size),
        };
        let per_second = match unit {
            "ns" => 1e9,
            "us" => 1e6,
            "ms" => 1e3,
            "m" => 1.0 / 60.0,
            "h" => 1.0 / 3600.0,
            "D" => 1.0 / 86_400.0,
            "" | "s" => 1.0,
            _ => return Err(unknown()),
        };
        let bytes = if letter == 'U' { size.saturating_mul(4) } else { size };
        if known { Ok(Self { big_endian: order == '>', letter, bytes, per_second }) } else { Err(unknown()) }
    }

    /// Bytes that a value takes as a cell of a column.
    fn in_memory(&self) -> u64 {
        (if "US".contains(self.letter) { size_of::<Option<String>>() + self.bytes } else { size_of::<f64>() })
            as u64
    }

    fn column<'a>(&self, cells: impl Iterator<Item = &'a [u8]>) -> Column {
        match self.letter {
            'U' | 'S' => Column::Words(
                cells.map(|cell| Some(self.word(cell)).filter(|word| !word.is_empty())).collect(),
            ),
            'M' => {
                let seconds = |cell| match self.whole(cell) as i64 {
                    // Not a time.
                    i64::MIN => f64::NAN,
                    stamp => time::split_seconds(stamp, self.per_second),
                };
                Column::Times(cells.map(seconds).collect())
            }
            _ => Column::Numbers(cells.map(|cell| self.number(cell)).collect()),
        }
    }

    /// The bits of a value, with the sign of whole numbers spread.
    fn whole(&self, cell: &[u8]) -> u64 {
        let join = |bits: u64, byte: &u8| (bits << 8) | u64::from(*byte);
        let bits = if self.big_endian { cell.iter().fold(0, join) } else { cell.iter().rev().fold(0, join) };
        let unused = 64 - 8 * cell.len().clamp(1, 8) as u32;
        if matches!(self.letter, 'i' | 'M') { (((bits << unused) as i64) >> unused) as u64 } else { bits }
    }

    fn number(&self, cell: &[u8]) -> f64 {
        let bits = self.whole(cell);
        match (self.letter, self.bytes) {
            ('f', 8) => f64::from_bits(bits),
            ('f', 4) => f64::from(f32::from_bits(bits as u32)),
            ('f', _) => half(bits as u16),
            ('i', _) => bits as i64 as f64,
            _ => bits as f64,
        }
    }

    fn word(&self, cell: &[u8]) -> String {
        if self.letter == 'S' {
            return String::from_utf8_lossy(cell).trim_end_matches('\0').to_owned();
        }
        let letter = |four: &[u8]| char::from_u32(self.whole(four) as u32).unwrap_or('\u{fffd}');
        let word: String = cell.chunks(4).map(letter).collect();
        word.trim_end_matches('\0').to_owned()
    }
}

/// IEEE 754 half precision: a sign, 5 bits of exponent, 10 of mantissa.
fn half(bits: u16) -> f64 {
    let (exponent, mantissa) = (i32::from((bits >> 10) & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => mantissa * 2_f64.powi(-24),
        31 if mantissa == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + mantissa) * 2_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// The fields of an array, whether columns come first, and its shape.
type Layout = (Vec<(String, Kind)>, bool, Vec<usize>);

/// What the header says.
fn described(header: &str) -> Result<Layout, String> {
    let fault = || {
        let shown: String = header.trim().chars().take(80).collect();
        format!("the header of the NumPy file is not understood: {shown}")
    };
    let after = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}'"))?;
        Some(rest.trim_start().strip_prefix(':')?.trim_start())
    };
    let descr = after("descr").ok_or_else(fault)?;
    let kinds = if let Some(list) = descr.strip_prefix('[') {
        let (list, _) = list.rsplit_once(']').ok_or_else(fault)?;
        let list = list.split("'fortran_order'").next().unwrap_or_default();
        let words: Vec<&str> = list.split('\'').skip(1).step_by(2).collect();
        let fields = words.as_chunks::<2>().0;
        ensure(!fields.is_empty() && list.matches('(').count() == fields.len(), fault)?;
        let field = |[name, kind]: &[&str; 2]| Ok(((*name).to_owned(), Kind::parse(kind)?));
        fields.iter().map(field).collect::<Result<_, String>>()?
    } else {
        let kind = descr.split('\'').nth(1).ok_or_else(fault)?;
        vec![(String::new(), Kind::parse(kind)?)]
    };
    let fortran = after("fortran_order").ok_or_else(fault)?.starts_with("True");
    let shape = after("shape").and_then(|rest| rest.strip_prefix('(')?.split_once(')')).ok_or_else(fault)?.0;
    let side = |side: &str| side.trim().parse::<usize>().map_err(|_| fault());
    let shape =
        shape.split(',').filter(|side| !side.trim().is_empty()).map(side).collect::<Result<_, _>>()?;
    Ok((kinds, fortran, shape))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn most() -> Memory {
        Memory::of(None)
    }

    /// A `.npy` file with this header and these bytes.
    fn file(header: &str, values: &[u8]) -> Vec<u8> {
        let length = u16::try_from(header.len()).expect("short").to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), values].concat()
    }

    #[test]
    fn an_array_is_read_in_either_order_and_with_fields() {
        let values: Vec<u8> =
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0_f64].iter().flat_map(|v| v.to_le_bytes()).collect();
        let header = |fortran| format!("{{'descr': '<f8', 'fortran_order': {fortran}, 'shape': (3, 2), }}\n");
        let of = |fortran| array_file(&file(&header(fortran), &values), most()).expect("reads");
        let column = |name: &str, values: &[f64]| (name.to_owned(), Column::Numbers(values.to_vec()));
        assert_eq!(of("False"), [column("x_0", &[1.0, 3.0, 5.0]), column("x_1", &[2.0, 4.0, 6.0])]);
        assert_eq!(of("True"), [column("x_0", &[1.0, 2.0, 3.0]), column("x_1", &[4.0, 5.0, 6.0])]);
        let header = "{'descr': [('a', '>i2'), ('b', '|b1')], 'fortran_order': False, 'shape': (2,), }";
        let read = array_file(&file(header, &[0xff, 0xfe, 1, 0, 3, 0]), most()).expect("reads");
        assert_eq!(read, [column("a", &[-2.0, 3.0]), column("b", &[1.0, 0.0])]);
    }

    #[test]
    fn words_stamps_and_small_numbers_are_read() {
        let half_and = "{'descr': '<f2', 'fortran_order': False, 'shape': (3,), }";
        let read = array_file(&file(half_and, &[0x00, 0x3c, 0x00, 0xc0, 0x01, 0x00]), most()).expect("reads");
        assert_eq!(read[0].1, Column::Numbers(vec![1.0, -2.0, 2_f64.powi(-24)]));
        let stamps = "{'descr': '<M8[ms]', 'fortran_order': False, 'shape': (2,), }";
        let bytes: Vec<u8> = [1500_i64, i64::MIN].iter().flat_map(|v| v.to_le_bytes()).collect();
        let Column::Times(times) = &array_file(&file(stamps, &bytes), most()).expect("reads")[0].1 else {
            panic!("times")
        };
        assert!(times[0] == 1.5 && times[1].is_nan());
        let words = "{'descr': '<U2', 'fortran_order': False, 'shape': (1,), }";
        let read = array_file(&file(words, &[b'h', 0, 0, 0, b'v', 0, 0, 0]), most()).expect("reads");
        assert_eq!(read[0].1, Column::Words(vec![Some("hv".into())]));
    }

    #[test]
    fn what_is_cut_off_or_of_another_type_is_one_sentence() {
        let good = file("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }", &[0; 16]);
        for length in 0..good.len() {
            assert!(array(&good[..length], most()).is_err(), "{length}");
        }
        let other = |header: &str| array(&file(header, &[0; 64]), most()).err().expect("refused");
        assert!(other("{'descr': '|O', 'fortran_order': False, 'shape': (2,), }").contains("astype(float)"));
        assert!(other("{'descr': '<f8', 'shape': (2,), }").contains("not understood"));
        assert!(
            other("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 99999999999), }")
                .contains("cut off")
        );
        for (kind, shape, reported) in [
            ("'<S0'", "(4611686018427387904,)", "not read"),
            ("'<f8'", "(0, 4611686018427387904)", "no rows"),
            ("'<f8'", "(4611686018427387904, 4611686018427387904)", "cut off"),
            ("'<f8'", "(-1,)", "not understood"),
            ("'<S2147483648'", "(1,)", "not read"),
            ("'|b1'", "(1, 9223372036854775807)", "cut off"),
        ] {
            let message = other(&format!("{{'descr': {kind}, 'fortran_order': True, 'shape': {shape}, }}"));
            assert!(message.contains(reported), "{kind} {shape}: {message}");
        }
        let wide = file("{'descr': '|b1', 'fortran_order': True, 'shape': (1, 200000), }", &[0; 200_000]);
        assert!(array(&wide, most()).err().expect("refused").contains("200000 columns"));
    }
}
