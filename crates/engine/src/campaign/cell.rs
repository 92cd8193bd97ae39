//! One point of a campaign, and what stands of it in the table.

/// One point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its changes as `--set` takes them, or why there is no such point.
    pub settings: Result<Vec<String>, String>,
    /// What was drawn for it, a cell for each of [`Plan::heads`](super::Plan::heads).
    pub cells: Vec<Cell>,
}

/// A column without its cells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Its name.
    pub name: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
}

/// What stands in a column for one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// As text, with its unit.
    pub text: String,
    /// The same as a number in the unit of the column.
    pub number: Option<f64>,
}
