"""What the figures of a report must show, computed from the tape alone: the judge's own table, with none of the report's code.

Momentum of the bodies comes from the URDF's masses and from positions at neighbouring samples, where the report computes velocities.
"""

import json
import xml.etree.ElementTree as ElementTree

import numpy as np

NUMPY = {"f64": "<f8", "f32": "<f4", "i64": "<i8", "i32": "<i4", "i16": "<i2", "i8": "i1", "u64": "<u8", "u32": "<u4", "u16": "<u2", "u8": "u1", "bool": "?", "enum": "u1"}
# Differences of positions over a sample: how exact a momentum from them is, N s and N m s.
BY_DIFFERENCES = 2e-4


def read_stream(run, port, *names):
    """The records of the first stream of that port that has all of these fields."""
    index = json.loads((run / "tape/index.json").read_text())
    for stream in index["streams"]:
        fields = stream["descriptor"]["fields"]
        if stream["port"] == port and {f["name"] for f in fields} >= set(names):
            dtype = [("t", "<f8")] + [(f["name"], NUMPY[f["element"]], tuple(f["shape"])) for f in fields]
            return np.fromfile(run / "tape" / stream["file"], dtype=np.dtype(dtype))
    return None


def times(a, b):
    """Products of quaternions, scalar first."""
    w = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=1, keepdims=True)
    return np.hstack([w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])])


def rotation_vector(q):
    q = np.where(q[:, :1] < 0, -q, q)
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    factor = np.where(sine > 0, 2 * np.arctan2(sine, q[:, :1]) / np.where(sine > 0, sine, 1), 0)
    return factor * q[:, 1:]


def rotate(q, v):
    v = np.broadcast_to(v, (len(q), 3))
    t = 2 * np.cross(q[:, 1:], v)
    return v + q[:, :1] * t + np.cross(q[:, 1:], t)


def matrices(q):
    """Rotation matrices of quaternions, scalar first: columns are the frame's axes in the world."""
    w, x, y, z = q.T
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), 2, 0)


def position_in_grasp(e, g, axes):
    return np.einsum("nji,nj->ni", matrices(axes), e - g)


def attitude_in_grasp(e, g):
    """The vector part by the rotation matrix alone: axis and angle, where the report multiplies quaternions."""
    r = np.einsum("nji,njk->nik", matrices(g), matrices(e))
    skew = np.column_stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]]) / 2
    sine, cosine = np.linalg.norm(skew, axis=1, keepdims=True), (np.trace(r, axis1=1, axis2=2).reshape(-1, 1) - 1) / 2
    return skew / np.where(sine > 0, sine, 1) * np.sin(np.arctan2(sine, cosine) / 2)


same = lambda *fields: np.column_stack(fields)
degrees = lambda field: np.degrees(field)
length = lambda field: np.linalg.norm(field, axis=1)
inverse = np.array([1, -1, -1, -1])

# Figure: the port, its fields, and what they make in the figure's unit.
FIGURES = {
    "position-error": ("truth", ["p_NE_N", "p_NG_N"], lambda e, g: length(e - g)),
    "attitude-error": ("truth", ["quat_NE", "quat_NG"], lambda e, g: degrees(length(rotation_vector(times(e * inverse, g))))),
    "position-error-in-grasp": ("truth", ["p_NE_N", "p_NG_N", "quat_NG"], position_in_grasp),
    "attitude-error-in-grasp": ("truth", ["quat_NE", "quat_NG"], attitude_in_grasp),
    "tracking-error": ("telemetry", ["p_DE_N"], length),
    "base-torque": ("command", ["torque_B"], same),
    "base-force": ("command", ["force_B"], same),
    "joint-torque": ("command", ["tau"], same),
    "base-torque-applied": ("truth", ["wheel_torque_B"], same),
    "base-force-applied": ("truth", ["thruster_force_B"], same),
    "joint-torque-applied": ("truth", ["tau"], same),
    "thruster-torque": ("truth", ["thruster_torque_B"], same),
    "epsilon": ("telemetry", ["epsilon", "epsilon_clamped"], same),
    "hybrid-variable": ("telemetry", ["h"], same),
    "integrator-base": ("telemetry", ["sigma"], lambda sigma: sigma[:, :6]),
    "integrator-arm": ("telemetry", ["sigma"], lambda sigma: sigma[:, 6:]),
    "feedback-torque": ("telemetry", ["feedback_torque_B"], same),
    "feedback-force": ("telemetry", ["feedback_force_B"], same),
    "feedback-joints": ("telemetry", ["feedback_tau"], same),
    "saturation": ("telemetry", ["feedback_saturated"], same),
    "progress": ("telemetry", ["progress_position", "progress_attitude"], same),
    "set-point": ("setpoint", ["p_ND_N"], same),
    "target-uncertainty": ("telemetry", ["sigma_position"], same),
    "target-age": ("telemetry", ["target_age"], same),
    "slosh": ("truth", ["slosh"], degrees),
    "end-effector-position": ("truth", ["p_NE_N"], same),
    "base-position": ("truth", ["p_NB_N"], same),
    "base-attitude": ("truth", ["quat_NB"], lambda q: degrees(rotation_vector(q))),
    "base-velocity": ("truth", ["v_NB_B"], same),
    "base-rate": ("truth", ["omega_NB_B"], degrees),
    "joint-angles": ("truth", ["q"], degrees),
    "joint-rates": ("truth", ["qdot"], degrees),
    "linear-momentum": ("truth", ["linear_momentum_N"], same),
    "angular-momentum": ("truth", ["angular_momentum_N"], same),
    "wheel-momentum": ("truth", ["wheel_momentum_B"], same),
    "energy": ("truth", ["energy", "actuator_work", "damper_loss", "impact_loss"], same),
    "momentum-residual": ("truth", ["angular_residual_N"], same),
    "energy-residual": ("truth", ["energy_residual"], same),
}
BODIES = [f"{kind}-momentum-{axis}" for kind in ("linear", "angular") for axis in "xyz"] + ["centre-of-mass"]


def curves(run, figure):
    """Stamps, and one column per curve."""
    port, names, formula = FIGURES[figure]
    records = read_stream(run, port, *names)
    assert records is not None, f"{figure}: no stream `{port}` has {names}"
    values = formula(*(records[name] for name in names))
    return records["t"], values.reshape(len(records), -1)


def masses(urdf):
    """The bodies of a URDF whose joints all have the same axes as their links: name, chain of joints from the root, mass, centre."""
    robot = ElementTree.fromstring(urdf)
    numbers = lambda node, key, default="0 0 0": np.array([float(x) for x in (node.get(key) if node is not None and node.get(key) else default).split()])
    joints = {j.find("child").get("link"): j for j in robot.findall("joint")}
    moving = [j for j in robot.findall("joint") if j.get("type") != "fixed"]
    bodies = []
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        mass = float(inertial.find("mass").get("value")) if inertial is not None else 0.0
        if mass == 0:
            continue
        chain, at = [], link.get("name")
        while at in joints:
            joint = joints[at]
            origin = joint.find("origin")
            number = moving.index(joint) if joint in moving else None
            chain.insert(0, (numbers(origin, "xyz"), numbers(origin, "rpy"), numbers(joint.find("axis"), "xyz", "1 0 0"), number))
            at = joint.find("parent").get("link")
        # A link behind fixed joints is a part of the body that carries it.
        owner = link.get("name")
        while owner in joints and joints[owner].get("type") == "fixed":
            owner = joints[owner].find("parent").get("link")
        bodies.append((owner.replace("_", " "), chain, mass, numbers(inertial.find("origin"), "xyz")))
    return bodies


def turn(axis, angle):
    half = np.asarray(angle, dtype=float).reshape(-1, 1) / 2
    return np.hstack([np.cos(half), np.sin(half) * (np.asarray(axis) / np.linalg.norm(axis))])


def linear_momenta(run, plant):
    """Records, by name the linear momentum of each body from positions before and after, and the common centre of mass."""
    r = read_stream(run, "truth", "p_NB_N", "slosh", "p_NT_N")
    spherical, arm = plant.get("slosh") == "spherical", r["q"].shape[1]
    angles = np.hstack([r["q"], 0 * r["slosh"] if spherical else r["slosh"]])
    h, total = r["t"][1] - r["t"][0], float(plant["target"]["mass"].split()[0])
    momenta, moment = {"target": total * r["v_NT_N"]}, total * r["p_NT_N"]
    for name, chain, mass, com in masses(plant["urdf"]):
        p, q, number = r["p_NB_N"], r["quat_NB"], None
        for xyz, rpy, axis, number in chain:
            p = p + rotate(q, xyz)
            for unit, angle in zip(np.eye(3)[::-1], rpy[::-1]):
                q = times(q, np.broadcast_to(turn(unit, angle), q.shape))
            if number is not None:
                q = times(q, turn(axis, angles[:, number]))
        if spherical and number is not None and number >= arm:
            com = np.linalg.norm(com) * r["slosh_direction_B"]
        p = p + rotate(q, com)
        momenta[name] = momenta.get(name, 0) + mass * np.gradient(p, h, axis=0)
        moment, total = moment + mass * p, total + mass
    return r, momenta, moment / total
