//! Dispersions combined with their designs: point number k.

mod made;

use std::collections::BTreeMap;

use lockstep::units::{Dimension, unit_factor};
use sampling::design::{Coordinate, DIMENSIONS};
use sampling::subset::Candidate;
use toml::Table;

use super::POINTS_MAX;
use super::cell::{Head, Point};
use super::column::{LEVEL, MATRIX, PARENT, ROW, SEED};
use super::dispersions::{Design, Dispersion, Draws, Quantity, Sized, by_names, near};
use made::Made;

/// Dispersions with their designs.
#[derive(Debug)]
pub struct Declared {
    dispersions: Vec<Dispersion>,
    ways: Vec<Way>,
    /// Number of points of each cell of the grid, or of each of the matrices.
    inner: usize,
    /// Number of cells of the grid, or number of matrices.
    outer: usize,
    /// Whether `outer` counts the matrices A, B and AB.
    matrices: bool,
    /// Whether points after the first level depend on the results of earlier points.
    levels: bool,
    /// The scenario's own numbers at the keys.
    start: BTreeMap<String, Quantity>,
    /// The seed of the draws.
    seed: u64,
    /// The seed of the first point, where each point has its own.
    first_seed: Option<u64>,
    /// Whether no draw depends on the number of points.
    grows: bool,
    heads: Vec<Head>,
}

/// How a dispersion gets its values.
#[derive(Debug)]
enum Way {
    /// One draw for all points.
    Once(Vec<Coordinate>),
    /// A draw from these coordinates for each point.
    Cube(Vec<Coordinate>),
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
type Wrong = (String, String);

fn wrong<T>(key: impl Into<String>, reason: impl Into<String>) -> Result<T, Wrong> {
    Err((key.into(), reason.into()))
}

/// Assigns coordinates to dispersions, in the order of the file.
struct Dealer {
    seed: u64,
    points: u64,
    /// Number of dimensions of the Sobol' sequence already assigned.
    taken: usize,
}

impl Dealer {
    fn coordinates(&mut self, one: &Dispersion, design: Design) -> Result<Vec<Coordinate>, Wrong> {
        let name = |at: usize| format!("{}[{at}]", one.name);
        let all = 0..one.draws.coordinates();
        all.map(|at| match design {
            Design::LatinHypercube => Ok(Coordinate::latin_hypercube(self.seed, &name(at), self.points)),
            Design::Sobol => self.sobol(one, &name(at)),
            _ => Ok(Coordinate::random(self.seed, &name(at))),
        })
        .collect()
    }

    /// Dimensions of A and B alternate, so that appending a dispersion changes no other.
    fn matrices(&mut self, one: &Dispersion, factor: usize) -> Result<Way, Wrong> {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for at in 0..one.draws.coordinates() {
            a.push(self.sobol(one, &format!("{}[{at}]", one.name))?);
            b.push(self.sobol(one, &format!("{}[{at}] B", one.name))?);
        }
        Ok(Way::Matrices { a, b, factor })
    }

    fn sobol(&mut self, one: &Dispersion, name: &str) -> Result<Coordinate, Wrong> {
        let made = Coordinate::sobol(self.seed, name, self.taken);
        self.taken += 1;
        match made {
            Some(made) => Ok(made),
            None => wrong(
                format!("vary.{}", one.name),
                format!(
                    "would need more than the {DIMENSIONS} dimensions that there are for Sobol' sequences: use another design for some dispersions"
                ),
            ),
        }
    }
}

impl Declared {
    /// Combines dispersions and designs. `start` are the scenario's own numbers; `first_seed` is the seed of the first
    /// point, where each has its own.
    ///
    /// # Errors
    /// The contradiction, with its key.
    pub fn new(
        dispersions: Vec<Dispersion>,
        design: Design,
        seed: u64,
        points: Option<u64>,
        start: BTreeMap<String, Quantity>,
        first_seed: Option<u64>,
    ) -> Result<Declared, Wrong> {
        no_overlaps(&dispersions)?;
        let (matrices, levels) = (design == Design::Saltelli, design == Design::Subset);
        let own = |one: &Dispersion| one.design.unwrap_or(design);
        for one in &dispersions {
            agree(one, own(one), design)?;
        }
        let on_grid = |one: &Dispersion| own(one) == Design::Grid && one.levels.or(one.draws.choices()).is_some();
        let drawn = |one: &&Dispersion| !one.once && !on_grid(one) && one.draws.varies();
        let others = dispersions.iter().any(|one| drawn(&one));
        let grows = !dispersions
            .iter()
            .any(|one| drawn(&one) && own(one) == Design::LatinHypercube);
        let inner = drawn_points(points, others, first_seed.is_some())?;
        let (mut ways, mut outer) = (Vec::new(), 1_usize);
        let mut dealer = Dealer {
            seed,
            points: inner as u64,
            taken: 0,
        };
        let mut factors = 0;
        for one in &dispersions {
            ways.push(if one.once {
                Way::Once(dealer.coordinates(one, Design::Random)?)
            } else if on_grid(one) {
                let levels = one.levels.or(one.draws.choices()).unwrap_or(1);
                outer = outer.saturating_mul(levels);
                Way::Grid { levels, every: 1 }
            } else if matrices && one.draws.coordinates() > 0 {
                factors += 1;
                dealer.matrices(one, factors)?
            } else {
                Way::Cube(dealer.coordinates(one, own(one))?)
            });
        }
        if matrices {
            outer = factors + 2;
        }
        if inner.saturating_mul(outer) > POINTS_MAX {
            return wrong(
                "points",
                format!("{inner} times {outer} points are more than {POINTS_MAX}: draw less"),
            );
        }
        // The first axis of a grid changes slowest.
        let mut left = outer;
        for way in &mut ways {
            if let Way::Grid { levels, every } = way {
                left /= *levels;
                *every = left;
            }
        }
        let mut made = Declared {
            dispersions,
            ways,
            inner,
            outer,
            matrices,
            levels,
            start,
            seed,
            first_seed,
            grows,
            heads: Vec::new(),
        };
        let (_, heads) = made.drawn(0, None);
        made.heads = heads;
        made.formulas_have_values()?;
        Ok(made)
    }

    /// The number of points.
    pub fn count(&self) -> usize {
        self.inner * self.outer
    }

    /// Whether adding points leaves the existing ones unchanged: in a Latin hypercube every draw depends on their number.
    pub fn grows(&self) -> bool {
        self.grows
    }

    /// The design of which the first points are no sample of their own, if there is one: it needs all of its points.
    pub fn needs_all(&self) -> Option<Design> {
        let on_grid = self.ways.iter().any(|way| matches!(way, Way::Grid { .. }));
        let designs = [
            (Design::Saltelli, self.matrices),
            (Design::LatinHypercube, !self.grows),
            (Design::Grid, on_grid && self.outer > 1),
        ];
        designs.into_iter().find(|(_, there)| *there).map(|(design, _)| design)
    }

    /// The seed of the draws.
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

    /// The dispersion that sets the `key` of `scenario`, a table around it, or a key in it.
    pub fn sets(&self, scenario: &Table, key: &str) -> Option<&Dispersion> {
        let mut all = self.dispersions.iter();
        all.find(|one| {
            one.targets
                .iter()
                .any(|target| near(&by_names(scenario, &target.key), key))
        })
    }

    /// The names of the dispersions whose Sobol' indices can be estimated, in the order of the matrices AB; `None` without
    /// those.
    pub fn factors(&self) -> Option<Vec<&str>> {
        let both = self.dispersions.iter().zip(&self.ways);
        let factors = both.filter(|(_, way)| matches!(way, Way::Matrices { .. }));
        self.matrices
            .then(|| factors.map(|(one, _)| one.name.as_str()).collect())
    }

    /// Point number `k`, from 0.
    pub fn point(&self, k: usize) -> Point {
        self.drawn(k, None).0
    }

    /// The coordinates that define a point of a level; `None` where points do not come in levels.
    pub fn coordinates(&self) -> Option<Vec<Coordinate>> {
        let cubes = self.ways.iter().filter_map(|way| match way {
            Way::Cube(all) => Some(all.clone()),
            _ => None,
        });
        self.levels.then(|| cubes.flatten().collect())
    }

    /// The point that a candidate of a level defines.
    pub fn candidate(&self, one: &Candidate) -> Point {
        self.drawn(one.number, Some(one)).0
    }

    /// The name of the dispersion that each of the [`coordinates`](Self::coordinates) belongs to; with a number where a
    /// dispersion takes several.
    pub fn names(&self) -> Vec<String> {
        let both = self.dispersions.iter().zip(&self.ways);
        let names = both.map(|(one, way)| match way {
            Way::Cube(all) if all.len() > 1 => (0..all.len()).map(|at| format!("{}[{at}]", one.name)).collect(),
            Way::Cube(all) if all.len() == 1 => vec![one.name.clone()],
            _ => Vec::new(),
        });
        names.flatten().collect()
    }

    /// Grid cells and matrices vary fastest, the index of the draw slowest: a campaign that grows keeps its points. A
    /// candidate brings its own coordinates.
    fn drawn(&self, k: usize, candidate: Option<&Candidate>) -> (Point, Vec<Head>) {
        let (inner, outer) = (k / self.outer, k % self.outer);
        let mut made = Made::new(&self.start);
        if self.matrices {
            let matrix = match outer {
                0 => "A".to_owned(),
                1 => "B".to_owned(),
                _ => format!("AB {}", self.factors().unwrap_or_default()[outer - 2]),
            };
            made.text(MATRIX, matrix);
            made.whole(ROW, inner as u64 + 1);
        }
        if self.levels {
            made.whole(LEVEL, candidate.map_or(0, |one| one.level as u64) + 1);
            let parent = candidate.and_then(|one| one.parent);
            made.whole(PARENT, parent.map_or(0, |parent| parent as u64 + 1));
        }
        let mut given = candidate.map_or(&[][..], |one| &one.u);
        for (one, way) in self.dispersions.iter().zip(&self.ways) {
            let at = |all: &[Coordinate], k: u64| all.iter().map(|one| one.at(k)).collect::<Vec<f64>>();
            let point = inner as u64;
            let u = match way {
                Way::Once(all) => at(all, 0),
                Way::Cube(all) if candidate.is_some() => {
                    let (own, others) = given.split_at(all.len());
                    given = others;
                    own.to_vec()
                }
                Way::Cube(all) => at(all, point),
                Way::Grid { levels, every } => {
                    let level = outer / every % levels;
                    if let Some(drawn) = one.draws.choice(level) {
                        made.put(one, drawn);
                        continue;
                    }
                    // The middle of each interval of equal probability.
                    vec![(level as f64 + 0.5) / *levels as f64]
                }
                Way::Matrices { a, b, factor } => at(if outer == 1 || outer == factor + 1 { b } else { a }, point),
            };
            let number = if matches!(way, Way::Once(_)) { 0 } else { point };
            let drawn = one
                .draws
                .draw(&u, number, &|formula| made.formula(formula).unwrap_or(f64::NAN));
            made.put(one, drawn);
        }
        if let Some(first) = self.first_seed {
            let seed = first.saturating_add(inner as u64);
            made.settings.insert("seed".to_owned(), seed.to_string());
            made.whole(SEED, seed);
        }
        made.finish()
    }

    fn formulas_have_values(&self) -> Result<(), Wrong> {
        let names: Vec<&str> = self.heads.iter().map(|head| head.name.as_str()).collect();
        for one in &self.dispersions {
            if let Draws::Formula(formula, _) = &one.draws
                && let Some(missing) = formula.names().into_iter().find(|name| !names.contains(name))
            {
                let key = format!("vary.{}.formula", one.name);
                return wrong(
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
pub(super) fn dimension_of(above: &[Dispersion], name: &str) -> Option<Sized> {
    let stem = name.split('[').next().unwrap_or(name);
    let found = above.iter().find(|one| one.name == stem)?;
    found.draws.numbers()?;
    if found.made.is_empty() {
        return Some((1.0, Dimension::default()));
    }
    unit_factor(&found.made).ok().map(|(_, dimension)| (1.0, dimension))
}

/// Number of draws of everything that is not on the grid.
fn drawn_points(points: Option<u64>, others: bool, seeds: bool) -> Result<usize, Wrong> {
    match points {
        Some(points) if others || seeds => Ok(points as usize),
        Some(1) => Ok(1),
        Some(_) => wrong(
            "points",
            "would be the same runs again: all dispersions are on the grid, whose values say how many points there are; \
             take it out",
        ),
        None if others => wrong("points", "is missing: write for example points = 200"),
        None => Ok(1),
    }
}

/// Checks that a dispersion is compatible with its design.
fn agree(one: &Dispersion, own: Design, campaign: Design) -> Result<(), Wrong> {
    let key = |key: &str| format!("vary.{}.{key}", one.name);
    let whole = |design| matches!(design, Design::Saltelli | Design::Subset);
    if whole(campaign) && one.design.is_some() {
        return wrong(
            key("design"),
            format!(
                "a campaign of the design {} has one for all dispersions: take it out",
                campaign.word()
            ),
        );
    }
    if !whole(campaign) && whole(own) {
        return wrong(
            key("design"),
            "is the design of a whole campaign: write it beside `points`",
        );
    }
    if campaign == Design::Subset && one.draws.coordinates() == 0 && one.draws.varies() {
        return wrong(
            key("order"),
            "values in turn are not drawn: write order = \"random\", or use another design",
        );
    }
    let design = own;
    if one.once && one.design.is_some() {
        return wrong(
            key("design"),
            "is drawn once for all points and has no design: take one of both out",
        );
    }
    if design != Design::Grid && one.levels.is_some() {
        return wrong(
            key("levels"),
            "is for the design grid: take it out, or write design = \"grid\"",
        );
    }
    if design != Design::Grid || one.once || one.draws.coordinates() == 0 {
        return Ok(());
    }
    match (one.draws.choices(), one.levels, one.draws.coordinates()) {
        (Some(_), Some(_), _) => wrong(key("levels"), "a list has its own values on a grid: take it out"),
        (None, None, 1) => wrong(
            key("levels"),
            "is missing: write how many values it takes on the grid, such as levels = 5",
        ),
        (None, _, 2..) => wrong(
            key("design"),
            "a grid takes distributions of one number: use another design for this one",
        ),
        _ => Ok(()),
    }
}

/// Two dispersions of one key must not overwrite each other.
fn no_overlaps(dispersions: &[Dispersion]) -> Result<(), Wrong> {
    for (at, one) in dispersions.iter().enumerate() {
        for target in &one.targets {
            let key = format!("vary.{}.key", one.name);
            if one.targets.iter().filter(|other| *other == target).count() > 1 {
                return wrong(key, format!("names `{}` twice", target.key));
            }
            for other in &dispersions[..at] {
                let Some(theirs) = other.targets.iter().find(|theirs| theirs.key == target.key) else {
                    continue;
                };
                let (name, target_key) = (&other.name, &target.key);
                let whole = one.replaces() && (target.element.is_none() || target.element == theirs.element);
                if one.draws.numbers().is_none() {
                    return wrong(
                        key,
                        format!("replaces what `{name}` gives `{target_key}`: take one out"),
                    );
                }
                if whole {
                    let remedy = "add to it with as = \"offset\", or take one out";
                    return wrong(key, format!("replaces what `{name}` gives `{target_key}`: {remedy}"));
                }
                if other.draws.numbers().is_none() {
                    let reason = format!(
                        "changes what `{name}` gives `{target_key}`, which is a value as it stands and no number that can be changed: \
                         write the value in the scenario and take `{name}` out, or take this one out"
                    );
                    return wrong(key, reason);
                }
            }
        }
    }
    Ok(())
}
