//! Campaign files: what they draw.

mod dispersed;

use std::sync::Arc;

use dispersed::{B, Files, one};
use engine::Catalogue;
use engine::campaign::{Plan, Point};
use engine::scenario::Scenario;

fn numbers(plan: &Plan, column: &str) -> Vec<f64> {
    let at = plan.heads().iter().position(|head| head.name == column);
    let at = at.unwrap_or_else(|| panic!("no column {column} in {:?}", plan.heads()));
    (0..plan.count())
        .map(|k| plan.point(k).cells[at].number.unwrap())
        .collect()
}

fn settings(point: &Point) -> Vec<String> {
    point.settings.clone().unwrap()
}

#[test]
fn values_are_absolute_or_made_of_the_scenarios_own() {
    let files = Files::new("modes");
    for (key, rest, expected) in [
        ("mass", "distribution = 'discrete'\nvalues = ['10 kg']", "mass=10.0 kg"),
        (
            "mass",
            "distribution = 'discrete'\nvalues = ['-500 g']\nas = 'offset'",
            "mass=11.5 kg",
        ),
        (
            "mass",
            "distribution = 'discrete'\nvalues = ['-50 %']\nas = 'relative'",
            "mass=6.0 kg",
        ),
        (
            "mass",
            "distribution = 'discrete'\nvalues = [1.5]\nas = 'factor'\nround = '0.01 kg'",
            "mass=18.00 kg",
        ),
        ("count", "distribution = 'discrete'\nvalues = [7]", "count=7"),
        (
            "part",
            "distribution = 'discrete'\nvalues = [0.71]\nround = 0.1",
            "part=0.7",
        ),
        (
            "part",
            "distribution = 'discrete'\nvalues = [-0.04]\nround = 0.1",
            "part=0.0",
        ),
        (
            "count",
            "distribution = 'discrete'\nvalues = [2]\nas = 'offset'\nround = 1",
            "count=5",
        ),
        (
            "position[1]",
            "distribution = 'discrete'\nvalues = ['50 cm']",
            "position=[1.0, 0.5, 3.0] m",
        ),
        (
            "position",
            "distribution = 'discrete'\nvalues = [1.0]\nas = 'relative'",
            "position=[2.0, 4.0, 6.0] m",
        ),
        (
            "position",
            "distribution = 'discrete'\nvalues = ['[0, 0, 1] m']",
            "position=\"[0, 0, 1] m\"",
        ),
        (
            "attitude",
            "distribution = 'constant'\nvalue = [0.0, 1.0, 0.0, 0.0]",
            "attitude=[0.0, 1.0, 0.0, 0.0]",
        ),
    ] {
        let plan = files
            .plan(&format!("seeds = 'same'\npoints = 1\n{}", one(key, rest)))
            .unwrap_or_else(|error| panic!("{rest}: {error}"));
        assert_eq!(settings(&plan.point(0)), [format!("{B}.{expected}")], "{rest}");
        // what the table has as a number is what was set
        for cell in plan.point(0).cells {
            let digits = cell.text.split(' ').next().unwrap_or_default();
            assert!(cell.number.is_none() || digits.parse().ok() == cell.number, "{cell:?}");
        }
    }
}

#[test]
fn vectors_attitudes_and_inertias_keep_their_shapes() {
    let files = Files::new("vectors");
    let plan = |key: &str, rest: &str| files.plan(&format!("points = 50\n{}", one(key, rest))).unwrap();
    let length = |plan: &Plan, of: usize| -> Vec<f64> {
        let columns: Vec<Vec<f64>> = (0..of).map(|at| numbers(plan, &format!("x[{at}]"))).collect();
        (0..plan.count())
            .map(|k| columns.iter().map(|column| column[k] * column[k]).sum::<f64>().sqrt())
            .collect()
    };
    let sphere = plan("position", "distribution = 'sphere'\nlength = '2 m'");
    assert!(length(&sphere, 3).iter().all(|length| (length - 2.0).abs() < 1e-12));
    let cone = plan(
        "position",
        "distribution = 'cone'\nlength = '1 m'\naxis = [0, 0, 1]\nhalf-angle = '10 deg'",
    );
    assert!(numbers(&cone, "x[2]").iter().all(|z| *z >= 10_f64.to_radians().cos()));
    let any = plan("attitude", "distribution = 'rotation'");
    assert!(length(&any, 4).iter().all(|length| (length - 1.0).abs() < 1e-12));
    let turned = plan("attitude", "distribution = 'misalignment'\ndeviation = '0.1 deg'");
    assert!(numbers(&turned, "x[0]").iter().all(|w| *w > 0.9999 && *w < 1.0));
    let angles = plan(
        "angles",
        "distribution = 'misalignment'\ndeviation = '0.1 deg'\nwritten = 'roll-pitch-yaw'",
    );
    assert!(
        numbers(&angles, "x[2]")
            .iter()
            .all(|yaw| (yaw - 90.0).abs() < 1.0 && *yaw != 90.0)
    );
    let bent = plan(
        "position",
        "distribution = 'misalignment'\ndeviation = '1 deg'\nwritten = 'direction'",
    );
    assert!(
        length(&bent, 3)
            .iter()
            .all(|length| (length - 14_f64.sqrt()).abs() < 1e-12)
    );
    let start = plan(
        "position",
        "distribution = 'correlated-normal'\ndeviations = '[1, 1, 1] mm'\nas = 'offset'",
    );
    assert!(
        numbers(&start, "x[1]")
            .iter()
            .all(|y| (y - 2.0).abs() < 0.01 && *y != 2.0)
    );
    for (key, more) in [("moments", ""), ("inertia", "turn = '5 deg'")] {
        let bodies = plan(key, &format!("distribution = 'inertia'\nlog-deviation = 0.5\n{more}"));
        let of = |at: usize| numbers(&bodies, &format!("x[{at}]"));
        let (x, y, z) = (of(0), of(1), of(2));
        assert!((0..50).all(|k| x[k] < y[k] + z[k] && y[k] < x[k] + z[k] && z[k] < x[k] + y[k]));
        assert!(settings(&bodies.point(3))[1].ends_with("] kg m^2"));
    }
}

#[test]
fn formulas_columns_and_faults_follow_the_others() {
    let files = Files::new("formulas");
    std::fs::write(files.0.join("drawn.csv"), "mass [g],name\n1000,a\n2000,b\n3000,c\n").unwrap();
    let plan = files
        .plan(&format!(
            r#"
points = 7
design = "latin-hypercube"

[vary.zz_mass]
key = "{B}.mass"
distribution = "column"
file = "drawn.csv"
column = "mass"
unit = "kg"

[vary.radius]
distribution = "constant"
value = "20 cm"

[vary.around]
key = "{B}.moments[0]"
distribution = "formula"
formula = "0.5 * zz_mass * radius^2"
unit = "kg m^2"

[vary.when]
key = "faults.late.at"
distribution = "uniform"
from = "100 ms"
to = "900 ms"
round = "1 ms"

[vary.shared]
key = "faults.1.extra-delay"
distribution = "uniform"
from = "1 ms"
to = "9 ms"
round = "0.001 ms"
once = true
"#
        ))
        .unwrap();
    assert_eq!(numbers(&plan, "zz_mass"), [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0]);
    assert!((numbers(&plan, "around")[1] - 0.04).abs() < 1e-15);
    let shared = numbers(&plan, "shared");
    assert!(shared.iter().all(|one| *one == shared[0]), "drawn once");
    let seeds = numbers(&plan, "seed");
    assert_eq!(seeds, [5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0]);
    // the scenario then has the random values, by the fault's name and by its number
    let catalogue = Arc::new(Catalogue::new("test"));
    let scenario = Scenario::read(&catalogue, &files.0.join("scenario.toml"), &settings(&plan.point(2))).unwrap();
    let fault = &scenario.resolved()["faults"][0];
    let when = numbers(&plan, "when")[2];
    assert_eq!(fault["at"].as_str(), Some(&*format!("{when:.0} ms")));
    assert_eq!(fault["extra-delay"].as_str(), Some(&*format!("{:?} ms", shared[0])));
    assert_eq!(
        scenario.resolved()["participants"]["body"]["parameters"]["mass"].as_str(),
        Some("3.0 kg")
    );
}

#[test]
fn draws_are_independent_of_other_dispersions_and_points() {
    let files = Files::new("apart");
    let mass = "[vary.mass]\nkey = 'participants.body.parameters.mass'\ndistribution = 'normal'\ndeviation = '1 kg'\nas = 'offset'\n";
    let part =
        "[vary.part]\nkey = 'participants.body.parameters.part'\ndistribution = 'uniform'\nfrom = 0.1\nto = 0.9\n";
    for design in ["random", "sobol"] {
        let of = |points: usize, text: &str| {
            files
                .plan(&format!("points = {points}\ndesign = '{design}'\n{text}"))
                .unwrap()
        };
        let alone = numbers(&of(20, mass), "mass");
        assert_eq!(numbers(&of(50, mass), "mass")[..20], alone, "{design}: more points");
        assert_eq!(
            numbers(&of(20, &format!("{mass}{part}")), "mass"),
            alone,
            "{design}: another dispersion"
        );
        let other = files
            .plan(&format!("points = 20\nseed = 2\ndesign = '{design}'\n{mass}"))
            .unwrap();
        assert_ne!(numbers(&other, "mass"), alone, "{design}: another seed");
    }
    // of a Latin hypercube the number of points is part, another dispersion is not
    let latin = |points: usize, text: &str| {
        files
            .plan(&format!("points = {points}\ndesign = 'latin-hypercube'\n{text}"))
            .unwrap()
    };
    assert_eq!(
        numbers(&latin(20, mass), "mass"),
        numbers(&latin(20, &format!("{part}{mass}")), "mass")
    );
    assert_ne!(
        numbers(&latin(20, mass), "mass"),
        numbers(&latin(21, mass), "mass")[..20]
    );
}

#[test]
fn grids_mix_with_draws_and_matrices_exchange_one_dispersion() {
    let files = Files::new("mixtures");
    let mixed = files
        .plan(&format!(
            "points = 3\n[vary.a]\nkey='{B}.mass'\ndistribution='uniform'\nfrom='0 kg'\nto='4 kg'\ndesign='grid'\nlevels=2\n\
             [vary.b]\nkey='{B}.count'\ndistribution='discrete'\nvalues=[1,2]\ndesign='grid'\n\
             [vary.c]\nkey='{B}.part'\ndistribution='uniform'\nfrom=0.0\nto=1.0\n"
        ))
        .unwrap();
    assert_eq!(mixed.count(), 12);
    assert_eq!(numbers(&mixed, "a")[..4], [1.0, 1.0, 3.0, 3.0]);
    assert_eq!(numbers(&mixed, "b")[..4], [1.0, 2.0, 1.0, 2.0]);
    let c = numbers(&mixed, "c");
    assert!(
        c[..4].iter().all(|one| *one == c[0]) && c[4] != c[0],
        "all cells of the grid see the same draws: {c:?}"
    );

    let matrices = files
        .plan(&format!(
            "points = 4\ndesign = 'saltelli'\n[vary.a]\nkey='{B}.mass'\ndistribution='uniform'\nfrom='0 kg'\nto='4 kg'\n\
             [vary.b]\nkey='{B}.part'\ndistribution='uniform'\nfrom=0.0\nto=1.0\n"
        ))
        .unwrap();
    let (a, b) = (numbers(&matrices, "a"), numbers(&matrices, "b"));
    assert_eq!(matrices.count(), 16);
    for row in 0..4 {
        let at = 4 * row;
        assert_eq!([a[at + 2], b[at + 2]], [a[at + 1], b[at]], "AB of the first");
        assert_eq!([a[at + 3], b[at + 3]], [a[at], b[at + 1]], "AB of the second");
        assert!(a[at] != a[at + 1] && b[at] != b[at + 1]);
    }
}

#[test]
fn points_of_grids_and_matrices_are_no_sample() {
    let files = Files::new("sample");
    let uniform = one("mass", "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'");
    let grid = format!("[vary.g]\nkey = '{B}.part'\ndistribution = 'discrete'\nvalues = [0.1, 0.2]\ndesign = 'grid'\n");
    let constant = one("mass", "distribution = 'constant'\nvalue = '2 kg'");
    for (campaign, sample) in [
        (format!("points = 8\n{uniform}"), true),
        (format!("points = 8\nseeds = 'same'\n{uniform}"), true),
        (format!("points = 8\ndesign = 'latin-hypercube'\n{uniform}"), true),
        (format!("points = 8\n{constant}"), true),
        (format!("seeds = 'same'\n{grid}"), false),
        (format!("points = 8\n{uniform}{grid}"), false),
        (format!("points = 8\ndesign = 'saltelli'\n{uniform}"), false),
    ] {
        let plan = files.plan(&campaign).unwrap();
        assert_eq!(plan.is_sample(), sample, "{campaign}");
    }
}

/// `unit` is the unit of the draws, so numbers without one have it.
#[test]
fn numbers_without_a_unit_have_that_of_the_table() {
    let files = Files::new("own-unit");
    for (rest, range) in [
        ("distribution = 'uniform'\nfrom = 20\nto = 30\nunit = 'g'", 20.0..=30.0),
        (
            "distribution = 'uniform'\nfrom = 20\nto = '0.03 kg'\nunit = 'g'",
            20.0..=30.0,
        ),
        ("distribution = 'discrete'\nvalues = [21, 22]\nunit = 'g'", 21.0..=22.0),
    ] {
        let plan = files.plan(&format!("points = 3\n{}", one("mass", rest))).unwrap();
        assert!(numbers(&plan, "x").iter().all(|one| range.contains(one)));
        let set = settings(&plan.point(0));
        assert!(
            set.iter().any(|one| one.contains("mass=2") && one.ends_with(" g")),
            "{set:?}"
        );
    }
}
