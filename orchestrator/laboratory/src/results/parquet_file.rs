//! Tables as Parquet, which every tool for data reads with types and without loss.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

/// Rows that are written at a time.
const GROUP: usize = 100_000;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Doubles.
    Number,
    /// Whole numbers.
    Whole,
    /// UTF-8.
    Text,
}

/// A column.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Its unit: the file's key `units` has them as JSON.
    pub unit: Option<String>,
    /// What it holds.
    pub kind: Kind,
}

/// Values of a column, in the order of the rows.
pub enum Values {
    /// Of [`Kind::Number`] and [`Kind::Whole`]; what is not finite becomes null.
    Numbers(Vec<f64>),
    /// Of [`Kind::Text`].
    Texts(Vec<Option<String>>),
}

/// Writes `rows` rows; `values` gives those of a column and a range of rows.
///
/// # Errors
/// As the writer's.
pub fn write(
    columns: &[Column],
    rows: usize,
    output: impl Write + Send,
    values: impl Fn(usize, Range<usize>) -> Values,
) -> io::Result<()> {
    let write = || -> Result<(), ParquetError> {
        let fields = columns.iter().map(|column| {
            let physical = match column.kind {
                Kind::Text => Physical::BYTE_ARRAY,
                Kind::Whole => Physical::INT64,
                Kind::Number => Physical::DOUBLE,
            };
            let field = Type::primitive_type_builder(&column.name, physical)
                .with_repetition(Repetition::OPTIONAL)
                .with_logical_type((column.kind == Kind::Text).then_some(LogicalType::String));
            field.build().map(Arc::new)
        });
        let fields = fields.collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("table")
            .with_fields(fields)
            .build()?;
        let units = columns.iter().filter_map(|column| {
            let unit = column.unit.as_deref()?;
            Some((column.name.as_str(), unit))
        });
        let units: BTreeMap<&str, &str> = units.collect();
        let units = KeyValue::new(
            "units".to_string(),
            serde_json::to_string(&units).unwrap_or_default(),
        );
        let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![units]));
        let properties = Arc::new(properties.build());
        let mut file = SerializedFileWriter::new(output, Arc::new(schema), properties)?;
        for from in (0..rows).step_by(GROUP) {
            let part = from..rows.min(from + GROUP);
            let mut group = file.next_row_group()?;
            for (place, column) in columns.iter().enumerate() {
                let Some(mut writer) = group.next_column()? else {
                    break;
                };
                match (values(place, part.clone()), column.kind) {
                    (Values::Texts(texts), _) => {
                        let there: Vec<i16> =
                            texts.iter().map(|text| i16::from(text.is_some())).collect();
                        let texts: Vec<ByteArray> = texts
                            .iter()
                            .flatten()
                            .map(|text| ByteArray::from(text.as_str()))
                            .collect();
                        writer
                            .typed::<ByteArrayType>()
                            .write_batch(&texts, Some(&there), None)?;
                    }
                    (Values::Numbers(numbers), kind) => {
                        let there: Vec<i16> =
                            numbers.iter().map(|n| i16::from(n.is_finite())).collect();
                        let numbers = numbers.into_iter().filter(|number| number.is_finite());
                        if kind == Kind::Whole {
                            let numbers: Vec<i64> = numbers.map(|number| number as i64).collect();
                            writer.typed::<Int64Type>().write_batch(
                                &numbers,
                                Some(&there),
                                None,
                            )?;
                        } else {
                            let numbers: Vec<f64> = numbers.collect();
                            writer.typed::<DoubleType>().write_batch(
                                &numbers,
                                Some(&there),
                                None,
                            )?;
                        }
                    }
                }
                writer.close()?;
            }
            group.close()?;
        }
        file.close()?;
        Ok(())
    };
    write().map_err(io::Error::other)
}
