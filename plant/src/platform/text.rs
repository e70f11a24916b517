//! A platform's geometry as text: places such as `"0.27 -0.13 0; 0.27 0.13 0"`, one actuator behind each semicolon, and
//! axes such as `"x rz"`.

use nalgebra::Vector3;

use super::{AXES, Actuator, Line};

/// Actuators from their points and either pins of the base or directions of the lines, which are normalised.
pub(super) fn actuators(
    points: &str,
    bases: &str,
    directions: &str,
) -> Result<Vec<Actuator>, String> {
    let points = places("points", points)?;
    let pinned = !bases.trim().is_empty();
    let (name, lines) = match (pinned, directions.trim().is_empty()) {
        (true, true) => ("bases", places("bases", bases)?),
        (false, false) => ("directions", places("directions", directions)?),
        _ => return Err("give either `bases` or `directions`".into()),
    };
    if lines.len() != points.len() {
        return Err(format!(
            "`points` has {} actuators and `{name}` has {}; expected as many",
            points.len(),
            lines.len()
        ));
    }
    let actuator = |(i, (point, line)): (usize, ([f64; 3], [f64; 3]))| {
        let line = match pinned {
            true => Line::Pinned(line),
            false => {
                let direction = Vector3::from(line);
                let length = direction.norm();
                if length <= 0.0 {
                    return Err(format!("`directions`: that of actuator {} is zero", i + 1));
                }
                Line::Fixed((direction / length).into())
            }
        };
        Ok(Actuator { point, line })
    };
    points
        .into_iter()
        .zip(lines)
        .enumerate()
        .map(actuator)
        .collect()
}

/// The axes that a text lists.
pub(super) fn axes(text: &str) -> Result<[bool; 6], String> {
    let mut free = [false; 6];
    for word in text.split([' ', ',']).filter(|word| !word.is_empty()) {
        let Some(place) = AXES.iter().position(|axis| *axis == word) else {
            return Err(format!(
                "`free`: `{word}` is not an axis; expected some of {}",
                AXES.join(", ")
            ));
        };
        free[place] = true;
    }
    Ok(free)
}

fn places(name: &str, text: &str) -> Result<Vec<[f64; 3]>, String> {
    let place = |(i, row): (usize, &str)| {
        let words: Vec<&str> = row
            .split([' ', ','])
            .filter(|word| !word.is_empty())
            .collect();
        let [x, y, z] = words.as_slice() else {
            return Err(format!(
                "`{name}`: actuator {} has {} numbers, expected 3",
                i + 1,
                words.len()
            ));
        };
        let number = |word: &&str| {
            word.parse::<f64>()
                .map_err(|_| format!("`{name}`: actuator {}: `{word}` is not a number", i + 1))
        };
        Ok([number(x)?, number(y)?, number(z)?])
    };
    text.split(';').enumerate().map(place).collect()
}
