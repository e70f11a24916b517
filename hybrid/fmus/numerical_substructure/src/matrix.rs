//! Square matrices as text.

use nalgebra::DMatrix;

/// A text that is not a square matrix.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum MatrixError {
    /// A word that is not a number.
    #[error("{name}: row {row}: `{word}` is not a number")]
    NotANumber {
        /// The matrix.
        name: &'static str,
        /// The row, from 1.
        row: usize,
        /// The word.
        word: String,
    },
    /// A row that is not as long as there are rows.
    #[error("{name}: row {row} has {numbers} numbers, expected {rows} as there are rows")]
    NotSquare {
        /// The matrix.
        name: &'static str,
        /// The row, from 1.
        row: usize,
        /// Numbers that it has.
        numbers: usize,
        /// Number of rows.
        rows: usize,
    },
}

/// Reads `"1 2; 3 4"`.
///
/// # Errors
/// Names the matrix, and the row and word that is at fault.
pub(crate) fn read(name: &'static str, text: &str) -> Result<DMatrix<f64>, MatrixError> {
    let mut numbers = Vec::new();
    let rows: Vec<&str> = text.split(';').collect();
    for (i, row) in rows.iter().enumerate() {
        let words = row.split([' ', ',']).filter(|word| !word.is_empty());
        let before = numbers.len();
        for word in words {
            let number: f64 = word.parse().map_err(|_| MatrixError::NotANumber {
                name,
                row: i + 1,
                word: word.to_string(),
            })?;
            numbers.push(number);
        }
        if numbers.len() - before != rows.len() {
            return Err(MatrixError::NotSquare {
                name,
                row: i + 1,
                numbers: numbers.len() - before,
                rows: rows.len(),
            });
        }
    }
    Ok(DMatrix::from_row_slice(rows.len(), rows.len(), &numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_read_by_rows() {
        let matrix = read("mass", "1, 2; 3 4").unwrap();
        assert_eq!(matrix, nalgebra::dmatrix![1.0, 2.0; 3.0, 4.0]);
        assert_eq!(
            read("mass", "1 2; 3").unwrap_err().to_string(),
            "mass: row 2 has 1 numbers, expected 2 as there are rows"
        );
        let refused = read("mass", "1 x; 3 4").unwrap_err();
        assert_eq!(refused.to_string(), "mass: row 1: `x` is not a number");
    }
}
