// The 3-D playback: camera, layers, labels, read-off.
const SHOWS = [["inside", "Inside"], ["axes", "Axes"], ["paths", "Paths"], ["arrows", "Arrows"], ["labels", "Labels"]];

/** Axes for a picture that has `up` upwards: at zero yaw and pitch the eye stands behind, on the side of `back`. */
function standing(up) {
  const u = V.unit(up), x = Math.abs(u[0]) < 0.9 ? [1, 0, 0] : [0, 0, 1], right = V.unit(V.sub(x, V.scale(u, V.dot(u, x))));
  return { up: u, right, back: V.cross(right, u) };
}

class Player {
  constructor(parent) {
    this.stage = el("div", { class: "card stage", id: "stage" });
    this.canvas = el("canvas", { class: "gl", "aria-label": "3-D playback", tabindex: "0" });
    this.labels = el("canvas", { class: "labels" });
    this.hud = el("div", { class: "hud" }); this.scaleNote = el("div", { class: "scale" });
    this.stage.append(this.canvas, this.labels, this.hud, this.scaleNote);
    parent.append(this.stage);
    this.gl = new Renderer(this.canvas);
    this.scenes = RUNS.map((run, slot) => run.scene && run.motion && new Scene(this.gl, run, slot)).filter(Boolean);
    this.lead = this.scenes[0];
    this.ground = standing(this.lead.spec.up);
    this.gl.stand(this.ground);
    this.on = Object.fromEntries(SHOWS.map(([key]) => [key, true]));
    this.visible = this.scenes.map(() => true);
    this.frames = 0;
    this.measure();
    this.cameraButtons(); this.showButtons();
    this.preset(this.lead.spec.chosen ? this.lead.spec.cameras[0].name : "overview");
    this.listenToPointer();
    for (const signal of [clock, themeChanged]) signal.listen(() => this.request());
    new ResizeObserver(() => this.request()).observe(this.stage);
  }

  /** The motion has grown. */
  grow(motion) {
    for (const scene of this.scenes) { scene.motion.append(motion); scene.measure(); }
    this.measure();
    if (this.view.name && this.view.whole) { const { pan, yaw, pitch } = this.view; this.preset(this.view.name); Object.assign(this.view, { pan, yaw, pitch }); }
    this.request();
  }

  /** The extent of the motion with its bodies, and the scales of the arrows. */
  measure() {
    const each = this.scenes.flatMap((scene) => scene.spec.bodies.map((body) => ({ scene, body, reach: scene.reach(body), points: scene.motion.points(body.position).points })));
    const points = each.flatMap((one) => one.points);
    this.lo = [0, 1, 2].map((i) => points.reduce((lo, p) => Math.min(lo, p[i]), Infinity)); this.hi = [0, 1, 2].map((i) => points.reduce((hi, p) => Math.max(hi, p[i]), -Infinity));
    if (!points.length) [this.lo, this.hi] = [[0, 0, 0], [0, 0, 0]];
    this.reach = each.reduce((all, one) => Math.max(all, one.reach), 0);
    // The whole motion fits: the sphere around it, with most of the largest body at its edge.
    this.radius = Math.max(this.reach, 0.5 * V.norm(V.sub(this.hi, this.lo)) + 0.65 * this.reach) || 1;
    this.unit = this.radius / 3;
    const peaks = new Map();
    for (const { arrow, peak } of this.scenes.flatMap((scene) => scene.arrows)) peaks.set(arrow.label, Math.max(peaks.get(arrow.label) || 0, peak));
    this.arrowScale = new Map(this.lead.arrows.map(({ arrow }) => [arrow.label, peaks.get(arrow.label) > 0 ? (arrow.length === null ? 0.9 * this.unit : arrow.length) / peaks.get(arrow.label) : 0]));
    const mark = ([r, g, b], text, dashed) => el("span", {}, el("i", { class: dashed && "dashed", style: `border-color:rgb(${[r, g, b].map((x) => Math.round(255 * x))})` }), text);
    const arrows = this.lead.arrows.filter(({ arrow }) => this.arrowScale.get(arrow.label) > 0)
      .map(({ arrow }) => mark(this.tone(arrow.colour), `${arrow.label}, 1 m = ${show(Number((1 / this.arrowScale.get(arrow.label)).toPrecision(2)))}${arrow.unit === "1" ? "" : " " + arrow.unit}`));
    const paths = this.scenes.length === 1 ? this.lead.paths.filter(({ path }) => path.label).map(({ path }) => mark(this.tone(path.colour), path.label, path.dashed)) : [];
    this.scaleNote.replaceChildren(...arrows, ...paths);
  }

  tone(colour) { return colour || [0.55, 0.6, 0.68]; }

  cameraButtons() {
    const names = [["overview", "Overview"], ["side", "Side"], ["top", "Top"]], own = this.lead.spec.cameras.map((camera) => [camera.name, camera.title]);
    const first = this.lead.spec.chosen ? own.splice(0, 1) : [];
    this.cameras = el("div", { class: "cameras" }, ...[...first, ...names, ...own].map(([key, name]) => el("button", { "data-camera": key, onclick: () => this.preset(key) }, name[0].toUpperCase() + name.slice(1))));
    this.stage.append(this.cameras);
  }

  showButtons() {
    const toggle = (name, get, set, style) => {
      const button = el("button", { title: name, "aria-pressed": get(), onclick: () => { set(!get()); button.setAttribute("aria-pressed", get()); this.request(); } }, style ? el("span", { class: "swatch", style }) : "", name);
      return button;
    };
    const bodies = this.scenes.flatMap((scene) => scene.spec.bodies);
    const has = { inside: this.scenes.some((scene) => scene.shells.size), axes: bodies.some((body) => body.axes), paths: bodies.some((body) => body.paths.length), arrows: bodies.some((body) => body.arrows.length), labels: bodies.some((body) => body.label) };
    const runs = this.scenes.length > 1 ? this.scenes.map((s, i) => toggle(s.run.name, () => this.visible[i], (on) => { this.visible[i] = on; }, `background:var(--c${s.slot})`)) : [];
    this.stage.append(el("div", { class: "shows" }, ...runs, ...SHOWS.filter(([key]) => has[key]).map(([key, name]) => toggle(name, () => this.on[key], (on) => { this.on[key] = on; }))));
  }

  /** Cameras look at a point that may move with a body; only angles and distance are set by hand. */
  preset(name) {
    const camera = this.lead.spec.cameras.find((one) => one.name === name), all = V.scale(V.add(this.lo, this.hi), 0.5), distance = (0.94 * this.radius) / Math.sin(0.31);
    const whole = { follow: () => all, yaw: 0.5, pitch: 0.34, distance, on: null, ground: this.ground, whole: true };
    if (name === "side") Object.assign(whole, { yaw: 0, pitch: 0 });
    if (name === "top") Object.assign(whole, { yaw: 0, pitch: 1.45 });
    this.view = { ...whole, ...(camera && this.placed(camera, whole)), name, pan: [0, 0, 0] };
    for (const button of this.cameras.children) button.setAttribute("aria-pressed", button.dataset.camera === name);
    this.request();
  }

  /** What a camera of the scene changes of one that sees the whole. */
  placed(camera, whole) {
    if (camera.on !== null) return { on: camera.on, camera, follow: () => (this.lead.pose(camera.on, clock.t) || { p: [0, 0, 0] }).p, whole: false };
    const ground = camera.up ? standing(camera.up) : this.ground;
    let last = [0, 0, 0];
    const body = () => { const pose = this.lead.pose(camera.follow, clock.t); if (pose) last = pose.p; return last; };
    const follow = camera.follow !== null ? body : camera.towards ? () => camera.towards : whole.follow;
    if (!camera.at) return { ground, follow, distance: camera.follow === null ? whole.distance : 5 * this.reach || whole.distance, whole: camera.follow === null };
    const off = camera.follow !== null ? camera.at : V.sub(camera.at, follow()), distance = V.norm(off), d = V.unit(off);
    return { ground, follow, distance, pitch: Math.asin(Math.min(1, Math.max(-1, V.dot(d, ground.up)))), yaw: Math.atan2(-V.dot(d, ground.right), V.dot(d, ground.back)), whole: false };
  }

  camera() {
    const v = this.view, carrier = v.on !== null && this.lead.pose(v.on, clock.t);
    if (carrier) {
      const { at, towards, up } = v.camera, place = (x) => V.add(carrier.p, Q.rotate(carrier.q, x));
      return { eye: place(at || [0, 0, 0]), at: place(towards), up: Q.rotate(carrier.q, up), angle: 0.95 };
    }
    const { up, back, right } = v.ground, pitch = Math.min(1.5, Math.max(-1.5, v.pitch)), [cy, sy, cp, sp] = [Math.cos(v.yaw), Math.sin(v.yaw), Math.cos(pitch), Math.sin(pitch)];
    const out = V.add(V.scale(up, sp), V.add(V.scale(back, cp * cy), V.scale(right, -cp * sy))), at = V.add(v.follow(), v.pan);
    return { eye: V.add(at, V.scale(out, v.distance)), at, up, angle: 0.62 };
  }

  listenToPointer() {
    let last = null;
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); last = [event.clientX, event.clientY]; });
    this.canvas.addEventListener("pointerup", () => { last = null; });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]], v = this.view;
      last = [event.clientX, event.clientY];
      if (v.on !== null) return;
      if (event.shiftKey || event.buttons === 2) {
        const { eye, at, up } = this.camera(), z = V.unit(V.sub(eye, at)), x = V.unit(V.cross(up, z)), y = V.cross(z, x), k = v.distance * 0.0011;
        v.pan = V.add(v.pan, V.add(V.scale(x, -dx * k), V.scale(y, dy * k)));
      } else { v.yaw -= dx * 0.006; v.pitch = Math.min(1.5, Math.max(-1.5, v.pitch + dy * 0.006)); }
      this.request();
    });
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.view.whole = false;
      this.view.distance = Math.min(40 * this.unit, Math.max(0.01 * this.unit, this.view.distance * Math.exp(event.deltaY * 0.0012))); this.request();
    }, { passive: false });
  }

  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.draw(); });
  }

  draw() {
    const { gl } = this, dark = document.documentElement.dataset.theme === "dark", t = clock.t;
    const first = this.scenes[this.visible.indexOf(true)], camera = this.camera(), far = V.norm(V.sub(camera.eye, camera.at));
    // All of it from afar; from near only what the camera looks at, with finer shadows.
    const now = this.lead.spec.bodies.filter((body) => body.models.length).map((body) => this.lead.pose(body, t)).filter(Boolean).map((pose) => pose.p);
    const middle = V.scale(now.reduce((a, b) => V.add(a, b), [0, 0, 0]), 1 / (now.length || 1)), reach = now.reduce((all, p) => Math.max(all, V.norm(V.sub(p, middle))), 0) + (this.reach || this.unit);
    const near = this.view.distance * 0.7 < reach, radius = near ? Math.max(0.25 * this.unit, this.view.distance * 0.7) : reach;
    gl.shadows(near ? V.add(this.view.follow(), this.view.pan) : middle, Math.min(radius, reach), 2 * reach, () => first && first.bodies(t, null, [], this.on.inside));
    // What is near is seen as well as what is far: depth goes with the distance of the eye.
    gl.begin(camera, dark, Math.min(this.unit, far / 3 || this.unit));
    const later = [], tags = [];
    this.scenes.forEach((scene, i) => {
      if (!this.visible[i]) return;
      const tint = scene === first ? null : hexColour(colour(scene.slot));
      scene.bodies(t, tint, later, this.on.inside);
      if (this.on.paths) this.paths(scene, dark);
      if (this.on.arrows) this.arrows(scene, t);
      if (scene === first) this.axes(scene, t, tags);
    });
    for (const draw of later) draw();
    this.drawLabels(this.on.labels ? tags : []);
    this.readOff();
    this.frames += 1;
  }

  paths(scene, dark) {
    for (const { body, path, points, along, line } of scene.paths) {
      const base = this.scenes.length > 1 ? hexColour(colour(scene.slot)) : this.tone(path.colour), dash = path.dashed ? 0.5 : 0;
      if (line) { this.gl.drawLine(line, path.width, [...base, path.opacity], { rest: [...base, dark ? 0.28 : 0.35], now: clock.t, dash }); continue; }
      const from = lowerBound(along.length, (i) => along[i], clock.t - path.last), to = lowerBound(along.length, (i) => along[i], clock.t), here = scene.pose(body, clock.t);
      const trail = this.gl.line([...points.slice(from, to), ...(here ? [here.p] : [])], [...along.slice(from, to), clock.t]);
      this.gl.drawLine(trail, path.width, [...base, path.opacity], { dash });
      this.gl.forget(trail);
    }
  }

  arrows(scene, t) {
    for (const { body, arrow } of scene.arrows) {
      const pose = scene.pose(body, t), vector = scene.motion.at(arrow.of, t), scale = this.arrowScale.get(arrow.label);
      if (pose && vector && scale) scene.arrow(pose.p, V.scale(arrow.body ? Q.rotate(pose.q, vector) : vector, scale), [...this.tone(arrow.colour), 1], arrow.heads, arrow.length === null ? this.unit : arrow.length / 0.9);
    }
  }

  axes(scene, t, tags) {
    const drawn = scene.spec.bodies.map((body) => ({ body, pose: scene.pose(body, t) })).filter(({ pose }) => pose);
    for (const { body, pose } of drawn) {
      // The axes of something at rest give way to others that stand in the same place.
      if (body.fixed && body.axes && drawn.some((other) => other.body !== body && other.body.axes && V.norm(V.sub(other.pose.p, pose.p)) < 0.02 * this.unit)) continue;
      if (body.axes && this.on.axes) scene.frame([pose.p, pose.q], body.axes);
      if (body.label && (!body.axes || this.on.axes)) tags.push([body.label, V.add(pose.p, Q.rotate(pose.q, [(body.axes || 0) * 1.12, 0, 0]))]);
    }
  }

  drawLabels(tags) {
    const scale = window.devicePixelRatio || 1, canvas = this.labels, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = Math.round(w * scale); canvas.height = Math.round(h * scale);
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale); pen.font = "600 12px system-ui, sans-serif"; pen.textAlign = "center"; pen.textBaseline = "middle";
    pen.lineWidth = 3; pen.strokeStyle = cssVar("--space-2"); pen.fillStyle = cssVar("--hud");
    for (const [text, p] of tags) {
      const at = this.gl.project(p);
      if (at) { pen.strokeText(text, ...at); pen.fillText(text, ...at); }
    }
  }

  /** The buttons below say which run has which colour; a name in every row would leave no room for the scene. */
  readOff() {
    const rows = this.scenes.filter((_, i) => this.visible[i]).flatMap((scene) => scene.spec.distances.map(({ label, from, to }) => {
      const a = scene.pose(from, clock.t), b = scene.pose(to, clock.t), cells = [];
      if (a && b) {
        const d = V.norm(V.sub(a.p, b.p));
        cells.push(d < 0.1 ? `${(1000 * d).toFixed(2)} mm` : `${d.toFixed(3)} m`);
        if ([from, to].every((body) => scene.spec.bodies[body].attitude !== null)) {
          const r = Q.times([a.q[0], -a.q[1], -a.q[2], -a.q[3]], b.q);
          cells.push(`${(2 * Math.atan2(Math.hypot(r[1], r[2], r[3]), Math.abs(r[0])) * 180 / Math.PI).toFixed(3)}°`);
        }
      }
      const many = this.scenes.length > 1, name = el("td", {}, many ? el("span", { class: "swatch", style: `background:var(--c${scene.slot})` }) : "", label);
      return el("tr", {}, name, ...cells.map((cell) => el("td", {}, cell)));
    }));
    this.hud.replaceChildren(el("div", { class: "t" }, showTime(clock.t)), el("table", {}, ...rows));
  }
}

/** A CSS colour such as #0b66b3 as three numbers from 0 to 1. */
function hexColour(text) { return [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255); }
