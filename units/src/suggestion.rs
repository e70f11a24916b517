//! The name that was meant by one that is not known.

/// The known name nearest to `name` with its likeness, from 0 to 1; capitals do not count.
fn likeliest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<(f64, &'a str)> {
    let wanted = name.to_lowercase();
    let likeness = |candidate: &str| {
        strsim::normalized_damerau_levenshtein(&wanted, &candidate.to_lowercase())
    };
    let all = known.into_iter().map(|own| (likeness(own), own));
    all.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Likeness from which a name is worth suggesting.
const LIKELY: f64 = 0.5;
/// Likeness below which the nearest name has nothing to do with the one that was meant.
const ALIKE: f64 = 0.35;
/// Names that are listed when none is likely.
const LISTED: usize = 40;

/// The name nearest to `name`, when one is near enough to be worth suggesting.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    likeliest(name, known)
        .filter(|(likeness, _)| *likeness >= LIKELY)
        .map(|(_, candidate)| candidate)
}

/// `; did you mean ...?` with the nearest of the known names, or the known names themselves.
pub fn hint<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match likeliest(name, known.iter().copied()) {
        Some((likeness, near)) if likeness >= LIKELY => format!("; did you mean `{near}`?"),
        Some(_) if known.len() <= LISTED => format!("; there is `{}`", known.join("`, `")),
        Some((likeness, near)) if likeness >= ALIKE => format!("; the nearest name is `{near}`"),
        Some(_) => String::new(),
        None => "; there is none".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_told_from_another_name() {
        let known = ["mpc", "three-variable", "none"];
        assert_eq!(nearest("mcp", known), Some("mpc"));
        assert_eq!(nearest("Three-Variable", known), Some("three-variable"));
        assert_eq!(nearest("zorkmid", known), None);
        assert_eq!(hint("mcp", known), "; did you mean `mpc`?");
        assert_eq!(
            hint("zorkmid", known),
            "; there is `mpc`, `three-variable`, `none`"
        );
        let many: Vec<String> = (0..50).map(|k| format!("output_{k}")).collect();
        let many = || many.iter().map(String::as_str);
        assert!(hint("outing", many()).starts_with("; the nearest name is `output_"));
        assert_eq!(hint("zork", many()), "");
        assert_eq!(hint("zork", []), "; there is none");
    }
}
