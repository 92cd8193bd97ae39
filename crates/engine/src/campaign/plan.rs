//! Points of a campaign, one by one: the changes and the table cells of a point are a function of the campaign's
//! declaration and of the point's number.

use super::Column;
use super::cell::{Cell, Head, Point};
use super::column::SEED;
use super::declared::Declared;

/// The points of a campaign.
#[derive(Debug)]
pub enum Plan {
    /// A list of points: a grid of the command line, a list of cases.
    Listed {
        /// The labels of the points.
        columns: Vec<Column>,
        /// The changes of each.
        points: Vec<Vec<String>>,
    },
    /// The declaration of a campaign file.
    Declared(Box<Declared>),
}

impl Plan {
    /// The number of points.
    pub fn count(&self) -> usize {
        match self {
            Plan::Listed { points, .. } => points.len(),
            Plan::Declared(declared) => declared.count(),
        }
    }

    /// Whether adding points leaves the existing ones unchanged. A list is always complete.
    pub fn grows(&self) -> bool {
        matches!(self, Plan::Declared(declared) if declared.grows())
    }

    /// Whether the points are a sample: each is one draw of everything that varies. On a grid the same draws are used again in each cell.
    pub fn is_sample(&self) -> bool {
        match self {
            Plan::Listed { columns, .. } => is_seed_alone(columns),
            Plan::Declared(declared) => declared.is_sample(),
        }
    }

    /// The dispersions whose Sobol' indices can be estimated, in the order of their matrices.
    pub fn factors(&self) -> Option<Vec<String>> {
        let Plan::Declared(declared) = self else { return None };
        Some(declared.factors()?.into_iter().map(str::to_owned).collect())
    }

    /// Point number `k`, from 0.
    pub fn point(&self, k: usize) -> Point {
        match self {
            Plan::Listed { columns, points } => Point {
                settings: Ok(points[k].clone()),
                cells: columns
                    .iter()
                    .map(|column| Cell {
                        text: column.texts[k].clone(),
                        number: column.numbers.as_ref().map(|numbers| numbers[k]),
                    })
                    .collect(),
            },
            Plan::Declared(declared) => declared.point(k),
        }
    }

    /// The columns without their cells.
    pub fn heads(&self) -> Vec<Head> {
        match self {
            Plan::Listed { columns, .. } => columns
                .iter()
                .map(|column| Head {
                    name: column.name.clone(),
                    unit: column.unit.clone(),
                })
                .collect(),
            Plan::Declared(declared) => declared.heads().to_vec(),
        }
    }

    /// The columns with the cells of all points, and the changes of each point.
    pub fn unrolled(&self) -> (Vec<Column>, Vec<Result<Vec<String>, String>>) {
        if let Plan::Listed { columns, points } = self {
            return (columns.clone(), points.iter().cloned().map(Ok).collect());
        }
        columns_of(&self.heads(), (0..self.count()).map(|k| self.point(k)))
    }
}

/// Whether the seed alone makes the points.
pub fn is_seed_alone(columns: &[Column]) -> bool {
    matches!(columns, [column] if column.name == SEED)
}

/// Columns with the cells of `points`, and the changes of each point.
pub fn columns_of(
    heads: &[Head],
    points: impl ExactSizeIterator<Item = Point>,
) -> (Vec<Column>, Vec<Result<Vec<String>, String>>) {
    let mut texts = vec![Vec::with_capacity(points.len()); heads.len()];
    let mut numbers = vec![Vec::with_capacity(points.len()); heads.len()];
    let mut settings = Vec::with_capacity(points.len());
    for point in points {
        for (at, cell) in point.cells.into_iter().enumerate() {
            texts[at].push(cell.text);
            numbers[at].push(cell.number);
        }
        settings.push(point.settings);
    }
    let columns = heads.iter().zip(texts.into_iter().zip(numbers));
    let columns = columns.map(|(head, (texts, numbers))| Column {
        whole: texts.iter().map(|text| text.parse().ok()).collect(),
        name: head.name.clone(),
        unit: head.unit.clone(),
        texts,
        numbers: numbers.into_iter().collect(),
    });
    (columns.collect(), settings)
}
