// One panel of a figure: axes, curves, limits, zoom and read-off. Curves are drawn once per change on one canvas; what
// follows the pointer and the clock is on another one above it.
const MARGIN = { left: 52, right: 12, top: 8, bottom: 24 };

function ticks(lo, hi, count) {
  const raw = (hi - lo) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const out = [];
  for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + step * 1e-9; k++) out.push(k * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (step / power === 2.5 ? 1 : 0));
  const label = Math.max(Math.abs(lo), Math.abs(hi)) < 1e-3 || Math.max(Math.abs(lo), Math.abs(hi)) >= 1e5
    ? (v) => (v === 0 ? "0" : v.toExponential(1).replace("e-", "e−").replace("-", "−"))
    : (v) => (v === 0 ? 0 : v).toFixed(Math.min(8, digits)).replace("-", "−");
  return out.map((v) => [v, label(v)]);
}

class Chart {
  /** `shared` carries what the panels of one figure have in common: unit, limits, logarithmic or not, the panels. */
  constructor(parent, shared, series, name) {
    this.shared = shared; this.series = series;
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
    clock.listen(() => { if (this.seen) this.drawOver(); });
    this.listenToPointer();
  }

  /** Ends of the whole run, s. */
  whole() {
    let lo = Infinity, hi = -Infinity;
    for (const s of this.series) if (s.length) { lo = Math.min(lo, s.x(0)); hi = Math.max(hi, s.x(s.length - 1)); }
    return lo < hi ? [lo, hi] : [0, 1];
  }

  xRange() { return range.lo === null ? this.shared.whole() : [range.lo, range.hi]; }

  /** Least and greatest visible value of this panel. */
  extent() {
    const [lo, hi] = this.xRange();
    let min = Infinity, max = -Infinity, positive = Infinity;
    for (const s of this.series) {
      if (!s.visible) continue;
      const from = Math.max(0, lowerBound(s.length, (i) => s.x(i), lo) - 1);
      for (let k = from; k < s.length && (k === from || s.x(k - 1) <= hi); k++) {
        const y = s.y[k];
        if (y < min) min = y;
        if (y > max) max = y;
        const size = Math.abs(y);
        if (size > 0 && size < positive) positive = size;
      }
    }
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
      const top = Math.log10(Math.max(Math.abs(min), Math.abs(max), 1e-300));
      const bottom = Number.isFinite(positive) ? Math.max(Math.log10(positive), top - 9) : top - 1;
      return [Math.floor(bottom * 4) / 4, Math.ceil(top * 4 + 1e-9) / 4 + 1e-6];
    }
    // A limit belongs into the view when the curves come near it; far away it would flatten them.
    const peak = Math.max(Math.abs(min), Math.abs(max));
    this.shared.limitsDrawn = this.shared.limits.filter((limit) => limit <= 4 * peak);
    for (const limit of this.shared.limitsDrawn) { min = Math.min(min, -limit); max = Math.max(max, limit); }
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
    const pen = this.fit(this.base), { clientWidth: w, clientHeight: h } = this.box;
    const [x0, x1] = this.xRange(), [y0, y1] = this.yRange();
    const log = this.shared.log;
    const width = w - MARGIN.left - MARGIN.right, height = h - MARGIN.top - MARGIN.bottom;
    this.toX = (x) => MARGIN.left + ((x - x0) / (x1 - x0)) * width;
    this.fromX = (px) => x0 + ((px - MARGIN.left) / width) * (x1 - x0);
    const linear = (y) => MARGIN.top + (1 - (y - y0) / (y1 - y0)) * height;
    this.toY = log ? (y) => linear(Math.log10(Math.max(Math.abs(y), 1e-300))) : linear;

    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1; pen.fillStyle = cssVar("--soft"); pen.strokeStyle = cssVar("--grid");
    pen.textAlign = "center"; pen.textBaseline = "top";
    const line = (ax, ay, bx, by) => { pen.beginPath(); pen.moveTo(ax, ay); pen.lineTo(bx, by); pen.stroke(); };
    const xTicks = ticks(x0, x1, width / 90);
    xTicks.forEach(([x, label], i) => {
      const px = this.toX(x);
      line(px, MARGIN.top, px, MARGIN.top + height);
      pen.fillText(i === xTicks.length - 1 ? label + " s" : label, px, MARGIN.top + height + 6);
    });
    pen.textAlign = "right"; pen.textBaseline = "middle";
    const yTicks = log
      ? ticks(y0, y1, 5).filter(([v]) => Math.abs(v - Math.round(v)) < 1e-9).map(([v]) => [v, "1e" + String(Math.round(v)).replace("-", "−")])
      : ticks(y0, y1, height / 34);
    for (const [y, label] of yTicks) {
      const py = linear(y);
      line(MARGIN.left, py, MARGIN.left + width, py);
      pen.fillText(label, MARGIN.left - 7, py);
    }

    pen.save();
    pen.beginPath(); pen.rect(MARGIN.left, MARGIN.top, width, height); pen.clip();
    if (!log && y0 < 0 && y1 > 0) { pen.strokeStyle = cssVar("--line"); line(MARGIN.left, linear(0), MARGIN.left + width, linear(0)); }
    if (!log) this.drawLimits(pen, linear, width);
    pen.lineJoin = "round";
    for (const s of this.series) if (s.visible) this.drawCurve(pen, s, x0, x1);
    pen.restore();
    pen.strokeStyle = cssVar("--line"); pen.strokeRect(MARGIN.left + 0.5, MARGIN.top + 0.5, width - 1, height - 1);
  }

  drawLimits(pen, linear, width) {
    pen.strokeStyle = pen.fillStyle = cssVar("--limit"); pen.setLineDash([6, 4]); pen.lineWidth = 1.2;
    for (const limit of this.shared.limitsDrawn || []) {
      for (const y of [limit, -limit]) {
        pen.beginPath(); pen.moveTo(MARGIN.left, linear(y)); pen.lineTo(MARGIN.left + width, linear(y)); pen.stroke();
      }
    }
    pen.setLineDash([]); pen.lineWidth = 1;
    // One line in words: the others look the same.
    const [first] = this.shared.limitsDrawn || [];
    if (first !== undefined) {
      pen.textAlign = "right"; pen.textBaseline = "top";
      pen.fillText(this.shared.limitsDrawn.length > 1 ? "limits" : `limit ${show(first)} ${this.shared.unit}`, MARGIN.left + width - 5, linear(Math.max(...this.shared.limitsDrawn)) + 3);
    }
    const hidden = this.shared.limits.filter((limit) => !this.shared.limitsDrawn.includes(limit));
    if (hidden.length) {
      pen.textAlign = "right"; pen.textBaseline = "bottom";
      const text = hidden.map(show).join(", ");
      pen.fillText(`limit ±${text} ${this.shared.unit}, outside the view`, MARGIN.left + width - 5, MARGIN.top + this.box.clientHeight - MARGIN.top - MARGIN.bottom - 3);
    }
  }

  drawCurve(pen, s, x0, x1) {
    pen.strokeStyle = colour(s.slot);
    pen.lineWidth = 1.6;
    pen.setLineDash(s.dash || []);
    pen.beginPath();
    const from = Math.max(0, lowerBound(s.length, (i) => s.x(i), x0) - 1);
    let up = true;
    for (let k = from; k < s.length; k++) {
      const x = s.x(k), y = s.y[k];
      if (Number.isFinite(y)) {
        if (up) pen.moveTo(this.toX(x), this.toY(y)); else pen.lineTo(this.toX(x), this.toY(y));
        up = false;
      } else up = true;
      if (x > x1) break;
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  /** Now, whether anybody has scrolled here yet or not: paper shows everything. */
  print() { this.draw(); }

  drawOver() {
    if (!this.toX) return;
    const pen = this.fit(this.over), h = this.box.clientHeight;
    const top = MARGIN.top, bottom = h - MARGIN.bottom, left = MARGIN.left, right = this.box.clientWidth - MARGIN.right;
    const line = (x) => { if (x >= left && x <= right) { pen.beginPath(); pen.moveTo(x, top); pen.lineTo(x, bottom); pen.stroke(); } };
    if (this.drag) {
      pen.fillStyle = cssVar("--accent"); pen.globalAlpha = 0.16;
      pen.fillRect(this.drag.from, top, this.drag.to - this.drag.from, bottom - top);
      pen.globalAlpha = 1;
    }
    pen.lineWidth = 1; pen.strokeStyle = cssVar("--accent"); pen.globalAlpha = 0.65;
    line(this.toX(clock.t));
    pen.globalAlpha = 1;
    if (this.hover === null) { this.tip.hidden = true; return; }
    pen.lineWidth = 1; pen.strokeStyle = cssVar("--soft"); pen.setLineDash([3, 3]);
    line(this.toX(this.hover)); pen.setLineDash([]);
    const rows = [];
    for (const s of this.series) {
      if (!s.visible || !s.length) continue;
      const k = s.nearest(this.hover);
      pen.fillStyle = colour(s.slot);
      pen.beginPath(); pen.arc(this.toX(s.x(k)), this.toY(s.y[k]), 3, 0, 7); pen.fill();
      const name = el("span", {}, el("span", { class: "swatch", style: `background:${colour(s.slot)}` }), s.name);
      rows.push(el("div", {}, name, el("b", {}, `${show(s.y[k])}${this.shared.unit === "1" ? "" : " " + this.shared.unit}`)));
    }
    this.tip.replaceChildren(el("div", {}, el("b", {}, `t = ${show(this.hover)} s`)), ...rows);
    this.tip.hidden = false;
    const x = this.toX(this.hover), wide = this.tip.offsetWidth;
    this.tip.style.left = (x + 14 + wide > this.box.clientWidth ? x - wide - 12 : x + 12) + "px";
    this.tip.style.top = MARGIN.top + 6 + "px";
  }

  listenToPointer() {
    const at = (event) => event.clientX - this.box.getBoundingClientRect().left;
    const inside = (px) => Math.min(this.box.clientWidth - MARGIN.right, Math.max(MARGIN.left, px));
    this.box.addEventListener("pointermove", (event) => {
      if (!this.toX) return;
      // The instant read off is that of a sample, not of a pixel.
      const t = this.fromX(inside(at(event))), s = this.series.find((one) => one.visible && one.length);
      this.hover = s ? s.x(s.nearest(t)) : t;
      if (this.drag) this.drag.to = inside(at(event));
      this.drawOver();
    });
    this.box.addEventListener("pointerleave", () => { this.hover = null; this.drawOver(); });
    this.box.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !this.toX) return;
      this.box.setPointerCapture(event.pointerId);
      this.drag = { from: inside(at(event)), to: inside(at(event)) };
    });
    this.box.addEventListener("pointerup", () => {
      if (!this.drag) return;
      const { from, to } = this.drag; this.drag = null;
      if (Math.abs(to - from) > 6) range.set(this.fromX(Math.min(from, to)), this.fromX(Math.max(from, to)));
      else clock.set(this.fromX(from));
    });
    this.box.addEventListener("dblclick", () => range.set(null, null));
    this.box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey || !this.toX) return;
      event.preventDefault();
      const [lo, hi] = this.xRange(), [a, b] = this.shared.whole(), t = this.fromX(inside(at(event))), f = Math.exp(event.deltaY * 0.0015);
      const next = [Math.max(a, t - (t - lo) * f), Math.min(b, t + (hi - t) * f)];
      if (next[0] <= a && next[1] >= b) range.set(null, null); else range.set(...next);
    }, { passive: false });
  }
}

/** A figure with its heading, legend and one panel, or one panel per run where the curves of all would be a thicket. */
class Figure {
  constructor(parent, spec) {
    this.spec = spec;
    const lists = RUNS.map((run) => (run.figures[spec.id] || []));
    const most = Math.max(...lists.map((list) => list.length));
    const apart = RUNS.length > 1 && most > 1;
    this.series = lists.flatMap((list, run) => list.map((raw, slot) => new Series(raw, run, RUNS.length > 1 && !apart ? run : slot)));
    for (const s of this.series) {
      s.name = apart ? s.label : [RUNS.length > 1 ? RUNS[s.run].name : "", s.label].filter(Boolean).join(" ");
      if (!apart && s.run > 0) s.dash = [6, 3];
      // Curves beyond the last colour take the first ones again, dotted.
      if (s.slot >= COLOURS) s.dash = [2, 2];
    }
    const limits = RUNS.map((run) => run.limits[spec.id] || []).reduce((a, b) => (a.length >= b.length ? a : b), []);
    this.shared = {
      unit: spec.unit, log: false, panels: [], limits: [...new Set(limits.map(Math.abs))],
      whole: () => { const all = this.shared.panels.map((p) => p.whole()); return [Math.min(...all.map((a) => a[0])), Math.max(...all.map((a) => a[1]))]; },
    };
    const log = el("button", { title: "Logarithmic axis", "aria-pressed": "false", onclick: () => {
      this.shared.log = !this.shared.log; log.setAttribute("aria-pressed", this.shared.log); this.invalidate();
    } }, "log");
    const save = el("button", { title: "Save this figure as a PNG picture", onclick: () => this.save() }, "PNG");
    const origins = [...new Set(this.series.map((s) => s.origin))].join("\n");
    this.legend = el("div", { class: "legend" });
    const panels = el("div", { class: "panels" });
    this.card = el("article", { class: "card figure" + (apart ? " wide" : ""), id: spec.id },
      el("div", { class: "bar" }, el("h3", { title: origins }, this.heading()), el("div", { class: "tools" }, log, save)),
      this.legend, panels);
    parent.append(this.card);
    const groups = apart ? RUNS.map((run, r) => [run.name, this.series.filter((s) => s.run === r)]) : [["", this.series]];
    this.shared.panels = groups.filter(([, list]) => list.length).map(([name, list]) => new Chart(panels, this.shared, list, name));
    this.fillLegend(apart);
    themeChanged.listen(() => this.fillLegend(apart));
  }

  fillLegend(apart) {
    const entries = new Map();
    for (const s of this.series) {
      const key = apart ? s.label : s.name;
      if (key) entries.set(key, [...(entries.get(key) || []), s]);
    }
    this.legend.replaceChildren(...[...entries].map(([name, list]) => {
      const dash = !list[0].dash ? "solid" : list[0].slot >= COLOURS ? "dotted" : "dashed";
      const entry = el("span", { title: "Show or hide", onclick: () => {
        const on = !list[0].visible;
        for (const s of list) s.visible = on;
        entry.classList.toggle("off", !on); this.invalidate();
      } }, el("i", { style: `border-top-color:${colour(list[0].slot)};border-top-style:${dash}` }), name);
      entry.classList.toggle("off", !list[0].visible);
      return entry;
    }));
  }

  heading() { return this.spec.title + (this.spec.unit === "1" ? "" : ` [${this.spec.unit}]`); }

  invalidate() { for (const panel of this.shared.panels) panel.invalidate(); }

  /** Heading, legend and panels as they are on the screen, as a picture of its own. */
  picture() {
    const [first] = this.shared.panels, scale = window.devicePixelRatio || 1, { width, height } = first.base;
    const entries = [...this.legend.children].filter((entry) => !entry.classList.contains("off"));
    const canvas = el("canvas", { width: this.shared.panels.length * width }), pen = canvas.getContext("2d");
    const small = `${11 * scale}px system-ui, sans-serif`, left = MARGIN.left * scale;
    pen.font = small;
    let x = left, y = 38 * scale;
    const places = entries.map((entry) => {
      const wide = 36 * scale + pen.measureText(entry.textContent).width;
      if (x > left && x + wide > canvas.width) { x = left; y += 16 * scale; }
      x += wide;
      return [x - wide, y];
    });
    const named = this.shared.panels.length > 1 ? 18 * scale : 0, top = (entries.length ? y + 12 * scale : 26 * scale) + named;
    canvas.height = top + height;
    pen.fillStyle = cssVar("--card"); pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = cssVar("--ink"); pen.font = `600 ${13 * scale}px system-ui, sans-serif`;
    pen.fillText(this.heading(), 10 * scale, 18 * scale);
    pen.font = small; pen.fillStyle = cssVar("--soft"); pen.textBaseline = "middle"; pen.lineWidth = 2 * scale;
    entries.forEach((entry, i) => {
      const [ex, ey] = places[i], line = entry.firstChild.style;
      pen.strokeStyle = line.borderTopColor; pen.setLineDash(line.borderTopStyle === "solid" ? [] : line.borderTopStyle === "dashed" ? [5 * scale, 3 * scale] : [2 * scale, 2 * scale]);
      pen.beginPath(); pen.moveTo(ex, ey); pen.lineTo(ex + 16 * scale, ey); pen.stroke();
      pen.fillText(entry.textContent, ex + 21 * scale, ey);
    });
    this.shared.panels.forEach((panel, i) => {
      if (named) pen.fillText(panel.series[0] ? RUNS[panel.series[0].run].name : "", i * width + left, top - named / 2);
      pen.drawImage(panel.base, i * width, top);
    });
    return canvas;
  }

  save() {
    this.picture().toBlob((blob) => {
      const url = URL.createObjectURL(blob);
      el("a", { href: url, download: `${this.spec.id}.png` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 1000);
    });
  }
}
