//! Cases of values: their qualities, the currents of transmitters, the formats of programs, and recordings that cannot be.

use super::super::formats::{LabView, influx, influx_pivot, labview, wincc};
use super::*;

/// Rows with another text for some of the servomotor's values.
fn marked(header: &str, mark: impl Fn(bool, f64) -> String) -> String {
    let mut text = format!("t [s],cmd [%],spool [%],p tank [bar],{header}\n");
    for (k, row) in rejection().iter().enumerate() {
        let [command, servomotor, spool, pressure] = row.values;
        let cells = mark((300..330).contains(&k), servomotor);
        let _ = writeln!(text, "{:.2},{command},{spool},{pressure},{cells}", row.time_s);
    }
    text
}

pub(super) fn qualities(cases: &mut Cases) {
    const KIND: &str = "quality";
    for (header, good, bad, expected) in [
        ("servo quality", "192", "24", Rest),
        ("servo q", "216", "0", Rest),
        ("servo quality", "0xC0", "0x00", Rest),
        ("servo StatusCode", "0x00000000", "0x80000000", Rest),
        ("servo QC", "128", "0", Rest),
        ("servo quality code", "16#80", "16#00", Rest),
        ("servo quality", "[valid]", "[invalid]", Rest),
        ("servo state", "OK", "NOK", Rest),
        ("servo quality", "Good", "UncertainLastUsableValue", Rest),
        ("servo_bad", "0", "1", Rest),
        ("servo_invalid", "false", "true", Rest),
        ("Questionable", "False", "True", Rest),
        ("PctGood", "100", "0", Rest),
        ("servo qualité", "bon", "mauvais", Rest),
        ("servo 质量", "好", "坏", Rest),
        ("servo_ok", "1", "0", Rest),
        ("servo IsGood", "True", "False", Rest),
        ("servo Confidence", "100", "0", Rest),
        ("servo annotation", "", "Bad Input", Rest),
        ("servo interpolated", "0", "1", Rest),
        ("servo status", "0", "-2146828288", Rest),
        ("servo status", "0", "248", Asked("quality:")),
        ("servo status", "1", "0", Asked("quality:")),
        ("servo fault", "0", "1", Asked("quality:")),
        ("servo flag", "", "*", Asked("quality:")),
    ] {
        let text = marked(&format!("servo [%],{header}"), |is_bad, value| {
            format!("{},{}", if is_bad { 0.0 } else { value }, if is_bad { bad } else { good })
        });
        cases.add(KIND, format!("{header}: {good}, {bad}"), text, expected);
    }
    for (stands, expected) in [
        ("-9999", Asked("stand for no value")),
        ("-999.25", Asked("stand for no value")),
        ("3.4028235E+38", Asked("stand for no value")),
        ("I/O Timeout", Asked("missing:")),
        ("Bad", Rest),
        ("0", Asked("saturated")),
    ] {
        let text = marked("servo [%]", |is_bad, value| if is_bad { stands.to_owned() } else { value.to_string() });
        cases.add(KIND, format!("instead of a value: {stands}"), text, expected);
    }
}

/// Columns whose names say that they are a figure of an interval, count closing, or hold what another signal is easily taken for.
pub(super) fn meanings(cases: &mut Cases) {
    const KIND: &str = "meaning of a column";
    for (name, header, expected) in [
        ("means", "Time,cmd (Average) [%],servo (Average) [%],spool (Average) [%],p tank (Average) [bar]", "are means"),
        ("maxima", "Time,Y_SP max [%],Y_PV max [%],HSV max [%],P_OIL max [bar]", "are minima or maxima"),
        ("closing", "Time,closing demand [%],closing position [%],spool [%],p tank [bar]", "`range: [100, 0]`"),
        (
            "Schließgrad",
            "Time,Sollwert [%],Schließgrad Ist [%],Steuerventil [%],Druck Speicher [bar]",
            "may count closing",
        ),
    ] {
        cases.add(KIND, name, wide(header, rejection(), iso, |value, _| value.to_string(), ","), Asked(expected));
    }
    for (name, header, more, expected) in [
        ("value and maximum", "Y_PV max [%]", 1.0, Right),
        ("two transducers", "Y_PV2 [%]", 1.0, Asked("moves with the spool as")),
        ("another place", "Penstock pressure [bar]", 0.3, Right),
    ] {
        let mut text = format!("t [s],Y_SP [%],Y_PV [%],HSV [%],P_OIL [bar],{header}\n");
        for row in rejection() {
            let cells = row.values.map(|value| value.to_string()).join(",");
            let _ = writeln!(text, "{:.2},{cells},{}", row.time_s, 0.1 + more * row.values[1]);
        }
        cases.add(KIND, name, text, expected);
    }
}

/// Factors of units, and what names say of pressures.
pub(super) fn units(cases: &mut Cases) {
    const KIND: &str = "number or unit";
    let header = HEADER.replace("Timestamp", "t [s]");
    for (unit, in_bar) in [("0.1 bar", 0.1), ("10 kPa", 0.1), ("100 kPa", 1.0)] {
        let cell = |value: f64, k: usize| if k < 3 { value } else { value / in_bar }.to_string();
        cases.add(KIND, format!("pressure in {unit}"), timed(&header.replace("bar", unit), cell, ","), Right);
    }
    let tenths = |value: f64, k: usize| if k < 3 { value } else { value * 10.0 }.to_string();
    let behind = timed(&header.replace("bar", "bar x 10"), tenths, ",");
    cases.add(KIND, "a factor behind a unit", behind.clone(), Asked("looks like 0.1 bar"));
    let map = "signals: {opening_command: cmd, servomotor_position: servo, spool_position: spool, tank_pressure: {column: p tank, unit: 0.1 bar}}\n";
    cases.by_map(KIND, "a factor in the map", behind.clone(), map, Right);
    let map =
        "signals: {opening_command: cmd, servomotor_position: servo, spool_position: spool, tank_pressure: p tank}\n";
    cases.by_map(
        KIND,
        "a factor behind a unit, and none in the map",
        behind,
        map,
        Refused("may mean 0.1 bar or 10 bar"),
    );
    for name in ["P_OIL_ABS [bar]", "Öldruck absolut [bar]", "油罐绝对压力(MPa)"] {
        let in_bar = if name.contains("MPa") { 10.0 } else { 1.0 };
        let cell = |value: f64, k: usize| if k < 3 { value } else { (value + 1.01325) / in_bar }.to_string();
        let header = format!("{},{name}", header.rsplit_once(',').unwrap().0);
        cases.add(KIND, format!("absolute by its name, {name}"), timed(&header, cell, ","), Right);
    }
}

/// Headers that name two units, of which the values are in one.
pub(super) fn several_units(cases: &mut Cases) {
    const KIND: &str = "number or unit";
    let header = HEADER.replace("Timestamp", "t [s]");
    type Cell = fn(f64) -> f64;
    let in_ma: Cell = |bar| 4.0 + 0.16 * bar;
    for (column, name, cell, expected) in [
        (3, "p tank 4-20 mA = 0..100 bar", in_ma, Asked("may be of `4 to 20 mA` or `0 to 100 bar`")),
        (3, "p tank 4-20 mA = 0..100 bar", |bar| bar, Right),
        (3, "p tank [%] (0-160 bar)", |bar| bar / 1.6, Asked("may be of `0 to 160 bar` or `%`")),
        (1, "servo 0-10 V = 0-100 %", |percent| percent / 10.0, Asked("may be of `0 to 10 V` or `0 to 100 %`")),
        (1, "servo 0-10 V = 0-100 %", |percent| percent, Right),
        (1, "servo [%] (0-100 %)", |percent| percent, Right),
    ] {
        let mut names: Vec<&str> = header.split(',').collect();
        names[column + 1] = name;
        let cell = |value: f64, k: usize| if k == column { cell(value) } else { value }.to_string();
        cases.add(KIND, name, timed(&names.join(","), cell, ","), expected);
    }
    let map =
        "signals: {opening_command: cmd, servomotor_position: servo, spool_position: spool, tank_pressure: \"#5\"}\n";
    let cell = |value: f64, k: usize| if k == 3 { in_ma(value) } else { value }.to_string();
    let behind = timed(&header.replace("p tank", "p tank 4-20 mA ="), cell, ",");
    cases.by_map(KIND, "two units, and none in the map", behind, map, Asked("say which with `unit`"));
}

pub(super) fn currents(cases: &mut Cases) {
    const KIND: &str = "4 to 20 mA";
    let map = "signals: {opening_command: {column: cmd}, spool_position: {column: spool}, tank_pressure: {column: p tank}, servomotor_position: ";
    let current =
        |fault: f64| move |is_bad: bool, value: f64| if is_bad { fault } else { 4.0 + 0.16 * value }.to_string();
    for fault in [0.0, 3.5, 21.5, 22.8] {
        let text = marked("servo [mA]", current(fault));
        cases.add(KIND, format!("a fault of {fault} mA"), text, Rest);
    }
    for (name, unit, range, by) in [
        ("calibrated", "mA", "{column: servo, range: [4, 20.0]}}", 1.0),
        ("amperes", "A", "{column: servo, range: [0.004, 0.02]}}", 1e-3),
        ("scale and offset", "mA", "{column: servo, scale: 0.0625, offset: -0.25, unit: pu}}", 1.0),
    ] {
        let text = marked(&format!("servo [{unit}]"), |is_bad, value| {
            (if is_bad { 22.0 } else { 4.0 + 0.16 * value } * by).to_string()
        });
        let map: &'static str = Box::leak(format!("{map}{range}\n").into_boxed_str());
        cases.by_map(KIND, name, text, map, Rest);
    }
    let volts = marked("servo [V]", |_, value| (4.0 + 0.16 * value).to_string());
    let map: &'static str = Box::leak(format!("{map}{{column: servo, range: [4, 20]}}}}\n").into_boxed_str());
    cases.by_map(KIND, "volts are no current", volts, map, Right);
}

pub(super) fn formats(cases: &mut Cases) {
    const KIND: &str = "format";
    for (times, decimal, segments) in
        [("One", '.', 1), ("One", ',', 3), ("No", '.', 1), ("No", ',', 3), ("Multi", '.', 2)]
    {
        let text = labview(LabView { times, decimal, separator: '\t', segments });
        cases.add(KIND, format!("LVM, X_Columns {times}, `{decimal}`, {segments} segments"), text, Right);
    }
    cases.add(KIND, "InfluxDB, a table for each series", influx(&[("U3", rejection())], true), Right);
    cases.add(KIND, "InfluxDB, one table", influx(&[("U3", rejection())], false), Right);
    cases.add(KIND, "InfluxDB, pivot", influx_pivot(), Right);
    cases.add(KIND, "WinCC", wincc("\"", true, true, 0..0), Right);
    cases.add(KIND, "WinCC, row by row", wincc("", false, false, 0..0), Right);
    cases.add(KIND, "WinCC, values that are not valid", wincc("\"", true, true, 300..330), Rest);
    let cfg = "PLANT,GOV,1999\n1,1A,0D\n1,Y,,,%,0.01,0,0,-32767,32767,1,1,P\n50\n";
    cases.add(KIND, "COMTRADE", cfg.to_owned(), Refused("COMTRADE"));
    cases.add(KIND, "COMTRADE in one file", format!("--- file type: CFG ---\n{cfg}"), Refused("COMTRADE"));
    let line = |row: &Truth| {
        format!(
            "gov,unit=U3 cmd={},servo={} 1790102300{:09}\n",
            row.values[0],
            row.values[1],
            (row.time_s * 1e9) as u64
        )
    };
    cases.add(KIND, "InfluxDB, line protocol", rejection().iter().map(line).collect(), Refused("line protocol"));
    cases.add(KIND, "JSON", "{\"t\":0,\"cmd\":1}\n{\"t\":1,\"cmd\":1}\n".to_owned(), Refused("JSON"));
    cases.add(
        KIND,
        "a page",
        "<html><table><tr><td>1</td></tr></table></html>".to_owned(),
        Refused("save the sheet as CSV"),
    );
    cases.add(KIND, "MDF", "MDF     4.10    x".to_owned(), Refused("MDF"));
}

pub(super) fn impossible(cases: &mut Cases) {
    const KIND: &str = "impossible";
    let header = "t [s],cmd [%],servo [%],spool [%],p tank [bar],TRIP";
    let map = "signals: {opening_command: {column: cmd}, servomotor_position: {column: servo}, spool_position: {column: spool}, tank_pressure: {column: p tank}, esv: \
               {column: TRIP, shutdown: 1}}\n";
    let rows = rejection();
    let count = rows.len();
    type Changed<'a> = (&'a str, &'a dyn Fn(usize) -> ([f64; 4], u8), &'static str);
    let changes: [Changed<'_>; 12] = [
        (
            "the position is the command",
            &|k| ([rows[k].values[0], rows[k].values[0], rows[k].values[2], rows[k].values[3]], 0),
            "is the command",
        ),
        (
            "the command is the position",
            &|k| ([rows[k].values[1], rows[k].values[1], rows[k].values[2], rows[k].values[3]], 0),
            "is the command",
        ),
        (
            "the position is the command of before",
            &|k| ([rows[k].values[0], rows[k.saturating_sub(2)].values[0], rows[k].values[2], rows[k].values[3]], 0),
            "is the command of 0.08 s before",
        ),
        (
            "the command is the position of before",
            &|k| ([rows[k.saturating_sub(2)].values[1], rows[k].values[1], rows[k].values[2], rows[k].values[3]], 0),
            "is the servomotor position of 0.08 s before",
        ),
        (
            "another value stands for some",
            &|k| {
                (
                    [
                        rows[k].values[0],
                        if (700..730).contains(&k) { 55.5 } else { rows[k].values[1] },
                        rows[k].values[2],
                        rows[k].values[3],
                    ],
                    0,
                )
            },
            "jumps by",
        ),
        ("time runs backwards", &|k| (rows[count - 1 - k].values, 0), "against"),
        (
            "the position is turned",
            &|k| ([rows[k].values[0], 100.0 - rows[k].values[1], rows[k].values[2], rows[k].values[3]], 0),
            "against",
        ),
        (
            "the position is doubled",
            &|k| ([rows[k].values[0], 2.0 * rows[k].values[1], rows[k].values[2], rows[k].values[3]], 0),
            "times its command",
        ),
        (
            "the spool is turned",
            &|k| ([rows[k].values[0], rows[k].values[1], -rows[k].values[2], rows[k].values[3]], 0),
            "sign: -1",
        ),
        (
            "the position is held",
            &|k| ([rows[k].values[0], rows[k - k % 12].values[1], rows[k].values[2], rows[k].values[3]], 0),
            "held",
        ),
        ("it runs while tripped", &|k| (rows[k].values, 1), "wrong way round"),
        (
            "pressure is a tenth",
            &|k| ([rows[k].values[0], rows[k].values[1], rows[k].values[2], rows[k].values[3] / 100.0], 0),
            "expected 5.0e5",
        ),
    ];
    for (name, change, words) in changes {
        let mut text = format!("{header}\n");
        for (k, row) in rows.iter().enumerate() {
            let (values, trip) = change(k);
            let _ = writeln!(text, "{:.2},{},{trip}", row.time_s, values.map(|value| value.to_string()).join(","));
        }
        cases.by_map(KIND, name, text, map, Asked(words));
    }
    // Half of the spool's range is neutral, where the servomotor rests.
    let cell = |value: f64, k: usize| if k == 2 { 50.0 + 0.5 * value } else { value }.to_string();
    let table = timed(header, cell, ",").replace('\n', ",0\n").replacen(",0\n", "\n", 1);
    cases.by_map(KIND, "the spool counts from fully closed", table.clone(), map, Asked("its neutral is another value"));
    cases.add(KIND, "a proposal for a spool that counts from fully closed", table, Asked("taken for neutral"));
}
