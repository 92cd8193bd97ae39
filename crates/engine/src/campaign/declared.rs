//! Declared campaigns: dispersions combined with their designs into point number k.

mod point_builder;

use std::collections::BTreeMap;

use lockstep::units::{Dimension, unit_factor};
use sampling::design::{Coordinate, DIMENSIONS};
use sampling::subset::Candidate;

use super::POINTS_MAX;
use super::cell::{Head, Point};
use super::column::{LEVEL, MATRIX, PARENT, ROW, SEED};
use super::dispersions::{Design, DimensionedValue, Dispersion, Quantity, ValueSource, keys_overlap};
use point_builder::PointBuilder;

/// Dispersions with their designs.
#[derive(Debug)]
pub struct Declared {
    dispersions: Vec<Dispersion>,
    methods: Vec<SamplingMethod>,
    /// Number of points of each cell of the grid, or of each of the matrices.
    points_per_block: usize,
    /// Number of cells of the grid, or number of matrices.
    blocks: usize,
    /// Whether `blocks` counts the matrices A, B and AB.
    matrices: bool,
    /// Whether points after the first level depend on the results of earlier points.
    levels: bool,
    /// The scenario's own numbers at the keys.
    nominal: BTreeMap<String, Quantity>,
    /// The seed of the random samples.
    seed: u64,
    /// The seed of the first point, where each point has its own.
    first_seed: Option<u64>,
    /// Whether no draw depends on the number of points.
    grows: bool,
    heads: Vec<Head>,
}

/// How a dispersion gets its values.
#[derive(Debug)]
enum SamplingMethod {
    /// One draw for all points.
    Once(Vec<Coordinate>),
    /// A draw from these coordinates for each point.
    PerPoint(Vec<Coordinate>),
    /// A grid axis: the number of its values, and the number of consecutive cells that share a value.
    Grid { levels: usize, every: usize },
    /// From the coordinates of A; in the matrices B and AB number `factor` from those of B.
    Matrices {
        a: Vec<Coordinate>,
        b: Vec<Coordinate>,
        factor: usize,
    },
}

/// A mistake, with its key.
type KeyedMistake = (String, String);

fn mistake<T>(key: impl Into<String>, reason: impl Into<String>) -> Result<T, KeyedMistake> {
    Err((key.into(), reason.into()))
}

/// Assigns coordinates to dispersions, in the order of the file.
struct CoordinateAllocator {
    seed: u64,
    points: u64,
    /// Number of dimensions of the Sobol' sequence already assigned.
    allocated: usize,
}

impl CoordinateAllocator {
    fn coordinates(&mut self, one: &Dispersion, design: Design) -> Result<Vec<Coordinate>, KeyedMistake> {
        let name = |at: usize| format!("{}[{at}]", one.name);
        let all = 0..one.source.coordinate_count();
        all.map(|at| match design {
            Design::LatinHypercube => Ok(Coordinate::latin_hypercube(self.seed, &name(at), self.points)),
            Design::Sobol => self.sobol(one, &name(at)),
            _ => Ok(Coordinate::random(self.seed, &name(at))),
        })
        .collect()
    }

    /// Dimensions of A and B alternate, so that appending a dispersion changes no other.
    fn matrices(&mut self, one: &Dispersion, factor: usize) -> Result<SamplingMethod, KeyedMistake> {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for at in 0..one.source.coordinate_count() {
            a.push(self.sobol(one, &format!("{}[{at}]", one.name))?);
            b.push(self.sobol(one, &format!("{}[{at}] B", one.name))?);
        }
        Ok(SamplingMethod::Matrices { a, b, factor })
    }

    fn sobol(&mut self, one: &Dispersion, name: &str) -> Result<Coordinate, KeyedMistake> {
        let coordinate = Coordinate::sobol(self.seed, name, self.allocated);
        self.allocated += 1;
        match coordinate {
            Some(coordinate) => Ok(coordinate),
            None => mistake(
                format!("vary.{}", one.name),
                format!(
                    "would need more than the {DIMENSIONS} dimensions that there are for Sobol' sequences: use another design for some dispersions"
                ),
            ),
        }
    }
}

impl Declared {
    /// Combines dispersions and designs. `nominal` are the scenario's own numbers; `first_seed` is the seed of the first
    /// point, where each has its own.
    ///
    /// # Errors
    /// The contradiction, with its key.
    pub fn new(
        dispersions: Vec<Dispersion>,
        design: Design,
        seed: u64,
        points: Option<u64>,
        nominal: BTreeMap<String, Quantity>,
        first_seed: Option<u64>,
    ) -> Result<Declared, KeyedMistake> {
        check_overlaps(&dispersions)?;
        let (matrices, levels) = (design == Design::Saltelli, design == Design::Subset);
        let own = |one: &Dispersion| one.design.unwrap_or(design);
        for one in &dispersions {
            check_design(one, own(one), design)?;
        }
        let on_grid = |one: &Dispersion| own(one) == Design::Grid && one.levels.or(one.source.choice_count()).is_some();
        let drawn = |one: &&Dispersion| !one.once && !on_grid(one) && one.source.varies();
        let others = dispersions.iter().any(|one| drawn(&one));
        let grows = !dispersions
            .iter()
            .any(|one| drawn(&one) && own(one) == Design::LatinHypercube);
        let points_per_block = count_points_per_block(points, others, first_seed.is_some())?;
        let (mut methods, mut blocks) = (Vec::new(), 1_usize);
        let mut allocator = CoordinateAllocator {
            seed,
            points: points_per_block as u64,
            allocated: 0,
        };
        let mut factors = 0;
        for one in &dispersions {
            methods.push(if one.once {
                SamplingMethod::Once(allocator.coordinates(one, Design::Random)?)
            } else if on_grid(one) {
                let levels = one.levels.or(one.source.choice_count()).unwrap_or(1);
                blocks = blocks.saturating_mul(levels);
                SamplingMethod::Grid { levels, every: 1 }
            } else if matrices && one.source.coordinate_count() > 0 {
                factors += 1;
                allocator.matrices(one, factors)?
            } else {
                SamplingMethod::PerPoint(allocator.coordinates(one, own(one))?)
            });
        }
        if matrices {
            blocks = factors + 2;
        }
        if points_per_block.saturating_mul(blocks) > POINTS_MAX {
            return mistake(
                "points",
                format!("{points_per_block} times {blocks} points are more than {POINTS_MAX}: draw less"),
            );
        }
        // The first axis of a grid changes slowest.
        let mut stride = blocks;
        for method in &mut methods {
            if let SamplingMethod::Grid { levels, every } = method {
                stride /= *levels;
                *every = stride;
            }
        }
        let mut declared = Declared {
            dispersions,
            methods,
            points_per_block,
            blocks,
            matrices,
            levels,
            nominal,
            seed,
            first_seed,
            grows,
            heads: Vec::new(),
        };
        let (_, heads) = declared.build_point(0, None);
        declared.heads = heads;
        declared.check_formula_names()?;
        Ok(declared)
    }

    /// The number of points.
    pub fn count(&self) -> usize {
        self.points_per_block * self.blocks
    }

    /// Whether adding points leaves the existing ones unchanged: in a Latin hypercube every draw depends on their number.
    pub fn grows(&self) -> bool {
        self.grows
    }

    /// Whether the points are a sample: each is one draw of everything that varies.
    pub fn is_sample(&self) -> bool {
        let drawn = |method: &SamplingMethod| matches!(method, SamplingMethod::PerPoint(all) if !all.is_empty());
        self.blocks == 1 && (self.first_seed.is_some() || self.methods.iter().any(drawn))
    }

    /// The design of which the first points are no sample of their own, if there is one: it needs all of its points.
    pub fn needs_all(&self) -> Option<Design> {
        let on_grid = self
            .methods
            .iter()
            .any(|method| matches!(method, SamplingMethod::Grid { .. }));
        let designs = [
            (Design::Saltelli, self.matrices),
            (Design::LatinHypercube, !self.grows),
            (Design::Grid, on_grid && self.blocks > 1),
        ];
        designs.into_iter().find(|(_, there)| *there).map(|(design, _)| design)
    }

    /// The seed of the random samples.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The columns.
    pub fn heads(&self) -> &[Head] {
        &self.heads
    }

    /// The dispersions in the order of the file.
    pub fn dispersions(&self) -> &[Dispersion] {
        &self.dispersions
    }

    /// The dispersion that sets the `key` of the scenario, a table around it, or a key in it.
    pub fn sets(&self, key: &str) -> Option<&Dispersion> {
        let mut all = self.dispersions.iter();
        all.find(|one| one.targets.iter().any(|target| keys_overlap(&target.key, key)))
    }

    /// The names of the dispersions whose Sobol' indices can be estimated, in the order of the matrices AB; `None` without
    /// those.
    pub fn factors(&self) -> Option<Vec<&str>> {
        let both = self.dispersions.iter().zip(&self.methods);
        let factors = both.filter(|(_, method)| matches!(method, SamplingMethod::Matrices { .. }));
        self.matrices
            .then(|| factors.map(|(one, _)| one.name.as_str()).collect())
    }

    /// Point number `k`, from 0.
    pub fn point(&self, k: usize) -> Point {
        self.build_point(k, None).0
    }

    /// The coordinates that define a point of a level; `None` where points do not come in levels.
    pub fn coordinates(&self) -> Option<Vec<Coordinate>> {
        let per_point = self.methods.iter().filter_map(|method| match method {
            SamplingMethod::PerPoint(all) => Some(all.clone()),
            _ => None,
        });
        self.levels.then(|| per_point.flatten().collect())
    }

    /// The point that a candidate of a level defines.
    pub fn candidate(&self, one: &Candidate) -> Point {
        self.build_point(one.number, Some(one)).0
    }

    /// The name of the dispersion that each of the [`coordinates`](Self::coordinates) belongs to; with a number where a
    /// dispersion takes several.
    pub fn names(&self) -> Vec<String> {
        let both = self.dispersions.iter().zip(&self.methods);
        let names = both.map(|(one, method)| match method {
            SamplingMethod::PerPoint(all) if all.len() > 1 => {
                (0..all.len()).map(|at| format!("{}[{at}]", one.name)).collect()
            }
            SamplingMethod::PerPoint(all) if all.len() == 1 => vec![one.name.clone()],
            _ => Vec::new(),
        });
        names.flatten().collect()
    }

    /// Grid cells and matrices vary fastest, the index of the draw slowest: a campaign that grows keeps its points. A
    /// candidate brings its own coordinates.
    fn build_point(&self, k: usize, candidate: Option<&Candidate>) -> (Point, Vec<Head>) {
        let (draw, block) = (k / self.blocks, k % self.blocks);
        let mut builder = PointBuilder::new(&self.nominal);
        if self.matrices {
            let matrix = match block {
                0 => "A".to_owned(),
                1 => "B".to_owned(),
                _ => format!("AB {}", self.factors().unwrap_or_default()[block - 2]),
            };
            builder.add_text(MATRIX, matrix);
            builder.add_integer(ROW, draw as u64 + 1);
        }
        if self.levels {
            builder.add_integer(LEVEL, candidate.map_or(0, |one| one.level as u64) + 1);
            let parent = candidate.and_then(|one| one.parent);
            builder.add_integer(PARENT, parent.map_or(0, |parent| parent as u64 + 1));
        }
        let mut remaining = candidate.map_or(&[][..], |one| &one.u);
        for (one, method) in self.dispersions.iter().zip(&self.methods) {
            let at = |all: &[Coordinate], k: u64| all.iter().map(|one| one.at(k)).collect::<Vec<f64>>();
            let point = draw as u64;
            let u = match method {
                SamplingMethod::Once(all) => at(all, 0),
                SamplingMethod::PerPoint(all) if candidate.is_some() => {
                    let (own, others) = remaining.split_at(all.len());
                    remaining = others;
                    own.to_vec()
                }
                SamplingMethod::PerPoint(all) => at(all, point),
                SamplingMethod::Grid { levels, every } => {
                    let level = block / every % levels;
                    if let Some(drawn) = one.source.choice(level) {
                        builder.apply(one, drawn);
                        continue;
                    }
                    // The middle of each interval of equal probability.
                    vec![(level as f64 + 0.5) / *levels as f64]
                }
                SamplingMethod::Matrices { a, b, factor } => {
                    at(if block == 1 || block == factor + 1 { b } else { a }, point)
                }
            };
            let number = if matches!(method, SamplingMethod::Once(_)) {
                0
            } else {
                point
            };
            let drawn = one
                .source
                .sample(&u, number, &|formula| builder.evaluate(formula).unwrap_or(f64::NAN));
            builder.apply(one, drawn);
        }
        if let Some(first) = self.first_seed {
            let seed = first.saturating_add(draw as u64);
            builder.settings.insert("seed".to_owned(), seed.to_string());
            builder.add_integer(SEED, seed);
        }
        builder.finish()
    }

    fn check_formula_names(&self) -> Result<(), KeyedMistake> {
        let names: Vec<&str> = self.heads.iter().map(|head| head.name.as_str()).collect();
        for one in &self.dispersions {
            if let ValueSource::Formula(formula, _) = &one.source
                && let Some(missing) = formula.names().into_iter().find(|name| !names.contains(name))
            {
                let key = format!("vary.{}.formula", one.name);
                return mistake(
                    key,
                    format!(
                        "`{missing}` is no number of a dispersion above it; there is {}",
                        names.join(", ")
                    ),
                );
            }
        }
        Ok(())
    }
}

/// The dimension of the number called `name` among `above`, with the value 1.
pub(super) fn dimension_of(above: &[Dispersion], name: &str) -> Option<DimensionedValue> {
    let stem = name.split('[').next().unwrap_or(name);
    let found = above.iter().find(|one| one.name == stem)?;
    found.source.number_count()?;
    if found.value_unit.is_empty() {
        return Some((1.0, Dimension::default()));
    }
    unit_factor(&found.value_unit)
        .ok()
        .map(|(_, dimension)| (1.0, dimension))
}

/// Number of points of each cell of the grid, or of each matrix: the number of samples of every dispersion that is not on the grid.
fn count_points_per_block(points: Option<u64>, others: bool, seeds: bool) -> Result<usize, KeyedMistake> {
    match points {
        Some(points) if others || seeds => Ok(points as usize),
        Some(1) => Ok(1),
        Some(_) => mistake(
            "points",
            "would be the same runs again: all dispersions are on the grid, whose values say how many points there are; \
             take it out",
        ),
        None if others => mistake("points", "is missing: write for example points = 200"),
        None => Ok(1),
    }
}

/// Checks that a dispersion is compatible with its design.
fn check_design(one: &Dispersion, own: Design, campaign: Design) -> Result<(), KeyedMistake> {
    let key = |key: &str| format!("vary.{}.{key}", one.name);
    let whole = |design| matches!(design, Design::Saltelli | Design::Subset);
    if whole(campaign) && one.design.is_some() {
        return mistake(
            key("design"),
            format!(
                "a campaign of the design {} has one for all dispersions: take it out",
                campaign.name()
            ),
        );
    }
    if !whole(campaign) && whole(own) {
        return mistake(
            key("design"),
            "is the design of a whole campaign: write it beside `points`",
        );
    }
    if campaign == Design::Subset && one.source.coordinate_count() == 0 && one.source.varies() {
        return mistake(
            key("order"),
            "values in turn are not drawn: write order = \"random\", or use another design",
        );
    }
    let design = own;
    if one.once && one.design.is_some() {
        return mistake(
            key("design"),
            "is drawn once for all points and has no design: take one of both out",
        );
    }
    if design != Design::Grid && one.levels.is_some() {
        return mistake(
            key("levels"),
            "is for the design grid: take it out, or write design = \"grid\"",
        );
    }
    if design != Design::Grid || one.once || one.source.coordinate_count() == 0 {
        return Ok(());
    }
    match (one.source.choice_count(), one.levels, one.source.coordinate_count()) {
        (Some(_), Some(_), _) => mistake(key("levels"), "a list has its own values on a grid: take it out"),
        (None, None, 1) => mistake(
            key("levels"),
            "is missing: write how many values it takes on the grid, such as levels = 5",
        ),
        (None, _, 2..) => mistake(
            key("design"),
            "a grid takes distributions of one number: use another design for this one",
        ),
        _ => Ok(()),
    }
}

/// Two dispersions of one key must not overwrite each other.
fn check_overlaps(dispersions: &[Dispersion]) -> Result<(), KeyedMistake> {
    for (at, one) in dispersions.iter().enumerate() {
        for target in &one.targets {
            let key = format!("vary.{}.key", one.name);
            if one.targets.iter().filter(|other| *other == target).count() > 1 {
                return mistake(key, format!("names `{}` twice", target.key));
            }
            for other in &dispersions[..at] {
                let Some(theirs) = other.targets.iter().find(|theirs| theirs.key == target.key) else {
                    continue;
                };
                let (name, target_key) = (&other.name, &target.key);
                let whole = one.replaces() && (target.element.is_none() || target.element == theirs.element);
                if one.source.number_count().is_none() {
                    return mistake(
                        key,
                        format!("replaces what `{name}` gives `{target_key}`: take one out"),
                    );
                }
                if whole {
                    let remedy = "add to it with as = \"offset\", or take one out";
                    return mistake(key, format!("replaces what `{name}` gives `{target_key}`: {remedy}"));
                }
                if other.source.number_count().is_none() {
                    let reason = format!(
                        "changes what `{name}` gives `{target_key}`, which is a value as it stands and no number that can be changed: \
                         write the value in the scenario and take `{name}` out, or take this one out"
                    );
                    return mistake(key, reason);
                }
            }
        }
    }
    Ok(())
}
