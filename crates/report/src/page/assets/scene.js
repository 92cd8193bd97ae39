// What is in the scene at an instant: bodies from the fields that they follow, their links, arrows, axes, paths.
const ROLES = {
  bus: [0.83, 0.62, 0.24, 1], tube: [0.90, 0.91, 0.93, 1], joint: [0.95, 0.49, 0.13, 1], tool: [0.36, 0.40, 0.47, 1],
  tank: [0.62, 0.80, 0.95, 0.22], bob: [0.16, 0.52, 0.96, 1], rod: [0.80, 0.84, 0.90, 1], visual: [0.75, 0.77, 0.80, 1],
  ring: [0.95, 0.49, 0.13, 1], metal: [0.60, 0.63, 0.67, 1], dark: [0.17, 0.19, 0.22, 1],
  cells: [0.09, 0.15, 0.36, 1], radiator: [0.80, 0.82, 0.85, 1], silver: [0.66, 0.69, 0.74, 1], lens: [0.05, 0.07, 0.12, 1], nozzle: [0.36, 0.33, 0.32, 1],
};
/** How light plays on a material: the name of a URDF's material, or what an invented shape stands for. */
const FINISH = {
  foil: { metal: 1, rough: 0.32, pattern: 1 }, bus: { metal: 1, rough: 0.32, pattern: 1 }, silver: { metal: 0.9, rough: 0.38, pattern: 1 },
  metal: { metal: 0.85, rough: 0.4 }, nozzle: { metal: 0.9, rough: 0.35 }, cells: { metal: 0.35, rough: 0.2, pattern: 2 }, radiator: { rough: 0.25, pattern: 3 },
  lens: { rough: 0.05 }, dark: { rough: 0.55 }, ring: { rough: 0.35 }, joint: { rough: 0.35 }, white: { rough: 0.38 }, tube: { rough: 0.38 }, tank: { rough: 0.15 }, bob: { rough: 0.2 },
};
const finite = (list) => list.every(Number.isFinite);

/** The motion of one run: channels by number, sampled between their instants. */
class Motion {
  constructor(raw) {
    this.t = decode(raw.t, Float64Array);
    this.channels = raw.channels.map(({ attitude, width, values }) => ({ attitude, width, values: decode(values, Float32Array) }));
    this.frames = this.t.length;
  }

  /** News of a run that is going on. */
  append({ keep, t, channels }) {
    this.t = joined(this.t, keep, decode(t, Float64Array));
    channels.forEach(({ width, values }, i) => { this.channels[i].values = joined(this.channels[i].values, keep * width, decode(values, Float32Array)); });
    this.frames = this.t.length;
  }

  /** A channel at t: linear between instants, and renormalised where it is an attitude; null where there is nothing yet. */
  at(number, t) {
    const channel = this.channels[number];
    if (!this.frames) return null;
    const k = Math.min(this.frames - 1, Math.max(0, lowerBound(this.frames, (i) => this.t[i], t)));
    const j = Math.max(0, k - 1), span = this.t[k] - this.t[j];
    const f = span > 0 ? Math.min(1, Math.max(0, (t - this.t[j]) / span)) : 0;
    const get = (i) => Array.from(channel.values.subarray(i * channel.width, (i + 1) * channel.width));
    const b = get(k), a = f < 1 ? get(j) : b;
    let out = a.map((x, i) => x + f * (b[i] - x));
    if (channel.attitude) {
      // q and -q are one attitude; the shorter way between two is on one side.
      const sign = a.reduce((sum, x, i) => sum + x * b[i], 0) < 0 ? -1 : 1;
      out = a.map((x, i) => x + f * (sign * b[i] - x));
      const n = Math.hypot(...out) || 1;
      out = out.map((x) => x / n);
    }
    return finite(out) ? out : null;
  }

  /** The vectors of a channel that are there, with their instants. */
  points(number) {
    const { values } = this.channels[number], points = [], along = [];
    for (let i = 0; i < this.frames; i++) {
      const p = Array.from(values.subarray(3 * i, 3 * i + 3));
      if (finite(p)) { points.push(p); along.push(this.t[i]); }
    }
    return { points, along };
  }

  /** The greatest length of a vector channel. */
  peak(number) { return this.points(number).points.reduce((max, p) => Math.max(max, V.norm(p)), 0); }
}

/** Poses of all links of a model: [position, attitude] in the scene. */
function kinematics(model, p, q, joints) {
  const poses = [[p, q]];
  model.links.forEach((link, i) => {
    if (link.parent === null) return;
    const [pp, pq] = poses[link.parent];
    let at = V.add(pp, Q.rotate(pq, link.xyz)), turn = Q.times(pq, Q.rpy(link.rpy));
    const value = link.joint === null || !joints ? 0 : joints[link.joint] || 0;
    if (link.axis && link.prismatic) at = V.add(at, Q.rotate(turn, V.scale(V.unit(link.axis), value)));
    else if (link.axis) turn = Q.times(turn, Q.turn(link.axis, value));
    poses[i] = [at, turn];
  });
  return poses;
}

class Scene {
  constructor(gl, run, slot) {
    this.gl = gl; this.run = run; this.slot = slot; this.spec = run.scene; this.motion = new Motion(run.motion);
    // Solids that are seen through on demand, because a pendulum hangs in them.
    this.shells = new Set(this.spec.bodies.flatMap((body) => body.models.flatMap((model) => (model.links[0] ? model.links[0].shapes.filter((shape) => encloses(model, shape)) : []))));
    this.measure();
  }

  /** What follows from the whole motion: lines, and how large arrows are. */
  measure() {
    const m = this.motion;
    for (const { line } of this.paths || []) if (line) this.gl.forget(line);
    this.paths = this.spec.bodies.flatMap((body) => body.paths.map((path) => {
      const { points, along } = m.points(body.position);
      return { body, path, points, along, line: path.last === null ? this.gl.line(points, along) : null };
    }));
    this.arrows = this.spec.bodies.flatMap((body) => body.arrows.map((arrow) => ({ body, arrow, peak: m.peak(arrow.of) })));
  }

  /** Where a body is, by its place or its name: { p, q }; null where it is not known yet. */
  pose(body, t) {
    const one = typeof body === "object" ? body : typeof body === "number" ? this.spec.bodies[body] : this.spec.bodies.find((each) => each.name === body);
    const p = one && this.motion.at(one.position, t), q = one && (one.attitude === null ? [1, 0, 0, 0] : this.motion.at(one.attitude, t));
    return p && q ? { p, q } : null;
  }

  /** The poses of a body's links at t, model by model. */
  links(body, t) {
    const pose = this.pose(body, t);
    return pose ? body.models.map((model) => kinematics(model, pose.p, pose.q, model.joints === null ? null : this.motion.at(model.joints, t))) : [];
  }

  /** How far solids reach from the origin of a body, m. */
  reach(body) {
    const pose = this.pose(body, this.motion.t[0]);
    if (!pose) return 0;
    const all = this.links(body, this.motion.t[0]).flatMap((poses, m) => poses.flatMap(([p, q], i) => body.models[m].links[i].shapes.map((shape) =>
      V.norm(V.sub(V.add(p, Q.rotate(q, shape.xyz)), pose.p)) + (shape.kind === "box" ? V.norm(shape.size) / 2 : shape.kind === "sphere" ? shape.size[0] : Math.hypot(Math.max(shape.size[0], shape.size[1]), shape.size[2] / 2)))));
    return Math.max(body.axes || 0, ...all);
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

  bodies(t, ghost, later, inside) {
    const draw = (shape, pose, thin = 1) => {
      // What can be seen through is drawn after everything else.
      const through = ghost || thin < 1 || (shape.rgba ? shape.rgba[3] : (ROLES[shape.role] || [0, 0, 0, 1])[3]) < 1;
      if (through) later.push(() => this.shape(shape, pose, ghost, thin)); else this.shape(shape, pose, ghost);
    };
    for (const body of this.spec.bodies) {
      // What all runs have in one place is drawn once.
      if (ghost && (body.once || body.fixed)) continue;
      this.links(body, t).forEach((poses, m) => body.models[m].links.forEach((link, i) => {
        for (const shape of link.shapes) draw(shape, poses[i], inside && this.shells.has(shape) ? 0.3 : 1);
      }));
    }
  }

  arrow(from, vector, colour, heads, unit) {
    const { gl } = this, length = V.norm(vector);
    if (length < 0.02 * unit) return;
    const u = V.unit(vector), turn = Q.fromZ(u), head = Math.min(0.14 * unit, 0.4 * length), r = 0.017 * unit;
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

/** True for a solid of a model's root that the pivot of a pendulum lies inside: of a moving link with a solid of the material `bob`. */
function encloses(model, shape) {
  const bob = model.links.find((link) => link.joint !== null && link.shapes.some((one) => one.role === "bob"));
  if (!bob || shape.kind === "sphere") return false;
  let p = bob.xyz;
  for (let at = bob.parent; at !== null; at = model.links[at].parent) p = V.add(model.links[at].xyz, p);
  const reach = shape.kind === "box" ? shape.size.map((x) => x / 2) : [shape.size[0], shape.size[0], shape.size[2] / 2];
  return V.sub(p, shape.xyz).every((x, i) => Math.abs(x) < reach[i]);
}
