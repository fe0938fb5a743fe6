//! Twenty broken files and what is said of each: the file, what was expected, what was found, and the way out.

use super::rows_of;

const MAP: &str = "time: {column: t}\nsignals: {spool_position: u, servomotor_position: y}\n";

/// A table of a servomotor that follows its spool.
fn table(rows: i64) -> String {
    let line =
        |k: i64| format!("{},{},{}\n", k as f64 / 100.0, (k as f64 / 50.0).sin(), 0.5 - 0.3 * (k as f64 / 50.0).cos());
    format!("t,u,y\n{}", (0..rows).map(line).collect::<String>())
}

/// What is said of a file: the error, or the warnings.
fn said(content: &[u8], map: &str) -> String {
    match rows_of(content, map) {
        Err(error) => format!("error: {error}"),
        Ok((_, outcome)) => format!("warnings: {}", outcome.warnings.join("\n")),
    }
}

#[test]
fn twenty_broken_files_are_each_named_with_a_way_out() {
    let good = table(400);
    let with_quote = good.replacen("0.05,", "0.05,\"", 1).replacen("t,u,y", "t,\"u\",y", 1);
    let endless = format!("{with_quote}{}", "1,2,3\n".repeat(2_000_000));
    let utf16: Vec<u8> = good.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let cases: [(&str, Vec<u8>, &str, &[&str]); 23] = [
        (
            "a quote that is not closed",
            with_quote.into_bytes(),
            MAP,
            &[
                "t.csv:7: a quotation mark (\") opens in this line, and 394 lines of the table follow before it is closed",
            ],
        ),
        ("empty", vec![], MAP, &["error: ", "t.csv: expected a table or a bag, found an empty file"]),
        ("a workbook", b"PK\x03\x04rest".to_vec(), MAP, &["a workbook or zip archive", "save the sheet as CSV"]),
        ("gzip", b"\x1f\x8b\x08rest".to_vec(), MAP, &["compressed with gzip", "gunzip"]),
        ("a MAT-file", b"MATLAB 5.0 MAT-file".to_vec(), MAP, &["a MAT-file", "writetable"]),
        (
            "a binary file",
            b"\x7fELF\x00\x01\x00\x00\x00rest".to_vec(),
            MAP,
            &["zero bytes, which no table of text has"],
        ),
        (
            "a letter",
            b"Dear all,\nthe data follow.\n".to_vec(),
            MAP,
            &["expected lines of numbers", "file: {first_line: N}"],
        ),
        ("names only", b"t,u,y\n".to_vec(), MAP, &["expected lines of numbers, found none"]),
        (
            "another name of a column",
            good.replace("t,u,y", "t,u,Y_ist").into_bytes(),
            MAP,
            &["servomotor_position: there is no column `y`", "columns: `t`, `u`, `Y_ist`"],
        ),
        (
            "a name twice",
            good.replace("t,u,y", "t,y,y").into_bytes(),
            "time: {column: t}\nsignals: {servomotor_position: y}\n",
            &["`y` is the name of columns 2 and 3; name the one you mean by its number, \"#2\""],
        ),
        (
            "no column of time",
            good.replace("t,u,y", "a,u,y").replace("0.03,", "0.5,").into_bytes(),
            "signals: {spool_position: u, servomotor_position: y}\n",
            &["expected a column of time", "time: {rate_hz: …}"],
        ),
        (
            "times of another pattern",
            good.into_bytes(),
            "time: {column: t, format: \"%d.%m.%Y\"}\nsignals: {servomotor_position: y}\n",
            &["t.csv:2: expected a time as `%d.%m.%Y`, found `0`"],
        ),
        (
            "month or day",
            b"t,u,y\n05/02/2024 10:00:00,1,2\n05/02/2024 10:00:01,1,2\n".to_vec(),
            MAP,
            &["may be month/day or day/month", "time: {format: \"%m/%d/%Y %H:%M:%S%.f\"}"],
        ),
        (
            "a zone that is none",
            b"t,u,y\n2024-05-02 10:00:00,1,2\n2024-05-02 10:00:01,1,2\n".to_vec(),
            "time: {column: t, zone: Europe/Zuerich}\nsignals: {servomotor_position: y}\n",
            &["time.zone: there is no zone `Europe/Zuerich`; did you mean `Europe/Zurich`?"],
        ),
        (
            "an hour that does not exist",
            b"t,u,y\n2024-03-31 01:59:59,1,2\n2024-03-31 02:30:00,1,2\n2024-03-31 03:00:00,1,2\n".to_vec(),
            "time: {column: t, zone: Europe/Zurich, format: iso}\nsignals: {servomotor_position: y}\n",
            &["t.csv:3: 1 lines left out", "does not exist in the zone", "\"+01:00\""],
        ),
        (
            "decimal commas in a table of points",
            table(100).replace(',', ";").replace("0.479425538604203", "0,479425538604203").into_bytes(),
            MAP,
            &["1 cells are no numbers, the first `0,479425538604203`", "file: {decimal: \",\"}"],
        ),
        (
            "groups of digits",
            table(100).replace(',', ";").replace(";0.", ";1,000,0.").into_bytes(),
            MAP,
            &["cells are no numbers, the first `1,000,0.", "file: {thousands: \",\"}"],
        ),
        (
            "words among numbers",
            table(100).replace("0.05,", "0.05,Bad Input").into_bytes(),
            MAP,
            &["t.csv:7: spool_position (`u`): 1 cells are no numbers, the first `Bad Input"],
        ),
        (
            "a line cut short",
            table(100).replace("0.05,", "0.05\n0.055,").into_bytes(),
            MAP,
            &["t.csv:7: 1 lines left out that have too few cells"],
        ),
        (
            "a quote that is never closed",
            endless.into_bytes(),
            MAP,
            &["is there a quotation mark (\") that is never closed?"],
        ),
        (
            "a footer",
            format!("{}End of export,,\n", table(100)).into_bytes(),
            MAP,
            &["t.csv:102: 1 lines left out, the first because expected a time as `seconds`, found `End of export`"],
        ),
        (
            "time that goes back",
            format!("{}{}", table(100), table(50).replace("t,u,y\n", "")).into_bytes(),
            MAP,
            &["time goes back"],
        ),
        ("UTF-16 without a mark", utf16, MAP, &["warnings: "]),
    ];
    for (what, content, map, words) in cases {
        let said = said(&content, map);
        for words in words {
            assert!(said.contains(words), "{what}: expected `{words}`, said:\n{}", &said[..said.len().min(1500)]);
        }
    }
    assert_eq!(rows_of(table(400), MAP).unwrap().1.warnings, Vec::<String>::new(), "a sound one passes without a word");
}

#[test]
fn maps_and_files_that_do_not_go_together_are_named() {
    let field = "signals: {servomotor_position: {field: /a.b}}\n";
    assert!(
        said(table(10).as_bytes(), field)
            .contains("the map names the field `/a.b`, and a table has columns; expected `column: NAME`")
    );
    let bag = super::fixture("rosbags.mcap");
    let of_bag = |map: &str| super::rows(std::slice::from_ref(&bag), map).unwrap_err().to_string();
    for (map, words) in [
        (
            "signals: {servomotor_position: y}\n",
            "the map names the column `y`, and a bag has topics; expected `field: /topic.field`",
        ),
        (
            "signals: {servomotor_position: '/joint_state.position[0]'}\n",
            "did you mean `/joint_states`? topics: /gate/setpoint (std_msgs/msg/Float64)",
        ),
        (
            "signals: {servomotor_position: '/joint_states.positions[0]'}\n",
            "has no field `positions`; it has header, name, position",
        ),
        (
            "signals: {servomotor_position: /joint_states.position}\n",
            "`position` is an array; name an element, `position[0]`",
        ),
        ("signals: {servomotor_position: joint_states}\n", "a bag has topics"),
    ] {
        assert!(of_bag(map).contains(words), "{map}: {}", of_bag(map));
    }
    // A name that no message holds is a finding, not silence.
    let (_, outcome) = super::rows(
        std::slice::from_ref(&bag),
        "signals: {tank_pressure: /oil.fluid_pressure, servomotor_position: '/joint_states.position[gate]'}",
    )
    .unwrap();
    let told = outcome.warnings.join("\n");
    assert!(told.contains("messages do not hold it") && told.contains("holds no value at all"), "{told}");
}
