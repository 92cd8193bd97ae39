//! A column of a campaign's table.

/// The maximum number of points of a campaign, and of rows of its table.
pub const POINTS_MAX: usize = 100_000;

/// The columns of every table; that of the digests where requested.
pub(super) const TABLE_COLUMNS: [&str; 4] = ["point", "outcome", "reason", "tape"];

/// The seed of each point.
pub(super) const SEED: &str = "seed";

/// The matrix and the row that a point of the design `saltelli` belongs to.
pub(super) const MATRIX: &str = "matrix";
/// See [`MATRIX`].
pub(super) const ROW: &str = "row";

/// The level of a point of the design `subset`, and the point from which it is a step.
pub(super) const LEVEL: &str = "level";
/// See [`LEVEL`].
pub(super) const PARENT: &str = "parent";

/// The columns that number the points instead of being quantities that vary: the seed, and those that a design makes.
pub(super) const INDEX_COLUMNS: [&str; 5] = [SEED, MATRIX, ROW, LEVEL, PARENT];

/// A column that distinguishes points.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
    /// The value of each point as text.
    pub texts: Vec<String>,
    /// The same as numbers, where all values are numbers of that unit.
    pub numbers: Option<Vec<f64>>,
    /// The same where all values are whole numbers without a unit, such as seeds, which a double cannot always represent.
    pub whole: Option<Vec<i64>>,
}

impl Column {
    /// A column of texts.
    pub fn of_texts(name: &str, texts: Vec<String>) -> Column {
        Column {
            name: name.to_owned(),
            unit: String::new(),
            texts,
            numbers: None,
            whole: None,
        }
    }

    pub(super) fn first(&self, count: usize) -> Column {
        fn some<T: Clone>(all: &[T], count: usize) -> Vec<T> {
            all.iter().take(count).cloned().collect()
        }
        Column {
            name: self.name.clone(),
            unit: self.unit.clone(),
            texts: some(&self.texts, count),
            numbers: self.numbers.as_ref().map(|all| some(all, count)),
            whole: self.whole.as_ref().map(|all| some(all, count)),
        }
    }

    /// Whether all values are whole numbers of which some exceed a signed 64-bit integer.
    pub(super) fn exceeds_i64(&self) -> bool {
        let digits = |text: &String| {
            text.strip_prefix('-')
                .unwrap_or(text)
                .bytes()
                .all(|letter| letter.is_ascii_digit())
        };
        self.whole.is_none() && self.numbers.is_some() && self.unit.is_empty() && self.texts.iter().all(digits)
    }

    /// The value of a point as JSON: a number where a reader recovers it exactly.
    pub fn json(&self, point: usize) -> serde_json::Value {
        match (&self.whole, &self.numbers) {
            (Some(whole), _) => serde_json::json!(whole[point]),
            (None, Some(numbers)) if !self.exceeds_i64() => serde_json::json!(numbers[point]),
            (None, _) => serde_json::json!(self.texts[point]),
        }
    }
}
