//! One step of a linear integrator as a matrix.

/// The matrix of a linear map from `inputs` to `outputs` numbers, row by row, found by applying
/// the map to the unit vectors.
#[must_use]
pub fn matrix_of(inputs: usize, outputs: usize, map: impl Fn(&[f64], &mut [f64])) -> Vec<f64> {
    let mut matrix = vec![0.0; inputs * outputs];
    let (mut unit, mut image) = (vec![0.0; inputs], vec![0.0; outputs]);
    for column in 0..inputs {
        unit[column] = 1.0;
        map(&unit, &mut image);
        unit[column] = 0.0;
        for row in 0..outputs {
            matrix[row * inputs + column] = image[row];
        }
    }
    matrix
}
