// The page: what stands where, and what a script may look at.
function logo() {
  const teeth = 12, out = [];
  for (let i = 0; i < teeth; i++) {
    const at = (k, r) => { const a = (2 * Math.PI * (i + k)) / teeth; return `${(r * Math.sin(a)).toFixed(2)} ${(-r * Math.cos(a)).toFixed(2)}`; };
    out.push(`${i ? "L" : "M"}${at(0, 10.6)} L${at(0.12, 10.6)} L${at(0.22, 7.4)} L${at(0.8, 7.4)}`);
  }
  document.getElementById("logo").setAttribute("d", out.join(" ") + "Z");
}

function section(id, title) {
  const body = el("section", { id }, el("h2", {}, title));
  document.getElementById("main").append(body);
  // What stands behind the # is the state of the page, not a place on it.
  const go = (event) => { event.preventDefault(); body.scrollIntoView({ behavior: "smooth" }); };
  document.getElementById("nav").append(el("a", { href: "#" + id, onclick: go }, title));
  return body;
}

/** How each run ended, in a word. */
function verdicts() {
  const many = RUNS.length > 1;
  const chips = RUNS.map((run, i) => {
    const row = DATA.summary.find((one) => one.verdict), met = row ? row.met[i] : run.met;
    if (met === null || met === undefined) return null;
    const word = row ? (met ? "" : "not ") + row.label.toLowerCase() : run.outcome;
    return el("span", { class: "verdict " + (met ? "yes" : "no") }, `${many ? run.name + ": " : ""}${word}`);
  });
  return chips.some(Boolean) ? el("div", { class: "verdicts" }, ...chips) : null;
}

function summaryCard(motion) {
  const rows = DATA.summary.filter((row) => row.main && !row.verdict), chips = verdicts();
  if (!rows.length && !chips) return null;
  const many = RUNS.length > 1, card = el("div", { class: "card summary", id: "summary" }, motion ? el("h2", {}, "Result") : null, chips);
  if (rows.length) card.append(summaryTable(rows));
  if (!many) card.append(el("div", { class: "origin" }, ...RUNS.map((run) => el("p", { class: "note" },
    [run.title, run.started && run.started.replace("T", " ").replace(/:\d\dZ$/, " UTC")].filter(Boolean).join(" · ")))));
  return card;
}

function summaryTable(rows) {
  const many = RUNS.length > 1;
  const head = el("tr", {}, el("th", {}, ""), ...RUNS.map((run, i) => el("th", {}, el("span", { class: "swatch", style: `background:var(--c${i % COLOURS})` }), run.name)), el("th", {}, ""));
  const body = rows.map((row) => el("tr", { "data-key": row.key },
    el("td", { title: row.key }, row.label, row.criterion ? el("small", {}, row.criterion) : ""),
    ...row.values.map((value, i) => el("td", {}, row.met[i] === null ? "" : el("span", { class: "mark " + (row.met[i] ? "yes" : "no") }, row.met[i] ? "✓" : "✗"), value.replace(/-/g, "−"))),
    el("td", { class: "unit" }, row.unit)));
  return el("table", {}, many ? el("thead", {}, head) : null, el("tbody", {}, ...body));
}

/** The parts of the wall time: colour and name. */
const PARTS = { computing: "var(--c0)", outside: "var(--grid)", "the clock": "color-mix(in srgb, var(--c7) 55%, transparent)", "the recorder": "color-mix(in srgb, var(--c4) 70%, transparent)", "room at a reader": "color-mix(in srgb, var(--c3) 65%, transparent)", input: "color-mix(in srgb, var(--c1) 70%, transparent)" };

function timesCard(run) {
  const sum = (p) => p.computing_s + p.outside_s + p.waiting.reduce((a, [, s]) => a + s, 0), total = Math.max(...run.participants.map(sum), 1e-12);
  const time = (s) => quantity(Number(s.toPrecision(3)), { scales: [{ exponent: -6, name: "µs" }, { exponent: -3, name: "ms" }, { exponent: 0, name: "s" }] });
  const rows = run.participants.map((p) => {
    const bar = (seconds, kind, name) => el("i", { "data-seconds": seconds, style: `width:${(100 * seconds) / total}%;background:${PARTS[kind]}`, title: `${name}: ${time(seconds)}` });
    const waits = p.waiting.filter(([, s]) => s > 0), waited = waits.reduce((all, [, s]) => all + s, 0);
    return el("div", { class: "row" }, el("span", {}, p.name),
      el("span", { class: "track" }, bar(p.computing_s, "computing", "computing"), ...waits.map(([on, s]) => bar(s, on in PARTS ? on : "input", "waiting for " + on)),
        p.outside_s > 0 ? bar(p.outside_s, "outside", "before its first step and after its last one") : null),
      el("span", {}, `${time(p.computing_s)} computing, ${time(waited)} waiting`));
  });
  const words = { computing: "computing", input: "waiting for a sample", "room at a reader": "for room at a reader", "the recorder": "for the recorder", "the clock": "for the clock", outside: "before its first step and after its last" };
  const legend = el("div", { class: "legend keys" }, ...Object.entries(words).map(([kind, text]) => el("span", {}, el("i", { style: `background:${PARTS[kind]}` }), text)));
  return el("div", { class: "card" }, el("h3", {}, `${RUNS.length > 1 ? run.name + ": w" : "W"}all time of each participant, ${time(total)} in all`), legend, el("div", { class: "times" }, ...rows));
}

/** The keys of the scenarios that are not the same in all runs. */
function differencesCard() {
  const head = el("tr", {}, el("th", {}, ""), ...RUNS.map((run, i) => el("th", {}, el("span", { class: "swatch", style: `background:var(--c${i % COLOURS})` }), run.name)));
  const rows = DATA.differences.map((row) => el("tr", { "data-key": row.key }, el("td", {}, el("code", {}, row.key)), ...row.values.map((value) => el("td", {}, value || "—"))));
  return el("div", { class: "card scroll" }, rows.length ? el("table", { class: "texts" }, el("thead", {}, head), el("tbody", {}, ...rows)) : el("p", { class: "note" }, "The scenarios are the same."));
}

function about() {
  const body = section("about", "About");
  for (const run of RUNS) {
    const card = el("div", { class: "card", style: "margin-bottom:1rem" }, el("h3", {}, run.name),
      run.digest ? el("p", { class: "note" }, "Tape ", el("code", {}, run.digest), run.sealed ? "" : " (the run ended before its tape was finished)") : null);
    for (const note of run.notes) card.append(el("p", { class: "note" }, note));
    if (run.events.length) card.append(el("table", { class: "events" }, ...run.events.map((event) => el("tr", {},
      el("td", {}, event.time), el("td", {}, event.kind), el("td", {}, event.participant || ""), el("td", { style: "text-align:left" }, event.text)))));
    if (run.plan) card.append(el("details", {}, el("summary", {}, "Plan"), el("pre", {}, run.plan)));
    body.append(card);
  }
  body.append(el("p", { class: "note" }, "Figures: drag to zoom, double-click to see all, click to move the clock, Ctrl and scroll to zoom around the pointer; cursors can be dragged. "
    + "Playback: drag to turn, scroll to approach, Shift and drag to move. A curve with more samples than it may have points shows the least and greatest sample of each of up to 2048 intervals; "
    + "means between the cursors are then those of the points (≈). Geometry without visuals in the model is drawn from its kinematics and inertias."));
}

function transport() {
  const at = (id) => document.getElementById(id), scrub = at("scrub"), marks = marksOf(RUNS.map((_, r) => r));
  at("transport").hidden = false;
  const bounds = () => {
    scrub.min = clock.start; scrub.max = clock.end;
    at("marks").replaceChildren(...marks.filter((mark) => mark.t >= clock.start && mark.t <= clock.end).map((mark) => el("button", {
      style: `left:${(100 * (mark.t - clock.start)) / (clock.end - clock.start || 1)}%;background:var(${MARKS[mark.kind] || "--soft"})`, "data-kind": mark.kind,
      title: `${show(mark.t)} s, ${mark.kind === "instant" ? mark.text : `${mark.kind}: ${mark.text}`}`, "aria-label": `Go to ${mark.text}`, onclick: () => clock.set(mark.t) })));
  };
  bounds();
  clock.bounds = bounds;
  clock.listen(() => {
    if (document.activeElement !== scrub || clock.playing) scrub.value = clock.t;
    at("play").textContent = clock.playing ? "⏸" : "▶"; at("now").textContent = showTime(clock.t);
    if (!clock.playing) link.write();
  });
  range.listen(() => { at("unzoom").hidden = range.lo === null; link.write(); });
  cursors.listen(() => { at("cursors").setAttribute("aria-pressed", cursors.a !== null); link.write(); });
  at("unzoom").hidden = range.lo === null; at("cursors").setAttribute("aria-pressed", cursors.a !== null);
  clock.tell();
}

/** What belongs to the page whatever it shows. */
function controls() {
  const at = (id) => document.getElementById(id), scrub = at("scrub");
  scrub.addEventListener("input", () => clock.set(Number(scrub.value)));
  at("play").addEventListener("click", () => clock.play(!clock.playing));
  const step = (by) => { clock.play(false); clock.set(clock.t + by); };
  at("back").addEventListener("click", () => step(-0.1)); at("ahead").addEventListener("click", () => step(0.1));
  at("unzoom").addEventListener("click", () => range.set(null, null));
  at("cursors").addEventListener("click", () => {
    if (cursors.a !== null) return cursors.set(null, null);
    const lo = range.lo === null ? clock.start : range.lo, hi = range.lo === null ? clock.end : range.hi;
    cursors.set(lo + (hi - lo) / 4, lo + (3 * (hi - lo)) / 4);
  });
  at("link").addEventListener("click", async () => {
    const address = location.href.replace(/#.*/, "") + link.text();
    try { history.replaceState(null, "", link.text()); } catch { /* a viewer that allows no change */ }
    try { await navigator.clipboard.writeText(address); at("link").textContent = "copied"; } catch { at("link").textContent = "see the address"; }
    setTimeout(() => { at("link").textContent = "Link"; }, 1500);
  });
  window.addEventListener("hashchange", () => link.read());
  at("speed").addEventListener("change", (event) => { clock.speed = Number(event.target.value); });
  document.addEventListener("keydown", (event) => {
    if (["INPUT", "SELECT", "BUTTON", "TEXTAREA"].includes(event.target.tagName) && event.target !== scrub) return;
    if (event.key === " ") { event.preventDefault(); clock.play(!clock.playing); }
    if (event.target === scrub) return;
    if (event.key === "ArrowRight") step(event.shiftKey ? 1 : 0.1);
    if (event.key === "ArrowLeft") step(event.shiftKey ? -1 : -0.1);
  });
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  setTheme(dark.matches ? "dark" : "light");
  dark.addEventListener("change", () => setTheme(dark.matches ? "dark" : "light"));
  at("theme").addEventListener("click", () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  // Paper is white whatever the screen was, as wide as it is, and without scrolling: everything is drawn for it at once.
  let before = "light";
  const draw = () => {
    const { figures = {}, player } = window.escapement || {};
    for (const figure of Object.values(figures)) for (const panel of [...figure.shared.panels, ...figure.below.panels]) if (!figure.card.hidden) panel.print();
    if (player) player.draw();
  };
  window.addEventListener("beforeprint", () => { before = document.documentElement.dataset.theme; document.documentElement.classList.add("printing"); setTheme("light"); draw(); });
  window.addEventListener("afterprint", () => { document.documentElement.classList.remove("printing"); setTheme(before); draw(); });
}

/** The first and the last instant of anything. */
function ends(motions) {
  let lo = Infinity, hi = -Infinity;
  for (const t of motions) { lo = Math.min(lo, t[0]); hi = Math.max(hi, t[t.length - 1]); }
  if (!motions.length) for (const raw of RUNS.flatMap((run) => Object.values(run.figures).flat())) {
    if (raw.samples) { lo = Math.min(lo, raw.t0 + raw.first * raw.dt); hi = Math.max(hi, raw.t0 + (raw.first + raw.samples - 1) * raw.dt); }
  }
  return lo < hi ? [lo, hi] : [0, 1];
}

/** Puts everything of DATA on the page, in place of what was there. */
function build() {
  for (const signal of [clock, range, cursors, themeChanged]) signal.listeners.length = 0;
  curves.clear();
  document.getElementById("main").replaceChildren(); document.getElementById("nav").replaceChildren();
  const titles = [...new Set(RUNS.map((run) => run.title).filter(Boolean))], title = (titles.length === 1 && titles[0]) || DATA.title;
  document.querySelector("h1").textContent = title;
  document.getElementById("runs").replaceChildren(...RUNS.map((run, i) => el("span", {}, RUNS.length > 1 ? el("span", { class: "swatch", style: `background:var(--c${i % COLOURS})` }) : "",
    [run.name !== title ? run.name : "", run.digest ? `tape ${run.digest.slice(0, 12)}` : ""].filter(Boolean).join(", "))));

  const motions = RUNS.filter((run) => run.scene && run.motion).map((run) => decode(run.motion.t, Float64Array)).filter((t) => t.length);
  const top = el("div", { class: "top" }), summary = summaryCard(motions.length);
  let player = null;
  [clock.start, clock.end] = ends(motions);
  clock.t = clock.start;
  if (motions.length) {
    const body = section("playback", "Playback");
    body.append(top);
    try { player = new Player(top); } catch (error) {
      top.append(el("div", { class: "card" }, el("p", {}, `The playback cannot be shown: ${error.message}. The figures below do not need it.`)));
    }
  } else if (summary) section("result", "Result").append(top);
  if (summary) top.append(summary);
  if (!summary || !motions.length) top.classList.add("alone");
  if (RUNS.length > 1) section("scenarios", "What differs").append(differencesCard());

  const figures = {}, groups = new Map(), chosen = DATA.figures.filter((spec) => !spec.signal), signals = DATA.figures.filter((spec) => spec.signal);
  // For scripts that look at the page: the curves as drawn, the clock, the playback.
  window.escapement = Object.assign(window.escapement || {}, { data: DATA, figures, clock, range, cursors, player, setTheme });
  for (const spec of chosen) {
    if (!groups.has(spec.group)) {
      const id = spec.group.toLowerCase().replace(/[^a-z0-9]+/g, "-"), grid = el("div", { class: "figures" });
      section(id, spec.group).append(grid); groups.set(spec.group, grid);
    }
    figures[spec.id] = new Figure(groups.get(spec.group), spec);
  }
  let list = null;
  if (signals.length) list = new Signals(section("signals", chosen.length ? "All signals" : "Signals"), signals, !chosen.length);
  window.escapement.open = (id) => figures[id] || (list && signals.some((spec) => spec.id === id) ? list.make(signals.find((spec) => spec.id === id)) : null);
  window.escapement.signals = list;
  const timed = RUNS.filter((run) => run.participants.length);
  if (timed.length) section("time", "Computing and waiting").append(...timed.map(timesCard));
  const rest = DATA.summary.filter((row) => !row.main);
  if (rest.length) section("all-figures-of-merit", "All figures of merit").append(el("div", { class: "card" }, summaryTable(rest)));
  about();
  transport();
  link.read();
}

logo();
controls();
build();
if (DATA.live) new Live();
