//! A small table as files.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::csv::quoted;
use super::error::ExportError;
use super::file::{WriteError, write_complete_file};
use super::parquet;
use super::sheet::{Cells, Sheet};

impl Sheet {
    /// Writes the file `path` as CSV (RFC 4180): a heading, then the rows. A missing value is an empty cell; numbers are
    /// the shortest text that parses to the same number.
    ///
    /// # Errors
    /// On an error of the file system.
    pub fn csv(&self, path: &Path) -> Result<(), ExportError> {
        write_complete_file(path, |file| self.write_csv(file).map_err(WriteError::Io))
    }

    /// Writes the file `path` as Parquet: the same columns, with the units in the metadata `escapement.units` as well.
    ///
    /// # Errors
    /// On an error of the file system.
    pub fn parquet(&self, path: &Path) -> Result<(), ExportError> {
        write_complete_file(path, |file| parquet::write_sheet(self, file).map_err(WriteError::Io))
    }

    fn write_csv(&self, out: &mut BufWriter<File>) -> io::Result<()> {
        let headings: Vec<String> = self.headings().iter().map(|heading| quoted(heading)).collect();
        writeln!(out, "{}", headings.join(","))?;
        for row in 0..self.rows() {
            let cells = self.columns.iter().map(|column| match &column.cells {
                Cells::Whole(all) => all[row].to_string(),
                Cells::Number(all) => all[row].map_or(String::new(), |value| format!("{value:?}")),
                Cells::Text(all) => all[row].as_deref().map_or(String::new(), quoted),
            });
            writeln!(out, "{}", cells.collect::<Vec<_>>().join(","))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::sheet::SheetColumn;

    #[test]
    fn sheet_cells_keep_digits_and_gaps() {
        let column = |name: &str, unit: &str, cells| SheetColumn {
            name: name.into(),
            unit: unit.into(),
            cells,
        };
        let sheet = Sheet {
            columns: vec![
                column("point", "", Cells::Whole(vec![1, 2])),
                column("delay", "ms", Cells::Number(vec![Some(0.1), None])),
                column("reason", "", Cells::Text(vec![None, Some("a, \"b\"\nc".into())])),
            ],
            about: Vec::new(),
        };
        let path = std::env::temp_dir().join(format!("sheet-{}.csv", std::process::id()));
        sheet.csv(&path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "point,delay [ms],reason\n1,0.1,\n2,,\"a, \"\"b\"\"\nc\"\n");
        std::fs::remove_file(&path).unwrap();
        sheet.parquet(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
        // the first column: two values there, then both
        let page = [&[2, 0, 0, 0, 3, 3][..], &1_i64.to_le_bytes(), &2_i64.to_le_bytes()].concat();
        assert!(bytes.windows(page.len()).any(|part| part == page));
        // the second: one of two
        let page = [&[2, 0, 0, 0, 3, 1][..], &0.1_f64.to_le_bytes()].concat();
        assert!(bytes.windows(page.len()).any(|part| part == page));
        std::fs::remove_file(&path).unwrap();
    }
}
