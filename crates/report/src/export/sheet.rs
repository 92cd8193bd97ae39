//! Small tables that are not streams: the rows of a campaign.

use super::columns::headings;

/// The cells of a column, from the first row on.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Numbers; `None` where missing.
    Number(Vec<Option<f64>>),
    /// Texts; `None` where missing.
    Text(Vec<Option<String>>),
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetColumn {
    /// Its name.
    pub name: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
    /// Its cells.
    pub cells: Cells,
}

/// A table. All columns have the same number of cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// The columns.
    pub columns: Vec<SheetColumn>,
    /// Information for readers of the Parquet file: keys and values of its metadata.
    pub about: Vec<(&'static str, String)>,
}

impl Sheet {
    /// The headings of the columns: the names with the units, `peak base torque [N m]`; all different.
    pub fn headings(&self) -> Vec<String> {
        let named = self.columns.iter().map(|column| (column.name.clone(), &*column.unit));
        headings(&named.collect::<Vec<_>>())
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| match &column.cells {
            Cells::Whole(all) => all.len(),
            Cells::Number(all) => all.len(),
            Cells::Text(all) => all.len(),
        })
    }
}
