//! Tables with a head of their own, as programs of plants write them, made from a shipped recording.

use std::fmt::Write as _;

use govtwin_bag::import::Target;

use super::{
    HEADER, Truth, assert_proposed, assert_right, by_proposal, file, iso, plain, propose, recording, rejection, series,
    wide,
};

/// How LabVIEW's file is written.
#[derive(Clone, Copy)]
pub(super) struct LabView {
    pub(super) times: &'static str,
    pub(super) decimal: char,
    pub(super) separator: char,
    pub(super) segments: usize,
}

/// The recording as LabVIEW writes it.
pub(super) fn labview(of: LabView) -> String {
    let LabView { times, decimal, separator, segments } = of;
    let s = separator.to_string();
    let number = |value: f64| format!("{value:.6}").replace('.', &decimal.to_string());
    let named = if separator == ',' { "Comma" } else { "Tab" };
    let mut text = format!(
        "LabVIEW Measurement{s}\r\nWriter_Version{s}2\r\nReader_Version{s}2\r\nSeparator{s}{named}\r\nDecimal_Separator{s}{decimal}\r\n\
         Multi_Headings{s}Yes\r\nX_Columns{s}{times}\r\nTime_Pref{s}Relative\r\nOperator{s}plant\r\nDate{s}2026/09/22\r\nTime{s}18:38:20{decimal}5\r\n\
         ***End_of_Header***{s}\r\n\r\n"
    );
    let names = ["cmd", "servo", "spool", "p tank"];
    for rows in rejection().chunks(rejection().len().div_ceil(segments)) {
        let key = |text: &mut String, key: &str, values: [String; 4]| {
            let between = if times == "Multi" { format!("{s}{s}") } else { s.clone() };
            let _ = write!(text, "{key}{s}{}{s}\r\n", values.join(&between));
        };
        // A segment begins at its own time, from which its rows count.
        let start_s = 20.5 + rows[0].time_s;
        let clock =
            format!("18:38:{:09.6}", start_s % 60.0).replace("18:38", if start_s < 60.0 { "18:38" } else { "18:39" });
        let _ = write!(text, "Channels{s}4{s}\r\n");
        key(&mut text, "Date", ["2026/09/22"; 4].map(str::to_owned));
        key(&mut text, "Time", [0; 4].map(|_| clock.replace('.', &decimal.to_string())));
        key(&mut text, "Y_Unit_Label", ["%", "%", "%", "bar"].map(str::to_owned));
        key(&mut text, "X_Dimension", ["Time"; 4].map(str::to_owned));
        key(&mut text, "X0", [0; 4].map(|_| number(0.0)));
        key(&mut text, "Delta_X", [0; 4].map(|_| number(0.04)));
        let _ = write!(text, "***End_of_Header***{s}\r\n");
        let columns: Vec<String> = match times {
            "Multi" => names.iter().flat_map(|name| ["X_Value".to_owned(), (*name).to_owned()]).collect(),
            _ => [&["X_Value"], &names[..]].concat().into_iter().map(str::to_owned).collect(),
        };
        let _ = write!(text, "{}{s}Comment\r\n", columns.join(&s));
        for row in rows {
            let time = number(row.time_s - rows[0].time_s);
            let values = row.values.map(number);
            let line = match times {
                "Multi" => values.map(|value| format!("{time}{s}{value}")).join(&s),
                "No" => format!("{s}{}", values.join(&s)),
                _ => format!("{time}{s}{}", values.join(&s)),
            };
            let _ = write!(text, "{line}{s}\r\n");
        }
        text.push_str("\r\n");
    }
    text
}

const FIELDS: [&str; 4] = ["y_cmd_pct", "servo_pct", "spool_pct", "p_tank_bar"];

/// Recordings of machines as `InfluxDB` answers, each series as a table, with or without a head of its own.
pub(super) fn influx(machines: &[(&str, &[Truth])], heads: bool) -> String {
    let mut text = String::new();
    let mut table = 0;
    for (unit, rows) in machines {
        for (k, field) in FIELDS.iter().enumerate() {
            if heads || table == 0 {
                text.push_str(
                    "#group,false,false,true,true,false,false,true,true,true\r\n\
                     #datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string,string\r\n\
                     #default,_result,,,,,,,,\r\n,result,table,_start,_stop,_time,_value,_field,_measurement,unit\r\n",
                );
            }
            for row in *rows {
                let _ = write!(
                    text,
                    ",,{table},2026-09-22T18:00:00Z,2026-09-22T19:00:00Z,{},{},{field},governor,{unit}\r\n",
                    iso(row),
                    row.values[k]
                );
            }
            text.push_str("\r\n");
            table += 1;
        }
    }
    text
}

/// The same as one table with a column for each field.
pub(super) fn influx_pivot() -> String {
    let mut text = format!(
        "#group,false,false,true,true,false,false,false,false,false\n#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,\
         double,double,double,double\n#default,_result,,,,,,,,\n,result,table,_start,_stop,_time,{}\n",
        FIELDS.join(",")
    );
    for row in rejection() {
        let cells = row.values.map(|value| value.to_string()).join(",");
        let _ = writeln!(text, ",,0,2026-09-22T18:00:00Z,2026-09-22T19:00:00Z,{},{cells}", iso(row));
    }
    text
}

/// The recording as WinCC logs it, one signal after the other or row by row; the servomotor's rows of some numbers are not valid.
pub(super) fn wincc(quote: &str, comma: bool, by_tag: bool, bad: std::ops::Range<usize>) -> String {
    let names = ["Y_CMD [%]", "SERVO [%]", "SPOOL [%]", "P_TANK [bar]"];
    let separator = if comma { ";" } else { "," };
    let point = |text: String| if comma { text.replace('.', ",") } else { text };
    let quoted = |text: &str| format!("{quote}{text}{quote}");
    let mut text = ["VarName", "TimeString", "VarValue", "Validity", "Time_ms"].map(quoted).join(separator) + "\r\n";
    let line = |row: usize, tag: usize| {
        let truth = &rejection()[row];
        let second = 20 + truth.time_s as usize;
        let clock = format!("22.09.2026 18:{}:{:02}", 38 + second / 60, second % 60);
        let millionths = 46_287_776_620.370_37 + truth.time_s / 86_400.0 * 1e6;
        let left_out = tag == 1 && bad.contains(&row);
        let value = if left_out { 0.0 } else { truth.values[tag] };
        let cells = [
            quoted(names[tag]),
            quoted(&clock),
            point(value.to_string()),
            u8::from(!left_out).to_string(),
            point(format!("{millionths:.4}")),
        ];
        cells.join(separator) + "\r\n"
    };
    let count = rejection().len();
    if by_tag {
        (0..4).for_each(|tag| (0..count).for_each(|row| text.push_str(&line(row, tag))));
    } else {
        (0..count).for_each(|row| (0..4).for_each(|tag| text.push_str(&line(row, tag))));
    }
    let end =
        [quoted("$RT_OFF$"), quoted("22.09.2026 18:59:00"), "0".into(), "2".into(), point("46287790972.2222".into())];
    text + &end.join(separator) + "\r\n"
}

#[test]
fn files_of_labview_are_read() {
    for (times, decimal, separator, segments) in [
        ("One", '.', '\t', 1),
        ("One", ',', '\t', 1),
        ("One", '.', ',', 1),
        ("One", '.', '\t', 3),
        ("No", '.', '\t', 1),
        ("No", ',', '\t', 3),
        ("Multi", '.', '\t', 1),
        ("Multi", ',', '\t', 2),
    ] {
        let what = format!("X_Columns {times}, decimal {decimal}, {segments} segments");
        assert_proposed(&what, &labview(LabView { times, decimal, separator, segments }), rejection());
    }
}

#[test]
fn answers_of_influx_are_read() {
    for heads in [true, false] {
        assert_proposed("series", &influx(&[("U3", rejection())], heads), rejection());
        let other = recording("practice/case_05/load_rejection.mcap", 4);
        let (rows, _, proposal) = by_proposal(&influx(&[("U3", rejection()), ("U5", &other)], heads)).unwrap();
        assert!(proposal.open.iter().any(|open| open.starts_with("machines:")), "{:?}", proposal.open);
        let first = proposal.map.signals.iter().find_map(|signal| signal.place()).unwrap();
        assert_right("one of two machines", &rows, if first.contains("U3") { rejection() } else { &other });
    }
    assert_proposed("pivot", &influx_pivot(), rejection());
    let error =
        by_proposal("#datatype,string,string\n#group,true,true\n#default,,\n,error,reference\n,no such bucket,897\n");
    assert!(error.unwrap_err().to_string().contains("no such bucket"));
}

#[test]
fn logs_of_wincc_are_read() {
    for (quote, comma, by_tag) in [("\"", true, true), ("\"", true, false), ("", true, true), ("\"", false, true)] {
        let what = format!("quote {quote}, comma {comma}, by tag {by_tag}");
        assert_proposed(&what, &wincc(quote, comma, by_tag, 0..0), rejection());
        let (rows, outcome, _) = by_proposal(&wincc(quote, comma, by_tag, 300..330)).unwrap();
        let found = series(&rows, Target::ServomotorPosition);
        assert_eq!(found.len(), 970, "{what}");
        assert!(outcome.notes.iter().any(|note| note.contains("30 values left out")), "{:?}", outcome.notes);
    }
}

#[test]
fn formats_that_are_not_read_are_named_with_the_way_out() {
    let cfg = "PLANT,GOV,1999\r\n2,2A,0D\r\n1,Y,,,%,0.01,0,0,-32767,32767,1,1,P\r\n2,P,,,bar,0.01,0,0,-32767,32767,1,1,P\r\n50\r\n1\r\n25,2\r\n";
    let data = "1,0,7000,6300\r\n2,40000,7001,6300\r\n";
    let cff = format!("--- file type: CFG ---\r\n{cfg}--- file type: DAT ASCII ---\r\n{data}");
    for (name, bytes, words) in [
        ("t.mf4", b"MDF     4.10    asammdf ".to_vec(), "MDF"),
        ("t.mf4", b"UnFinMF 4.10    logger  ".to_vec(), "MDF"),
        ("t.cfg", cfg.into(), "COMTRADE"),
        ("t.txt", cff.into(), "COMTRADE"),
    ] {
        let (_folder, path) = file(name, bytes);
        let error = propose(&path).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("CSV"), "{error}");
    }
    // Its data are known by the file beside them.
    for data in [data.as_bytes().to_vec(), [1_u32.to_le_bytes(), 0_u32.to_le_bytes(), [1, 2, 3, 4]].concat()] {
        let (folder, path) = file("t.dat", data);
        std::fs::write(folder.path().join("t.CFG"), cfg).unwrap();
        let error = propose(&path).unwrap_err().to_string();
        assert!(error.contains("COMTRADE") && error.contains("CSV"), "{error}");
    }
    // A table that begins alike is none of them.
    let table =
        wide(&HEADER.replace("Timestamp", "t [s]"), rejection(), |row| format!("{:.2}", row.time_s), plain, ",");
    assert_proposed("a table", &table, rejection());
}
