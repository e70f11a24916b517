//! Numbers as spreadsheets write them: one decimal mark for a whole file.

/// The decimal mark of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Decimals {
    /// `0.5`
    Point,
    /// `0,5`
    Comma,
    /// Commas, each of which could be a thousands separator: `1,234`.
    Unclear,
}

const MIXED: &str = "; expected one decimal mark in the whole file and no thousands separators";
const UNCLEAR: &str = "; a comma here may be a decimal mark or a thousands separator: expected \
    numbers with a decimal point, or more numbers";
const PLAIN: &str = "; expected a number, or an empty cell for a missing sample";

impl Decimals {
    /// The mark that the first telling one of `cells` has.
    pub fn of<'a, Cells: Iterator<Item = &'a str>>(cells: impl Fn() -> Cells) -> Self {
        let mut unclear = false;
        for cell in cells() {
            if cell.contains(',') {
                if !Self::is_number(cell) {
                    continue;
                }
                if !may_part_thousands(cell) {
                    return Self::Comma;
                }
                unclear = true;
            } else if cell.contains('.') && cell.parse::<f64>().is_ok() {
                return Self::Point;
            }
        }
        if unclear { Self::Unclear } else { Self::Point }
    }

    /// Whether a cell is a number with some decimal mark.
    pub fn is_number(cell: &str) -> bool {
        let starts = cell.starts_with(|c: char| c.is_ascii_digit() || "+-.,\u{2212}".contains(c));
        starts && plain(cell).replacen(',', ".", 1).parse::<f64>().is_ok()
    }

    /// The number of a cell; NaN where it is empty or `nan`.
    ///
    /// # Errors
    /// What would do, as a clause.
    pub fn read(self, cell: &str) -> Result<f64, &'static str> {
        if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
            return Ok(f64::NAN);
        }
        let finite = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite());
        let text = plain(cell);
        let value = match (self, text.contains(','), text.contains('.')) {
            (_, false, false) | (Self::Point, false, _) => finite(&text),
            (Self::Comma, true, false) => finite(&text.replacen(',', ".", 1)),
            (Self::Unclear, true, _) if Self::is_number(cell) => return Err(UNCLEAR),
            _ if text
                .replace(',', ".")
                .chars()
                .all(|c| "+-.eE".contains(c) || c.is_ascii_digit()) =>
            {
                return Err(MIXED);
            }
            _ => None,
        };
        value.ok_or(PLAIN)
    }
}

/// With a hyphen for the sign of minus that word processors set.
fn plain(cell: &str) -> std::borrow::Cow<'_, str> {
    if cell.contains('\u{2212}') {
        cell.replace('\u{2212}', "-").into()
    } else {
        cell.into()
    }
}

/// `1,234` could be a thousand and more, `0,234` and `1,23` could not.
fn may_part_thousands(cell: &str) -> bool {
    let digits = plain(cell);
    let digits = digits.trim_start_matches(['+', '-']);
    let Some((before, after)) = digits.split_once(',') else {
        return false;
    };
    (1..=3).contains(&before.len())
        && !before.starts_with('0')
        && after.len() == 3
        && after.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(cells: &[&'static str]) -> Decimals {
        Decimals::of(|| cells.iter().copied())
    }

    #[test]
    fn the_mark_is_told_from_numbers_that_allow_one_reading() {
        assert_eq!(mark(&["0", "12", "0.5"]), Decimals::Point);
        assert_eq!(mark(&["0", "12"]), Decimals::Point);
        assert_eq!(mark(&["1,234", "0,002"]), Decimals::Comma);
        assert_eq!(mark(&["-1,5e-3"]), Decimals::Comma);
        assert_eq!(mark(&["1,234", "-12,500"]), Decimals::Unclear);
    }

    #[test]
    fn numbers_in_all_their_spellings() {
        let point = |cell: &str| Decimals::Point.read(cell);
        assert_eq!(point("+1.5E-03"), Ok(1.5e-3));
        assert_eq!(point(".5"), Ok(0.5));
        assert_eq!(point("\u{2212}5."), Ok(-5.0));
        assert_eq!(Decimals::Comma.read("-,25e1"), Ok(-2.5));
        assert_eq!(Decimals::Comma.read("7"), Ok(7.0));
        for empty in ["", "nan", "NaN"] {
            assert!(point(empty).unwrap().is_nan());
        }
    }

    #[test]
    fn what_may_be_read_two_ways_is_refused() {
        assert_eq!(Decimals::Point.read("1,234"), Err(MIXED));
        assert_eq!(Decimals::Point.read("1,234.5"), Err(MIXED));
        assert_eq!(Decimals::Comma.read("1.234,5"), Err(MIXED));
        assert_eq!(Decimals::Comma.read("1.5"), Err(MIXED));
        assert_eq!(Decimals::Unclear.read("1,234"), Err(UNCLEAR));
        for cell in ["x", "n/a", "inf", "1e999", "12:30", "--1"] {
            assert_eq!(Decimals::Point.read(cell), Err(PLAIN), "{cell}");
        }
    }
}
