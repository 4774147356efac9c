//! Parquet and Arrow files (Feather too), by the libraries of the Arrow project.

use std::io::Cursor;

use arrow_array::{
    Array, RecordBatch,
    cast::AsArray,
    types::{
        ArrowPrimitiveType, Date32Type, Date64Type, Decimal128Type, Float16Type, Float32Type, Float64Type,
        Int8Type, Int16Type, Int32Type, Int64Type, Time32MillisecondType, Time32SecondType,
        Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType,
        TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
    },
};
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_schema::{ArrowError, DataType, TimeUnit};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::{
    super::{columns::check_count, time},
    Column, claims,
    guard::guarded,
};
use crate::memory::Memory;

type Columns = Result<Vec<(String, Column)>, String>;

/// Cells that are read of a Parquet file at a time.
const BATCH: usize = 1 << 22;

/// The columns of a Parquet or Arrow file; `None` if it is neither.
pub(super) fn columns(bytes: &[u8], memory: Memory) -> Option<Columns> {
    let (what, read): (_, fn(&[u8], Memory) -> Columns) = match bytes {
        [b'P', b'A', b'R', b'1', ..] => ("Parquet", parquet_file),
        [b'A', b'R', b'R', b'O', b'W', b'1', ..] => ("Arrow", arrow_file),
        // The stream format begins with the mark of a message.
        [0xff, 0xff, 0xff, 0xff, ..] => ("Arrow", arrow_stream),
        _ => return None,
    };
    let read = guarded(|| read(bytes, memory));
    Some(read.map_err(|error| format!("the {what} file is damaged or not supported: {error}")))
}

fn parquet_file(bytes: &[u8], memory: Memory) -> Columns {
    let builder = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::copy_from_slice(bytes))
        .map_err(|error| error.to_string())?;
    let columns = builder.schema().fields().len();
    check_count(columns)?;
    claims::check_parquet(bytes, builder.metadata(), memory)?;
    let rows = (BATCH / columns.max(1)).clamp(1, 1 << 16);
    let reader = builder.with_batch_size(rows).build().map_err(|error| error.to_string())?;
    of(reader, bytes.len(), memory)
}

fn arrow_file(bytes: &[u8], memory: Memory) -> Columns {
    claims::check_arrow_file(bytes, memory)?;
    let reader = FileReader::try_new(Cursor::new(bytes), None).map_err(|error| error.to_string())?;
    of(reader, bytes.len(), memory)
}

fn arrow_stream(bytes: &[u8], memory: Memory) -> Columns {
    claims::check_arrow_stream(bytes, memory)?;
    let reader = StreamReader::try_new(Cursor::new(bytes), None).map_err(|error| error.to_string())?;
    of(reader, bytes.len(), memory)
}

fn of(
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>>,
    length: usize,
    memory: Memory,
) -> Columns {
    let mut columns: Vec<(String, Column)> = Vec::new();
    for batch in batches {
        let batch = batch.map_err(|error| error.to_string())?;
        check_count(batch.num_columns())?;
        // Runs of one value take a few bytes, however long they are.
        let held: u64 = columns.iter().map(|(_, column)| column.bytes()).sum();
        let more = (batch.num_rows() as u64).saturating_mul((batch.num_columns() * size_of::<f64>()) as u64);
        memory.check_growth(held.saturating_add(more), length as u64)?;
        for (place, field) in batch.schema().fields().iter().enumerate() {
            let more = column(batch.column(place).as_ref());
            match columns.get_mut(place) {
                None => columns.push((field.name().clone(), more)),
                Some((_, column)) => column.append(more),
            }
        }
    }
    Ok(columns)
}

impl Column {
    fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::Numbers(a), Self::Numbers(b)) | (Self::Times(a), Self::Times(b)) => a.extend(b),
            (Self::Words(a), Self::Words(b)) => a.extend(b),
            (column, other) => *column = other,
        }
    }
}

/// The values of an array; what is null is missing.
fn numbers<T: ArrowPrimitiveType>(array: &dyn Array, value: impl Fn(T::Native) -> f64) -> Vec<f64> {
    array.as_primitive::<T>().iter().map(|of| of.map_or(f64::NAN, &value)).collect()
}

/// An array as a column.
fn column(array: &dyn Array) -> Column {
    let words = |words: Vec<Option<&str>>| {
        Column::Words(words.into_iter().map(|word| word.map(str::to_owned)).collect())
    };
    Column::Numbers(match array.data_type() {
        DataType::Null => vec![f64::NAN; array.len()],
        DataType::Boolean => array.as_boolean().iter().map(|of| of.map_or(f64::NAN, f64::from)).collect(),
        DataType::Int8 => numbers::<Int8Type>(array, f64::from),
        DataType::Int16 => numbers::<Int16Type>(array, f64::from),
        DataType::Int32 => numbers::<Int32Type>(array, f64::from),
        DataType::Int64 => numbers::<Int64Type>(array, |value| value as f64),
        DataType::UInt8 => numbers::<UInt8Type>(array, f64::from),
        DataType::UInt16 => numbers::<UInt16Type>(array, f64::from),
        DataType::UInt32 => numbers::<UInt32Type>(array, f64::from),
        DataType::UInt64 => numbers::<UInt64Type>(array, |value| value as f64),
        DataType::Float16 => numbers::<Float16Type>(array, |value| value.to_f64()),
        DataType::Float32 => numbers::<Float32Type>(array, f64::from),
        DataType::Float64 => numbers::<Float64Type>(array, |value| value),
        DataType::Decimal128(_, scale) => {
            let unit = 10_f64.powi(i32::from(*scale));
            numbers::<Decimal128Type>(array, |value| value as f64 / unit)
        }
        DataType::Utf8 => return words(array.as_string::<i32>().iter().collect()),
        DataType::LargeUtf8 => return words(array.as_string::<i64>().iter().collect()),
        DataType::Utf8View => return words(array.as_string_view().iter().collect()),
        DataType::Dictionary(..) => return of_dictionary(array),
        kind => return times(array, kind),
    })
}

/// Stamps and times of day, so many a second, in seconds.
fn seconds<T: ArrowPrimitiveType<Native: Into<i64>>>(array: &dyn Array, per: f64) -> Vec<f64> {
    numbers::<T>(array, |value| time::split_seconds(value.into(), per))
}

/// Stamps, dates and times of day in seconds; anything else by its name.
fn times(array: &dyn Array, kind: &DataType) -> Column {
    Column::Times(match kind {
        DataType::Timestamp(TimeUnit::Second, _) => seconds::<TimestampSecondType>(array, 1.0),
        DataType::Timestamp(TimeUnit::Millisecond, _) => seconds::<TimestampMillisecondType>(array, 1e3),
        DataType::Timestamp(TimeUnit::Microsecond, _) => seconds::<TimestampMicrosecondType>(array, 1e6),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => seconds::<TimestampNanosecondType>(array, 1e9),
        DataType::Date32 => numbers::<Date32Type>(array, |day| f64::from(day) * 86_400.0),
        DataType::Date64 => seconds::<Date64Type>(array, 1e3),
        DataType::Time32(TimeUnit::Second) => seconds::<Time32SecondType>(array, 1.0),
        DataType::Time32(_) => seconds::<Time32MillisecondType>(array, 1e3),
        DataType::Time64(TimeUnit::Microsecond) => seconds::<Time64MicrosecondType>(array, 1e6),
        DataType::Time64(_) => seconds::<Time64NanosecondType>(array, 1e9),
        other => {
            let name = other.to_string();
            return Column::Other(name.split(['(', '<']).next().unwrap_or_default().to_owned());
        }
    })
}

/// The values that the keys of a category stand for.
fn of_dictionary(array: &dyn Array) -> Column {
    let dictionary = array.as_any_dictionary();
    let values = column(dictionary.values().as_ref());
    let keys = dictionary.normalized_keys();
    let key = |row: usize| (!array.is_null(row)).then(|| keys[row]);
    match values {
        Column::Words(words) => Column::Words(
            (0..array.len()).map(|row| key(row).and_then(|key| words.get(key).cloned().flatten())).collect(),
        ),
        Column::Numbers(numbers) => Column::Numbers(
            (0..array.len())
                .map(|row| key(row).and_then(|key| numbers.get(key).copied()).unwrap_or(f64::NAN))
                .collect(),
        ),
        Column::Times(_) | Column::Other(_) => {
            Column::Other("categories of something else than words".into())
        }
    }
}
