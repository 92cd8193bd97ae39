// One panel of a figure: axes, curves, limits, marks, zoom and read-off. Curves are drawn once per change on one canvas; what
// follows the pointer and the clock is on another one above it.
const MARGIN = { left: 52, right: 12, top: 20, bottom: 24 };
const MARKS = { instant: "--soft", fault: "--bad", failure: "--bad", substitution: "--c3", restart: "--c4", checkpoint: "--c5", resume: "--c2", note: "--soft" };

function ticks(lo, hi, count) {
  const raw = (hi - lo) / Math.max(1, count);
  if (!(raw > 0) || !Number.isFinite(raw)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const out = [];
  for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + step * 1e-9 && out.length < 200; k++) out.push(k * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (step / power === 2.5 ? 1 : 0));
  const size = Math.max(Math.abs(lo), Math.abs(hi));
  const label = size < 1e-3 || size >= 1e5
    ? (v) => (v === 0 ? "0" : v.toExponential(1).replace("e-", "e−").replace("-", "−"))
    : (v) => (v === 0 ? 0 : v).toFixed(Math.min(8, digits)).replace("-", "−");
  return out.map((v) => [v, label(v)]);
}

/** The marks of the runs with these numbers, each once. */
function marksOf(runs) {
  const seen = new Set();
  return runs.flatMap((r) => RUNS[r].marks || []).filter((mark) => {
    const key = `${mark.t} ${mark.text}`;
    return !seen.has(key) && seen.add(key);
  });
}

class Chart {
  /** `shared` carries what the panels of one figure have in common: axis, limits, logarithmic or not, the panels. */
  constructor(parent, shared, series, name) {
    this.shared = shared; this.series = series;
    this.marks = shared.against ? [] : marksOf([...new Set(series.flatMap((s) => (s.run === undefined ? [] : [s.run])))]);
    this.box = el("div", { class: "panel" });
    this.base = el("canvas"); this.over = el("canvas", { class: "over" });
    this.box.append(this.base, this.over);
    this.tip = el("div", { class: "tip", hidden: true });
    this.box.append(this.tip);
    parent.append(name ? el("div", {}, el("div", { class: "name" }, name), this.box) : this.box);
    this.hover = null; this.drag = null; this.seen = false; this.stale = true;
    new ResizeObserver(() => { this.hover = null; this.invalidate(); }).observe(this.box);
    new IntersectionObserver(([entry]) => { this.seen = entry.isIntersecting; if (this.seen) this.refresh(); }, { rootMargin: "200px" })
      .observe(this.box);
    range.listen(() => this.invalidate());
    themeChanged.listen(() => this.invalidate());
    for (const signal of [clock, cursors]) signal.listen(() => { if (this.seen) this.drawOver(); });
    this.listenToPointer();
  }

  /** Ends of the whole run, s. */
  whole() {
    let lo = Infinity, hi = -Infinity;
    for (const s of this.series) if (s.length) { lo = Math.min(lo, s.t(0)); hi = Math.max(hi, s.t(s.length - 1)); }
    return [lo, hi];
  }

  /** The instants that are shown. */
  span() { return range.lo === null ? this.shared.whole() : [range.lo, range.hi]; }

  /** Calls `f` with the series and the number of each point that is shown, and of the neighbours outside. */
  each(f) {
    const [lo, hi] = this.span();
    for (const s of this.series) {
      if (!s.visible) continue;
      const from = Math.max(0, s.from(lo) - 1);
      for (let k = from; k < s.length && (k === from || s.t(k - 1) <= hi); k++) f(s, k);
    }
  }

  /** What the horizontal axis shows. */
  xRange() {
    if (!this.shared.against) return this.span();
    let lo = Infinity, hi = -Infinity;
    for (const panel of this.shared.panels) panel.each((s, k) => { const x = s.x(k); if (x < lo) lo = x; if (x > hi) hi = x; });
    if (!(lo <= hi)) return [0, 1];
    const pad = lo === hi ? Math.abs(lo) * 0.1 || 1 : (hi - lo) * 0.04;
    return [lo - pad, hi + pad];
  }

  /** Least and greatest visible value of this panel. */
  extent() {
    let min = Infinity, max = -Infinity, positive = Infinity;
    this.each((s, k) => {
      const y = s.y[k];
      if (y < min) min = y;
      if (y > max) max = y;
      const size = Math.abs(y);
      if (size > 0 && size < positive) positive = size;
    });
    return [min, max, positive];
  }

  yRange() {
    let min = Infinity, max = -Infinity, positive = Infinity;
    for (const panel of this.shared.panels) {
      const [a, b, p] = panel.extent();
      min = Math.min(min, a); max = Math.max(max, b); positive = Math.min(positive, p);
    }
    if (!(min <= max)) [min, max] = [0, 1];
    if (this.shared.log) {
      this.unit = [1, bestScale(this.shared.axis.scales, 1)[1]];
      const top = Math.log10(Math.max(Math.abs(min), Math.abs(max), 1e-300));
      const bottom = Number.isFinite(positive) ? Math.max(Math.log10(positive), top - 9) : top - 1;
      return [Math.floor(bottom * 4) / 4, Math.ceil(top * 4 + 1e-9) / 4 + 1e-6];
    }
    // A limit belongs into the view when the curves come near it; far away it would flatten them.
    const peak = Math.max(Math.abs(min), Math.abs(max));
    this.near = this.shared.limits.filter((limit) => Math.abs(limit.y) <= 4 * peak);
    for (const { y } of this.near) { min = Math.min(min, y); max = Math.max(max, y); }
    this.unit = bestScale(this.shared.axis.scales, Math.max(Math.abs(min), Math.abs(max)));
    if (min === max) { const pad = Math.abs(min) * 0.1 || 1; min -= pad; max += pad; }
    const pad = (max - min) * 0.06;
    return [min - pad, max + pad];
  }

  invalidate() { this.stale = true; if (this.seen) this.refresh(); }

  refresh() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; if (this.stale) this.draw(); this.drawOver(); });
  }

  fit(canvas) {
    const scale = printing() ? 3 : window.devicePixelRatio || 1, { clientWidth: w, clientHeight: h } = this.box;
    if (canvas.width !== Math.round(w * scale) || canvas.height !== Math.round(h * scale)) {
      canvas.width = Math.round(w * scale); canvas.height = Math.round(h * scale);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, w, h);
    return pen;
  }

  draw() {
    this.stale = false;
    this.paint(this.fit(this.base), this.box.clientWidth, this.box.clientHeight);
  }

  /** The panel as it is on the screen, with whatever takes strokes as a canvas does. */
  paint(pen, w, h) {
    const [x0, x1] = this.xRange(), [y0, y1] = this.yRange(), log = this.shared.log, { against, axis } = this.shared;
    const width = w - MARGIN.left - MARGIN.right, height = h - MARGIN.top - MARGIN.bottom;
    this.toX = (x) => MARGIN.left + ((x - x0) / (x1 - x0)) * width;
    this.fromX = (px) => x0 + ((px - MARGIN.left) / width) * (x1 - x0);
    const linear = (y) => MARGIN.top + (1 - (y - y0) / (y1 - y0)) * height;
    this.toY = log ? (y) => linear(Math.log10(Math.max(Math.abs(y), 1e-300))) : linear;
    const [factor, unit] = this.unit, [along, alongUnit] = against ? bestScale(against.scales, Math.max(Math.abs(x0), Math.abs(x1))) : [1, "s"];

    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1; pen.fillStyle = cssVar("--soft"); pen.strokeStyle = cssVar("--grid");
    pen.textAlign = "left"; pen.textBaseline = "top";
    const words = [unit && (/^10/.test(unit) ? "× " + unit : unit), axis.frame && `in ${axis.frame}`].filter(Boolean).join(" ");
    pen.fillText(words, 8, 3);
    pen.textAlign = "center";
    const line = (ax, ay, bx, by) => { pen.beginPath(); pen.moveTo(ax, ay); pen.lineTo(bx, by); pen.stroke(); };
    const xTicks = ticks(x0 / along, x1 / along, width / 90), below = against ? `${against.name} [${alongUnit || "1"}]` : null;
    xTicks.forEach(([x, label], i) => {
      const px = this.toX(x * along);
      line(px, MARGIN.top, px, MARGIN.top + height);
      if (!below || px < MARGIN.left + width - pen.measureText(below).width - 20) pen.fillText(i === xTicks.length - 1 && !below ? label + " s" : label, px, MARGIN.top + height + 6);
    });
    if (below) { pen.textAlign = "right"; pen.fillText(below, MARGIN.left + width, MARGIN.top + height + 6); }
    pen.textAlign = "right"; pen.textBaseline = "middle";
    const yTicks = axis.names.length ? axis.names.filter(({ value }) => value >= y0 && value <= y1).map(({ name, value }) => [value, name]) : log
      ? ticks(y0, y1, 5).filter(([v]) => Math.abs(v - Math.round(v)) < 1e-9).map(([v]) => [v, "1e" + String(Math.round(v)).replace("-", "−")])
      : ticks(y0 / factor, y1 / factor, height / 34).map(([y, label]) => [y * factor, label]);
    for (const [y, label] of yTicks) {
      const py = linear(y);
      line(MARGIN.left, py, MARGIN.left + width, py);
      pen.fillText(label, MARGIN.left - 7, py, MARGIN.left - 9);
    }
    this.paintMarks(pen, width, height);

    pen.save();
    pen.beginPath(); pen.rect(MARGIN.left, MARGIN.top, width, height); pen.clip();
    if (!log && y0 < 0 && y1 > 0) { pen.strokeStyle = cssVar("--line"); line(MARGIN.left, linear(0), MARGIN.left + width, linear(0)); }
    if (!log) this.paintLimits(pen, linear, width, height);
    pen.lineJoin = "round";
    for (const s of this.series) if (s.visible) this.paintCurve(pen, s);
    pen.restore();
    pen.strokeStyle = cssVar("--line"); pen.lineWidth = 1; pen.strokeRect(MARGIN.left + 0.5, MARGIN.top + 0.5, width - 1, height - 1);
  }

  paintMarks(pen, width, height) {
    let free = MARGIN.left + Math.max(0, pen.measureText("10⁻³ m/s in N").width - 40);
    pen.textBaseline = "top";
    for (const mark of this.marks) {
      const px = this.toX(mark.t);
      if (!(px >= MARGIN.left - 0.5 && px <= MARGIN.left + width + 0.5)) continue;
      pen.strokeStyle = pen.fillStyle = cssVar(MARKS[mark.kind] || "--soft");
      pen.globalAlpha = 0.55; pen.setLineDash(mark.kind === "instant" ? [1, 3] : [4, 3]);
      pen.beginPath(); pen.moveTo(px, MARGIN.top - 3); pen.lineTo(px, MARGIN.top + height); pen.stroke();
      pen.setLineDash([]); pen.globalAlpha = 1;
      const text = mark.kind === "instant" ? mark.text : mark.kind, wide = pen.measureText(text).width, left = Math.min(px - wide / 2, MARGIN.left + width - wide);
      if (left > free) { pen.textAlign = "left"; pen.fillText(text, left, 3); free = left + wide + 8; }
    }
    pen.fillStyle = cssVar("--soft");
  }

  paintLimits(pen, linear, width, height) {
    pen.strokeStyle = pen.fillStyle = cssVar("--limit"); pen.setLineDash([6, 4]); pen.lineWidth = 1.2;
    const right = MARGIN.left + width, words = (limit) => {
      const both = this.shared.limits.some((other) => other.y === -limit.y && limit.y !== 0);
      return `${limit.text} ${both ? "±" : ""}${quantity(both ? Math.abs(limit.y) : limit.y, this.shared.axis)}`;
    };
    for (const { y } of this.near) { pen.beginPath(); pen.moveTo(MARGIN.left, linear(y)); pen.lineTo(right, linear(y)); pen.stroke(); }
    pen.setLineDash([]); pen.lineWidth = 1; pen.textAlign = "right";
    // In words where there is room: limits that lie close together are named once.
    let last = -Infinity;
    for (const limit of [...this.near].sort((a, b) => b.y - a.y)) {
      const py = linear(limit.y);
      if (py - last < 14 || (limit.y < 0 && this.near.some((other) => other.y === -limit.y))) continue;
      pen.textBaseline = py > MARGIN.top + height - 16 ? "bottom" : "top";
      pen.fillText(words(limit), right - 5, py + (pen.textBaseline === "top" ? 3 : -3));
      last = py;
    }
    const hidden = [...new Set(this.shared.limits.filter((limit) => !this.near.includes(limit)).map(words))];
    if (hidden.length) { pen.textBaseline = "bottom"; pen.fillText(`${hidden.slice(0, 2).join(", ")}${hidden.length > 2 ? ", …" : ""}: outside the view`, right - 5, MARGIN.top + height - 3); }
  }

  paintCurve(pen, s) {
    const [lo, hi] = this.span();
    pen.strokeStyle = colour(s.slot);
    pen.lineWidth = 1.6;
    pen.setLineDash(s.dash || []);
    pen.beginPath();
    let up = true, level = 0;
    for (let k = Math.max(0, s.from(lo) - 1); k < s.length; k++) {
      const x = s.x(k), y = s.y[k];
      if (Number.isFinite(y) && Number.isFinite(x)) {
        const px = this.toX(x), py = this.toY(y);
        if (up) pen.moveTo(px, py);
        else { if (s.step && !s.along) pen.lineTo(px, level); pen.lineTo(px, py); }
        up = false; level = py;
      } else up = true;
      if (s.t(k) > hi) break;
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  /** Draws now, whether the figure has been scrolled to or not: paper shows everything. */
  print() { this.draw(); }

  drawOver() {
    if (!this.toX) return;
    const pen = this.fit(this.over), h = this.box.clientHeight, { against } = this.shared;
    const top = MARGIN.top, bottom = h - MARGIN.bottom, left = MARGIN.left, right = this.box.clientWidth - MARGIN.right;
    const line = (x) => { if (x >= left && x <= right) { pen.beginPath(); pen.moveTo(x, top); pen.lineTo(x, bottom); pen.stroke(); } };
    if (this.drag && this.drag.from !== undefined) {
      pen.fillStyle = cssVar("--accent"); pen.globalAlpha = 0.16;
      pen.fillRect(this.drag.from, top, this.drag.to - this.drag.from, bottom - top);
      pen.globalAlpha = 1;
    }
    pen.lineWidth = 1; pen.strokeStyle = cssVar("--accent"); pen.globalAlpha = 0.65;
    if (against) this.points(pen, clock.t, 4); else line(this.toX(clock.t));
    pen.globalAlpha = 1;
    if (!against && cursors.a !== null) {
      pen.strokeStyle = pen.fillStyle = cssVar("--ink"); pen.font = "600 11px system-ui, sans-serif"; pen.textAlign = "center"; pen.textBaseline = "bottom";
      for (const [name, t] of [["A", cursors.a], ["B", cursors.b]]) {
        const x = this.toX(t);
        line(x);
        if (x >= left && x <= right) pen.fillText(name, x + 8, bottom - 2);
      }
    }
    if (this.hover === null) { this.tip.hidden = true; return; }
    pen.lineWidth = 1; pen.strokeStyle = cssVar("--soft"); pen.setLineDash([3, 3]);
    if (!against) line(this.toX(this.hover));
    pen.setLineDash([]);
    this.points(pen, this.hover, 3);
    this.readOff();
  }

  /** A dot on every curve at an instant. */
  points(pen, t, size) {
    for (const s of this.series) {
      if (!s.visible || !s.length) continue;
      const k = s.nearest(t);
      pen.fillStyle = colour(s.slot);
      pen.beginPath(); pen.arc(this.toX(s.step && !s.along ? t : s.x(k)), this.toY(s.y[k]), size, 0, 7); pen.fill();
    }
  }

  readOff() {
    const rows = this.series.filter((s) => s.visible && s.length).map((s) => {
      const y = s.y[s.nearest(this.hover)];
      const name = el("span", {}, el("span", { class: "swatch", style: `background:${colour(s.slot)}` }), s.name);
      return el("div", {}, name, el("b", { "data-value": y }, quantity(y, this.shared.axis)));
    });
    const near = this.marks.filter((mark) => Math.abs(this.toX(mark.t) - this.toX(this.hover)) < 5);
    this.tip.replaceChildren(el("div", {}, el("b", {}, `t = ${show(this.hover)} s`)), ...rows,
      ...near.slice(0, 4).map((mark) => el("p", { class: "mark" }, mark.kind === "instant" ? mark.text : `${mark.kind}: ${mark.text}`)));
    this.tip.hidden = false;
    const x = this.shared.against ? this.pointer : this.toX(this.hover), wide = this.tip.offsetWidth, room = this.box.clientWidth;
    this.tip.style.left = Math.max(0, Math.min(room - wide, x + 14 + wide > room ? x - wide - 12 : x + 12)) + "px";
    this.tip.style.top = MARGIN.top + 6 + "px";
  }

  /** The instant under the pointer: that of a sample, not of a pixel. */
  instant(px, py) {
    const s = this.series.find((one) => one.visible && one.length);
    if (!s) return this.fromX(px);
    if (!this.shared.against) return s.t(s.nearest(this.fromX(px)));
    let best = 0, least = Infinity;
    for (let k = 0; k < s.length; k++) {
      const d = Math.hypot(this.toX(s.x(k)) - px, this.toY(s.y[k]) - py);
      if (d < least) { least = d; best = k; }
    }
    return s.t(best);
  }

  listenToPointer() {
    const place = (event) => { const box = this.box.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    const inside = (px) => Math.min(this.box.clientWidth - MARGIN.right, Math.max(MARGIN.left, px)), { against } = this.shared;
    this.box.addEventListener("pointermove", (event) => {
      if (!this.toX) return;
      const [px, py] = place(event);
      this.pointer = px; this.hover = this.instant(inside(px), py);
      if (this.drag && this.drag.cursor) cursors.set(...(this.drag.cursor === "a" ? [this.hover, cursors.b] : [cursors.a, this.hover]));
      else if (this.drag) this.drag.to = inside(px);
      this.drawOver();
    });
    this.box.addEventListener("pointerleave", () => { this.hover = null; this.drawOver(); });
    this.box.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !this.toX) return;
      this.box.setPointerCapture(event.pointerId);
      const px = inside(place(event)[0]), near = (t) => !against && t !== null && Math.abs(this.toX(t) - px) < 7;
      this.drag = near(cursors.a) ? { cursor: "a" } : near(cursors.b) ? { cursor: "b" } : { from: px, to: px };
    });
    this.box.addEventListener("pointerup", (event) => {
      if (!this.drag) return;
      const { from, to, cursor } = this.drag; this.drag = null;
      if (cursor) return;
      if (Math.abs(to - from) <= 6) clock.set(against ? this.instant(...place(event)) : this.fromX(from));
      else if (!against) range.set(this.fromX(Math.min(from, to)), this.fromX(Math.max(from, to)));
      this.drawOver();
    });
    this.box.addEventListener("dblclick", () => range.set(null, null));
    this.box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey || !this.toX || against) return;
      event.preventDefault();
      const [lo, hi] = this.xRange(), [a, b] = this.shared.whole(), t = this.fromX(inside(place(event)[0])), f = Math.exp(event.deltaY * 0.0015);
      const next = [Math.max(a, t - (t - lo) * f), Math.min(b, t + (hi - t) * f)];
      if (next[0] <= a && next[1] >= b) range.set(null, null); else range.set(...next);
    }, { passive: false });
  }
}
