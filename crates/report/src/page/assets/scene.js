// What is in the scene at an instant: bodies from the model and the joint angles, arrows, frames, paths.
const ROLES = {
  bus: [0.83, 0.62, 0.24, 1], arm: [0.90, 0.91, 0.93, 1], joint: [0.95, 0.49, 0.13, 1], tool: [0.36, 0.40, 0.47, 1],
  tank: [0.62, 0.80, 0.95, 0.22], bob: [0.16, 0.52, 0.96, 1], rod: [0.80, 0.84, 0.90, 1], visual: [0.75, 0.77, 0.80, 1],
  target: [0.52, 0.55, 0.60, 1], ring: [0.95, 0.49, 0.13, 1], metal: [0.60, 0.63, 0.67, 1], dark: [0.17, 0.19, 0.22, 1],
  cells: [0.09, 0.15, 0.36, 1], radiator: [0.80, 0.82, 0.85, 1], silver: [0.66, 0.69, 0.74, 1], lens: [0.05, 0.07, 0.12, 1], nozzle: [0.36, 0.33, 0.32, 1],
};
/** How light plays on a material: the name of a URDF's material, or what an invented shape stands for. */
const FINISH = {
  foil: { metal: 1, rough: 0.32, pattern: 1 }, bus: { metal: 1, rough: 0.32, pattern: 1 }, silver: { metal: 0.9, rough: 0.38, pattern: 1 },
  metal: { metal: 0.85, rough: 0.4 }, nozzle: { metal: 0.9, rough: 0.35 }, cells: { metal: 0.35, rough: 0.2, pattern: 2 }, radiator: { rough: 0.25, pattern: 3 },
  lens: { rough: 0.05 }, dark: { rough: 0.55 }, ring: { rough: 0.35 }, joint: { rough: 0.35 }, white: { rough: 0.38 }, arm: { rough: 0.38 }, tank: { rough: 0.15 }, bob: { rough: 0.2 },
};

/** The motion of one run: channels by name, sampled between their instants. */
class Motion {
  constructor(raw) {
    this.t = decode(raw.t, Float64Array);
    this.channels = {};
    for (const [name, { width, values }] of Object.entries(raw.channels)) this.channels[name] = { width, values: decode(values, Float32Array) };
    this.frames = this.t.length;
  }

  /** News of a run that is going on. */
  append({ keep, t, channels }) {
    this.t = joined(this.t, keep, decode(t, Float64Array));
    for (const [name, { width, values }] of Object.entries(channels)) {
      const own = this.channels[name];
      if (own) own.values = joined(own.values, keep * width, decode(values, Float32Array));
    }
    this.frames = this.t.length;
  }

  has(name) { return name in this.channels; }

  /** A channel at t: linear between instants, and renormalised where it is an attitude. */
  at(name, t) {
    const channel = this.channels[name];
    if (!channel || !this.frames) return null;
    const k = Math.min(this.frames - 1, Math.max(0, lowerBound(this.frames, (i) => this.t[i], t)));
    const j = Math.max(0, k - 1), span = this.t[k] - this.t[j];
    const f = span > 0 ? Math.min(1, Math.max(0, (t - this.t[j]) / span)) : 0;
    const get = (i) => Array.from(channel.values.subarray(i * channel.width, (i + 1) * channel.width));
    const a = get(j), b = get(k);
    if (!name.startsWith("quat")) return a.map((x, i) => x + f * (b[i] - x));
    // q and -q are one attitude; the shorter way between two is on one side.
    const sign = a.reduce((sum, x, i) => sum + x * b[i], 0) < 0 ? -1 : 1;
    const q = a.map((x, i) => x + f * (sign * b[i] - x)), n = Math.hypot(...q) || 1;
    return q.map((x) => x / n);
  }

  points(name) {
    const channel = this.channels[name], out = [];
    if (channel) for (let i = 0; i < this.frames; i++) out.push(Array.from(channel.values.subarray(3 * i, 3 * i + 3)));
    return out;
  }

  /** The greatest length of a vector channel. */
  peak(name) { return this.points(name).reduce((max, p) => Math.max(max, V.norm(p)), 0); }
}

/** Poses of all bodies of a model: [position, attitude] in the world. */
function kinematics(model, p, q, channels) {
  const poses = [[p, q]];
  model.bodies.forEach((body, i) => {
    if (body.parent === null) return;
    const [pp, pq] = poses[body.parent];
    let at = V.add(pp, Q.rotate(pq, body.xyz)), turn = Q.times(pq, Q.rpy(body.rpy));
    const value = body.channel ? (channels[body.channel[0]] || [])[body.channel[1]] || 0 : 0;
    if (body.axis && body.prismatic) at = V.add(at, Q.rotate(turn, V.scale(V.unit(body.axis), value)));
    else if (body.axis) turn = Q.times(turn, Q.turn(body.axis, value));
    poses[i] = [at, turn];
  });
  return poses;
}

class Scene {
  constructor(gl, run, slot) {
    this.gl = gl; this.run = run; this.slot = slot; this.motion = new Motion(run.motion);
    this.model = run.model; this.target = run.target;
    if (!this.target) this.target = this.inventTarget();
    this.measure();
  }

  /** What follows from the whole motion: paths, and how long arrows may be. */
  measure() {
    const m = this.motion;
    for (const { line } of this.paths || []) this.gl.forget(line);
    this.paths = ["p_NE", "p_ND", "p_NB"].filter((name) => m.has(name)).map((name) => ({ name, line: this.gl.line(m.points(name), m.t) }));
    // What is drawn is what acts; what was demanded only where nobody tells what acted.
    const peak = (key) => m.peak(m.has(key) ? key : "command_" + key);
    this.forcePeak = peak("force"); this.torquePeak = peak("torque");
  }

  /** A box that has the grasp point on its face, with a ring there, when no model of the target is given. */
  inventTarget() {
    const m = this.motion;
    if (!m.has("p_NT") || !m.has("p_NG")) return null;
    const t = m.t[0], q = m.at("quat_NT", t) || [1, 0, 0, 0], back = [q[0], -q[1], -q[2], -q[3]];
    const g = Q.rotate(back, V.sub(m.at("p_NG", t), m.at("p_NT", t))), d = V.norm(g);
    if (d < 1e-3) return null;
    const axis = [0, 1, 2].reduce((best, i) => (Math.abs(g[i]) > Math.abs(g[best]) ? i : best), 0);
    const size = [0, 1, 2].map((i) => (i === axis ? 2 * d * 0.985 : 1.54 * d));
    const u = V.unit(g), pitch = Math.atan2(Math.hypot(u[0], u[1]), u[2]), yaw = Math.atan2(u[1], u[0]);
    // The face with the grasp point is drawn in a frame whose z points out of it; lengths are in terms of its distance.
    const out = Q.rpy([0, pitch, yaw]), [a, b] = [0, 1, 2].filter((i) => i !== axis), half = [size[a] / 2, size[b] / 2], shapes = [];
    const add = (kind, s, xyz, role, rpy = [0, 0, 0]) => shapes.push({ kind, size: s, xyz, rpy, rgba: null, role });
    const at = (x, y, z) => Q.rotate(out, V.scale([x, y, z], d)), on = (kind, s, x, y, z, role) => add(kind, s.map((l) => l * d), at(x, y, z), role, [0, pitch, yaw]);
    add("box", size, [0, 0, 0], "silver");
    // Rails along all edges.
    for (let i = 0; i < 3; i++) for (const s of [-1, 1]) for (const r of [-1, 1]) {
      const p = [0, 0, 0], l = [0.04 * d, 0.04 * d, 0.04 * d], [j, k] = [(i + 1) % 3, (i + 2) % 3];
      l[i] = size[i] + 0.04 * d; p[j] = s * size[j] / 2; p[k] = r * size[k] / 2; add("box", l, p, "metal");
    }
    // Cells on the sides, wings along the longer axis of the face, a launch ring behind.
    for (const s of [-1, 1]) {
      const p = [0, 0, 0], l = size.map((x) => 0.84 * x); p[b] = s * (half[1] + 0.008 * d); l[b] = 0.02 * d; add("box", l, p, "cells");
      for (let k = 0; k < 2; k++) {
        const w = [0, 0, 0], e = [0, 0, 0]; w[a] = s * (half[0] + d * (0.62 + 0.98 * k)); e[a] = 0.94 * d; e[b] = 0.035 * d; e[axis] = 1.25 * d; add("box", e, w, "cells");
      }
      const y = [0, 0, 0], t = [0.05 * d, 0.05 * d, 0.05 * d]; y[a] = s * (half[0] + 0.09 * d); t[a] = 0.18 * d; add("box", t, y, "metal");
    }
    on("cylinder", [0.42, 0.42, 0.06], 0, 0, -1.0, "metal");
    // The grapple fixture: a ring to hold, a post in its middle, a plate with marks for the camera.
    on("box", [0.62, 0.62, 0.012], 0, 0, 0.985, "dark");
    on("cylinder", [0.22, 0.22, 0.022], 0, 0, 0.994, "ring"); on("cylinder", [0.185, 0.185, 0.026], 0, 0, 0.994, "dark");
    on("cylinder", [0.035, 0.035, 0.05], 0, 0, 0.985, "metal");
    for (const [x, y] of [[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]]) on("cylinder", [0.028, 0.028, 0.016], x, y, 0.99, "radiator");
    on("cylinder", [0.1, 0.13, 0.2], 0.52, 0.5, 1.05, "nozzle"); on("cylinder", [0.016, 0.016, 0.5], -0.55, 0.5, 1.15, "metal"); on("sphere", [0.03, 0, 0], -0.55, 0.5, 1.42, "ring");
    return { bodies: [{ parent: null, shapes }] };
  }

  state(t) {
    const m = this.motion, s = {};
    for (const name of Object.keys(m.channels)) s[name] = m.at(name, t);
    return s;
  }

  /** Draws one solid; `ghost` is the colour of a run laid over another one, `thin` an opacity that shows what is inside. */
  shape(shape, [p, q], ghost, thin = 1) {
    const { gl } = this, place = V.add(p, Q.rotate(q, shape.xyz)), turn = Q.times(q, Q.rpy(shape.rpy)), size = shape.size;
    let colour = shape.rgba || ROLES[shape.role] || ROLES.visual;
    if (ghost) colour = [...ghost, 0.34 * colour[3]];
    else if (thin < 1) colour = [...colour.slice(0, 3), thin];
    const finish = FINISH[shape.role] || {};
    if (shape.kind === "box") {
      const pose = M.pose(place, turn, size);
      gl.draw(gl.mesh("box", Mesh.box), pose, colour, finish);
      if (!ghost && !gl.casting && colour[3] < 1) gl.drawEdges(pose, colour.slice(0, 3).map((x) => 0.45 * x));
    }
    else if (shape.kind === "sphere") gl.draw(gl.mesh("sphere", Mesh.sphere), M.pose(place, turn, [size[0], size[0], size[0]]), colour, finish);
    else {
      const [r0, r1, length] = size, big = Math.max(r0, r1) || 1;
      const mesh = gl.mesh(`cylinder ${(r0 / big).toFixed(4)} ${(r1 / big).toFixed(4)}`, () => Mesh.cylinder(r0 / big, r1 / big));
      gl.draw(mesh, M.pose(place, turn, [big, big, length]), colour, finish);
    }
  }

  bodies(s, ghost, later, inside) {
    const draw = (shape, pose, thin = 1) => {
      // What can be seen through is drawn after everything else.
      const through = ghost || thin < 1 || (shape.rgba ? shape.rgba[3] : (ROLES[shape.role] || [0, 0, 0, 1])[3]) < 1;
      if (through) later.push(() => this.shape(shape, pose, ghost, thin)); else this.shape(shape, pose, ghost);
    };
    if (this.model && s.p_NB) {
      const poses = kinematics(this.model, s.p_NB, s.quat_NB || [1, 0, 0, 0], s);
      this.model.bodies.forEach((body, i) => {
        for (const shape of body.shapes) draw(shape, poses[i], inside && i === 0 && this.hidesTank(shape) ? 0.3 : 1);
      });
    } else if (s.p_NB) {
      draw({ kind: "box", size: [1, 1, 1], xyz: [0, 0, 0], rpy: [0, 0, 0], role: "bus" }, [s.p_NB, s.quat_NB || [1, 0, 0, 0]]);
    }
    // One target is enough: runs that are compared usually have the same one.
    if (this.target && s.p_NT && !ghost) {
      const poses = kinematics(this.target, s.p_NT, s.quat_NT || [1, 0, 0, 0], {});
      this.target.bodies.forEach((body, i) => { for (const shape of body.shapes) draw(shape, poses[i]); });
    }
  }

  /** True for a solid of the root that a slosh joint lies inside. */
  hidesTank(shape) {
    const slosh = this.model.bodies.find((body) => body.channel && body.channel[0] === "q_slosh");
    if (!slosh || shape.kind === "sphere") return false;
    let p = slosh.xyz;
    for (let at = slosh.parent; at !== null; at = this.model.bodies[at].parent) p = V.add(this.model.bodies[at].xyz, p);
    const reach = shape.kind === "box" ? shape.size.map((x) => x / 2) : [shape.size[0], shape.size[0], shape.size[2] / 2];
    return V.sub(p, shape.xyz).every((x, i) => Math.abs(x) < reach[i]);
  }

  arrow(from, vector, colour, heads = 1) {
    const { gl } = this, length = V.norm(vector);
    if (length < 0.02) return;
    const u = V.unit(vector), turn = Q.fromZ(u), head = Math.min(0.14, 0.4 * length), r = 0.017;
    const shaft = length - head;
    gl.draw(gl.mesh("cylinder 1 1", () => Mesh.cylinder(1, 1)), M.pose(V.add(from, V.scale(u, shaft / 2)), turn, [r, r, shaft]), colour);
    for (let i = 0; i < heads; i++) {
      const at = V.add(from, V.scale(u, shaft + head / 2 - i * head * 0.75));
      gl.draw(gl.mesh("cylinder 1 0", () => Mesh.cylinder(1, 0)), M.pose(at, turn, [3 * r, 3 * r, head]), colour);
    }
  }

  frame([p, q], length) {
    const { gl } = this;
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, i) => {
      const colour = [[0.92, 0.26, 0.24, 1], [0.22, 0.74, 0.36, 1], [0.26, 0.52, 0.98, 1]][i], to = Q.rotate(q, axis);
      const mesh = gl.mesh("cylinder 1 1", () => Mesh.cylinder(1, 1)), r = 0.009 * length / 0.3;
      gl.draw(mesh, M.pose(V.add(p, V.scale(to, length / 2)), Q.fromZ(to), [r, r, length]), colour);
    });
  }
}
