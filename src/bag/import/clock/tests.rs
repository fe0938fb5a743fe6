//! Clocks of tables, tried.

use super::*;

fn clock(format: &str, zone: Option<&str>, start: Option<&str>) -> TimeReader {
    let map = TimeMap { zone: zone.map(str::to_owned), start: start.map(str::to_owned), ..TimeMap::default() };
    let numbers = Numbers { decimal: '.', thousands: None, missing: vec![] };
    TimeReader::new(Format::of(format).unwrap(), &map, &numbers).unwrap()
}

#[test]
fn one_moment_is_read_from_every_format() {
    let moment_ns = 1_714_636_800_250_000_000; // 2024-05-02T08:00:00.25Z
    for (format, zone, start, text) in [
        ("iso", None, None, "2024-05-02T08:00:00.25Z"),
        ("iso", None, None, "2024-05-02 10:00:00.250+02:00"),
        ("iso", Some("Europe/Zurich"), None, "2024-05-02 10:00:00.25"),
        ("iso", Some("+02:00"), None, "2024-05-02T10:00:00,25"),
        ("iso", None, None, "2024-05-02 08:00:00:250"),
        ("%d.%m.%Y %H:%M:%S:%f", None, None, "02.05.2024 08:00:00:25"),
        ("%m/%d/%Y %I:%M:%S%.f %p", None, None, "05/02/2024 08:00:00:250 AM"),
        ("%H:%M:%S%.f", None, Some("2024-05-02"), "08:00:00:250"),
        ("iso", Some("Asia/Tokyo"), None, "2024-05-02 10:00:00.25 UTC+0200"),
        ("%d.%m.%Y %H:%M:%S%.f", None, None, "02.05.2024 10:00:00.250 UTC+0200"),
        ("%d.%m.%Y %H:%M:%S%.f", Some("UTC+0200"), None, "02.05.2024 10:00:00.250"),
        ("unix_s", None, None, "1714636800.25"),
        ("unix_s", Some("Europe/Zurich"), None, "1.71463680025e9"),
        ("unix_ms", None, None, "1714636800250"),
        ("unix_ns", None, None, "1714636800250000000"),
        ("filetime", None, None, "133591104002500000"),
        ("dotnet_ticks", None, None, "638502336002500000"),
        ("windows_us", None, None, "13359110400250000"),
        ("labview_s", None, None, "3797481600.25"),
        ("seconds", None, Some("2024-05-02T08:00:00Z"), "0.25"),
        ("milliseconds", Some("Europe/Zurich"), Some("2024-05-02T10:00:00"), "250"),
        ("0.1 milliseconds", None, Some("2024-05-02T08:00:00Z"), "2500"),
        ("0.0001 milliseconds", None, Some("2024-05-02T08:00:00Z"), "2500000"),
        ("excel", Some("Europe/Zurich"), None, "45414.4166695602"),
        ("matlab", None, None, "739374.333336227"),
        ("%d.%m.%Y %H:%M:%S%.f", Some("Europe/Zurich"), None, "02.05.2024 10:00:00.250"),
        ("%d.%m.%Y %H:%M:%S%.f", Some("UTC+2"), None, "02.05.2024 10:00:00,250"),
        ("%m/%d/%Y %I:%M:%S%.f %p", None, None, "05/02/2024 08:00:00.250 AM"),
        ("%Y-%m-%d %H:%M:%S%.f %z", None, None, "2024-05-02 10:00:00.25 +0200"),
        ("%d.%m.%Y %H:%M:%S%.f", Some("Asia/Tokyo"), None, "02.05.2024 10:00:00.250 CEST"),
        ("%d.%m.%Y %H:%M:%S%.f CEST", None, None, "02.05.2024 09:00:00.250 CET"),
        ("%d.%m.%Y %H:%M:%S%.f IST", Some("Asia/Kolkata"), None, "02.05.2024 13:30:00.250 IST"),
        ("%b %d %Y %I:%M:%S%.f %p", None, None, "May 02 2024 04:00:00.250 AM EDT"),
        ("%H:%M:%S%.f", None, Some("2024-05-02"), "10:00:00.25 CEST"),
        ("%H:%M:%S%.f", Some("Europe/Zurich"), Some("2024-05-02"), "10:00:00.25"),
    ] {
        assert_eq!(clock(format, zone, start).read(text), Ok(moment_ns), "{format} {text}");
    }
}

#[test]
fn the_hour_that_comes_twice_goes_on_and_the_one_that_does_not_exist_is_refused() {
    let mut clock = clock("iso", Some("Europe/Zurich"), None);
    let read = |clock: &mut TimeReader, text: &str| clock.read(text).unwrap() / 1_000_000_000;
    let before = read(&mut clock, "2024-10-27 01:59:00");
    let first = read(&mut clock, "2024-10-27 02:30:00");
    let second = read(&mut clock, "2024-10-27 02:10:00");
    let after = read(&mut clock, "2024-10-27 03:00:00");
    assert_eq!((first - before, second - first, after - second), (31 * 60, 40 * 60, 50 * 60));
    assert_eq!(clock.folded, 2);
    let error = clock.read("2024-03-31 02:30:00").unwrap_err();
    assert!(error.contains("does not exist in the zone") && error.contains("+01:00"), "{error}");
}

#[test]
fn counters_that_begin_anew_go_on() {
    for (format, texts, step_ns) in [
        ("milliseconds", ["65530", "65535", "4"], 5_000_000),
        ("milliseconds", ["4294967291", "4294967293", "4294967295"], 2_000_000),
        ("milliseconds", ["4294967290", "4294967295", "4"], 5_000_000),
        ("microseconds", ["2147483640", "2147483645", "-2147483646"], 5000),
    ] {
        let mut clock = clock(format, None, None);
        let times = texts.map(|text| clock.read(text).unwrap());
        assert_eq!([times[1] - times[0], times[2] - times[1]], [step_ns; 2], "{texts:?}");
    }
    let mut clock = clock("seconds", None, None);
    let times = ["100000", "100001", "5"].map(|text| clock.read(text).unwrap() / 1_000_000_000);
    assert_eq!((times, clock.wraps), ([100_000, 100_001, 5], 0), "a counter that was reset is none that ran over");
}

#[test]
fn counts_from_midnight_pass_it() {
    // The one whose column says so may do it with a gap; of others only the step tells.
    for (name, texts, step_s) in [
        ("t", ["86399000", "86399500", "500"], 1),
        ("t", ["82000000", "86000000", "500000"], -85_500),
        ("ms of day", ["82000000", "86000000", "500000"], 900),
        ("Millisekunden seit Mitternacht", ["50000000", "60000000", "5000000"], 31_400),
        ("ms of day", ["90000000", "90000500", "500"], -90_000),
    ] {
        let map = TimeMap { columns: vec![name.to_owned()], ..TimeMap::default() };
        let numbers = Numbers { decimal: '.', thousands: None, missing: vec![] };
        let mut clock = TimeReader::new(Format::of("milliseconds").unwrap(), &map, &numbers).unwrap();
        let times_ns = texts.map(|text| clock.read(text).unwrap());
        assert_eq!((times_ns[2] - times_ns[1]) / 1_000_000_000, step_s, "{name} {texts:?}");
    }
}

#[test]
fn times_of_day_pass_midnight() {
    let mut clock = clock("%H:%M:%S", None, Some("2024-05-02"));
    let first = clock.read("23:59:59").unwrap();
    assert_eq!(clock.read("00:00:01").unwrap() - first, 2_000_000_000);
}

#[test]
fn zones_and_formats_that_are_none_come_with_a_way_out() {
    assert!(zone("Europe/Zuerich").unwrap_err().contains("did you mean `Europe/Zurich`?"));
    assert!(zone("+99:99").unwrap_err().contains("expected an offset"));
    assert!(Format::of("unix").unwrap_err().to_string().contains("did you mean `unix_"));
    let mut clock = clock("%d.%m.%Y", None, None);
    assert!(clock.read("2024-05-02").unwrap_err().contains("expected a time as `%d.%m.%Y`, found `2024-05-02`"));
}
