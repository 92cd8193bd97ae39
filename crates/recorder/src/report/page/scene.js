// What is in the scene at an instant: bodies from the model and the joint angles, arrows, frames, paths.
const ROLES = {
  bus: [0.80, 0.66, 0.36, 1], arm: [0.90, 0.91, 0.93, 1], joint: [0.93, 0.52, 0.20, 1], tool: [0.36, 0.40, 0.47, 1],
  tank: [0.55, 0.75, 0.95, 0.16], bob: [0.20, 0.55, 0.95, 1], rod: [0.75, 0.80, 0.88, 1], visual: [0.75, 0.77, 0.80, 1],
  target: [0.62, 0.66, 0.72, 1], ring: [0.86, 0.68, 0.30, 1],
};

/** The motion of one run: channels by name, sampled between their instants. */
class Motion {
  constructor(raw) {
    this.t = decode(raw.t, Float64Array);
    this.channels = {};
    for (const [name, { width, values }] of Object.entries(raw.channels)) this.channels[name] = { width, values: decode(values, Float32Array) };
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
    const m = this.motion;
    this.paths = ["p_NE", "p_ND", "p_NB"].filter((name) => m.has(name)).map((name) => ({ name, line: gl.line(m.points(name), m.t) }));
    this.forcePeak = Math.max(m.peak("force"), m.peak("command_force")); this.torquePeak = Math.max(m.peak("torque"), m.peak("command_torque"));
    this.model = run.model; this.target = run.target;
    if (!this.target) this.target = this.inventTarget();
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
    const shape = (kind, s, xyz, role, rpy = [0, 0, 0]) => ({ kind, size: s, xyz, rpy, rgba: null, role });
    const u = V.unit(g), z = V.scale(u, d * 0.99);
    const pitch = Math.atan2(Math.hypot(u[0], u[1]), u[2]), yaw = Math.atan2(u[1], u[0]);
    return { bodies: [{ parent: null, shapes: [
      shape("box", size, [0, 0, 0], "target"),
      shape("cylinder", [0.2 * d, 0.17 * d, 0.05 * d], z, "ring", [0, pitch, yaw]),
      shape("cylinder", [0.06 * d, 0.06 * d, 0.052 * d], z, "tool", [0, pitch, yaw]),
    ] }] };
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
    const metal = shape.role === "bus" || shape.role === "ring" ? 0.75 : 0.35;
    if (shape.kind === "box") {
      const pose = M.pose(place, turn, size);
      gl.draw(gl.mesh("box", Mesh.box), pose, colour, metal);
      if (!ghost) gl.drawEdges(pose, colour.slice(0, 3).map((x) => 0.45 * x));
    }
    else if (shape.kind === "sphere") gl.draw(gl.mesh("sphere", Mesh.sphere), M.pose(place, turn, [size[0], size[0], size[0]]), colour, 0.6);
    else {
      const [r0, r1, length] = size, big = Math.max(r0, r1) || 1;
      const mesh = gl.mesh(`cylinder ${(r0 / big).toFixed(4)} ${(r1 / big).toFixed(4)}`, () => Mesh.cylinder(r0 / big, r1 / big));
      gl.draw(mesh, M.pose(place, turn, [big, big, length]), colour, metal);
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
    const u = V.unit(vector), turn = Q.fromZ(u), head = Math.min(0.12, 0.4 * length), r = 0.014;
    const shaft = length - head;
    gl.draw(gl.mesh("cylinder 1 1", () => Mesh.cylinder(1, 1)), M.pose(V.add(from, V.scale(u, shaft / 2)), turn, [r, r, shaft]), colour, 0.2);
    for (let i = 0; i < heads; i++) {
      const at = V.add(from, V.scale(u, shaft + head / 2 - i * head * 0.75));
      gl.draw(gl.mesh("cylinder 1 0", () => Mesh.cylinder(1, 0)), M.pose(at, turn, [3 * r, 3 * r, head]), colour, 0.2);
    }
  }

  frame([p, q], length) {
    const { gl } = this;
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, i) => {
      const colour = [[0.92, 0.26, 0.24, 1], [0.22, 0.74, 0.36, 1], [0.26, 0.52, 0.98, 1]][i], to = Q.rotate(q, axis);
      const mesh = gl.mesh("cylinder 1 1", () => Mesh.cylinder(1, 1)), r = 0.011 * (length / 0.3) ** 0.5;
      gl.draw(mesh, M.pose(V.add(p, V.scale(to, length / 2)), Q.fromZ(to), [r, r, length]), colour, 0.1);
    });
  }
}
