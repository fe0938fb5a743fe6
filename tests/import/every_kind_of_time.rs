//! Cases of time: how it counts, how it is written, in which order, and in which columns.

use super::*;

pub(super) fn times(cases: &mut Cases) {
    const KIND: &str = "time";
    let headed = |header: &str, time: &dyn Fn(&Truth) -> String| {
        wide(&HEADER.replace("Timestamp", header), rejection(), time, plain, ",")
    };
    let count = |unit_s: f64, zero: i64| move |row: &Truth| (zero + (row.time_s / unit_s).round() as i64).to_string();
    cases.add(KIND, "FILETIME", headed("Time", &count(1e-7, 134_345_759_000_000_000)), Right);
    cases.add(KIND, ".NET ticks", headed("Time", &count(1e-7, 639_000_000_000_000_000)), Right);
    cases.add(KIND, "us since 1970", headed("Time", &count(1e-6, 1_790_102_300_000_000)), Right);
    cases.add(KIND, "ms since boot", headed("t [ms]", &count(1e-3, 900_000_000)), Right);
    cases.add(KIND, "ms since boot, no unit", headed("t", &count(1e-3, 900_000_000)), Refused("time: {format"));
    cases.add(
        KIND,
        "a counter that runs over",
        headed("t [ms]", &|row| ((60_000 + (row.time_s * 1e3).round() as i64) % 65_536).to_string()),
        Right,
    );
    let of_day = |row: &Truth| (86_380_000 + (row.time_s * 1e3).round() as i64) % 86_400_000;
    for header in ["ms of day", "Time [ms]", "ms since midnight"] {
        cases.add(KIND, format!("{header} over midnight"), headed(header, &|row| of_day(row).to_string()), Right);
    }
    cases.add(
        KIND,
        "seconds of day over midnight",
        headed("Seconds of day", &|row| format!("{:.3}", of_day(row) as f64 * 1e-3)),
        Right,
    );
    cases.add(
        KIND,
        "seconds of GPS",
        headed("GPS s", &|row| format!("{:.2}", 1_474_137_518.0 + row.time_s)),
        Refused("GPS"),
    );
    cases.add(
        KIND,
        "days of Excel",
        headed("Time", &|row| format!("{:.10}", 46_287.776_620_37 + row.time_s / 86_400.0)),
        Right,
    );
    cases.add(
        KIND,
        "ms behind a colon",
        headed("Time", &|row| {
            let text = iso(row);
            format!("22.09.2026 {}:{}", &text[11..19], &text[20..23])
        }),
        Right,
    );
    let behind_colon = |part: &str, row: &Truth| format!("{}:{part}", &iso(row)[11..19]);
    cases.add(
        KIND,
        "a time of day with ms behind a colon",
        headed("Time", &|row| behind_colon(&iso(row)[20..23], row)),
        Right,
    );
    cases.add(
        KIND,
        "ms without zeros behind a colon",
        headed("Time", &|row| behind_colon(&iso(row)[20..23].parse::<u16>().unwrap().to_string(), row)),
        Right,
    );
    cases.add(
        KIND,
        "hundredths behind a colon",
        headed("Time", &|row| behind_colon(&iso(row)[20..22], row)),
        Refused("milliseconds, or a fraction?"),
    );
    let parted = |header: &str, second: &dyn Fn(&str) -> String, width: usize, pad: usize| {
        let header = HEADER.replace("Timestamp", header);
        wide(
            &header,
            rejection(),
            |row| {
                let (text, ms) = (iso(row), iso(row)[20..23].parse::<u64>().unwrap());
                format!("{},{:0pad$}", second(&text), ms * 10_u64.pow(width as u32 - 3))
            },
            plain,
            ",",
        )
    };
    let german = |text: &str| format!("22.09.2026 {}", &text[11..19]);
    let digits = |text: &str| text[..19].replace(['-', ':', 'T'], "");
    let unix = |text: &str| {
        let of = |from: usize| text[from..from + 2].parse::<i64>().unwrap();
        (1_790_035_200 + of(11) * 3600 + of(14) * 60 + of(17)).to_string()
    };
    cases.add(KIND, "ms beside date and time", parted("Time,ms", &german, 3, 1), Right);
    cases.add(
        KIND,
        "ms with zeros beside ISO",
        parted("Timestamp,Millisecond", &|text| text[..19].to_owned(), 3, 3),
        Right,
    );
    cases.add(
        KIND,
        "ms beside date, time",
        parted("Date,Time,Time ms", &|text| german(text).replace(' ', ","), 3, 1),
        Right,
    );
    cases.add(KIND, "us beside date and time", parted("Time,usec", &german, 6, 1), Right);
    cases.add(KIND, "sec, nanosec", parted("sec,nanosec", &unix, 9, 1), Right);
    cases.add(KIND, "stamp.sec, stamp.nanosec", parted("header.stamp.sec,header.stamp.nanosec", &unix, 9, 1), Right);
    cases.add(
        KIND,
        "sec, nanosec from a start",
        parted("sec,nanosec", &|text| unix(text)[6..].to_owned(), 9, 1),
        Right,
    );
    cases.add(KIND, "digits alone", headed("Time", &|row| iso(row)[..23].replace(['-', ':', 'T', '.'], "")), Right);
    cases.add(
        KIND,
        "digits alone with a point",
        headed("Time", &|row| iso(row)[..23].replace(['-', ':', 'T'], "")),
        Right,
    );
    cases.add(KIND, "digits alone beside ms", parted("Time,ms", &digits, 3, 1), Right);
    cases.add(
        KIND,
        "digits of date and time of day",
        headed("Date,Time", &|row| iso(row)[..23].replace(['-', ':'], "").replace('T', ",")),
        Right,
    );
    // Not the part of the second: how long a cycle took.
    cases.add(
        KIND,
        "whole seconds beside a cycle's ms",
        wide(
            &HEADER.replace("Timestamp", "Time,ms"),
            rejection(),
            |row| format!("{},{}", german(&iso(row)), 3 + (row.time_s * 7919.0) as u64 % 5),
            plain,
            ",",
        ),
        Asked("have the time of the one before"),
    );
    cases.add(KIND, "basic ISO", headed("Time", &|row| iso(row).replace(['-', ':', 'Z'], "")), Right);
    cases.add(
        KIND,
        "month or day",
        headed("Time", &|row| format!("09/05/2026 {}", &iso(row)[11..23])),
        Refused("month/day or day/month"),
    );
    let mut newest = rejection().to_vec();
    newest.reverse();
    cases.add(KIND, "newest first", wide(HEADER, &newest, iso, plain, ","), Right);
    let parts = [&rejection()[600..], &rejection()[..600]].concat();
    cases.add(KIND, "parts in another order", wide(HEADER, &parts, iso, plain, ","), Right);
    let twice = [&rejection()[..700], &rejection()[200..]].concat();
    cases.add(KIND, "two recordings", wide(HEADER, &twice, iso, plain, ","), Refused("split the file"));
    let unit = |tag: &str| UNITS[TAGS.iter().position(|known| *known == tag).unwrap()];
    let line = |tag: &str, row: &Truth, value: f64| format!("{tag},{},{value},{}", iso(row), unit(tag));
    cases.add(KIND, "one tag after the other", tall("Tag,Timestamp,Value,Unit", true, line), Right);
    cases.add(KIND, "tags by turns", tall("Tag,Timestamp,Value,Unit", false, line), Right);
    let cut = |tag: &str, row: &Truth, value: f64| format!("{tag},{}Z,{value},{}", &iso(row)[..19], unit(tag));
    cases.add(
        KIND,
        "whole seconds of tags",
        tall("Tag,Timestamp,Value,Unit", true, cut),
        Asked("the time of the one before"),
    );
    // Pairs of time and value side by side, of which the first ends first.
    let mut pairs = String::from("Time,cmd [%],Time,servo [%],Time,spool [%],Time,p tank [bar]\n");
    for (k, row) in rejection().iter().enumerate() {
        let pair = |signal: usize| {
            let ended = signal == 0 && k >= 950;
            if ended {
                ",".to_owned()
            } else {
                format!("{:.3},{}", row.time_s + 1e-3 * signal as f64, row.values[signal])
            }
        };
        let _ = writeln!(pairs, "{}", (0..4).map(pair).collect::<Vec<_>>().join(","));
    }
    cases.add(KIND, "pairs side by side", pairs, Rest);
    // Each signal has times of its own, half a second later than those of the one before it, and half as many.
    let apart = |header: &str, steps: [usize; 4], pair: &dyn Fn(&Truth, f64) -> String| {
        let mut text = format!("{header}\n");
        for k in 0..rejection().len() {
            let cell = |signal: usize| {
                rejection().get(k * steps[signal]).map_or(",".to_owned(), |row| pair(row, row.values[signal]))
            };
            let _ = writeln!(text, "{}", (0..4).map(cell).collect::<Vec<_>>().join(","));
        }
        text
    };
    for (name, header) in [
        ("t_ of each signal", "t_cmd [s],cmd [%],t_servo [s],servo [%],t_spool [s],spool [%],t_tank [s],p tank [bar]"),
        ("time of each signal", "cmd time,cmd [%],servo time,servo [%],spool time,spool [%],tank time,p tank [bar]"),
        ("numbered times", "Time,cmd [%],Time.1,servo [%],Time.2,spool [%],Time.3,p tank [bar]"),
        ("X and Y of each signal", "cmd X,cmd Y [%],servo X,servo Y [%],spool X,spool Y [%],p tank X,p tank Y [bar]"),
    ] {
        let by_second = |row: &Truth, value: f64| format!("{:.3},{value}", row.time_s);
        let by_date = |row: &Truth, value: f64| format!("{},{value}", iso(row));
        let pair: &dyn Fn(&Truth, f64) -> String =
            if header.contains("time") || header.starts_with("Time") { &by_date } else { &by_second };
        cases.add(KIND, name, apart(header, [1; 4], pair), Right);
        cases.add(KIND, format!("{name}, of several rates"), apart(header, [1, 2, 1, 2], pair), Half);
    }
    for (name, header) in [
        (
            "t_ behind each signal",
            "cmd [%],t_cmd [s],servo [%],t_servo [s],spool [%],t_spool [s],p tank [bar],t_tank [s]",
        ),
        ("times behind values", "cmd [%],Time,servo [%],Time,spool [%],Time,p tank [bar],Time"),
    ] {
        let pair: &dyn Fn(&Truth, f64) -> String = &|row, value| format!("{value},{:.3}", row.time_s);
        cases.add(KIND, name, apart(header, [1; 4], pair), Right);
        cases.add(KIND, format!("{name}, of several rates"), apart(header, [1, 2, 1, 2], pair), Half);
    }
    let tags = "Y_SP [%],,Y.PV [%],,SPOOL [%],,OILP [bar],\nTime,Value,Time,Value,Time,Value,Time,Value";
    cases.add(KIND, "tags above pairs", apart(tags, [1, 2, 1, 2], &|row, value| format!("{},{value}", iso(row))), Half);
    for name in ["时间", "Tid", "Data/Hora", "Время", "Moment de mesure", "Logged at"] {
        cases.add(KIND, format!("a time called {name}"), headed(name, &iso), Right);
    }
    cases.add(
        KIND,
        "local and universal time",
        headed("Local time,UTC", &|row| format!("{},{}", iso(row).replace('Z', ""), iso(row))),
        Right,
    );
    let moment = |date: &str, row: &Truth| format!("{date} {}", &iso(row)[11..23]);
    for (name, date) in [
        ("a month in German", "22. Sept. 2026"),
        ("a month in French", "22 sept. 2026"),
        ("a month in Spanish", "22-set-26"),
    ] {
        cases.add(KIND, name, headed("Time", &|row| moment(date, row)), Right);
    }
    cases.add(KIND, "a date in Chinese", headed("时间", &|row| moment("2026年9月22日", row)), Right);
    cases.add(
        KIND,
        "a zone in letters",
        headed("Time", &|row| format!("{} CEST", iso(row).replace(['T', 'Z'], " ").trim_end())),
        Right,
    );
    cases.add(
        KIND,
        "minutes and seconds",
        headed("Time", &|row| {
            format!("{:02}:{:06.3}", ((row.time_s + 3580.0) / 60.0) as u32 % 60, (row.time_s + 3580.0) % 60.0)
        }),
        Right,
    );
    cases.add(
        KIND,
        "seconds of the minute",
        headed("sec", &|row| format!("{:.2}", (row.time_s + 20.0) % 40.0)),
        Refused("began anew"),
    );
    cases.add(
        KIND,
        "days alone",
        headed("Date,ms", &|row| format!("2026-09-22,{}", 67_100_000 + (row.time_s * 1e3) as u64)),
        Asked("days alone"),
    );
    cases.add(
        KIND,
        "an unknown date",
        headed("Logged", &|row| moment("22/IX/2026", row)),
        Refused("found `22/IX/2026"),
    );
    // As mail writes it, and as a database does.
    let of_mail = |row: &Truth| format!("\"Tue, 22 Sep 2026 {} +0000\"", &iso(row)[11..23]);
    cases.add(KIND, "a date of a mail", headed("Logged", &of_mail), Right);
    let of_database = |row: &Truth| format!("22-SEP-26 06.{}.{}000 PM", &iso(row)[14..16], &iso(row)[17..23]);
    cases.add(KIND, "points in times of day", headed("TS", &of_database), Right);
    let blank_below = headed("t [s]", &|row| format!("{:.2}", row.time_s)).replacen('\n', "\n\n", 1);
    cases.add(KIND, "a blank line below the names", blank_below, Right);
    let lost_power = headed("t [s]", &|row| format!("{:.2}", row.time_s)) + &"\0".repeat(512);
    cases.add(KIND, "zeros behind the last line", lost_power, Right);
}

/// Units with factors, and zones in words and headers.
pub(super) fn units_and_zones(cases: &mut Cases) {
    const KIND: &str = "time";
    let headed = |header: &str, time: &dyn Fn(&Truth) -> String| {
        wide(&HEADER.replace("Timestamp", header), rejection(), time, plain, ",")
    };
    let count = |unit_s: f64, zero: i64| move |row: &Truth| (zero + (row.time_s / unit_s).round() as i64).to_string();
    for (header, unit_s) in [("t [0.1 ms]", 1e-4), ("t [10 ms]", 1e-2), ("Timestamp (100 ns)", 1e-7)] {
        cases.add(KIND, header, headed(header, &count(unit_s, 0)), Right);
    }
    cases.add(
        KIND,
        "Ticks (0.1 ms) that run over",
        headed("Ticks (0.1 ms)", &|row| ((4_294_960_000 + (row.time_s * 1e4).round() as i64) % (1 << 32)).to_string()),
        Right,
    );
    cases.add(KIND, "t [ms x 10]", headed("t [ms x 10]", &count(1e-2, 0)), Refused("may mean 0.1 ms or 10 ms"));
    for (name, hour, zone, expected) in [
        ("a zone in letters behind a German date", "20", "CEST", Right),
        ("UTC behind a German date", "18", "UTC", Right),
        ("EDT behind a German date", "14", "EDT", Right),
        ("an offset without a colon behind a German date", "20", "UTC+0200", Right),
        ("an offset behind a German date", "20", "+02:00", Right),
        ("a zone in letters of several offsets", "23", "IST", Refused("`IST` behind the times")),
    ] {
        let time = |row: &Truth| format!("22.09.2026 {hour}{} {zone}", &iso(row)[13..23]);
        cases.add(KIND, name, headed("Zeit", &time), expected);
    }
    for (header, hour) in [("Time (UTC+02:00)", "20"), ("Timestamp (UTC)", "18"), ("Time (UTC+0200)", "20")] {
        let time = |row: &Truth| format!("2026-09-22 {hour}{}", &iso(row)[13..23]);
        cases.add(KIND, header, headed(header, &time), Right);
    }
    let by_turns = |row: &Truth| {
        let (hour, zone) = if row.time_s < 20.0 { ("20", "CEST") } else { ("19", "CET") };
        format!("22.09.2026 {hour}{} {zone}", &iso(row)[13..23])
    };
    cases.add(KIND, "summer time and winter time in letters", headed("Zeit", &by_turns), Right);
}
