//! A platform's geometry as text: places such as `"0.27 -0.13 0; 0.27 0.13 0"`, one actuator behind each semicolon, and
//! axes such as `"x rz"`.

use nalgebra::Vector3;

use super::{AXES, Actuator, Line};

/// A text that is not a geometry.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum TextError {
    /// Both pins and directions, or neither.
    #[error("give either `bases` or `directions`")]
    Lines,
    /// Points and lines of different numbers of actuators.
    #[error("`points` has {points} actuators and `{name}` has {lines}; expected as many")]
    Count {
        /// Number of points.
        points: usize,
        /// The text of the lines.
        name: &'static str,
        /// Their number.
        lines: usize,
    },
    /// A direction without a length.
    #[error("`directions`: that of actuator {0} is zero")]
    NoDirection(usize),
    /// A word that is not the name of an axis.
    #[error("`free`: `{word}` is not an axis; expected some of {axes}", axes = AXES.join(", "))]
    Axis {
        /// The word.
        word: String,
    },
    /// A place that does not have three numbers.
    #[error("`{name}`: actuator {actuator} has {numbers} numbers, expected 3")]
    Numbers {
        /// The text.
        name: &'static str,
        /// The actuator, from 1.
        actuator: usize,
        /// Numbers that it has.
        numbers: usize,
    },
    /// A word that is not a number.
    #[error("`{name}`: actuator {actuator}: `{word}` is not a number")]
    NotANumber {
        /// The text.
        name: &'static str,
        /// The actuator, from 1.
        actuator: usize,
        /// The word.
        word: String,
    },
}

/// Actuators from their points and either pins of the base or directions of the lines, which are normalised.
pub(super) fn actuators(
    points: &str,
    bases: &str,
    directions: &str,
) -> Result<Vec<Actuator>, TextError> {
    let points = places("points", points)?;
    let pinned = !bases.trim().is_empty();
    let (name, lines) = match (pinned, directions.trim().is_empty()) {
        (true, true) => ("bases", places("bases", bases)?),
        (false, false) => ("directions", places("directions", directions)?),
        _ => return Err(TextError::Lines),
    };
    if lines.len() != points.len() {
        return Err(TextError::Count {
            points: points.len(),
            name,
            lines: lines.len(),
        });
    }
    let actuator = |(i, (point, line)): (usize, ([f64; 3], [f64; 3]))| {
        let line = match pinned {
            true => Line::Pinned(line),
            false => {
                let direction = Vector3::from(line);
                let length = direction.norm();
                if length <= 0.0 {
                    return Err(TextError::NoDirection(i + 1));
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
pub(super) fn axes(text: &str) -> Result<[bool; 6], TextError> {
    let mut free = [false; 6];
    for word in text.split([' ', ',']).filter(|word| !word.is_empty()) {
        let Some(place) = AXES.iter().position(|axis| *axis == word) else {
            return Err(TextError::Axis { word: word.into() });
        };
        free[place] = true;
    }
    Ok(free)
}

fn places(name: &'static str, text: &str) -> Result<Vec<[f64; 3]>, TextError> {
    let place = |(i, row): (usize, &str)| {
        let words: Vec<&str> = row
            .split([' ', ','])
            .filter(|word| !word.is_empty())
            .collect();
        let [x, y, z] = words.as_slice() else {
            return Err(TextError::Numbers {
                name,
                actuator: i + 1,
                numbers: words.len(),
            });
        };
        let number = |word: &&str| {
            word.parse::<f64>().map_err(|_| TextError::NotANumber {
                name,
                actuator: i + 1,
                word: (*word).into(),
            })
        };
        Ok([number(x)?, number(y)?, number(z)?])
    };
    text.split(';').enumerate().map(place).collect()
}
