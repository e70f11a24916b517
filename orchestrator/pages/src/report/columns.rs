//! Tables of text with aligned columns.

/// Rows of cells; the first column is aligned left, the others right.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            let padding = " ".repeat(widths[column].saturating_sub(cell.chars().count()));
            if column == 0 {
                line += cell;
                line += &padding;
            } else {
                line += "  ";
                line += &padding;
                line += cell;
            }
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

/// As [`aligned`], with the last column aligned left.
pub fn last_left(mut rows: Vec<Vec<String>>) -> String {
    let last: Vec<String> = rows.iter_mut().filter_map(Vec::pop).collect();
    let width = rows
        .iter()
        .flat_map(|row| row.last())
        .map(|c| c.chars().count())
        .max();
    for row in &mut rows {
        if let Some(cell) = row.last_mut() {
            *cell = format!("{cell:<0$}", width.unwrap_or(0));
        }
    }
    let table = aligned(&rows);
    let full = table
        .lines()
        .map(|line| line.chars().count())
        .max()
        .unwrap_or(0);
    let lines = table.lines().zip(last);
    lines
        .map(|(line, last)| format!("{line:<full$}  {last}").trim_end().to_string() + "\n")
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Vec<Vec<String>> {
        let rows = text.lines();
        rows.map(|row| row.split('|').map(str::to_string).collect())
            .collect()
    }

    #[test]
    fn numbers_end_in_line_and_words_at_the_end_begin_there() {
        let table = "name|value|unit\nloop gain|9.5|1/s\nlag|120|ms";
        assert_eq!(
            aligned(&rows(table)),
            "name       value  unit\nloop gain    9.5   1/s\nlag          120    ms\n"
        );
        assert_eq!(
            last_left(rows(table)),
            "name       value  unit\nloop gain  9.5    1/s\nlag        120    ms\n"
        );
    }
}
