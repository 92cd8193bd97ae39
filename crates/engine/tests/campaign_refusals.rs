//! Campaign files that cannot be: each is refused with file, line, key, value and remedy before anything runs.

mod dispersed;

use dispersed::{B, Files, one};

/// A parameter, what stands below its `[vary.x]`, and parts of the refusal.
type Case = (&'static str, &'static str, &'static [&'static str]);

const DISPERSIONS: [Case; 32] = [
    (
        "mass",
        "distribution = 'discrete'\nvalues = ['1 kg', '2 kg']\nlabels = ['x', 'x']",
        &["vary.x.labels", "has `x` twice"],
    ),
    (
        "mass",
        "distribution = 'normal'\nmean = '12 kg'\ndeviation = '-1 kg'",
        &["campaign.toml:7: vary.x.deviation", "-1 is not above zero"],
    ),
    (
        "mass",
        "distribution = 'normal'\nmean = '12 kg'",
        &["vary.x: `deviation` is missing", "write for example"],
    ),
    (
        "mass",
        "distribution = 'normal'\nmean = '12 kg'\ndeviation = '1 m'",
        &["vary.x.deviation", "dimension m"],
    ),
    (
        "mass",
        "distribution = 'normal'\nmean = '12 kg'\ndeviation = 1",
        &["vary.x.deviation", "has no unit"],
    ),
    (
        "mass",
        "distribution = 'gaussian'",
        &["vary.x.distribution", "`gaussian` is unknown; there is uniform, normal"],
    ),
    (
        "mass",
        "distribution = 'normal'\nmean = '1 kg'\ndeviation = '1 kg'\nsigma = 2",
        &["vary.x.sigma", "unknown key; there is"],
    ),
    (
        "mass",
        "distribution = 'uniform'\nfrom = '2 kg'\nto = '1 kg'",
        &["vary.x.to", "1 is not above `from` = 2"],
    ),
    (
        "mass",
        "distribution = 'triangular'\nfrom = '1 kg'\nmode = '5 kg'\nto = '2 kg'",
        &["vary.x.mode"],
    ),
    (
        "mass",
        "distribution = 'truncated-normal'\nmean = '0 kg'\ndeviation = '1 kg'\nfrom = '50 kg'",
        &["vary.x.from", "50 is 50 deviations above the mean 0"],
    ),
    (
        "mass",
        "distribution = 'discrete'\nvalues = ['1 kg']\nweights = [0]",
        &["vary.x.weights", "none is above zero"],
    ),
    (
        "mass",
        "distribution = 'discrete'\nvalues = ['1 kg']\nweights = [1, 2]",
        &["vary.x.weights", "2 numbers for 1 values"],
    ),
    (
        "nothing",
        "distribution = 'normal'\ndeviation = '5 %'\nas = 'relative'",
        &["vary.x.key", "does not say", "absolute"],
    ),
    (
        "position",
        "distribution = 'normal'\nmean = '1 m'\ndeviation = '1 m'",
        &["vary.x.key", "name one of the numbers"],
    ),
    (
        "position[3]",
        "distribution = 'normal'\nmean = '1 m'\ndeviation = '1 m'",
        &["vary.x.key", "no element 3, counted from 0"],
    ),
    (
        "position",
        "distribution = 'correlated-normal'\nmean = '[0, 0] m'\ndeviations = '[1, 1] m'",
        &["vary.x.key", "have 2 numbers"],
    ),
    (
        "position",
        "distribution = 'correlated-normal'\ndeviations = '[1, 1, 1] m'\nas = 'offset'\ncorrelations = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]",
        &["vary.x.correlations", "contradicts itself"],
    ),
    (
        "mass",
        "distribution = 'inertia'\nlog-deviation = 0.1",
        &["vary.x.key", "three principal moments"],
    ),
    (
        "moments",
        "distribution = 'inertia'\nlog-deviation = 0.1\nturn = '1 deg'",
        &["vary.x.key", "xx, yy, zz"],
    ),
    (
        "wrong",
        "distribution = 'inertia'\nlog-deviation = 0.1",
        &["vary.x.key", "the inertia of no body"],
    ),
    (
        "position",
        "distribution = 'misalignment'\ndeviation = '1 deg'",
        &["vary.x.key", "no quaternion", "`written`"],
    ),
    (
        "position",
        "distribution = 'cone'\naxis = [0, 0, 0]\nhalf-angle = '1 deg'",
        &["vary.x.axis", "[0, 0, 1]"],
    ),
    (
        "count",
        "distribution = 'normal'\nmean = 3.0\ndeviation = 1.0",
        &["vary.x.key", "round = 1"],
    ),
    (
        "mass",
        "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'\nround = '1 g'",
        &["vary.x.round", "\"0.1 kg\""],
    ),
    (
        "mass",
        "distribution = 'column'\nfile = 'none.csv'\ncolumn = 'a'",
        &["vary.x.file", "none.csv", "cannot be read"],
    ),
    (
        "mass",
        "distribution = 'column'\nfile = 'empty.csv'\ncolumn = 'a'",
        &["vary.x.file", "has no rows"],
    ),
    (
        "mass",
        "distribution = 'formula'\nformula = '2 * y'\nunit = 'kg'",
        &["vary.x.formula", "`y`"],
    ),
    (
        "mass",
        "distribution = 'formula'\nformula = 'exp(2)'\nunit = 'kg'",
        &["vary.x.formula", "not understood"],
    ),
    (
        "mass",
        "distribution = 'formula'\nformula = '2'\nunit = 'kg'",
        &["vary.x.formula", "dimension 1"],
    ),
    (
        "mass",
        "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'\ndesign = 'grid'",
        &["vary.x.levels", "levels = 5"],
    ),
    (
        "mass",
        "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'\nlevels = 5",
        &["vary.x.levels", "design = \"grid\""],
    ),
    (
        "mass",
        "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'\nonce = true\ndesign = 'sobol'",
        &["vary.x.design", "drawn once"],
    ),
];

fn refused(files: &Files, campaign: &str, parts: &[&str]) {
    let error = files.plan(campaign).map(|_| ()).unwrap_err();
    for part in parts {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
}

#[test]
fn invalid_dispersion_is_refused_with_its_key() {
    let files = Files::new("refused");
    std::fs::write(files.0.join("empty.csv"), "a\n").unwrap();
    for (key, rest, parts) in DISPERSIONS {
        refused(&files, &format!("points = 3\n{}", one(key, rest)), parts);
    }
}

#[test]
fn title_of_a_campaign_is_one_line_without_control_characters() {
    let files = Files::new("refused-title");
    let rest = one("mass", "distribution = 'constant'\nvalue = '2 kg'");
    for (written, shown) in [
        ("\\u001b[2J", "\\u{1b}[2J"),
        ("one\\ntwo", "one\\ntwo"),
        ("\\u2028", "\\u{2028}"),
    ] {
        let campaign = format!("points = 3\ntitle = \"{written}\"\n{rest}");
        let place = format!("campaign.toml:3: title: \"{shown}\"");
        refused(
            &files,
            &campaign,
            &[&place, "write one line without control characters"],
        );
    }
}

#[test]
fn entry_by_number_and_by_name_is_one_key() {
    let files = Files::new("refused-entry");
    let dispersion = |name: &str, key: &str| {
        format!("[vary.{name}]\nkey = '{key}.extra-delay'\ndistribution = 'constant'\nvalue = '2 ms'\n")
    };
    for (first, second) in [("faults.1", "faults.late"), ("faults.late", "faults.1")] {
        let campaign = format!("points = 3\n{}{}", dispersion("x", first), dispersion("y", second));
        refused(
            &files,
            &campaign,
            &["vary.y.key", "replaces what `x` gives `faults.late.extra-delay`"],
        );
    }
}

#[test]
fn invalid_campaign_is_refused_with_its_key() {
    let files = Files::new("refused-whole");
    let two = format!(
        "points = 3\n{}[vary.y]\nkey = '{B}.mass'\ndistribution = 'constant'\nvalue = '1 kg'\n",
        one("mass", "distribution = 'constant'\nvalue = '2 kg'")
    );
    refused(&files, &two, &["vary.y.key", "replaces what `x` gives", "offset"]);
    // A list as it stands is replaced by nothing, and cannot be turned.
    let listed = "distribution = 'constant'\nvalue = [0.0, 1.0, 0.0, 0.0]";
    let turned = "distribution = 'misalignment'\ndeviation = '1 deg'";
    let after = |first: &str, second: &str| {
        let first = one("attitude", first);
        format!("points = 3\n{first}[vary.y]\nkey = '{B}.attitude'\n{second}\n")
    };
    let parts = [
        "vary.y.key",
        "changes what `x` gives",
        "write the value in the scenario and take `x` out",
    ];
    refused(&files, &after(listed, turned), &parts);
    refused(
        &files,
        &after(turned, listed),
        &["vary.y.key", "replaces what `x` gives", "take one out"],
    );
    let uniform = one("mass", "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'");
    refused(&files, &uniform, &["points: is missing", "points = 200"]);
    for (head, parts) in [
        (
            "design = 'halton'",
            &["design", "there is random, latin-hypercube, sobol, grid, saltelli"][..],
        ),
        (
            "pionts = 3",
            &["pionts", "unknown key; there is title, scenario, points"],
        ),
        ("points = 0", &["points", "no whole number from 1 to"]),
        ("points = 3\nseed = -1", &["seed", "no whole number from 0"]),
        ("points = 99_999\ndesign = 'saltelli'", &["points", "draw less"]),
    ] {
        refused(&files, &format!("{head}\n{uniform}"), parts);
    }
    refused(&files, "points = 3", &["vary", "is missing", "[vary.delay]"]);
    refused(
        &files,
        "points = 3\nvary = 3",
        &["campaign.toml:3: vary: 3 is no table", "[vary.delay]"],
    );
    let list = "points = 3\n[[vary]]\nkey = 'seed'";
    refused(
        &files,
        list,
        &["campaign.toml:3: vary: is a list and no table", "[vary.delay]"],
    );
    // Without a valid distribution its keys are not checked.
    for (kind, part) in [
        ("", "`distribution` is missing"),
        ("distribution = 3\n", "3 is no text"),
    ] {
        let keys = format!("{kind}from = '1 kg'\nto = '2 kg'");
        let error = files.plan(&format!("points = 3\n{}", one("mass", &keys))).unwrap_err();
        assert!(error.contains(part) && error.lines().count() == 1, "{error}");
    }
    let listed = one("mass", "distribution = 'discrete'\nvalues = ['1 kg', '2 kg']");
    refused(
        &files,
        &format!("seeds = 'same'\npoints = 3\ndesign = 'grid'\n{listed}"),
        &["points", "take it out"],
    );
}

#[test]
fn design_columns_are_refused_as_names_of_dispersions() {
    let files = Files::new("taken");
    for design in ["saltelli", "subset"] {
        let drawn = |name: &str| {
            let uniform = one("mass", "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'");
            format!(
                "points = 20\ndesign = '{design}'\n{}",
                uniform.replace("vary.x", &format!("vary.{name}"))
            )
        };
        let made = files.plan(&drawn("x")).unwrap().heads();
        let made: Vec<&str> = made
            .iter()
            .map(|head| head.name.as_str())
            .filter(|name| *name != "x")
            .collect();
        assert_eq!(made.len(), 3, "two of the design and the seed: {made:?}");
        for name in made {
            refused(&files, &drawn(name), &[&format!("the name `{name}` is not possible")]);
        }
    }
}

/// Draws of a time have more digits than an exact fraction, except by accident: without a step some points would be refused.
#[test]
fn drawn_time_without_a_step_is_refused() {
    let files = Files::new("refused-times");
    let table = |name: &str, key: &str, rest: &str| format!("[vary.{name}]\nkey = '{key}'\n{rest}\n");
    let delay = "distribution = 'uniform'\nfrom = '1 ms'\nto = '9 ms'";
    let later = "distribution = 'normal'\nas = 'offset'\ndeviation = '1 ms'";
    let free = "[vary.free]\ndistribution = 'uniform'\nfrom = '1 ms'\nto = '9 ms'\n";
    let computed = "distribution = 'formula'\nformula = '2 * free'\nunit = 'ms'";
    for (above, key, rest, step) in [
        ("", "faults.late.extra-delay", delay, "0.1 ms"),
        ("", "faults.late.at", later, "0.1 s"),
        (free, "faults.late.extra-delay", computed, "0.1 ms"),
    ] {
        let campaign = format!("points = 3\n{above}{}", table("x", key, rest));
        let reason = format!("vary.x: draws {key}, an exact fraction of seconds");
        let remedy = format!("round = \"{step}\"");
        refused(&files, &campaign, &[&reason, &remedy]);
        let rounded = format!("points = 3\n{above}{}", table("x", key, &format!("{rest}\n{remedy}")));
        files.plan(&rounded).unwrap();
    }
    // A number that is no time, and times that are listed, need none.
    let listed = table(
        "x",
        "faults.late.extra-delay",
        "distribution = 'discrete'\nvalues = ['1 ms', '1/3 ms']",
    );
    files.plan(&format!("points = 3\n{listed}")).unwrap();
    let mass = one("mass", "distribution = 'uniform'\nfrom = '1 kg'\nto = '2 kg'");
    files.plan(&format!("points = 3\n{mass}")).unwrap();
}

#[test]
fn mistake_in_one_key_makes_no_other_key_unknown() {
    let files = Files::new("refused-alone");
    for (key, rest, wrong) in [
        (
            "position",
            "distribution = 'correlated-normal'\nmean = 3\ndeviations = '[1, 1, 1] m'\ncorrelations = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
            "vary.x.mean",
        ),
        (
            "position",
            "distribution = 'correlated-normal'\nmean = '[0, 0, 1] m'\ndeviations = '1 m'\ncorrelations = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
            "vary.x.deviations",
        ),
        (
            "attitude",
            "distribution = 'misalignment'\nwritten = 'euler'\ndeviation = '1 deg'",
            "vary.x.written",
        ),
        (
            "moments",
            "distribution = 'inertia'\nlog-deviation = 'a lot'\nturn = '1 deg'",
            "vary.x.log-deviation",
        ),
        (
            "mass",
            "distribution = 'discrete'\nvalues = 3\nlabels = ['a']\nweights = [1]",
            "vary.x.values",
        ),
    ] {
        let error = files.plan(&format!("points = 3\n{}", one(key, rest))).unwrap_err();
        assert!(error.contains(wrong) && error.lines().count() == 1, "{error}");
    }
}
