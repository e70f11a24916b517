//! What the columns of a laboratory's file are, by their headers in several languages and by their units.

use units::{Unit, convert};

use recordings::name_and_unit;

/// What a column may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    /// The displacement that was asked for.
    Command,
    /// A voltage at a valve or an amplifier.
    Voltage,
    Displacement,
    Velocity,
    Acceleration,
    Force,
    /// What a test machine calls strain and stress.
    Strain,
    Stress,
}

impl Role {
    /// In words, for messages.
    pub fn words(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Command => "commanded displacement",
            Self::Voltage => "voltage",
            Self::Displacement => "measured displacement",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Force => "force",
            Self::Strain => "strain",
            Self::Stress => "stress",
        }
    }

    /// SI unit.
    fn unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Command | Self::Displacement => "m",
            Self::Voltage => "V",
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s^2",
            Self::Force => "N",
            Self::Strain => "1",
            Self::Stress => "Pa",
        }
    }
}

/// A column that was recognised.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Recognised {
    pub role: Role,
    /// Its header as it stands.
    pub head: String,
    /// Its unit, where header or unit row say it.
    pub unit: Option<String>,
    /// How well it fits its role; more is better.
    pub fit: u8,
}

/// Words of a role, in lower case without accents; those of four letters and more may be beginnings.
const WORDS: [(Role, &[&str]); 9] = [
    (
        Role::Time,
        &["time", "t", "zeit", "temps", "tiempo", "tempo", "seconds"],
    ),
    (
        Role::Acceleration,
        &["accel", "acc", "a", "beschl", "acel", "kiihtyvyys"],
    ),
    (
        Role::Force,
        &[
            "force", "f", "kraft", "effort", "fuerza", "forza", "load", "forca",
        ],
    ),
    (
        Role::Velocity,
        &["velocity", "vel", "v", "geschw", "vitesse", "velo", "speed"],
    ),
    (Role::Stress, &["stress", "sigma", "spannung", "contrainte"]),
    (
        Role::Strain,
        &["strain", "epsilon", "dehnung", "deformation"],
    ),
    (
        Role::Command,
        &[
            "command",
            "cmd",
            "reference",
            "ref",
            "setpoint",
            "soll",
            "sollwert",
            "consigne",
            "demand",
            "desired",
            "target",
            "drive",
            "commande",
            "comando",
            "referencia",
            "riferimento",
            "input",
            "r",
            "demanded",
            "commanded",
            "comand",
            "vorgabe",
            "eingang",
            "ingresso",
            "entree",
            "entrada",
        ],
    ),
    (
        Role::Voltage,
        &[
            "voltage",
            "volt",
            "u",
            "tension",
            "valve",
            "motor",
            "amplifier",
            "ventil",
            "servo",
            "spannung",
            "stell",
        ],
    ),
    (
        Role::Displacement,
        &[
            "displacement",
            "disp",
            "position",
            "pos",
            "x",
            "weg",
            "istwert",
            "ist",
            "deplacement",
            "lvdt",
            "stroke",
            "measured",
            "meas",
            "feedback",
            "response",
            "desplazamiento",
            "posicion",
            "spostamento",
            "achieved",
            "actual",
            "deslocamento",
            "output",
            "y",
            "istweg",
            "tischweg",
            "kolbenweg",
            "auslenkung",
            "verschiebung",
            "messwert",
            "mesure",
            "course",
            "corsa",
            "misurat",
            "uscita",
            "sortie",
            "salida",
        ],
    ),
];

/// Words that say that a column is the table's own, where there are several.
const TABLE: [&str; 6] = ["table", "tisch", "platform", "mesa", "plateforme", "tavola"];

/// Reads a header's cell, with the unit of a row below where there is one; none where no role fits.
pub(super) fn recognised(cell: &str, unit_below: Option<&str>) -> Option<Recognised> {
    let (name, in_header) = name_and_unit(cell);
    let mut name = name;
    let mut unit = in_header.or(unit_below).map(str::to_owned);
    if unit.is_none() {
        // `x_mm`, `v_mm_s`: what follows the name may be its unit.
        let tails = name.match_indices(['_', ' ']);
        let tails = tails.map(|(at, _)| (&name[..at], name[at + 1..].replace('_', "/")));
        let found = tails
            .into_iter()
            .find(|(front, own)| !front.is_empty() && !own.is_empty() && Unit::parse(own).is_ok());
        if let Some((front, own)) = found {
            (name, unit) = (front, Some(own));
        }
    }
    let words = words(name);
    let says = |all: &[&str]| words.iter().any(|word| all.iter().any(|own| is(word, own)));
    let has = |of: Role| {
        let own = WORDS.iter().find(|(role, _)| *role == of);
        own.is_some_and(|(_, all)| says(all))
    };
    let fits = |of: Role| {
        unit.as_deref()
            .is_none_or(|unit| convert(1.0, unit, of.unit()).is_ok())
    };
    let role = if has(Role::Command) {
        // What was asked for may be a displacement or a voltage, and nothing else here.
        let alone = [Role::Force, Role::Acceleration, Role::Velocity, Role::Time];
        let first = [Role::Command, Role::Voltage]
            .into_iter()
            .find(|own| fits(*own));
        first.filter(|_| {
            !alone
                .into_iter()
                .any(|own| has(own) && unit.is_some() && fits(own))
        })?
    } else {
        let mut all = WORDS.iter().map(|(role, _)| *role);
        all.find(|role| has(*role) && fits(*role))?
    };
    let own = WORDS.iter().find(|(of, _)| *of == role)?.1;
    let exact = words.len() == 1 && own.contains(&words[0].as_str());
    let fit = 2 * u8::from(says(&TABLE)) + u8::from(exact) + u8::from(unit.is_some());
    Some(Recognised {
        role,
        head: cell.trim().to_owned(),
        unit,
        fit,
    })
}

/// Whether `word` is `own`, or begins with it where that is long enough.
fn is(word: &str, own: &str) -> bool {
    word == own || own.len() >= 4 && word.starts_with(own)
}

/// Words of a name in lower case, without accents.
fn words(name: &str) -> Vec<String> {
    let mut text = String::new();
    let mut before = ' ';
    for letter in name.chars() {
        if letter.is_uppercase() && before.is_lowercase() {
            text.push(' ');
        }
        before = letter;
        for small in letter.to_lowercase() {
            match small {
                'à'..='å' => text.push('a'),
                'ç' => text.push('c'),
                'è'..='ë' => text.push('e'),
                'ì'..='ï' => text.push('i'),
                'ñ' => text.push('n'),
                'ò'..='ö' => text.push('o'),
                'ù'..='ü' => text.push('u'),
                'ß' => text.push_str("ss"),
                own if own.is_alphanumeric() => text.push(own),
                _ => text.push(' '),
            }
        }
    }
    text.split_whitespace().map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_several_languages_are_recognised() {
        let read =
            |cell: &str| recognised(cell, None).map(|own| (own.role, own.unit.unwrap_or_default()));
        let cases = [
            ("Time (ms)", Role::Time, "ms"),
            ("Zeit [s]", Role::Time, "s"),
            ("Sollwert [mm]", Role::Command, "mm"),
            ("Consigne [m]", Role::Command, "m"),
            ("Command (in)", Role::Command, "in"),
            ("command [V]", Role::Voltage, "V"),
            ("valve_command [V]", Role::Voltage, "V"),
            ("Déplacement [mm]", Role::Displacement, "mm"),
            ("Weg [mm]", Role::Displacement, "mm"),
            ("Beschleunigung [g]", Role::Acceleration, "g"),
            ("Accélération [m/s²]", Role::Acceleration, "m/s²"),
            ("Kraft [kN]", Role::Force, "kN"),
            ("Effort [kN]", Role::Force, "kN"),
            ("x_cmd_mm", Role::Command, "mm"),
            ("x_meas_mm", Role::Displacement, "mm"),
            ("force_N", Role::Force, "N"),
            ("Displacement", Role::Displacement, ""),
            ("reference displacement [mm]", Role::Command, "mm"),
            ("Istweg (mm)", Role::Displacement, "mm"),
            ("Spannung [V]", Role::Voltage, "V"),
            ("Spannung [MPa]", Role::Stress, "MPa"),
            ("Spostamento comandato (mm)", Role::Command, "mm"),
            ("Déplacement mesuré [mm]", Role::Displacement, "mm"),
            ("Déplacement de consigne [mm]", Role::Command, "mm"),
        ];
        for (cell, role, unit) in cases {
            assert_eq!(read(cell), Some((role, unit.to_owned())), "{cell}");
        }
        for cell in ["remark", "12.5", "", "temperature [K]"] {
            assert_eq!(read(cell), None, "{cell}");
        }
    }

    #[test]
    fn words_are_in_small_letters_without_accents() {
        for (name, expected) in [
            ("Âge à Måling", "age a maling"),
            ("Force reçue", "force recue"),
            ("Élan relevé, même Noël", "elan releve meme noel"),
            ("Dì naïf, île", "di naif ile"),
            ("Señal", "senal"),
            ("Größe òrdine", "grosse ordine"),
            ("Où Züge", "ou zuge"),
            ("actuatorForce_N", "actuator force n"),
        ] {
            assert_eq!(words(name).join(" "), expected);
        }
    }
}
