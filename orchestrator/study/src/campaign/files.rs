//! The table of a study as CSV and Parquet.

use std::io::{self, Write};

use super::table::{Cell, Kind, Role, Table};
use laboratory::results::parquet_file::{self, Values};

/// Writes the table as CSV: a heading with units, then one line per run; what is missing is empty.
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
/// what is missing as null.
///
/// # Errors
/// As the writer's.
pub fn parquet(table: &Table, output: impl Write + Send) -> io::Result<()> {
    let columns = table.columns.iter().map(|column| parquet_file::Column {
        name: column.name.clone(),
        unit: column.unit.clone(),
        kind: match column.kind {
            Kind::Text => parquet_file::Kind::Text,
            Kind::Number if column.role == Role::Run => parquet_file::Kind::Whole,
            Kind::Number => parquet_file::Kind::Number,
        },
    });
    let columns: Vec<_> = columns.collect();
    parquet_file::write(&columns, table.rows.len(), output, |place, rows| {
        let cells = table.rows[rows].iter().map(|row| &row[place]);
        match table.columns[place].kind {
            Kind::Text => Values::Texts(cells.map(|cell| cell.text().map(String::from)).collect()),
            Kind::Number => Values::Numbers(
                cells
                    .map(|cell| cell.number().unwrap_or(f64::NAN))
                    .collect(),
            ),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::table::Column;
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

    #[test]
    fn lines_of_csv_have_units_of_factors_and_gaps_for_what_is_missing() {
        let column = |name: &str, unit: Option<&str>, role, kind| Column {
            name: name.to_string(),
            unit: unit.map(str::to_string),
            role,
            kind,
        };
        let table = Table {
            columns: vec![
                column("number", None, Role::Run, Kind::Number),
                column(
                    "specimen.stiffness",
                    Some("N/m"),
                    Role::Factor,
                    Kind::Number,
                ),
                column("delay_s", Some("s"), Role::Result, Kind::Number),
                column("reason", None, Role::Ending, Kind::Text),
            ],
            rows: vec![
                vec![0.0.into(), 14_000.5.into(), 0.012.into(), Cell::Missing],
                vec![
                    1.0.into(),
                    1e-9.into(),
                    Cell::Missing,
                    "it, \"stopped\"".into(),
                ],
            ],
        };
        let mut text = Vec::new();
        csv(&table, &mut text).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "number,specimen.stiffness [N/m],delay_s,reason\n0,14000.5,0.012,\n1,0.000000001,,\"it, \"\"stopped\"\"\"\n"
        );
    }
}
