// The 3-D playback: camera, layers, labels, read-off.
const SHOWS = [["inside", "Tank and slosh", true], ["frames", "Frames", true], ["paths", "Paths", true], ["arrows", "Thrust and torque", true], ["labels", "Labels", true]];
const PATHS = { p_NE: [0.16, 0.62, 0.98], p_ND: [0.98, 0.72, 0.22], p_NB: [0.55, 0.6, 0.68] };
const ARROWS = { force: [0.98, 0.62, 0.16, 1], torque: [0.74, 0.42, 0.96, 1] };

class Player {
  constructor(parent) {
    this.stage = el("div", { class: "card stage", id: "stage" });
    this.canvas = el("canvas", { class: "gl", "aria-label": "3-D playback", tabindex: "0" });
    this.labels = el("canvas", { class: "labels" });
    this.hud = el("div", { class: "hud" }); this.scaleNote = el("div", { class: "scale" });
    this.stage.append(this.canvas, this.labels, this.hud, this.scaleNote);
    parent.append(this.stage);
    this.gl = new Renderer(this.canvas);
    this.scenes = RUNS.map((run, slot) => run.motion && new Scene(this.gl, run, slot)).filter(Boolean);
    this.on = Object.fromEntries(SHOWS.map(([key, , on]) => [key, on]));
    this.visible = this.scenes.map(() => true);
    this.frames = 0;
    this.measure();
    this.cameraButtons(); this.showButtons();
    this.preset("overview");
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

  /** The extent of the motion, and the scales of the arrows. */
  measure() {
    const points = this.scenes.flatMap((s) => ["p_NB", "p_NE", "p_NT"].flatMap((name) => s.motion.points(name)));
    this.lo = [0, 1, 2].map((i) => Math.min(...points.map((p) => p[i]), Infinity)); this.hi = [0, 1, 2].map((i) => Math.max(...points.map((p) => p[i]), -Infinity));
    const peak = (key) => Math.max(...this.scenes.map((s) => s[key]), 0) || 1;
    this.arrowScale = { force: 0.9 / peak("forcePeak"), torque: 0.9 / peak("torquePeak") };
    const mark = ([r, g, b], text, dashed) => el("span", {}, el("i", { class: dashed && "dashed", style: `border-color:rgb(${[r, g, b].map((x) => Math.round(255 * x))})` }), text);
    const part = (key, unit, name) => (this.scenes.some((s) => s[key + "Peak"] > 0)
      ? [mark(ARROWS[key], `${name}, 1 m = ${show(Number((1 / this.arrowScale[key]).toPrecision(2)))} ${unit}`)] : []);
    const path = (name, text, dashed) => (this.scenes.length === 1 && this.scenes[0].motion.has(name) ? [mark(PATHS[name], text, dashed)] : []);
    this.scaleNote.replaceChildren(...part("force", "N", "base force"), ...part("torque", "N m", "base torque"), ...path("p_NE", "path of the tool"), ...path("p_ND", "commanded", true));
  }

  cameraButtons() {
    const names = { overview: "Overview", side: "Side", top: "Top", approach: "Approach", grasp: "Grasp point", tool: "Tool camera" };
    this.cameras = el("div", { class: "cameras" }, ...Object.entries(names).map(([key, name]) => el("button", { "data-camera": key, onclick: () => this.preset(key) }, name)));
    this.stage.append(this.cameras);
  }

  showButtons() {
    const toggle = (name, get, set, style) => {
      const button = el("button", { "aria-pressed": get(), onclick: () => { set(!get()); button.setAttribute("aria-pressed", get()); this.request(); } }, style ? el("span", { class: "swatch", style }) : "", name);
      return button;
    };
    const runs = this.scenes.length > 1 ? this.scenes.map((s, i) => toggle(s.run.name, () => this.visible[i], (on) => { this.visible[i] = on; }, `background:var(--c${s.slot})`)) : [];
    this.stage.append(el("div", { class: "shows" }, ...runs, ...SHOWS.map(([key, name]) => toggle(name, () => this.on[key], (on) => { this.on[key] = on; }))));
  }

  state() { return this.scenes[0].state(clock.t); }

  /** Cameras look at a point that moves with the scene; only angles and distance are set by hand. */
  preset(name) {
    const s = this.state(), span = Math.max(2.4, ...[0, 1, 2].map((i) => this.hi[i] - this.lo[i]));
    const grasp = () => { const now = this.state(); return now.p_NG || now.p_NE || now.p_NB || [0, 0, 0]; };
    // The whole motion fits: the sphere around it, and a metre for the bodies themselves.
    const all = V.scale(V.add(this.lo, this.hi), 0.5), fit = (0.5 * V.norm(V.sub(this.hi, this.lo)) + 1.35) / Math.sin(0.31);
    const presets = {
      overview: { follow: () => all, yaw: 0.5, pitch: 0.34, distance: 0.94 * fit },
      side: { follow: () => all, yaw: 0, pitch: 0, distance: 0.94 * fit },
      top: { follow: () => all, yaw: 0, pitch: 1.45, distance: 0.94 * fit },
      approach: { follow: () => (s.p_NT ? this.state().p_NT : grasp()), yaw: 1.0, pitch: 0.44, distance: 1.8 * span + 1.4 },
      grasp: { follow: grasp, yaw: 0.62, pitch: 0.22, distance: 1.5 },
      tool: { tool: true, follow: grasp, yaw: 0, pitch: 0, distance: 1 },
    };
    this.view = { name, pan: [0, 0, 0], whole: ["overview", "side", "top"].includes(name), ...presets[name] };
    for (const button of this.cameras.children) button.setAttribute("aria-pressed", button.dataset.camera === name);
    this.request();
  }

  camera() {
    const v = this.view, s = this.state(), angle = 0.62;
    if (v.tool && s.p_NE && s.quat_NE) {
      const eye = V.add(s.p_NE, Q.rotate(s.quat_NE, [0.16, 0, -0.42]));
      return { eye, at: V.add(s.p_NE, Q.rotate(s.quat_NE, [0, 0, 0.7])), up: Q.rotate(s.quat_NE, [1, 0, 0]), angle: 0.95 };
    }
    // Up is +x and right is +z at zero yaw: the approach of the stock scenarios runs along z, from left to right.
    const [cy, sy, cp, sp] = [Math.cos(v.yaw), Math.sin(v.yaw), Math.cos(v.pitch), Math.sin(v.pitch)];
    const back = [sp, cp * cy, -cp * sy], at = V.add(v.follow(), v.pan);
    return { eye: V.add(at, V.scale(back, v.distance)), at, up: [1, 0, 0], angle };
  }

  listenToPointer() {
    let last = null;
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); last = [event.clientX, event.clientY]; });
    this.canvas.addEventListener("pointerup", () => { last = null; });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]], v = this.view;
      last = [event.clientX, event.clientY];
      if (v.tool) return;
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
      this.view.distance = Math.min(40, Math.max(0.25, this.view.distance * Math.exp(event.deltaY * 0.0012))); this.request();
    }, { passive: false });
  }

  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.draw(); });
  }

  draw() {
    const { gl } = this, dark = document.documentElement.dataset.theme === "dark";
    gl.dark = dark;
    const lead = this.scenes[this.visible.indexOf(true)];
    // All of it from afar; from near only what the camera looks at, with finer shadows.
    const now = this.state(), ends = [now.p_NB, now.p_NT].filter(Boolean), reach = 2.9 + (ends[1] ? 0.5 * V.norm(V.sub(ends[0], ends[1])) : 0);
    const near = this.view.distance * 0.7 < reach, middle = near ? V.add(this.view.follow(), this.view.pan) : V.scale(ends.reduce((a, b) => V.add(a, b), [0, 0, 0]), 1 / (ends.length || 1));
    gl.shadows(middle, near ? Math.max(0.8, this.view.distance * 0.7) : reach, 2 * reach, () => lead && lead.bodies(lead.state(clock.t), null, [], this.on.inside));
    gl.begin(this.camera(), dark);
    const later = [], tags = [];
    this.scenes.forEach((scene, i) => {
      if (!this.visible[i]) return;
      const s = scene.state(clock.t), first = i === this.visible.indexOf(true);
      const tint = first ? null : hexColour(colour(scene.slot));
      scene.bodies(s, tint, later, this.on.inside);
      if (this.on.paths) this.paths(scene, dark);
      if (this.on.arrows) this.arrows(scene, s);
      if (this.on.frames && first) this.axes(scene, s, tags);
    });
    for (const draw of later) draw();
    this.drawLabels(this.on.labels ? tags : []);
    this.readOff();
    this.frames += 1;
  }

  paths(scene, dark) {
    const many = this.scenes.length > 1;
    for (const { name, line } of scene.paths) {
      const base = many ? hexColour(colour(scene.slot)) : PATHS[name];
      const bright = [...base, name === "p_NB" ? 0.55 : 1], dim = [...base, dark ? 0.28 : 0.35];
      this.gl.drawLine(line, name === "p_NE" ? 3 : 2, bright, { rest: dim, now: clock.t, dash: name === "p_ND" ? 0.5 : 0 });
    }
  }

  arrows(scene, s) {
    for (const [key, heads] of [["force", 1], ["torque", 2]]) {
      const vector = s[key] || s["command_" + key];
      if (vector && s.p_NB) scene.arrow(s.p_NB, V.scale(Q.rotate(s.quat_NB || [1, 0, 0, 0], vector), this.arrowScale[key]), ARROWS[key], heads);
    }
  }

  axes(scene, s, tags) {
    const poses = { N: [[0, 0, 0], [1, 0, 0, 0], 0.3], B: [s.p_NB, s.quat_NB, 0.75], E: [s.p_NE, s.quat_NE, 0.18], G: [s.p_NG, s.quat_NG, 0.18], T: [s.p_NT, s.quat_NT, 0.75] };
    for (const [name, [p, q, length]] of Object.entries(poses)) {
      if (!p || !q || (name === "N" && s.p_NT && V.norm(s.p_NT) < 0.05)) continue;
      scene.frame([p, q], length);
      tags.push([name, V.add(p, Q.rotate(q, [length * 1.12, 0, 0]))]);
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

  readOff() {
    const rows = this.scenes.filter((_, i) => this.visible[i]).map((scene) => {
      const s = scene.state(clock.t), cells = [];
      if (s.p_NE && s.p_NG) {
        const d = V.norm(V.sub(s.p_NE, s.p_NG));
        cells.push(d < 0.1 ? `${(1000 * d).toFixed(2)} mm` : `${d.toFixed(3)} m`);
      }
      if (s.quat_NE && s.quat_NG) {
        const [a, b] = [s.quat_NE, s.quat_NG], r = Q.times([a[0], -a[1], -a[2], -a[3]], b);
        cells.push(`${(2 * Math.atan2(Math.hypot(r[1], r[2], r[3]), Math.abs(r[0])) * 180 / Math.PI).toFixed(3)}°`);
      }
      const name = el("td", {}, this.scenes.length > 1 ? el("span", { class: "swatch", style: `background:var(--c${scene.slot})` }) : "", this.scenes.length > 1 ? scene.run.name : "tool to grasp point");
      return el("tr", {}, name, ...cells.map((cell) => el("td", {}, cell)));
    });
    this.hud.replaceChildren(el("div", { class: "t" }, showTime(clock.t)), el("table", {}, ...rows));
  }
}

/** A CSS colour such as #0b66b3 as three numbers from 0 to 1. */
function hexColour(text) { return [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255); }
