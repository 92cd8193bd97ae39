//! One point of a campaign, and its cells in the table.

/// One point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its changes as `--set` takes them, or the reason why the point does not exist.
    pub settings: Result<Vec<String>, String>,
    /// The values drawn for it, a cell for each of [`Plan::heads`](super::Plan::heads).
    pub cells: Vec<Cell>,
}

/// The head of a column: name and unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Its name.
    pub name: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
}

/// The value of one point in a column.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// As text, with its unit.
    pub text: String,
    /// The same as a number in the unit of the column.
    pub number: Option<f64>,
}
