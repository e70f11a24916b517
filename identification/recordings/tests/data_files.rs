//! Files of measured data as laboratories keep them: what is read, and how faults are named.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::path::Path;

use proptest::prelude::*;
use recordings::{
    Called, Channel, DataError, Named, Pick, Recording, Sheet, TimeBase, Wanted, columns_called,
    decode, named_columns,
};

fn parse(bytes: &[u8]) -> Result<Recording, DataError> {
    let file = Path::new("a.csv");
    Recording::parse(file, decode(file, bytes)?, "a")
}

fn read(text: &str) -> Recording {
    parse(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn fault(text: &str) -> String {
    match parse(text.as_bytes()) {
        Err(error) => error.to_string(),
        Ok(recording) => panic!("{text}\n{recording:?}"),
    }
}

fn stamps(recording: &Recording) -> &[f64] {
    match &recording.time {
        TimeBase::Stamps(stamps) => stamps,
        other => panic!("{other:?}"),
    }
}

const PLAIN: &str = "time [s],valve_command [V],displacement [m]\n0,1.5,-0.25\n0.002,2.5,\n";

#[test]
fn the_same_numbers_in_the_files_of_many_programs() {
    let plain = read(PLAIN);
    assert_eq!(stamps(&plain), [0.0, 0.002]);
    assert_eq!(plain.samples(Channel::ValveCommand), [1.5, 2.5]);
    assert!(plain.samples(Channel::Displacement)[1].is_nan());
    for text in [
        // A spreadsheet set to German, with a byte-order mark and Windows line ends.
        "\u{feff}time [s];valve_command [V];displacement [m]\r\n0;1,5;-0,25\r\n0,002;2,5;\r\n",
        // Decimal commas between commas, quoted.
        "\"time [s]\",\"valve_command [V]\",\"displacement [m]\"\n0,\"1,5\",\"-0,25\"\n\"0,002\",\"2,5\",\n",
        // Tabs, capitals, round brackets, signs and exponents.
        "Time (s)\tValve Command (V)\tDisplacement (m)\n0\t+1.5\t-2.5E-01\n2e-3\t+.25e1\tNaN\n",
        // Units in a row of their own, another order, a column of another name.
        "remark;displacement;time;valve_command\n;m;s;V\nok;-0,25;0;1,5\n;;0,002;2,5\n",
        "displacement,time,valve_command\n[m],[s],[V]\n-0.25,0,1.5\n,0.002,2.5\n",
        // A preamble, which holds the name of a channel, and comments.
        "Test 12;;\nTime;12:30;\nOperator;Meyer;\n\n# noise off\ntime [s];valve_command [V];displacement [m]\n0;1,5;-0,25\n%;;\n0,002;2,5;\n;;\n",
        // A header that is a comment, units behind an underscore or a stroke.
        "# Test 12\n# t_s,u_V,x/m\n0,1.5,-0.25\n0.002,2.5,nan\n",
        "t / s;u / V;x / m\n0;1,5;-0,25\n0,002;2,5;\n",
        // A comment that a spreadsheet has quoted and a row that it has padded.
        "\"# a;b\";;;\ntime [s];valve_command [V];displacement [m];\n0;1,5;-0,25;\n0,002;2,5;;\n",
    ] {
        let other = read(text);
        assert_eq!(stamps(&other), stamps(&plain), "{text}");
        for (channel, values) in plain.channels() {
            let bits =
                |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
            assert_eq!(bits(other.samples(channel)), bits(values), "{text}");
        }
        assert_eq!(other.notes, Vec::<String>::new());
    }
}

#[test]
fn units_are_those_of_the_laboratory() {
    let text = "Time (ms);Acceleration [gal];Displacement [in];Actuator Force (kN)\n2;100;1;0,5\n";
    let recording = read(text);
    assert_eq!(stamps(&recording), [0.002]);
    assert_eq!(recording.samples(Channel::Acceleration), [1.0]);
    assert_eq!(recording.samples(Channel::Displacement), [0.0254]);
    assert_eq!(recording.samples(Channel::ActuatorForce), [500.0]);
}

#[test]
fn another_encoding_is_read_and_noted() {
    let text = b"# M\xfcller\ntime [s];displacement [\xb5m]\n0;1\n";
    let recording = parse(text).unwrap();
    assert_eq!(recording.samples(Channel::Displacement), [1e-6]);
    assert_eq!(
        recording.notes,
        ["line 1 is not UTF-8; the file was read as ISO-8859-1"]
    );
}

#[test]
fn faults_name_file_line_column_and_what_was_expected() {
    for (text, words) in [
        ("", "a.csv: the file is empty"),
        (
            "# only\n",
            "a.csv: only comments; expected a header such as `time [s]",
        ),
        ("time [s],x [m]\n", "a.csv: a header and no data"),
        // The unit V is not a velocity below names that nobody knows.
        (
            "Messung 7\nZeit;Ventil;Weg\nms;V;mm\n0;1;2\n1;1;2\n",
            "a.csv, line 2: no column with a known name among Zeit, Ventil, Weg; expected a header such as",
        ),
        (
            "# a\n\n0,1\n1,2\n",
            "a.csv, line 3: numbers instead of a header; expected such as",
        ),
        (
            "time [s],displacement\n0,1\n",
            "a.csv, line 1: column `displacement` has no unit; expected for example \
             `displacement [m]`",
        ),
        (
            "time [s],x\n0,1\n",
            "a.csv, line 1: column `x` (displacement) has no unit; expected for example `x [m]`",
        ),
        (
            "time [s],displacement [lbf]\n0,1\n",
            "a.csv, line 1, column 2 (`displacement`): unit \"lbf\" (kg m s^-2) does not fit \
             \"m\" (m)",
        ),
        (
            "time;displacement\ns;inchs\n0;1\n",
            "a.csv, line 2, column 2 (`displacement`): unknown unit \"inchs\"",
        ),
        (
            "time [s],displacement [in]\n\n# x\n0,1\n0.002,x\n",
            "a.csv, line 5, column 2 (`displacement`): \"x\" is not a finite number; expected a \
             number, or an empty cell for a missing sample",
        ),
        (
            "time [s];force [kN]\n0,002;1.234,5\n",
            "a.csv, line 2, column 2 (`force`): \"1.234,5\" is not a finite number; expected one \
             decimal mark in the whole file and no thousands separators",
        ),
        (
            "time [ms];force [N]\n2;1,234\n4;1,250\n",
            "a.csv, line 2, column 2 (`force`): \"1,234\" is not a finite number; a comma here \
             may be a decimal mark or a thousands separator",
        ),
        (
            "time [s],x [m],f [N]\n0,1,2\n1,2\n",
            "a.csv, line 3: 2 cells; expected 3, as in the header",
        ),
        (
            "time [s],x [m]\n0,0,1,5\n1,2,5\n",
            "a.csv, line 2: 4 cells; expected 2, as in the header",
        ),
        (
            "time [s],x [m],x [mm]\n0,1,2\n",
            "a.csv, line 1: column `displacement` occurs twice",
        ),
        (
            "time [s],x [m],position [mm]\n0,1,2\n",
            "a.csv, line 1: columns `x` and `position` both mean displacement; expected one, \
             named `displacement`",
        ),
    ] {
        let message = fault(text);
        assert!(message.starts_with(words), "{text}\n{message}");
    }
    // Another name counts only with a unit that fits, and not beside the channel's own.
    let recording = read("time [s],command [mm],x [m],displacement [m]\n0,1,2,3\n");
    assert_eq!(recording.channel(Channel::ValveCommand), None);
    assert_eq!(recording.samples(Channel::Displacement), [3.0]);
}

#[test]
fn columns_of_any_name_are_picked_with_their_units() {
    const FORCE: Channel = Channel::Other {
        name: "friction",
        unit: "N",
    };
    let file = Path::new("rig.csv");
    let text = decode(file, b"t_s;x_mm;F\n0;1,5;2\n0,1;2,5;3\n").unwrap();
    let wanted = Wanted {
        is_column: &|cell| ["t_s", "F"].contains(&cell),
        header: "`t_s,F`",
    };
    let sheet = Sheet::parse(file, text, wanted).unwrap();
    let pick = |channel, head, unit| Pick {
        channel,
        head,
        unit,
    };
    let picks = [pick(FORCE, "F", "kN"), pick(Channel::Time, "t_s", "s")];
    let recording = Recording::pick(&sheet, "rig", &picks).unwrap();
    assert_eq!(recording.samples(FORCE), [2000.0, 3000.0]);
    assert_eq!(stamps(&recording), [0.0, 0.1]);
    let error = Recording::pick(&sheet, "rig", &[pick(FORCE, "f", "kN")]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "rig.csv, line 1: no column `f` among t_s, x_mm, F; did you mean `F`?"
    );
}

#[test]
fn names_that_nobody_knows_keep_the_units_in_the_row_below() {
    let wanted = || Wanted {
        is_column: &|_| false,
        header: "`a,b`",
    };
    let file = Path::new("rig.csv");
    for preamble in ["", "A rig of ours\n", "A rig of ours\nmeasured by us\n"] {
        let text = format!("{preamble}when,what\n[s],[mm]\n0,1\n0.1,2\n");
        let text = decode(file, text.as_bytes()).unwrap();
        let sheet = Sheet::parse(file, text, wanted()).unwrap();
        assert_eq!(sheet.heads(), ["when", "what"], "{preamble:?}");
        assert_eq!(sheet.unit_below(1).unwrap().1, "mm");
        assert_eq!(sheet.column(1, "what").unwrap(), [1.0, 2.0]);
    }
}

#[test]
fn the_page_on_data_files_lists_every_channel() {
    let page = include_str!("../../../docs/data-files.md");
    for channel in Channel::KNOWN {
        let names = channel.aliases().iter().map(|name| format!("`{name}`"));
        let unit = channel.unit().replace("^2", "²");
        let row = format!(
            "| `{}` | {unit} | {} |",
            channel.name(),
            names.collect::<Vec<_>>().join(", ")
        );
        assert!(page.contains(&row), "{row}");
    }
}

/// How a program writes a file.
#[derive(Debug, Clone)]
struct Dialect {
    delimiter: char,
    comma: bool,
    mark: bool,
    windows: bool,
    quoted: bool,
    exponents: bool,
    milliseconds: bool,
    units_below: bool,
    preamble: bool,
    padded: bool,
}

prop_compose! {
    fn dialects()(
        delimiter in prop::sample::select(vec![',', ';', '\t']),
        flags in prop::array::uniform9(any::<bool>()),
    ) -> Dialect {
        let [comma, mark, windows, quoted, exponents, milliseconds, units_below, preamble, padded] =
            flags;
        // A decimal comma between commas must be quoted.
        let quoted = quoted || (comma && delimiter == ',');
        Dialect {
            delimiter, comma, mark, windows, quoted, exponents, milliseconds, units_below,
            preamble, padded,
        }
    }
}

impl Dialect {
    fn write(&self, rows: &[[f64; 3]]) -> String {
        let time = if self.milliseconds { "ms" } else { "s" };
        let names = [
            ("Time", time),
            ("valve_command", "V"),
            ("displacement", "m"),
        ];
        let mut lines: Vec<Vec<String>> = Vec::new();
        if self.preamble {
            lines.push(vec!["Test 12".into(), "Time".into(), String::new()]);
        }
        if self.units_below {
            lines.push(names.map(|own| own.0.to_string()).to_vec());
            lines.push(names.map(|own| own.1.to_string()).to_vec());
        } else {
            lines.push(names.map(|own| format!("{} [{}]", own.0, own.1)).to_vec());
        }
        for (k, row) in rows.iter().enumerate() {
            // 2 ms is written from whole numbers, so that both texts mean the same number.
            let time = match self.milliseconds {
                true => format!("{}", 2 * k),
                false => format!("{}.{:03}", 2 * k / 1000, 2 * k % 1000),
            };
            let number = |value: f64| match self.exponents {
                true => format!("{value:e}"),
                false => format!("{value}"),
            };
            let mut cells = vec![time];
            cells.extend(row[1..].iter().map(|value| number(*value)));
            if self.comma {
                cells
                    .iter_mut()
                    .for_each(|cell| *cell = cell.replace('.', ","));
            }
            lines.push(cells);
        }
        let end = if self.windows { "\r\n" } else { "\n" };
        let mut text = String::from(if self.mark { "\u{feff}" } else { "" });
        for mut cells in lines {
            if self.quoted {
                cells
                    .iter_mut()
                    .for_each(|cell| *cell = format!("\"{cell}\""));
            }
            if self.padded {
                cells.push(String::new());
            }
            text += &cells.join(&self.delimiter.to_string());
            text += end;
        }
        text
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Every dialect gives back the numbers to the bit.
    #[test]
    fn a_round_trip_under_all_dialects(
        dialect in dialects(),
        values in prop::collection::vec((-1e6..1e6f64, -1e-3..1e-3f64), 3..40),
    ) {
        let rows: Vec<[f64; 3]> = (0..).zip(&values)
            .map(|(k, (u, x))| [0.002 * f64::from(k), *u, *x])
            .collect();
        let recording = read(&dialect.write(&rows));
        let column = |i: usize| -> Vec<f64> { rows.iter().map(|row| row[i]).collect() };
        prop_assert_eq!(recording.samples(Channel::ValveCommand), column(1));
        prop_assert_eq!(recording.samples(Channel::Displacement), column(2));
        for (found, wanted) in stamps(&recording).iter().zip(column(0)) {
            prop_assert!((found - wanted).abs() <= 1e-15 * wanted.max(1.0));
        }
    }

    /// Any bytes at all: a recording or an error, never a panic.
    #[test]
    fn no_bytes_break_the_reader(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = parse(&bytes);
    }

    /// The same with what such files are made of.
    #[test]
    fn no_text_breaks_the_reader(
        text in "(time \\[s\\]|x \\(mm\\)|t_s|[-+0-9.,;\t \n\r\"#%a-z\\[\\]()]){0,60}",
    ) {
        let _ = parse(text.as_bytes()).map(Recording::on_even_base);
    }
}

#[test]
fn channels_that_are_called_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.csv");
    // `position` would be the displacement, were it not said that `LVDT 1` is.
    std::fs::write(
        &file,
        "t [ms],LVDT 1,position [m],LC [kN]\n0,1,7,2\n2,2,8,3\n",
    )
    .unwrap();
    let called = |channel, head: &str, unit: Option<&str>| Called {
        channel,
        head: head.to_string(),
        unit: unit.map(String::from),
    };
    let names = [
        called(Channel::Displacement, "LVDT 1", Some("mm")),
        called(Channel::ActuatorForce, "LC", None),
    ];
    let read = Recording::read_called(&file, "a", &names).unwrap();
    assert_eq!(read.samples(Channel::Displacement), [0.001, 0.002]);
    assert_eq!(read.samples(Channel::ActuatorForce), [2000.0, 3000.0]);
    assert_eq!(read.stamps().unwrap()[1], 0.002);
    // The same columns by name, in the order of the channels.
    let named = |all: Vec<Named>| -> Vec<(Channel, String, String)> {
        all.into_iter()
            .map(|own| (own.channel, own.head, own.unit))
            .collect()
    };
    let own = |channel, head: &str, unit: &str| (channel, head.to_string(), unit.to_string());
    let mut found = named(columns_called(&file, &names).unwrap());
    let mut expected = vec![
        own(Channel::Time, "t [ms]", "ms"),
        own(Channel::Displacement, "LVDT 1", "mm"),
        own(Channel::ActuatorForce, "LC [kN]", "kN"),
    ];
    for all in [&mut found, &mut expected] {
        all.sort_by(|a, b| a.1.cmp(&b.1));
    }
    assert_eq!(found, expected);
    let found = named(named_columns(&file).unwrap());
    assert!(
        found.contains(&own(Channel::Displacement, "position [m]", "m")),
        "{found:?}"
    );
    let missing = [called(Channel::Velocity, "v1", None)];
    let error = Recording::read_called(&file, "a", &missing).unwrap_err();
    assert!(error.to_string().contains("no column `v1`"), "{error}");
    let without = [called(Channel::Displacement, "LVDT 1", None)];
    let error = Recording::read_called(&file, "a", &without).unwrap_err();
    assert!(error.to_string().contains("has no unit"), "{error}");
}

#[test]
fn a_reference_without_a_unit_is_left_alone_beside_a_voltage_only() {
    let read = read("time [s],reference,command [V],displacement [mm]\n0,1,0.5,2\n1,2,0.5,3\n");
    assert!(read.channel(Channel::Reference).is_none());
    assert_eq!(read.samples(Channel::ValveCommand), [0.5, 0.5]);
    let alone = fault("time [s],reference,displacement [mm]\n0,1,2\n1,2,3\n");
    assert!(alone.contains("`reference` has no unit"), "{alone}");
}

#[test]
fn a_channel_s_samples_are_replaced_by_as_many_others_or_taken_out() {
    let mut own = read(PLAIN);
    let command = vec![3.0, 4.0];
    own.replace(Channel::ValveCommand, command.clone()).unwrap();
    assert_eq!(own.samples(Channel::ValveCommand), command);
    own.replace(Channel::Velocity, vec![5.0, 6.0]).unwrap();
    assert_eq!(own.channels().count(), 3);
    let refused = own
        .replace(Channel::Velocity, vec![5.0])
        .unwrap_err()
        .to_string();
    assert!(refused.contains("has 1 samples, not 2"), "{refused}");
    assert_eq!(own.samples(Channel::Velocity), [5.0, 6.0]);
    let own = own.without(Channel::Velocity);
    assert_eq!(
        (own.channel(Channel::Velocity), own.channels().count()),
        (None, 2)
    );
}

#[test]
fn a_described_unit_must_be_that_of_the_header() {
    let file = Path::new("rig.csv");
    let text = || decode(file, b"t [s],F [kN]\n0,2\n0.1,3\n").unwrap();
    let picked = |unit| {
        let wanted = Wanted {
            is_column: &|cell| cell.starts_with('t'),
            header: "`t,F`",
        };
        let sheet = Sheet::parse(file, text(), wanted).unwrap();
        assert!(!sheet.is_empty() && sheet.len() == 2);
        let time = Pick {
            channel: Channel::Time,
            head: "t [s]",
            unit: "s",
        };
        let force = Pick {
            channel: Channel::ActuatorForce,
            head: "F [kN]",
            unit,
        };
        Recording::pick(&sheet, "rig", &[time, force]).map_err(|error| error.to_string())
    };
    assert_eq!(
        picked("kN").unwrap().samples(Channel::ActuatorForce),
        [2000.0, 3000.0]
    );
    let refused = picked("N").unwrap_err();
    let said = "column `F [kN]` is described in N; expected the unit of its header, kN";
    assert!(refused.contains(said), "{refused}");
}
