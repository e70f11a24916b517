//! The table of a study as CSV and Parquet.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::table::{Cell, Column, Kind, Role, Table};

/// Rows of one group of a Parquet file.
const GROUP: usize = 100_000;

/// Writes the table as CSV: a heading with units, then a line a run; what is missing is empty.
///
/// # Errors
/// As the writer's.
pub fn csv(table: &Table, output: impl Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(output);
    writer.write_record(
        table
            .columns
            .iter()
            .map(|column| match (&column.unit, column.role) {
                (Some(unit), Role::Factor) => format!("{} [{unit}]", column.name),
                _ => column.name.clone(),
            }),
    )?;
    for row in &table.rows {
        writer.write_record(row.iter().map(|cell| match cell {
            Cell::Number(number) => number.to_string(),
            Cell::Text(text) => text.clone(),
            Cell::Missing => String::new(),
        }))?;
    }
    writer.flush()
}

/// Writes the table as Parquet: numbers as doubles, the run's number as a whole one, texts as UTF-8,
/// what is missing as null; the units stand in the file's key `units` as JSON.
///
/// # Errors
/// As the writer's.
pub fn parquet(table: &Table, output: impl Write + Send) -> io::Result<()> {
    write(table, output).map_err(io::Error::other)
}

fn is_whole(column: &Column) -> bool {
    column.role == Role::Run && column.kind == Kind::Number
}

fn write(table: &Table, output: impl Write + Send) -> Result<(), parquet::errors::ParquetError> {
    let fields = table.columns.iter().map(|column| {
        let physical = match column.kind {
            Kind::Text => Physical::BYTE_ARRAY,
            Kind::Number if is_whole(column) => Physical::INT64,
            Kind::Number => Physical::DOUBLE,
        };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type((column.kind == Kind::Text).then_some(LogicalType::String));
        field.build().map(Arc::new)
    });
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(
        Type::group_type_builder("runs")
            .with_fields(fields)
            .build()?,
    );
    let units: std::collections::BTreeMap<&str, &str> = table
        .columns
        .iter()
        .filter_map(|column| Some((column.name.as_str(), column.unit.as_deref()?)))
        .collect();
    let units = parquet::file::metadata::KeyValue::new(
        "units".to_string(),
        serde_json::to_string(&units).unwrap_or_default(),
    );
    let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![units]));
    let mut file = SerializedFileWriter::new(output, schema, Arc::new(properties.build()))?;
    for rows in table.rows.chunks(GROUP) {
        let mut group = file.next_row_group()?;
        for (place, column) in table.columns.iter().enumerate() {
            let cells = rows.iter().map(|row| &row[place]);
            let Some(mut writer) = group.next_column()? else {
                break;
            };
            match column.kind {
                Kind::Text => {
                    let (values, there) = present(cells, |cell| cell.text().map(ByteArray::from));
                    writer
                        .typed::<ByteArrayType>()
                        .write_batch(&values, Some(&there), None)?;
                }
                Kind::Number if is_whole(column) => {
                    let (values, there) = present(cells, |cell| cell.number().map(|n| n as i64));
                    writer
                        .typed::<Int64Type>()
                        .write_batch(&values, Some(&there), None)?;
                }
                Kind::Number => {
                    let (values, there) = present(cells, Cell::number);
                    writer
                        .typed::<DoubleType>()
                        .write_batch(&values, Some(&there), None)?;
                }
            }
            writer.close()?;
        }
        group.close()?;
    }
    file.close()?;
    Ok(())
}

/// The values that are there, and for each cell whether it has one.
fn present<'a, T>(
    cells: impl Iterator<Item = &'a Cell>,
    value: impl Fn(&Cell) -> Option<T>,
) -> (Vec<T>, Vec<i16>) {
    let mut values = Vec::new();
    let there = cells.map(|cell| {
        let value = value(cell);
        let is_there = i16::from(value.is_some());
        values.extend(value);
        is_there
    });
    let there = there.collect();
    (values, there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    #[test]
    fn parquet_holds_what_the_table_does() {
        let column = |name: &str, role, kind| Column {
            name: name.to_string(),
            unit: (kind == Kind::Number && role == Role::Factor).then(|| "N/m".to_string()),
            role,
            kind,
        };
        let columns = vec![
            column("number", Role::Run, Kind::Number),
            column("controller", Role::Factor, Kind::Text),
            column("specimen.stiffness", Role::Factor, Kind::Number),
            column("reason", Role::Ending, Kind::Text),
        ];
        let rows = (0..1000).map(|n| {
            let missing = n % 7 == 0;
            vec![
                Cell::Number(f64::from(n)),
                Cell::from(if n % 2 == 0 { "mpc" } else { "größer" }),
                Cell::Number(0.1 * f64::from(n)),
                if missing {
                    Cell::Missing
                } else {
                    Cell::from(format!("{n}"))
                },
            ]
        });
        let table = Table {
            columns,
            rows: rows.collect(),
        };
        let mut file = tempfile::tempfile().unwrap();
        parquet(&table, &mut file).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let keys = reader
            .metadata()
            .file_metadata()
            .key_value_metadata()
            .unwrap();
        assert_eq!(
            keys[0].value.as_deref(),
            Some("{\"specimen.stiffness\":\"N/m\"}")
        );
        let mut count = 0;
        for (row, expected) in reader.get_row_iter(None).unwrap().zip(&table.rows) {
            let row = row.unwrap();
            let found = row.get_column_iter().map(|(_, field)| match field {
                Field::Long(number) => Cell::Number(*number as f64),
                Field::Double(number) => Cell::Number(*number),
                Field::Str(text) => Cell::Text(text.clone()),
                Field::Null => Cell::Missing,
                other => panic!("{other}"),
            });
            assert_eq!(&found.collect::<Vec<_>>(), expected);
            count += 1;
        }
        assert_eq!(count, 1000);
    }
}
