//! A table of numbers as programs export it: columns parted by comma, semicolon or tab, decimal
//! point or comma, comment and preamble lines before the header, units in it or in a row below.

use std::path::{Path, PathBuf};

use csv::StringRecord;
use units::{Unit, nearest, split_header};

use super::DataError;
use super::number::Decimals;
use super::text::{Text, read_text};

/// Content lines among which the header is looked for.
const PREAMBLE: usize = 200;

/// What a file should hold, to find its header and to say what is missing.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    /// Whether a header cell names a column that is looked for.
    pub is_column: &'a dyn Fn(&str) -> bool,
    /// The header that would do, for messages.
    pub header: &'a str,
}

/// Cells under a header.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    file: PathBuf,
    header_line: u64,
    heads: Vec<String>,
    units: Option<(u64, Vec<String>)>,
    rows: Vec<Row>,
    decimals: Decimals,
    comments: Vec<String>,
    note: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    line: u64,
    cells: StringRecord,
}

impl Row {
    fn cell(&self, column: usize) -> &str {
        self.cells.get(column).unwrap_or("").trim()
    }

    fn filled(&self) -> impl Iterator<Item = &str> {
        self.cells
            .iter()
            .map(str::trim)
            .filter(|cell| !cell.is_empty())
    }

    fn has_numbers_only(&self) -> bool {
        self.filled().next().is_some() && self.filled().all(Decimals::is_number)
    }
}

impl Sheet {
    /// Reads a file.
    ///
    /// # Errors
    /// No text, no header, no data, or rows that are not as long as the header.
    pub fn read(file: &Path, wanted: Wanted<'_>) -> Result<Self, DataError> {
        if file.is_dir() {
            return Err(DataError::file(file, "a folder; expected a file of data"));
        }
        Self::parse(file, read_text(file)?, wanted)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(file: &Path, text: Text, wanted: Wanted<'_>) -> Result<Self, DataError> {
        let Text { text, note } = text;
        let lines = Lines::part(&text);
        let delimiter = lines.delimiter();
        let mut rows = lines.rows(delimiter, file)?;
        let (header, below) = header(&rows, &lines.comments, delimiter, wanted, file)?;
        let mut heads: Vec<String> = header.cells.iter().map(|cell| cell.trim().into()).collect();
        while heads.last().is_some_and(String::is_empty) {
            heads.pop();
        }
        rows.drain(..below);
        let units = units_row(rows.first());
        if units.is_some() {
            rows.remove(0);
        }
        rows.retain(|row| row.filled().next().is_some());
        if rows.is_empty() {
            return Err(DataError::file(file, "a header and no data"));
        }
        for row in &rows {
            let surplus_is_filled = (heads.len()..row.cells.len()).any(|i| !row.cell(i).is_empty());
            if row.cells.len() < heads.len() || surplus_is_filled {
                let reason = format!(
                    "{} cells; expected {}, as in the header",
                    row.cells.len(),
                    heads.len()
                );
                return Err(DataError::line(file, row.line, reason));
            }
        }
        let cells = || rows.iter().flat_map(Row::filled);
        Ok(Self {
            file: file.to_path_buf(),
            header_line: header.line,
            heads,
            units,
            decimals: Decimals::of(cells),
            comments: lines.comments.into_iter().map(|(_, text)| text).collect(),
            note,
            rows,
        })
    }

    /// The file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Line of the header.
    pub fn header_line(&self) -> u64 {
        self.header_line
    }

    /// The header's cells.
    pub fn heads(&self) -> &[String] {
        &self.heads
    }

    /// The place of the column with this text in the header, or with it before the unit: `Load` is
    /// `Load [kN]` or `Load (kN)`, too.
    ///
    /// # Errors
    /// It is missing (the message lists the existing ones) or occurs twice.
    pub fn place(&self, head: &str) -> Result<usize, DataError> {
        let places = |name: fn(&str) -> &str| -> Vec<usize> {
            let all = self.heads.iter().enumerate();
            all.filter(|(_, own)| name(own) == head)
                .map(|(i, _)| i)
                .collect()
        };
        let mut found = places(|own| own);
        if found.is_empty() {
            found = places(|own| name_and_unit(own).0);
        }
        let wrong = |reason: String| DataError::line(&self.file, self.header_line, reason);
        match found[..] {
            [place] => Ok(place),
            [] => {
                let near = nearest(head, self.heads.iter().map(|own| name_and_unit(own).0));
                let near = near.map(|near| format!("; did you mean `{near}`?"));
                Err(wrong(format!(
                    "no column `{head}` among {}{}",
                    self.heads.join(", "),
                    near.unwrap_or_default()
                )))
            }
            [first, second, ..] => Err(wrong(format!(
                "columns {} and {} are both called `{head}`; expected different names",
                first + 1,
                second + 1
            ))),
        }
    }

    /// Line and text of a column's unit in the row below the header, if there is one.
    pub fn unit_below(&self, column: usize) -> Option<(u64, &str)> {
        let (line, units) = self.units.as_ref()?;
        let unit = units.get(column).filter(|unit| !unit.is_empty())?;
        Some((*line, unit))
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True without a row, which no sheet is.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Line of a row in the file; 0 beyond the last row.
    pub fn line(&self, row: usize) -> u64 {
        self.rows.get(row).map_or(0, |row| row.line)
    }

    /// Comment lines without their sign.
    pub fn comments(&self) -> &[String] {
        &self.comments
    }

    /// What the reader of the file should know.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// The numbers of a column, NaN where a cell is empty or `nan`; `name` is what messages call
    /// the column.
    ///
    /// # Errors
    /// A cell that holds anything else.
    pub fn column(&self, column: usize, name: &str) -> Result<Vec<f64>, DataError> {
        let mut values = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let cell = row.cell(column);
            let value = self
                .decimals
                .read(cell)
                .map_err(|hint| self.not_a_number(row, column, name, hint))?;
            values.push(value);
        }
        Ok(values)
    }

    /// The numbers of a column in which every cell must hold one.
    ///
    /// # Errors
    /// A cell that holds no finite number.
    pub fn full_column(&self, column: usize, name: &str) -> Result<Vec<f64>, DataError> {
        let mut values = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let value = self.decimals.read(row.cell(column));
            let value = value.ok().filter(|value| value.is_finite());
            const FULL: &str = "; expected one in every cell";
            values.push(value.ok_or_else(|| self.not_a_number(row, column, name, FULL))?);
        }
        Ok(values)
    }

    fn not_a_number(&self, row: &Row, column: usize, name: &str, hint: &'static str) -> DataError {
        DataError::NotANumber {
            file: self.file.clone(),
            line: row.line,
            column: column + 1,
            name: name.to_string(),
            text: row.cell(column).to_string(),
            hint,
        }
    }
}

/// Lines of content, and comments, with their numbers.
struct Lines<'a> {
    content: Vec<(u64, &'a str)>,
    comments: Vec<(u64, String)>,
}

impl<'a> Lines<'a> {
    fn part(text: &'a str) -> Self {
        let (mut content, mut comments) = (Vec::new(), Vec::new());
        for (number, line) in (1..).zip(text.lines()) {
            let bare = line.trim();
            // A spreadsheet may quote a comment that holds the separator.
            match bare.trim_start_matches('"').strip_prefix(['#', '%']) {
                Some(comment) => comments.push((number, comment.trim_end_matches('"').to_string())),
                None if bare.is_empty() => {}
                None => content.push((number, line)),
            }
        }
        Self { content, comments }
    }

    /// What parts the cells of most lines at the end of the file, where the numbers are.
    fn delimiter(&self) -> u8 {
        let count = self.content.len();
        let last = &self.content[count - count.div_ceil(2).min(PREAMBLE)..];
        let parts = |delimiter: u8| {
            let cut = |line: &str| {
                let mut quoted = false;
                line.bytes().any(|byte| {
                    quoted ^= byte == b'"';
                    byte == delimiter && !quoted
                })
            };
            2 * last.iter().filter(|(_, line)| cut(line)).count() > last.len()
        };
        match (parts(b'\t'), parts(b';')) {
            (true, _) => b'\t',
            (false, true) => b';',
            _ => b',',
        }
    }

    fn rows(&self, delimiter: u8, file: &Path) -> Result<Vec<Row>, DataError> {
        let mut text = String::new();
        for (_, line) in &self.content {
            text.push_str(line);
            text.push('\n');
        }
        let number = |line: u64| {
            let place = usize::try_from(line).unwrap_or(1).saturating_sub(1);
            self.content.get(place).map_or(0, |(number, _)| *number)
        };
        let mut rows = Vec::with_capacity(self.content.len());
        for cells in reader(delimiter)
            .from_reader(text.as_bytes())
            .into_records()
        {
            let cells = cells.map_err(|error| DataError::file(file, error.to_string()))?;
            let line = number(cells.position().map_or(1, csv::Position::line));
            rows.push(Row { line, cells });
        }
        Ok(rows)
    }
}

fn reader(delimiter: u8) -> csv::ReaderBuilder {
    let mut reader = csv::ReaderBuilder::new();
    reader
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All);
    reader
}

/// The header, and how many rows go before the first one below it.
fn header(
    rows: &[Row],
    comments: &[(u64, String)],
    delimiter: u8,
    wanted: Wanted<'_>,
    file: &Path,
) -> Result<(Row, usize), DataError> {
    let known = |cells: &StringRecord| {
        cells
            .iter()
            .filter(|cell| (wanted.is_column)(cell.trim()))
            .count()
    };
    // Below names that nobody knows, units may be taken for names, such as V for a velocity.
    let is_units = |at: usize| {
        let filled = rows[at].filled().count();
        at > 0
            && filled == rows[at - 1].filled().count()
            && 2 * known(&rows[at].cells) <= filled
            && units_row(rows.get(at)).is_some()
    };
    // The first of those with most names: a preamble may hold one of them.
    let most = (0..rows.len().min(PREAMBLE))
        .rev()
        .max_by_key(|&at| known(&rows[at].cells))
        .filter(|&at| known(&rows[at].cells) > 0 && !is_units(at));
    if let Some(at) = most {
        return Ok((rows[at].clone(), at + 1));
    }
    // Some programs write the header as a comment.
    for (line, comment) in comments {
        let mut records = reader(delimiter)
            .from_reader(comment.as_bytes())
            .into_records();
        if let Some(Ok(cells)) = records.next()
            && known(&cells) > 1
        {
            let below = rows.partition_point(|row| row.line < *line);
            return Ok((Row { line: *line, cells }, below));
        }
    }
    let Some(first) = rows.first() else {
        let reason = format!("only comments; expected a header {}", wanted.header);
        return Err(DataError::file(file, reason));
    };
    match rows.iter().position(Row::has_numbers_only) {
        Some(0) => Err(DataError::line(
            file,
            first.line,
            format!("numbers instead of a header; expected {}", wanted.header),
        )),
        Some(at) if at > 1 && is_units(at - 1) => Ok((rows[at - 2].clone(), at - 1)),
        Some(at) => Ok((rows[at - 1].clone(), at)),
        None => Ok((first.clone(), 1)),
    }
}

/// The units of a row that holds no number and mostly units.
fn units_row(row: Option<&Row>) -> Option<(u64, Vec<String>)> {
    let row = row?;
    let bare = |cell: &str| -> String { cell.trim_matches(|c| "[]() ".contains(c)).to_string() };
    let is_unit = |cell: &str| {
        let cell = bare(cell);
        cell.chars().any(char::is_alphabetic) && Unit::parse(&cell).is_ok()
    };
    let filled = row.filled().count();
    let units = row.filled().filter(|cell| is_unit(cell)).count();
    let has_number = row
        .filled()
        .any(|cell| cell != "1" && Decimals::is_number(cell));
    (units > 0 && 2 * units >= filled && !has_number).then(|| {
        (
            row.line,
            row.cells.iter().map(|cell| bare(cell.trim())).collect(),
        )
    })
}

/// A header's cell as its name and its unit: `Load [kN]`, or `Load (kN)` if the parentheses contain
/// a unit.
#[must_use]
pub fn name_and_unit(cell: &str) -> (&str, Option<&str>) {
    let cell = cell.trim();
    if let (name, Some(unit)) = split_header(cell) {
        return (name, Some(unit));
    }
    let inside = cell.strip_suffix(')').and_then(|own| own.rsplit_once('('));
    match inside.filter(|(_, unit)| Unit::parse(unit).is_ok()) {
        Some((name, unit)) => (name.trim(), Some(unit.trim())),
        None => (cell, None),
    }
}

/// Whether a header's cell is called so, with or without its unit.
#[must_use]
pub fn is_called(cell: &str, head: &str) -> bool {
    cell == head || name_and_unit(cell).0 == head
}
