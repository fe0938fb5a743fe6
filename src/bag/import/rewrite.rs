//! Tables of text with a head of their own, rewritten line by line into plain ones while they are read: LabVIEW's LVM and `InfluxDB`'s annotated CSV.
//!
//! Each line becomes one line, perhaps a blank one, so that messages keep the lines of the file.

mod influx;
mod labview;

use std::io::{self, BufRead, BufReader, Cursor, Read};

/// A head longer than this is none, bytes.
const LONGEST_LINE_BYTES: u64 = 1 << 23;

/// What rewrites lines.
trait Rewriter {
    /// The line that stands in the place of one of the file, both without their end.
    ///
    /// # Errors
    /// In words, where the file cannot be one table.
    fn line(&mut self, line: &str) -> Result<String, String>;
}

/// The same text with plain tables in the place of known formats.
pub(super) fn plain_table(text: impl Read + 'static) -> io::Result<Box<dyn Read>> {
    let mut text = BufReader::with_capacity(1 << 16, text);
    let mut first = vec![];
    text.by_ref().take(LONGEST_LINE_BYTES).read_until(b'\n', &mut first)?;
    if !first.ends_with(b"\n") && first.contains(&b'\r') {
        let feeds: Box<dyn Read> = Box::new(EndedByReturns(Cursor::new(first).chain(text)));
        return plain_table(feeds);
    }
    let head = String::from_utf8_lossy(&first);
    let rewriter: Box<dyn Rewriter> = if head.trim_end().trim_end_matches(['\t', ',', ';']) == "LabVIEW Measurement" {
        Box::<labview::LabView>::default()
    } else if influx::begins(&head) {
        Box::<influx::Influx>::default()
    } else {
        return Ok(Box::new(Cursor::new(first).chain(text)));
    };
    let lines = Cursor::new(first).chain(text);
    Ok(Box::new(Rewritten { lines: BufReader::new(lines), rewriter, line: vec![], ready: Cursor::default() }))
}

/// Lines that end with a carriage return alone, with a line feed in its place.
struct EndedByReturns<R>(R);

impl<R: Read> Read for EndedByReturns<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.0.read(buffer)?;
        buffer.iter_mut().take(count).filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
        Ok(count)
    }
}

/// Rewritten lines as a text.
struct Rewritten<R> {
    lines: BufReader<R>,
    rewriter: Box<dyn Rewriter>,
    line: Vec<u8>,
    ready: Cursor<Vec<u8>>,
}

impl<R: Read> Read for Rewritten<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.ready.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            self.line.clear();
            self.lines.by_ref().take(LONGEST_LINE_BYTES).read_until(b'\n', &mut self.line)?;
            if self.line.is_empty() {
                return Ok(0);
            }
            let line = String::from_utf8_lossy(&self.line);
            let line = line.trim_end_matches(['\n', '\r']);
            let invalid = |problem: String| io::Error::new(io::ErrorKind::InvalidData, problem);
            let mut plain = self.rewriter.line(line).map_err(invalid)?.into_bytes();
            plain.push(b'\n');
            self.ready = Cursor::new(plain);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(text: &'static str) -> Result<String, io::Error> {
        let mut read = String::new();
        plain_table(Cursor::new(text))?.read_to_string(&mut read)?;
        Ok(read)
    }

    #[test]
    fn other_tables_stay_as_they_are() {
        for text in ["", "t,y\n0,1\n", "LabVIEW;Measurement\n1;2\n", "no end of line"] {
            assert_eq!(plain(text).unwrap(), text);
        }
        assert_eq!(plain("t,y\r0,1\r").unwrap(), "t,y\n0,1\n");
    }

    #[test]
    fn segments_of_labview_are_one_table_in_local_time() {
        let head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tNo\nDate\t2026/09/22\n***End_of_Header***\n\n";
        let segment = |time: &str, value: &str| {
            format!(
                "Channels\t1\nDate\t2026/09/22\nTime\t{time}\nY_Unit_Label\tmm\nX0\t0,0\nDelta_X\t0,5\n***End_of_Header***\nX_Value\tgate\tComment\n\t{value}\t\n\t2\t\n\n"
            )
        };
        let text = format!("{head}{}{}", segment("18:38:59,5", "1,5"), segment("18:40:00", "3"));
        let text: &'static str = Box::leak(text.into_boxed_str());
        let read = plain(text).unwrap();
        assert_eq!(read.lines().count(), text.lines().count());
        let full: Vec<&str> = read.lines().filter(|line| !line.is_empty()).collect();
        assert_eq!(
            full,
            [
                "X_Value\tgate [mm]\tComment",
                "2026-09-22T18:38:59.5\t1,5\t",
                "2026-09-22T18:39:00\t2\t",
                "2026-09-22T18:40:00\t3\t",
                "2026-09-22T18:40:00.5\t2\t",
            ]
        );
    }

    #[test]
    fn series_of_influx_are_named_by_all_their_tags() {
        let read = plain(
            "#group,false,false,true,false,true,true,true\n#datatype,string,long,dateTime:RFC3339,double,string,string,string\n#default,last,,,,,,\n\
             ,result,table,_start,_time,_value,_field,_measurement,unit\n",
        );
        // The annotations have a cell less than the names.
        assert!(read.is_err(), "{read:?}");
        let read = plain(
            "#group,false,false,false,false,true,true,true\n#default,_result,,,,gate,,\n,result,table,_time,_value,_field,_measurement,unit\n\
             ,,0,2026-09-22T18:38:20Z,1.5,,gov,U3\n,,1,2026-09-22T18:38:20Z,2.5,\"a,b\",gov,U5\n",
        )
        .unwrap();
        let full: Vec<&str> = read.lines().filter(|line| !line.is_empty()).collect();
        assert_eq!(
            full,
            ["_time,_field,_value", "2026-09-22T18:38:20Z,U3.gov.gate,1.5", "2026-09-22T18:38:20Z,\"U5.gov.a,b\",2.5"]
        );
    }

    #[test]
    fn an_answer_that_is_an_error_is_told() {
        let problem =
            plain("#datatype,string,string\n#group,true,true\n#default,,\n,error,reference\n,bucket not found,897\n");
        assert!(problem.unwrap_err().to_string().contains("bucket not found"));
    }
}
