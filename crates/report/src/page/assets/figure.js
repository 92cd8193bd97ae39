// A figure: heading, legend, its panels, what is measured between the cursors, and what it is saved as.

/** One panel, or one for each run where the curves of all would be a thicket, and below them what the runs differ by. */
class Figure {
  constructor(parent, spec) {
    this.spec = spec;
    this.series = seriesOf(spec.id);
    const count = (r) => this.series.filter((s) => s.run === r).length, runs = [...new Set(this.series.map((s) => s.run))];
    this.apart = RUNS.length > 1 && Math.max(...runs.map(count), 0) > 1;
    this.dress(this.series);
    this.shared = this.share(spec.limits);
    this.below = this.share([]);
    this.legend = el("div", { class: "legend" });
    this.measured = el("div", { class: "measured", hidden: true });
    const panels = el("div", { class: "panels" }), differences = el("div", { class: "panels differences" });
    const origins = [...new Set(this.series.map((s) => s.origin))].join("\n");
    this.card = el("article", { class: "card figure" + (this.apart ? " wide" : ""), id: spec.id },
      el("div", { class: "bar" }, el("h3", { title: origins }, spec.title), this.tools()), this.legend, panels, differences, this.measured);
    parent.append(this.card);
    const groups = this.apart ? runs.map((r) => [RUNS[r].name, this.series.filter((s) => s.run === r)]) : [["", this.series]];
    this.shared.panels = groups.map(([name, list]) => new Chart(panels, this.shared, list, name));
    this.subtract(differences);
    this.fillLegend();
    themeChanged.listen(() => { this.fillLegend(); this.measure(); });
    for (const signal of [cursors, range]) signal.listen(() => this.measure());
    this.measure();
  }

  /** What panels with one vertical axis share. */
  share(limits) {
    const shared = { axis: this.spec, against: this.spec.against, log: false, panels: [], limits: limits || [] };
    shared.whole = () => {
      const all = this.shared.panels.map((p) => p.whole()), lo = Math.min(...all.map((a) => a[0])), hi = Math.max(...all.map((a) => a[1]));
      return lo < hi ? [lo, hi] : [Number.isFinite(lo) ? lo : 0, (Number.isFinite(lo) ? lo : 0) + 1];
    };
    return shared;
  }

  /** Colours, dashes and names. */
  dress(list) {
    const own = new Map();
    for (const s of list) {
      const slot = own.get(s.run) || 0;
      own.set(s.run, slot + 1);
      s.slot = RUNS.length > 1 && !this.apart ? s.run : slot;
      s.name = this.apart ? s.label : [RUNS.length > 1 ? RUNS[s.run].name : "", s.label].filter(Boolean).join(" ");
      // Curves beyond the last colour take the first ones again, dotted.
      s.dash = s.slot >= COLOURS ? [2, 2] : !this.apart && s.run > 0 ? [6, 3] : null;
    }
  }

  /** Each run less the first one, with an axis of its own. */
  subtract(parent) {
    this.differences = RUNS.flatMap((run, r) => ((run.differences || {})[this.spec.id] || []).map((raw) => new Series(raw, r)));
    if (!this.differences.length) return parent.remove();
    this.dress(this.differences);
    for (const s of this.differences) s.name = [s.label, RUNS.length > 2 && !this.apart ? RUNS[s.run].name : ""].filter(Boolean).join(" ") || "difference";
    const runs = [...new Set(this.differences.map((s) => s.run))];
    const groups = this.apart ? runs.map((r) => [`${RUNS[r].name} less ${RUNS[0].name}`, this.differences.filter((s) => s.run === r)])
      : [[runs.length > 1 ? `less ${RUNS[0].name}` : `${RUNS[runs[0]].name} less ${RUNS[0].name}`, this.differences]];
    this.below.panels = groups.map(([name, list]) => new Chart(parent, this.below, list, name));
  }

  tools() {
    const log = el("button", { title: "Logarithmic axis", "aria-pressed": "false", onclick: () => {
      this.shared.log = !this.shared.log; log.setAttribute("aria-pressed", this.shared.log); this.invalidate();
    } }, "log");
    const save = (name, title, what) => el("button", { title, "data-save": name, onclick: what }, name), id = this.spec.id;
    return el("div", { class: "tools" }, log,
      save("PNG", "Save this figure as a picture of pixels", () => this.picture().toBlob((blob) => download(`${id}.png`, blob))),
      save("SVG", "Save this figure as a picture of lines", () => download(`${id}.svg`, this.svg(), "image/svg+xml")),
      save("CSV", "Save the points of this figure in the time that is shown", () => download(`${id}.csv`, this.csv(), "text/csv")));
  }

  fillLegend() {
    const entries = new Map();
    for (const s of this.series) {
      const key = this.apart ? s.label : s.name;
      if (key) entries.set(key, [...(entries.get(key) || []), s]);
    }
    // The heading says what a curve alone is.
    this.legend.replaceChildren(...[...entries].map(([name, list]) => {
      const dash = !list[0].dash ? "solid" : list[0].slot >= COLOURS ? "dotted" : "dashed";
      const entry = el("span", { title: "Show or hide", onclick: () => {
        const on = !list[0].visible;
        for (const s of [...list, ...this.differences.filter((d) => this.apart && d.label === name)]) s.visible = on;
        entry.classList.toggle("off", !on); this.invalidate(); this.measure();
      } }, el("i", { style: `border-top-color:${colour(list[0].slot)};border-top-style:${dash}` }), name);
      entry.classList.toggle("off", !list[0].visible);
      return entry;
    }));
  }

  invalidate() { for (const panel of [...this.shared.panels, ...this.below.panels]) panel.invalidate(); }

  /** Statistics between the two cursors. */
  measure() {
    this.measured.hidden = cursors.a === null || !!this.spec.against;
    if (this.measured.hidden) return;
    const lo = Math.min(cursors.a, cursors.b), hi = Math.max(cursors.a, cursors.b), visible = this.series.filter((s) => s.visible && s.length);
    const told = visible.map((s) => s.statistics(lo, hi)), peak = Math.max(0, ...told.flatMap((one) => (one ? [Math.abs(one.min), Math.abs(one.max)] : [])));
    const [factor, unit] = bestScale(this.spec.scales, peak), value = (y) => el("td", { "data-value": y }, show(Number((y / factor).toPrecision(4))));
    const exact = this.series.every((s) => s.whole);
    const rows = visible.map((s, i) => {
      const a = s.y[s.nearest(cursors.a)], b = s.y[s.nearest(cursors.b)];
      const name = el("td", {}, el("span", { class: "swatch", style: `background:${colour(s.slot)}` }), [this.apart ? RUNS[s.run].name : "", s.name].filter(Boolean).join(" "));
      return el("tr", {}, name, value(a), value(b), value(b - a), ...(told[i] ? [told[i].min, told[i].max, told[i].mean, told[i].rms].map(value) : [el("td", { colspan: 4 }, "no sample")]));
    });
    const head = [/^10/.test(unit) ? "× " + unit : unit, "A", "B", "B − A", "min", "max", exact ? "mean" : "mean ≈", exact ? "rms" : "rms ≈"].map((name) => el("th", {}, name));
    this.measured.replaceChildren(el("table", {}, el("thead", {}, el("tr", {}, ...head)), el("tbody", {}, ...rows)));
  }

  csv() { return table([...this.series], this.spec.unit, this.shared.panels[0].span()); }

  /** Heading, legend and panels as they are on the screen, drawn on `pen` from the left upper corner on; gives the height. */
  compose(pen, width, paint) {
    const entries = [...this.legend.children].filter((entry) => !entry.classList.contains("off")), [left, end] = [MARGIN.left, width];
    let x = left, y = 38;
    pen.font = "11px system-ui, sans-serif";
    const places = entries.map((entry) => {
      const wide = 36 + pen.measureText(entry.textContent).width;
      if (x > left && x + wide > end) { x = left; y += 16; }
      x += wide;
      return [x - wide, y];
    });
    const named = this.shared.panels.length > 1 ? 18 : 0, top = (entries.length ? y + 12 : 26) + named;
    if (!paint) return [top, named];
    pen.fillStyle = cssVar("--ink"); pen.font = "600 13px system-ui, sans-serif"; pen.textAlign = "left"; pen.textBaseline = "alphabetic";
    pen.fillText(this.spec.signal ? `${this.spec.group}.${this.spec.title}` : this.spec.title, 10, 18);
    pen.font = "11px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.lineWidth = 2;
    entries.forEach((entry, i) => {
      const [ex, ey] = places[i], line = entry.firstChild.style;
      pen.strokeStyle = line.borderTopColor; pen.setLineDash({ solid: [], dashed: [5, 3], dotted: [2, 2] }[line.borderTopStyle]);
      pen.beginPath(); pen.moveTo(ex, ey); pen.lineTo(ex + 16, ey); pen.stroke();
      pen.fillStyle = cssVar("--soft"); pen.fillText(entry.textContent, ex + 21, ey);
    });
    pen.setLineDash([]);
    return [top, named];
  }

  picture() {
    const [first] = this.shared.panels, scale = window.devicePixelRatio || 1, { width, height } = first.base;
    const canvas = el("canvas", { width: this.shared.panels.length * width }), pen = canvas.getContext("2d");
    const [top, named] = this.compose(pen, canvas.width / scale, false);
    canvas.height = Math.round(top * scale) + height;
    pen.fillStyle = cssVar("--card"); pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.scale(scale, scale);
    this.compose(pen, canvas.width / scale, true);
    this.shared.panels.forEach((panel, i) => {
      if (named) pen.fillText(panel.series[0] ? RUNS[panel.series[0].run].name : "", (i * width) / scale + MARGIN.left, top - named / 2);
      pen.drawImage(panel.base, (i * width) / scale, top, width / scale, height / scale);
    });
    return canvas;
  }

  svg() {
    const width = this.shared.panels[0].box.clientWidth || 480, height = this.shared.panels[0].box.clientHeight || 225, all = this.shared.panels.length * width;
    const pen = new SvgPen(all, height), [top, named] = this.compose(pen, all, false);
    pen.height = Math.ceil(top + height);
    pen.fillStyle = cssVar("--card"); pen.fillRect(0, 0, all, pen.height);
    this.compose(pen, all, true);
    this.shared.panels.forEach((panel, i) => {
      if (named) pen.fillText(panel.series[0] ? RUNS[panel.series[0].run].name : "", i * width + MARGIN.left, top - named / 2);
      pen.offset = [i * width, top];
      panel.paint(pen, width, height);
      pen.offset = [0, 0];
    });
    return pen.text();
  }
}

/** The fields of all streams, with a search; a figure is made when it is first shown. */
class Signals {
  constructor(body, specs, alone) {
    this.specs = specs; this.made = new Map(); this.groups = new Map(); this.more = FIRST;
    this.search = el("input", { type: "search", placeholder: `Search ${specs.length} signals`, "aria-label": "Search the signals by participant, port, field or unit", spellcheck: "false", oninput: () => { this.more = FIRST; this.fill(); } });
    this.count = el("span", { class: "note" });
    this.ports = el("div", { class: "ports" }, ...[...new Set(specs.map((spec) => spec.group))].map((group) => el("button", { "data-port": group, onclick: () => {
      this.search.value = this.search.value === group + "." ? "" : group + "."; this.more = FIRST; this.fill();
    } }, group)));
    this.grids = el("div", {});
    this.next = el("button", { onclick: () => { this.more += FIRST; this.fill(); } });
    body.append(el("div", { class: "search" }, this.search, this.count), this.ports, this.grids, el("p", {}, this.next));
    // After figures that the scenario selects, the fields are hidden until they are requested.
    this.eager = alone;
    this.fill();
  }

  /** All words must be found in what names the signal. */
  matching() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const text = (spec) => `${spec.id} ${spec.unit} ${spec.frame}`.toLowerCase();
    return words.length || this.eager ? this.specs.filter((spec) => words.every((word) => text(spec).includes(word))) : [];
  }

  fill() {
    const all = this.matching(), shown = new Set(all.slice(0, this.more));
    for (const spec of shown) this.make(spec);
    for (const [spec, figure] of this.made) figure.card.hidden = !shown.has(spec);
    for (const { box, specs } of this.groups.values()) box.hidden = !specs.some((spec) => shown.has(spec));
    for (const button of this.ports.children) button.setAttribute("aria-pressed", this.search.value === button.dataset.port + ".");
    this.count.textContent = all.length ? `${Math.min(shown.size, all.length)} of ${this.specs.length}` : this.search.value ? "nothing has that name" : "";
    this.next.hidden = shown.size >= all.length;
    this.next.textContent = `Show ${Math.min(FIRST, all.length - shown.size)} more`;
  }

  make(spec) {
    if (this.made.has(spec)) return this.made.get(spec);
    if (!this.groups.has(spec.group)) {
      const grid = el("div", { class: "figures" }), box = el("div", { class: "port" }, el("h3", {}, spec.group), grid);
      this.groups.set(spec.group, { box, grid, specs: this.specs.filter((one) => one.group === spec.group) });
      // In the order of the streams, whatever is asked for first.
      const order = [...new Set(this.specs.map((one) => one.group))].filter((group) => this.groups.has(group));
      this.grids.replaceChildren(...order.map((group) => this.groups.get(group).box));
    }
    const { grid, specs } = this.groups.get(spec.group), figure = new Figure(grid, spec);
    const behind = specs.slice(specs.indexOf(spec) + 1).find((one) => this.made.has(one));
    if (behind) grid.insertBefore(figure.card, this.made.get(behind).card);
    this.made.set(spec, figure);
    window.escapement.figures[spec.id] = figure;
    return figure;
  }
}

/** The number of signals that are shown before the reader requests more. */
const FIRST = 24;
