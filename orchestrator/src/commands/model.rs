//! `escapement model MODEL.urdf [STATES.json]`: the tree of a model, or every quantity of its dynamics at given states, for
//! a comparison with another engine. Elements of the file that the dynamics ignore are reported as warnings, with their
//! line.
//!
//! STATES.json is one state, a list of states, or an object with a list `states` (then each entry may hold its state
//! under `state`, beside results that are ignored: a file of reference values is a valid input). A state is
//! `{"p": [3], "quat_wxyz": [4], "qj": [N], "v": [N + 6], "tau": [N + 6]}`; with `v` of length N the base is fixed. `tau`
//! defaults to zero. Output: `{"about": …, "states": [{"state", "M", "C", "bias", "acceleration", "kinetic_energy",
//! "linear_momentum_N", "angular_momentum_about_com_N", "com_N", "frames": {NAME: {"p_N", "R_NE", "J_body",
//! "Jdot_body"}}, "end_effector": {…}}]}`, matrices by rows, SI units; `end_effector` is the frame of that name, or the
//! last link's when there is none.

use anyhow::{Context, Result, bail};
use clap::Args;
use multibody::nalgebra::Vector3;
use multibody::{Description, DynState, DynTree, FrameId, Quaternion, UrdfOptions};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

use crate::refusal::Refusal;

/// The keys of a state.
const STATE_KEYS: [&str; 5] = ["p", "quat_wxyz", "qj", "v", "tau"];

/// The format of the states, for the help text.
const STATES_HELP: &str = "\
STATES.json is one state, a list of states, or an object with such a list
under `states`; SI units and radians. A state of two joints:

  {\"qj\": [0.1, -0.2], \"v\": [0, 0, 0, 0, 0, 0, 0, 0]}

  qj         positions of the N joints, in the order of the tree; required
  v          angular and linear velocity of the base in its own axes, then
             the rates of the joints; those alone for a fixed base; required
  tau        generalised forces, as many as v; zero by default
  p          position of the base in the world; zero by default
  quat_wxyz  attitude of the base, a unit quaternion, scalar first";

/// Arguments of `model`.
#[derive(Debug, Args)]
#[command(after_help = STATES_HELP)]
pub struct ModelArgs {
    /// The model, a URDF file
    pub model: PathBuf,
    /// States in JSON; without them the tree is printed
    pub states: Option<PathBuf>,
    /// Accept links with inertias that no distribution of mass has, with a warning
    #[arg(long)]
    pub allow_unphysical: bool,
}

/// Prints the tree of a URDF file or, with states, evaluates it at those states and prints JSON.
pub fn run(args: &ModelArgs) -> Result<()> {
    // All possible errors are mistakes in the files.
    let found = output_text(args).map_err(Refusal::of)?;
    print!("{found}");
    Ok(())
}

/// The output to be printed.
fn output_text(args: &ModelArgs) -> Result<String> {
    let description = read(&args.model, args.allow_unphysical)?;
    let Some(path) = args.states.as_deref() else {
        return listing(&description);
    };
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let file: Value = serde_json::from_str(&text).with_context(|| format!("in {}", path.display()))?;
    let out = evaluate(&description, &file).with_context(|| format!("in {}", path.display()))?;
    Ok(serde_json::to_string_pretty(&out)? + "\n")
}

/// Reads a file; warnings go to standard error.
pub(super) fn read(file: &Path, allow_unphysical: bool) -> Result<Description> {
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let at = |line: Option<u32>| {
        line.map_or_else(
            || file.display().to_string(),
            |line| format!("{}:{line}", file.display()),
        )
    };
    match Description::read_urdf(&text, UrdfOptions { allow_unphysical }) {
        Ok(reading) => {
            for warning in &reading.warnings {
                eprintln!("warning: {}: {}", at(warning.line), warning.text);
            }
            Ok(reading.description)
        }
        Err(errors) => {
            let all: Vec<String> = errors
                .iter()
                .map(|error| format!("{}: {}", at(error.line), error.kind))
                .collect();
            let unphysical = errors.iter().any(|error| error.kind.is_unphysical());
            let remedy = if unphysical {
                "\n`--allow-unphysical` accepts inertias that no distribution of mass has"
            } else {
                ""
            };
            bail!("{}{remedy}", all.join("\n"))
        }
    }
}

/// The tree, one body per line, with the links that were merged into it.
fn listing(description: &Description) -> Result<String> {
    // a root without inertia (often called `world`) can only be a fixed base
    let floating = DynTree::new(description, true);
    let base = if floating.is_ok() {
        "floating base"
    } else {
        "fixed base"
    };
    let tree = floating.or_else(|refusal| DynTree::new(description, false).map_err(|_| refusal))?;
    let bodies = tree.bodies();
    let followers = match bodies.iter().filter(|body| body.mimic.is_some()).count() {
        0 => String::new(),
        count => format!(" ({count} of them follow others)"),
    };
    let mut out = format!(
        "{}: {} moving joints{followers}, {} degrees of freedom with a {base}, {} kg\n",
        description.name,
        bodies.len() - 1,
        tree.dim(),
        description.total_mass()
    );
    for body in &bodies {
        let joint = match (&body.joint, body.coordinate) {
            (Some(joint), Some(k)) => {
                let kind = if body.prismatic { "slides" } else { "turns" };
                let follows = body.mimic.as_ref().map_or_else(String::new, |mimic| {
                    let sign = if mimic.offset < 0.0 { '-' } else { '+' };
                    format!(" = {} {} {sign} {}", mimic.multiplier, mimic.joint, mimic.offset.abs())
                });
                format!("  [{k}] {kind} on {joint}{follows}")
            }
            _ => format!("  {base}"),
        };
        let extra = |what: &str, x: f64| {
            if x == 0.0 {
                String::new()
            } else {
                format!(", {what} {x}")
            }
        };
        let merged = tree.frames_on(body);
        let merged: Vec<&str> = merged.into_iter().filter(|name| *name != body.link).collect();
        let with = if merged.is_empty() {
            String::new()
        } else {
            format!(", with {}", merged.join(", "))
        };
        let name = format!("{}{}", "  ".repeat(body.depth), body.link);
        out += &format!(
            "  {name:<24}{:>12.6} kg{joint}{}{}{with}\n",
            body.mass,
            extra("damping", body.damping),
            extra("motor inertia", body.motor_inertia),
        );
    }
    Ok(out)
}

fn evaluate(description: &Description, file: &Value) -> Result<Value> {
    let list = match file {
        Value::Object(object) if object.contains_key("states") => &file["states"],
        other => other,
    };
    let list: Vec<&Value> = match list {
        Value::Array(states) => states.iter().collect(),
        one => vec![one],
    };
    let dof = description.dof();
    let mut trees: [Option<DynTree>; 2] = [None, None];
    let mut results = Vec::new();
    for (i, entry) in list.iter().enumerate() {
        let state = if entry.get("state").is_some() {
            &entry["state"]
        } else {
            entry
        };
        let place = || format!("state {i}");
        check_keys(state).with_context(place)?;
        let v = numbers(state, "v", None).with_context(place)?;
        let floating = match v.len() {
            n if n == dof + 6 => true,
            n if n == dof => false,
            n => bail!(
                "state {i}: `v` has {n} numbers; the model has {dof} joints, so give {} (or {dof} for a fixed base)",
                dof + 6
            ),
        };
        let tau = if state.get("tau").is_some() {
            numbers(state, "tau", Some(v.len()))
        } else {
            Ok(vec![0.0; v.len()])
        };
        let tau = tau.with_context(place)?;
        let at = read_state(state, dof, v).with_context(place)?;
        let slot = &mut trees[usize::from(floating)];
        let tree = match slot {
            Some(tree) => tree,
            None => slot.insert(DynTree::new(description, floating)?),
        };
        results.push(quantities(description, tree, state, &at, &tau)?);
    }
    let about = format!(
        "{}, {dof} joints in the order of the file. Generalised velocity [omega_NB in B; v_NB in B; joint rates]. acceleration = \
         forward dynamics for tau with joint damping applied. Jacobians map the generalised velocity to [omega; v] in the \
         frame's axes. SI units.",
        description.name
    );
    Ok(json!({ "about": about, "states": results }))
}

/// Rejects anything that is no key of a state: a misspelt one would leave its value at the default.
fn check_keys(state: &Value) -> Result<()> {
    let known = STATE_KEYS.map(|key| format!("`{key}`")).join(", ");
    let Some(state) = state.as_object() else {
        bail!("`{state}` is not a state; a state is an object with the keys {known}");
    };
    match state.keys().find(|key| !STATE_KEYS.contains(&key.as_str())) {
        Some(key) => bail!("`{key}` is not a key of a state; the keys are {known}"),
        None => Ok(()),
    }
}

fn read_state(state: &Value, dof: usize, nu: Vec<f64>) -> Result<DynState> {
    let three = |key: &str| numbers(state, key, Some(3)).map(|x| Vector3::new(x[0], x[1], x[2]));
    let p_nb = if state.get("p").is_some() {
        three("p")?
    } else {
        Vector3::zeros()
    };
    let quat_nb = if state.get("quat_wxyz").is_some() {
        let x = numbers(state, "quat_wxyz", Some(4))?;
        let quat = Quaternion::from_wxyz([x[0], x[1], x[2], x[3]]);
        let norm = quat.norm_squared().sqrt();
        if (norm - 1.0).abs() > 1e-6 {
            bail!("`quat_wxyz` has length {norm}; give a unit quaternion, scalar first");
        }
        quat
    } else {
        Quaternion::IDENTITY
    };
    Ok(DynState {
        p_nb,
        quat_nb,
        q: numbers(state, "qj", Some(dof))?,
        nu,
    })
}

fn numbers(state: &Value, key: &str, length: Option<usize>) -> Result<Vec<f64>> {
    let Some(list) = state.get(key).and_then(Value::as_array) else {
        bail!("`{key}` is missing or not a list of numbers");
    };
    let numbers: Option<Vec<f64>> = list.iter().map(Value::as_f64).collect();
    let Some(numbers) = numbers else {
        bail!("`{key}` contains something that is not a number")
    };
    match length {
        Some(n) if n != numbers.len() => bail!("`{key}` has {} numbers, it must have {n}", numbers.len()),
        _ => Ok(numbers),
    }
}

fn quantities(d: &Description, tree: &DynTree, given: &Value, s: &DynState, tau: &[f64]) -> Result<Value> {
    let (m, c) = tree.mass_and_coriolis(s);
    let momentum = tree.momentum(s);
    let mut frames = Map::new();
    for name in tree.frame_names() {
        frames.insert(name.clone(), frame(tree, s, tree.frame(name)?));
    }
    let last = d.links.last().map_or("", |l| l.name.as_str());
    let end_effector = frames.get("end_effector").or_else(|| frames.get(last)).cloned();
    let world = |v: &Vector3<f64>| list(&s.quat_nb.rotate(v));
    Ok(json!({
        "state": given,
        "M": m.to_rows(),
        "C": c.to_rows(),
        "bias": tree.bias(s),
        "acceleration": tree.forward_dynamics(s, tau),
        "kinetic_energy": tree.kinetic_energy(s),
        "linear_momentum_N": world(&momentum.linear_b),
        "angular_momentum_about_com_N": world(&momentum.angular_b),
        "com_N": list(&(s.p_nb + s.quat_nb.rotate(&momentum.p_bc))),
        "end_effector": end_effector,
        "frames": frames,
    }))
}

fn frame(tree: &DynTree, s: &DynState, id: FrameId) -> Value {
    let at = tree.placement_in_world(s, id);
    let (j, j_rate) = tree.jacobian_and_rate(s, id);
    let rows: Vec<Vec<f64>> = (0..3).map(|r| (0..3).map(|c| at.r[(r, c)]).collect()).collect();
    json!({ "p_N": list(&at.p), "R_NE": rows, "J_body": j.to_rows(), "Jdot_body": j_rate.to_rows() })
}

fn list(v: &Vector3<f64>) -> [f64; 3] {
    [v.x, v.y, v.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    const URDF: &str = include_str!("../../../models/servicer.urdf");

    #[test]
    fn model_listing_shows_tree_and_merged_links() {
        let text = listing(&Description::from_urdf(URDF).unwrap()).unwrap();
        assert!(
            text.starts_with("servicer: 9 moving joints, 15 degrees of freedom"),
            "{text}"
        );
        assert!(text.contains("[6] turns on A7, with tool, end_effector"), "{text}");
        assert!(text.contains("[8] turns on slosh_x, damping 0.0131"), "{text}");
    }

    #[test]
    fn model_listing_shows_mimic_joints() {
        let gripper = r#"<robot name="gripper"><link name="palm"><inertial><mass value="2"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <joint name="left" type="prismatic"><parent link="palm"/><child link="a"/></joint>
            <joint name="right" type="prismatic"><parent link="palm"/><child link="b"/>
              <mimic joint="left" multiplier="-2" offset="-0.5"/></joint></robot>"#;
        let text = listing(&Description::from_urdf(gripper).unwrap()).unwrap();
        assert!(
            text.contains("2 moving joints (1 of them follow others), 7 degrees of freedom"),
            "{text}"
        );
        assert!(text.contains("[0] slides on right = -2 left - 0.5"), "{text}");
    }

    #[test]
    fn model_evaluation_gives_every_quantity() {
        let d = Description::from_urdf(URDF).unwrap();
        let state = json!({"p": [0, 0, 0], "quat_wxyz": [1, 0, 0, 0], "qj": vec![0; 9], "v": vec![0; 15]});
        let out = evaluate(&d, &state).unwrap();
        let first = &out["states"][0];
        // the sum of the links' masses, each rounded
        assert!((first["M"][3][3].as_f64().unwrap() - 450.2).abs() < 1e-12);
        assert_eq!(first["end_effector"], first["frames"]["end_effector"]);
    }

    #[test]
    fn state_with_an_unknown_key_or_a_wrong_length_is_refused() {
        let d = Description::from_urdf(URDF).unwrap();
        let good = || json!({"qj": vec![0; 9], "v": vec![0; 15]});
        let refused = |key: &str, value: Value| {
            let mut state = good();
            state[key] = value;
            // the same as an entry of a list, beside results that are ignored
            let wrapped = json!({"states": [{"state": good(), "M": 1}, {"state": state.clone(), "M": 1}]});
            let error = format!("{:#}", evaluate(&d, &wrapped).unwrap_err());
            assert!(error.starts_with("state 1: "), "{error}");
            format!("{:#}", evaluate(&d, &state).unwrap_err())
        };
        for (key, value, part) in [
            ("taw", json!(vec![0; 15]), "`taw` is not a key of a state"),
            ("quat", json!([1, 0, 0, 0]), "`quat_wxyz`"),
            ("v", json!(vec![0; 4]), "`v` has 4 numbers"),
            ("qj", json!(vec![0; 8]), "`qj` has 8 numbers, it must have 9"),
            ("tau", json!(vec![0; 9]), "`tau` has 9 numbers, it must have 15"),
            ("p", json!([0, 0]), "`p` has 2 numbers, it must have 3"),
            (
                "quat_wxyz",
                json!([1, 0, 0]),
                "`quat_wxyz` has 3 numbers, it must have 4",
            ),
            ("tau", json!(1), "`tau` is missing or not a list"),
        ] {
            let error = refused(key, value);
            assert!(error.contains(part), "{key}: {error}");
        }
        let error = evaluate(&d, &json!([7])).unwrap_err();
        assert!(format!("{error:#}").contains("`7` is not a state"), "{error:#}");
    }
}
