//! Square matrices as text.

use nalgebra::DMatrix;

/// Reads `"1 2; 3 4"`.
///
/// # Errors
/// Names the matrix, and the row and word that is at fault.
pub(crate) fn read(name: &str, text: &str) -> Result<DMatrix<f64>, String> {
    let mut numbers = Vec::new();
    let rows: Vec<&str> = text.split(';').collect();
    for (i, row) in rows.iter().enumerate() {
        let words = row.split([' ', ',']).filter(|word| !word.is_empty());
        let before = numbers.len();
        for word in words {
            let number: f64 = word
                .parse()
                .map_err(|_| format!("{name}: row {}: `{word}` is not a number", i + 1))?;
            numbers.push(number);
        }
        if numbers.len() - before != rows.len() {
            return Err(format!(
                "{name}: row {} has {} numbers, expected {} as there are rows",
                i + 1,
                numbers.len() - before,
                rows.len()
            ));
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
            read("mass", "1 2; 3").unwrap_err(),
            "mass: row 2 has 1 numbers, expected 2 as there are rows"
        );
        assert!(read("mass", "1 x; 3 4").unwrap_err().contains("`x`"));
    }
}
