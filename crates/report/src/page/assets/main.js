// The page: what stands where, and what a script may look at.
function wheel() {
  const teeth = 12, out = [];
  for (let i = 0; i < teeth; i++) {
    const at = (k, r) => { const a = (2 * Math.PI * (i + k)) / teeth; return `${(r * Math.sin(a)).toFixed(2)} ${(-r * Math.cos(a)).toFixed(2)}`; };
    out.push(`${i ? "L" : "M"}${at(0, 10.6)} L${at(0.12, 10.6)} L${at(0.22, 7.4)} L${at(0.8, 7.4)}`);
  }
  document.getElementById("wheel").setAttribute("d", out.join(" ") + "Z");
}

function section(id, title) {
  const body = el("section", { id }, el("h2", {}, title));
  document.getElementById("main").append(body);
  document.getElementById("nav").append(el("a", { href: "#" + id }, title));
  return body;
}

function summaryCard() {
  if (!DATA.summary.length) return null;
  const many = RUNS.length > 1, card = el("div", { class: "card summary", id: "summary" }, el("h2", {}, "Result"));
  const captured = DATA.summary.find((row) => row.key === "captured");
  if (captured) card.append(el("div", { class: "verdicts" }, ...RUNS.map((run, i) => captured.met[i] === null ? null
    : el("span", { class: "verdict " + (captured.met[i] ? "yes" : "no") }, `${many ? run.name + ": " : ""}${captured.met[i] ? "captured" : "not captured"}`))));
  card.append(summaryTable(DATA.summary.filter((row) => row.main && row.key !== "captured")));
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

function timesCard(run) {
  const total = Math.max(...run.participants.map((p) => p.computing_s + Object.values(p.waiting_s).reduce((a, b) => a + b, 0)), 1e-9);
  const rows = run.participants.map((p) => {
    const waits = Object.entries(p.waiting_s);
    const bar = (seconds, i, name) => el("i", { style: `width:${(100 * seconds) / total}%;background:${i < 0 ? "var(--c0)" : `color-mix(in srgb, var(--c${1 + (i % 7)}) 60%, transparent)`}`, title: `${name}: ${show(seconds)} s` });
    const waited = waits.reduce((sum, [, s]) => sum + s, 0);
    return el("div", { class: "row" }, el("span", {}, p.name),
      el("span", { class: "track" }, bar(p.computing_s, -1, "computing"), ...waits.map(([on, s], i) => bar(s, i, "waiting for " + on))),
      el("span", {}, `${show(p.computing_s)} s computing, ${show(waited)} s waiting`));
  });
  return el("div", { class: "card" }, el("h3", {}, RUNS.length > 1 ? run.name : "Wall time of each participant"), el("div", { class: "times" }, ...rows));
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
  body.append(el("p", { class: "note" }, "Figures: drag to zoom, double-click to see all, click to move the clock, Ctrl and wheel to zoom around the pointer. "
    + "Playback: drag to turn, wheel to approach, Shift and drag to move. Curves of more than 8192 samples show the least and greatest sample of each of 2048 intervals. "
    + "Geometry without visuals in the model is drawn from its kinematics and inertias."));
}

function transport() {
  const at = (id) => document.getElementById(id), scrub = at("scrub");
  at("transport").hidden = false;
  scrub.min = clock.start; scrub.max = clock.end;
  clock.listen(() => {
    if (document.activeElement !== scrub || clock.playing) scrub.value = clock.t;
    at("play").textContent = clock.playing ? "⏸" : "▶"; at("now").textContent = showTime(clock.t);
  });
}

/** What belongs to the page whatever it shows. */
function controls() {
  const at = (id) => document.getElementById(id), scrub = at("scrub");
  scrub.addEventListener("input", () => clock.set(Number(scrub.value)));
  at("play").addEventListener("click", () => clock.play(!clock.playing));
  const step = (by) => { clock.play(false); clock.set(clock.t + by); };
  at("back").addEventListener("click", () => step(-0.1)); at("ahead").addEventListener("click", () => step(0.1));
  at("speed").addEventListener("change", (event) => { clock.speed = Number(event.target.value); });
  document.addEventListener("keydown", (event) => {
    if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName) && event.target !== scrub) return;
    if (event.key === " ") { event.preventDefault(); clock.play(!clock.playing); }
    if (event.target === scrub) return;
    if (event.key === "ArrowRight") step(event.shiftKey ? 1 : 0.1);
    if (event.key === "ArrowLeft") step(event.shiftKey ? -1 : -0.1);
  });
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  setTheme(dark.matches ? "dark" : "light");
  dark.addEventListener("change", () => setTheme(dark.matches ? "dark" : "light"));
  at("theme").addEventListener("click", () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  // Paper is white whatever the screen was, as wide as it is, and nobody scrolls on it: everything is drawn for it at once.
  let before = "light";
  const draw = () => {
    const { figures = {}, player } = window.escapement || {};
    for (const figure of Object.values(figures)) for (const panel of figure.shared.panels) panel.print();
    if (player) player.draw();
  };
  window.addEventListener("beforeprint", () => { before = document.documentElement.dataset.theme; document.documentElement.classList.add("printing"); setTheme("light"); draw(); });
  window.addEventListener("afterprint", () => { document.documentElement.classList.remove("printing"); setTheme(before); draw(); });
}

/** Puts everything of DATA on the page, in place of what was there. */
function build() {
  for (const signal of [clock, range, themeChanged]) signal.listeners.length = 0;
  document.getElementById("main").replaceChildren(); document.getElementById("nav").replaceChildren();
  const title = (RUNS.length === 1 && RUNS[0].title) || DATA.title;
  document.querySelector("h1").textContent = title;
  document.getElementById("runs").textContent = RUNS.map((run) => [run.name !== title ? run.name : "", run.digest ? `tape ${run.digest.slice(0, 12)}` : ""].filter(Boolean).join(", ")).join("   ·   ");

  const motions = RUNS.filter((run) => run.motion).map((run) => decode(run.motion.t, Float64Array)).filter((t) => t.length);
  const top = el("div", { class: "top" }), summary = summaryCard();
  let player = null;
  if (motions.length) {
    clock.start = Math.min(...motions.map((t) => t[0])); clock.end = Math.max(...motions.map((t) => t[t.length - 1])); clock.t = clock.start;
    const body = section("playback", "Playback");
    body.append(top);
    try { player = new Player(top); } catch (error) {
      top.append(el("div", { class: "card" }, el("p", {}, `The playback cannot be shown: ${error.message}. The figures below do not need it.`)));
    }
    transport();
  } else section("result", "Result").append(top);
  if (summary) top.append(summary);
  if (!summary || !motions.length) top.classList.add("alone");

  const figures = {}, groups = new Map();
  for (const spec of DATA.figures) {
    if (!groups.has(spec.group)) {
      const id = spec.group.toLowerCase().replace(/[^a-z]+/g, "-"), grid = el("div", { class: "figures" });
      section(id, spec.group).append(grid); groups.set(spec.group, grid);
    }
    figures[spec.id] = new Figure(groups.get(spec.group), spec);
  }
  const timed = RUNS.filter((run) => run.participants.length);
  if (timed.length) section("time", "Computing and waiting").append(...timed.map(timesCard));
  const rest = DATA.summary.filter((row) => !row.main);
  if (rest.length) section("all-figures-of-merit", "All figures of merit").append(el("div", { class: "card" }, summaryTable(rest)));
  about();
  // For scripts that look at the page: the curves as drawn, the clock, the playback.
  window.escapement = Object.assign(window.escapement || {}, { data: DATA, figures, clock, range, player, setTheme });
}

wheel();
controls();
build();
if (DATA.live) new Live();
