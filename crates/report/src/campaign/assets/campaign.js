// The page of a campaign. All numbers come with it; this only draws them.
const at = (id) => document.getElementById(id), main = at("main");
const GOOD = new Set(["met", "complete"]);
const inputs = DATA.inputs.map((one) => ({ ...one, values: decode(one.values, Float32Array) }));
const measures = DATA.measures.map((one) => ({ ...one, values: decode(one.values, Float32Array) }));
const named = (one) => one.name + (one.unit ? ` [${one.unit}]` : "");
const unitOf = (one) => (one.unit ? `[${one.unit}]` : "");
const behind = (unit) => (unit ? " " + unit : "");
const percent = (x) => show(Number((100 * x).toPrecision(4))) + " %";
const interval = (low, high, unit = "") => (low == null && high == null ? "" : `${low == null ? "below" : show(low)} to ${high == null ? "above" : show(high)}${behind(unit)}`);
const shade = (word) => cssVar(GOOD.has(word) ? "--c0" : word === "not-met" ? "--bad" : "--soft");

/** Least and greatest of what is there, a little apart. */
function span(lists, margin = 0.04) {
  let lo = Infinity, hi = -Infinity;
  for (const list of lists) for (const x of list) if (x != null && Number.isFinite(x)) { if (x < lo) lo = x; if (x > hi) hi = x; }
  if (!(lo <= hi)) return [0, 1];
  const pad = hi > lo ? margin * (hi - lo) : Math.abs(lo) * 0.05 || 0.5;
  return [lo - pad, hi + pad];
}

/** The range of what is not far out, and how many values are: a few outliers would flatten everything else. */
function core(values, also = []) {
  const sorted = [...values].filter(Number.isFinite).sort((a, b) => a - b), n = sorted.length;
  if (n < 20) return { range: span([sorted, also]), out: 0 };
  const low = sorted[Math.floor(0.02 * n)], high = sorted[Math.ceil(0.98 * n) - 1], reach = 2 * (high - low);
  const inside = reach > 0 ? sorted.filter((v) => v >= low - reach && v <= high + reach) : sorted;
  return { range: span([inside, also]), out: n - inside.length };
}

/** Limits that stand near enough to be drawn: one far away would flatten what is drawn. */
function close(limits, values) {
  const [lo, hi] = core(values).range;
  return limits.filter((limit) => limit > 2 * lo - hi && limit < 2 * hi - lo);
}

/** A canvas with axes; `draw(pen, X, Y, box)` fills it, again whenever size or theme change. */
const drawings = [];
function plot({ x, y, below, left, words = [], places, draw, percents = false }) {
  const canvas = el("canvas", { role: "img", "aria-label": `${left || ""} over ${below || ""}` }), box = el("div", { class: "plot" }, canvas);
  const paint = () => {
    const w = box.clientWidth, h = box.clientHeight, scale = window.devicePixelRatio || 1;
    if (!w || !h) return;
    canvas.width = Math.round(w * scale); canvas.height = Math.round(h * scale);
    const pen = canvas.getContext("2d"); pen.scale(scale, scale); pen.clearRect(0, 0, w, h);
    const frame = { l: 50, r: w - 8, t: 8, b: h - 32 };
    const X = (v) => frame.l + ((v - x[0]) / (x[1] - x[0])) * (frame.r - frame.l), Y = (v) => frame.b - ((v - y[0]) / (y[1] - y[0])) * (frame.b - frame.t);
    pen.font = "10px system-ui, sans-serif"; pen.lineWidth = 1; pen.strokeStyle = cssVar("--grid"); pen.fillStyle = cssVar("--soft");
    pen.textAlign = "center";
    const marks = words.length ? words.map((word, i) => [i, word.length > 12 ? word.slice(0, 11) + "…" : word]) : places || ticks(x[0], x[1], Math.max(2, w / 90));
    for (const [v, label] of marks) { if (v < x[0] || v > x[1]) continue; pen.beginPath(); pen.moveTo(X(v), frame.t); pen.lineTo(X(v), frame.b); pen.stroke(); pen.fillText(label, X(v), frame.b + 12); }
    pen.textAlign = "right";
    for (const [v, label] of ticks(y[0], y[1], Math.max(2, h / 45))) { pen.beginPath(); pen.moveTo(frame.l, Y(v)); pen.lineTo(frame.r, Y(v)); pen.stroke(); pen.fillText(percents ? percent(v) : label, frame.l - 5, Y(v) + 3); }
    pen.textAlign = "center"; pen.fillText(below || "", (frame.l + frame.r) / 2, h - 5);
    if (left) { pen.save(); pen.translate(9, (frame.t + frame.b) / 2); pen.rotate(-Math.PI / 2); pen.fillText(left, 0, 0); pen.restore(); }
    pen.save(); pen.beginPath(); pen.rect(frame.l, frame.t, frame.r - frame.l, frame.b - frame.t); pen.clip();
    draw(pen, X, Y, frame); pen.restore();
  };
  drawings.push({ box, paint });
  return box;
}
function repaint() { for (const one of drawings) if (one.box.isConnected) one.paint(); }

function line(pen, points, color, dash = []) {
  pen.strokeStyle = color; pen.setLineDash(dash); pen.beginPath();
  let up = true;
  for (const [a, b] of points) { if (!Number.isFinite(b)) { up = true; continue; } up ? pen.moveTo(a, b) : pen.lineTo(a, b); up = false; }
  pen.stroke(); pen.setLineDash([]);
}

/** A histogram with the cumulative curve over it, and limits. */
function histogram(one, { limits = [], words = [], below = named(one) } = {}) {
  const values = [...one.values].filter(Number.isFinite).sort((a, b) => a - b), n = values.length;
  const near = close(limits, values), far = limits.filter((limit) => !near.includes(limit));
  const { range, out } = core(values, near), x = words.length ? [-0.6, words.length - 0.4] : range;
  const bins = words.length || Math.max(1, Math.min(40, Math.ceil(2 * Math.cbrt(n)))), counts = new Array(bins).fill(0);
  const seen = out ? values.filter((v) => v >= x[0] && v <= x[1]) : values;
  const lo = words.length ? -0.5 : seen[0] ?? 0, hi = words.length ? words.length - 0.5 : seen[seen.length - 1] ?? 1, width = (hi - lo) / bins || 1;
  below = [below, out && `${out} further out`, far.length && `limit ${far.map(show).join(" and ")}`].filter(Boolean).join(", ");
  for (const v of seen) counts[Math.min(bins - 1, Math.max(0, Math.floor((v - lo) / width)))]++;
  const most = Math.max(1, ...counts);
  return plot({ x, y: [0, 1.05], below, percents: true, words, draw(pen, X, Y) {
    pen.fillStyle = cssVar("--c0"); pen.globalAlpha = 0.35;
    counts.forEach((count, i) => pen.fillRect(X(lo + i * width) + 0.5, Y(count / most), Math.max(1, X(lo + width) - X(lo) - 1), Y(0) - Y(count / most)));
    pen.globalAlpha = 1; pen.lineWidth = 1.6;
    if (!words.length && n) line(pen, [[X(values[0]), Y(0)], ...values.map((v, i) => [X(v), Y((i + 1) / n)])], cssVar("--c1"));
    pen.lineWidth = 1;
    for (const limit of near) line(pen, [[X(limit), Y(0)], [X(limit), Y(1.05)]], cssVar("--limit"), [5, 3]);
  } });
}

/** Every point, in the colour of what became of it. */
function scatter(input, measure) {
  const words = input.words, x = words.length ? [-0.6, words.length - 0.4] : span([input.values]), y = core(measure.values, close(measure.limits, measure.values)).range;
  const alpha = Math.max(0.25, Math.min(0.8, 60 / Math.sqrt(measure.values.length + 1) / 2));
  return plot({ x, y, words, below: unitOf(input), draw(pen, X, Y) {
    const order = DATA.outcomes.map((word, i) => i).sort((a, b) => GOOD.has(DATA.outcomes[b]) - GOOD.has(DATA.outcomes[a]));
    pen.globalAlpha = alpha;
    for (const i of order) {
      if (!Number.isFinite(measure.values[i]) || !Number.isFinite(input.values[i])) continue;
      // Texts and truths lie on lines: a fixed shift tells points apart.
      const shift = (of) => of * 0.5 * (((i * 0.618034) % 1) - 0.5);
      pen.fillStyle = shade(DATA.outcomes[i]); pen.fillRect(X(input.values[i] + shift(words.length ? 1 : 0)) - 1.2, Y(measure.values[i] + shift(measure.truth ? 0.4 : 0)) - 1.2, 2.4, 2.4);
    }
    pen.globalAlpha = 1;
    for (const limit of measure.limits) line(pen, [[X(x[0]), Y(limit)], [X(x[1]), Y(limit)]], cssVar("--limit"), [5, 3]);
  } });
}

function convergence(measure) {
  const rows = measure.convergence, pairs = measure.truth ? [1] : [1, 4], y = span(rows.map((row) => row.slice(1)));
  const x = [Math.log10(rows[0]?.[0] ?? 1), Math.log10(Math.max(rows[rows.length - 1]?.[0] ?? 10, 2))];
  if (!(x[1] > x[0])) x[1] = x[0] + 1;
  const decades = [1, 2, 3, 4, 5].flatMap((power) => [1, 2, 5].map((digit) => [Math.log10(digit * 10 ** power), String(digit * 10 ** power)]));
  return plot({ x, y, below: "points", places: decades, left: named(measure), percents: measure.truth, draw(pen, X, Y) {
    pairs.forEach((first, i) => {
      const along = rows.map((row) => X(Math.log10(row[0]))), of = (k) => rows.map((row, at) => [along[at], row[first + k] == null ? NaN : Y(row[first + k])]);
      pen.lineWidth = 1.8; line(pen, of(0), cssVar("--c" + i)); pen.lineWidth = 1;
      line(pen, of(1), cssVar("--c" + i), [3, 3]); line(pen, of(2), cssVar("--c" + i), [3, 3]);
    });
  } });
}

const row = (...cells) => el("tr", {}, ...cells.map((cell) => (cell instanceof Node ? cell : el("td", {}, String(cell)))));
const table = (heads, rows) => el("table", {}, el("thead", {}, el("tr", {}, ...heads.map((head) => el("th", {}, head)))), el("tbody", {}, ...rows));
function section(id, title, ...parts) {
  at("nav").append(el("a", { href: "#" + id }, title));
  const made = el("section", { id }, el("h2", {}, title), ...parts.filter(Boolean));
  main.append(made);
  return made;
}

const NO_SAMPLE = "No interval: the points are no random sample of one draw each.";

function top() {
  const { good, ran, interval } = DATA.share;
  at("runs").append(DATA.words);
  const rate = el("div", { class: "card" }, el("h3", {}, `Share that is ${DATA.good}`), el("div", { class: "big" }, ran ? percent(good / ran) : "—"),
    el("p", { class: "note" }, ran ? `${good} of ${ran} that ran` + (interval ? `: ${percent(interval[0])} to ${percent(interval[1])} with 95 % confidence (Wilson).` : `. ${NO_SAMPLE}`) : "No point ran to its end."));
  const truth = measures.find((one) => one.truth);
  if (truth) rate.append(convergence(truth), el("p", { class: "note" }, interval ? "Of all points: the share after more and more of them, with its interval." : "Of all points: the share after more and more of them."));
  const groups = DATA.failures.map((one) => row(one.outcome, String(one.count), el("td", { class: "reason" }, one.reason || "—"), el("td", { class: "reason" }, one.points.join(", ") + (one.count > one.points.length ? ", …" : ""))));
  const failures = el("div", { class: "card" }, el("h3", {}, "What went wrong, by its reason"), groups.length ? table(["outcome", "points", "reason", "which"], groups) : el("p", { class: "note" }, "Nothing."));
  section("success", "Success", el("div", { class: "two" }, rate, failures));
}

/** A probability as 10 to its power. */
const tiny = (x) => (x >= 0.001 ? percent(x) : x.toExponential(1).replace("e-", "·10⁻").replace(/⁻(\d+)$/, (_, digits) => "⁻" + [...digits].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]).join("")));

/** How probable the rare event is, how its levels came to it, and what it has to do with. */
function rare() {
  const one = DATA.rare;
  if (!one) return;
  const found = one.probability > 0, name = one.criterion.replaceAll("_", " ");
  const rate = el("div", { class: "card" }, el("h3", {}, `${name} is missed`), el("div", { class: "big" }, found ? tiny(one.probability) : "below " + tiny(one.interval[1])),
    el("p", { class: "note" }, found ? `${tiny(one.interval[0])} to ${tiny(one.interval[1])} with 95 % confidence: ${one.limits}. ${one.points} points in ${one.levels.length} levels${one.equivalent ? `; as many independent ones as say the same: ${show(one.equivalent)}` : ""}.` : `It was never missed in ${one.points} points: ${one.limits}.`),
    one.stuck ? el("p", { class: "note" }, "The levels stopped rising: the figure takes few different values, or hardly any step was accepted because noise decides.") : null);
  rate.append(table(["level", `beyond${behind(one.unit && `[${one.unit}]`)}`, "states", "share", "steps taken"], one.levels.map((level, i) => row(i + 1, level.threshold == null ? "—" : show(level.threshold), level.states, percent(level.share), level.acceptance == null ? "—" : percent(level.acceptance)))));
  const parts = [rate];
  const curve = one.exceedance.map(([x, part]) => [x, Math.log10(part)]);
  if (curve.length > 1) {
    const limits = [one.levels[one.levels.length - 1].threshold].filter((limit) => limit != null), y = [Math.floor(Math.min(...curve.map((point) => point[1]))), 0];
    parts.push(el("div", { class: "card" }, el("h3", {}, "How often it is beyond a value"), plot({ x: span([curve.map((point) => point[0]), limits]), y, below: `${name}${one.unit ? ` [${one.unit}]` : ""}`, left: "log₁₀ of the probability", draw(pen, X, Y) {
      pen.lineWidth = 1.8; line(pen, curve.map(([a, b]) => [X(a), Y(b)]), cssVar("--c0")); pen.lineWidth = 1;
      for (const limit of limits) line(pen, [[X(limit), Y(y[0])], [X(limit), Y(0)]], cssVar("--limit"), [5, 3]);
    } }), el("p", { class: "note" }, "Of all levels. The dashed line is the limit.")));
  }
  if (one.centre.length) parts.push(el("div", { class: "card" }, el("h3", {}, "What it has to do with"), table(["drawn", "mean where it is missed"], [...one.centre].sort((a, b) => Math.abs(b[1]) - Math.abs(a[1])).slice(0, 20).map(([drawn, mean]) => row(drawn, `${mean < 0 ? "−" : "+"}${Math.abs(mean).toFixed(2)} σ`))), el("p", { class: "note" }, "In standard deviations of each draw, as a standard normal number; within about 0.3 it has nothing to do with it.")));
  section("rare", "A rare event", el("div", { class: "two" }, ...parts));
  main.append(el("p", { class: "note" }, `What follows is of the ${DATA.points} points of the first level, which are a plain random sample; the ten worst points are of all.`));
}

function worst() {
  if (!DATA.worst.length) return;
  const rows = DATA.worst.map((one) => row(one.point, one.outcome, one.criterion, one.part == null ? "not measured" : percent(one.part), ...one.drawn.map((x, i) => (typeof x === "number" ? show(x) + behind(DATA.columns[i][1]) : x))));
  section("worst", "The ten worst points", el("div", { class: "card wide" }, table(["point", "outcome", "criterion", "part of its limit", ...DATA.columns.map(([name]) => name)], rows)));
}

/** Whether there is anything to see: a figure that is the same everywhere depends on nothing. */
const differs = (one) => one.limits.length > 0 || [...one.values].some((v) => v !== one.values[0] && !(Number.isNaN(v) && Number.isNaN(one.values[0])));
const constant = measures.filter((one) => !differs(one));
let chosen = Math.max(0, measures.findIndex((one) => !one.truth));
function heat() {
  if (!inputs.length || !measures.length) return;
  const noise = 1.96 / Math.sqrt(Math.max(4, DATA.points) - 1);
  const rows = measures.map((one, m) => {
    if (!differs(one)) return null;
    const cells = one.correlations.map((rho, i) => {
      if (rho == null) return el("td", {}, "");
      const strong = Math.abs(rho) > noise;
      const cell = el("td", { title: `${one.name} and ${inputs[i].name}: ${rho.toFixed(3)}`, style: `background: color-mix(in srgb, var(${rho > 0 ? "--c1" : "--c0"}) ${strong ? Math.round(85 * Math.abs(rho)) : 0}%, transparent)` }, strong ? rho.toFixed(2).replace("-", "−").replace("0.", ".") : "·");
      return cell;
    });
    return el("tr", { "data-measure": m }, el("td", {}, el("button", { onclick: () => choose(m, true) }, named(one))), ...cells);
  });
  section("correlations", "Rank correlations", el("div", { class: "card heat" }, table(["figure", ...inputs.map((one) => one.name)], rows.filter(Boolean))),
    el("p", { class: "note" }, `Spearman's, of every figure with everything that varies. A dot is less than ${noise.toFixed(2)}, what chance gives in 19 of 20 cases. A click shows the figure below.`));
}

function figures() {
  const cards = measures.map((one, m) => one.truth || !differs(one) ? null : el("div", { class: "card pick", tabindex: 0, role: "button", "data-measure": m, onclick: () => choose(m, true), onkeydown: (event) => { if (event.key === "Enter") choose(m, true); } },
    el("h3", {}, one.name, " ", el("small", {}, one.percentiles[2] ? `median ${show(one.percentiles[2][1])}${behind(one.unit)}` : "not measured")), histogram(one, { limits: one.limits, below: unitOf(one) })));
  section("figures", "Figures of merit", el("div", { class: "plots small" }, ...cards),
    constant.length ? el("p", { class: "note" }, `The same at all points: ${constant.map((one) => `${one.name} ${Number.isNaN(one.values[0]) ? "not measured" : show(one.values[0]) + behind(one.unit)}`).join(", ")}.`) : null);
}

function detail() {
  const place = el("div", {});
  const select = el("select", { onchange: () => choose(Number(select.value), false) }, ...measures.map((one, m) => el("option", { value: m }, named(one))));
  const made = section("figure", "One figure", el("div", { class: "choose" }, select), place);
  return { place, select, made };
}

function indices(one) {
  const rows = one.indices.of.map(([first, firstHalf, total, totalHalf], i) => row(DATA.factors[i], `${first.toFixed(3)} ± ${firstHalf.toFixed(3)}`, `${total.toFixed(3)} ± ${totalHalf.toFixed(3)}`));
  return el("div", { class: "card" }, el("h3", {}, "Sobol' indices"), table(["dispersion", "first order", "total"], rows), el("p", { class: "note" }, `Parts of the variance, of ${one.indices.rows} rows that ran whole, with 95 % confidence.`));
}

function choose(m, move) {
  chosen = m;
  const one = measures[m], { place, select, made } = view;
  select.value = m;
  for (const node of document.querySelectorAll("[data-measure]")) { const on = Number(node.dataset.measure) === m; node.classList.toggle("on", on); if (node.getAttribute("role") === "button") node.setAttribute("aria-pressed", on); }
  drawings.splice(kept);
  const percentiles = one.percentiles.map(([part, value, low, high]) => row(percent(part), show(value), low == null ? "—" : show(low), high == null ? "—" : show(high)));
  const order = [...one.values.keys()].filter((i) => Number.isFinite(one.values[i])).sort((a, b) => (one.lowest ? 1 : -1) * (one.values[a] - one.values[b])).slice(0, 10);
  const extremes = order.map((i) => row(DATA.shown[i], show(one.values[i]), DATA.outcomes[i], ...inputs.map((input) => (input.words.length ? input.words[input.values[i]] : show(input.values[i])))));
  place.replaceChildren(
    el("div", { class: "two" },
      el("div", { class: "card" }, el("h3", {}, "Histogram and cumulative curve"), histogram(one, { limits: one.limits }), el("p", { class: "note" }, one.moments ? `${one.count} points, mean ${show(one.moments[0])}${behind(one.unit)}, standard deviation ${show(one.moments[1])}${behind(one.unit)}.` : `${one.count} points.`)),
      one.truth ? null : el("div", { class: "card" }, el("h3", {}, `Percentiles${one.unit ? ", " + one.unit : ""}`), table(["percentile", "value", "from", "to"], percentiles), el("p", { class: "note" }, DATA.share.interval ? "From and to: an interval of order statistics with 95 % confidence or more, whatever the distribution. A dash: too few points." : NO_SAMPLE)),
      el("div", { class: "card" }, el("h3", {}, one.truth ? "Share over the number of points" : "Median and 95 % over the number of points"), convergence(one), el("p", { class: "note" }, DATA.share.interval ? "Dashed: the intervals with 95 % confidence." : NO_SAMPLE)),
      one.indices ? indices(one) : null),
    inputs.length ? el("h3", {}, `${one.name} over everything that varies`) : null,
    el("div", { class: "plots small" }, ...inputs.map((input, i) => el("div", { class: "card" }, el("h3", {}, input.name, " ", el("small", {}, one.correlations[i] == null ? "" : `ρ ${one.correlations[i].toFixed(2).replace("-", "−")}`)), scatter(input, one)))),
    one.truth ? null : el("h3", {}, `The ten ${one.lowest ? "least" : "greatest"}`),
    one.truth ? null : el("div", { class: "card wide" }, table(["point", named(one), "outcome", ...inputs.map(named)], extremes)));
  repaint();
  if (move) made.scrollIntoView({ behavior: "smooth" });
}

function vectors() {
  if (!DATA.vectors.length) return;
  const cards = DATA.vectors.map((one) => {
    const values = one.values.map((list) => decode(list, Float32Array)), [cep, most] = one.zero, [own] = one.mean;
    const reach = Math.max(...span(values.slice(0, 2)).map(Math.abs)), extent = [-reach, reach];
    const ring = (pen, X, Y, centre, radius, color) => { pen.strokeStyle = color; pen.beginPath(); pen.ellipse(X(centre[0]), Y(centre[1]), Math.abs(X(radius) - X(0)), Math.abs(Y(radius) - Y(0)), 0, 0, 7); pen.stroke(); };
    const picture = plot({ x: extent, y: extent, below: `${one.name}[0]${one.unit ? ` [${one.unit}]` : ""}`, left: `${one.name}[1]`, draw(pen, X, Y) {
      pen.globalAlpha = 0.5;
      for (let i = 0; i < values[0].length; i++) if (Number.isFinite(values[0][i])) { pen.fillStyle = shade(DATA.outcomes[i]); pen.fillRect(X(values[0][i]) - 1.2, Y(values[1][i]) - 1.2, 2.4, 2.4); }
      pen.globalAlpha = 1; pen.lineWidth = 1.5; ring(pen, X, Y, [0, 0], cep[0], cssVar("--c1")); ring(pen, X, Y, one.centre, own[0], cssVar("--c2"));
    } });
    const word = one.size === 2 ? "CEP" : "SEP", unit = one.unit;
    return el("div", { class: "card" }, el("h3", {}, one.name), picture, el("p", { class: "note" }, `${word} around zero ${show(cep[0])}${behind(unit)} (${interval(cep[1], cep[2], unit)}), 95 % within ${show(most[0])}${behind(unit)} (${interval(most[1], most[2], unit)}); around the mean ${show(own[0])}${behind(unit)} (${interval(own[1], own[2], unit)}). With 95 % confidence.`));
  });
  section("vectors", "Vectors", el("div", { class: "plots" }, ...cards));
}

function drawn() {
  if (!inputs.length) return;
  section("drawn", "What was drawn", el("div", { class: "plots small" }, ...inputs.map((one) => el("div", { class: "card" }, el("h3", {}, one.name), histogram(one, { words: one.words, below: unitOf(one) })))));
}

let kept = 0, view = null;
function statistics() {
  rare(); top(); worst(); heat(); figures(); vectors(); drawn();
  kept = drawings.length;
  view = measures.length ? detail() : null;
  if (DATA.points > DATA.shown.length) main.append(el("p", { class: "note" }, `Pictures and lists of single points show ${DATA.shown.length} of the ${DATA.points} points; all other numbers are of all of them.`));
  if (view) { at("figures").after(view.made); choose(chosen, false); }
}
DATA.cases ? cases() : statistics();
repaint();
at("theme").addEventListener("click", () => { setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); repaint(); });
addEventListener("resize", repaint);
let before;
addEventListener("beforeprint", () => { before = document.documentElement.dataset.theme; document.documentElement.classList.add("printing"); setTheme("light"); repaint(); });
addEventListener("afterprint", () => { document.documentElement.classList.remove("printing"); setTheme(before || "light"); repaint(); });
