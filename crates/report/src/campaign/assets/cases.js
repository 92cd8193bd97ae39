// The page of a list of cases: they were chosen, so they are compared one by one, and nothing is said of how probable anything is.

/** How much of its limit a value is, the nearer one of two; none where there is no limit that can be divided by. */
function part(one, value) {
  const [first, second] = one.limits, most = one.lowest ? undefined : first, least = one.lowest ? first : second;
  const parts = [most > 0 ? value / most : NaN, least > 0 ? (value > 0 ? least / value : Infinity) : NaN].filter((x) => !Number.isNaN(x));
  return parts.length ? Math.max(...parts) : null;
}

/** A table whose rows are sorted by a click on a heading. `rows` are lists of [what is shown, what it is sorted by]. */
function sortable(heads, rows) {
  const body = el("tbody", {}), made = rows.map((cells) => ({ keys: cells.map(([, key]) => key), row: el("tr", {}, ...cells.map(([cell]) => cell)) }));
  const order = (a, b) => (typeof a === "number" && typeof b === "number" ? (Number.isNaN(a) ? 1 : Number.isNaN(b) ? -1 : a - b) : String(a).localeCompare(String(b), "en", { numeric: true }));
  let sorted = 0, sign = 1;
  const fill = () => { body.replaceChildren(...[...made].sort((a, b) => sign * order(a.keys[sorted], b.keys[sorted])).map((one) => one.row)); };
  const head = heads.map((name, i) => el("th", { "aria-sort": "none" }, el("button", { title: "Sort by this", onclick: () => {
    sign = i === sorted ? -sign : 1; sorted = i; fill();
    head.forEach((one, at) => one.setAttribute("aria-sort", at === sorted ? (sign > 0 ? "ascending" : "descending") : "none"));
  } }, name)));
  fill();
  return el("table", {}, el("thead", {}, el("tr", {}, ...head)), body);
}

function cases() {
  const judged = measures.filter((one) => one.limits.length), shown = judged.length ? judged : measures, { good, ran } = DATA.share;
  // A list of cases names each in its first column; of failures all columns together say which.
  const listed = DATA.columns[0][0] === "case", name = (i) => (listed ? DATA.cases[i - 1].cells[0] : DATA.cases[i - 1].cells.filter(Boolean).join(" "));
  at("runs").append(DATA.words);
  const groups = DATA.failures.map((one) => row(one.outcome, String(one.count), el("td", { class: "reason" }, one.reason || "—"), el("td", { class: "reason" }, one.points.map(name).join(", ") + (one.count > one.points.length ? ", …" : ""))));
  section("success", "Success", el("div", { class: "two" },
    el("div", { class: "card" }, el("h3", {}, `Cases that are ${DATA.good}`), el("div", { class: "big" }, `${good} of ${ran}`), el("p", { class: "note" }, "Of those that ran. Cases are chosen: their share says nothing of how probable a failure is.")),
    el("div", { class: "card" }, el("h3", {}, "What went wrong, by its reason"), groups.length ? table(["outcome", "cases", "reason", "which"], groups) : el("p", { class: "note" }, "Nothing."))));

  const told = (text, key = text, more = {}) => [el("td", more, text), key];
  const value = (one, i) => {
    const x = one.values[i], of = Number.isNaN(x) ? null : part(one, x), beyond = of > 1;
    const tint = of == null ? "" : `background: color-mix(in srgb, var(${beyond ? "--bad" : "--c0"}) ${beyond ? 45 : Math.round(30 * Math.max(0, Math.min(1, of)))}%, transparent)`;
    return told(Number.isNaN(x) ? "—" : show(x), x, { style: tint, title: of == null ? one.name : `${one.name}: ${percent(of)} of its limit` });
  };
  // What names a case stands first, what a list of cases sets behind what became of it: its keys are long.
  const first = listed ? 1 : DATA.columns.length, heads = DATA.columns.map(([key, unit]) => key + (unit ? ` [${unit}]` : ""));
  const rows = DATA.cases.map((one, i) => [told(String(i + 1), i + 1), ...one.cells.slice(0, first).map((cell) => told(cell)),
    told(one.outcome, one.outcome, { style: `color: ${GOOD.has(one.outcome) ? "inherit" : "var(--bad)"}`, title: one.reason || "" }), ...shown.map((measure) => value(measure, i)),
    ...one.cells.slice(first).map((cell) => told(cell))]);
  section("cases", "Cases", el("div", { class: "card wide cases" }, sortable(["number", ...heads.slice(0, first), "outcome", ...shown.map(named), ...heads.slice(first)], rows)),
    el("p", { class: "note" }, judged.length ? "Shaded by the part of its limit that a figure takes; red beyond it. A click on a heading sorts." : "Nothing here has a limit. A click on a heading sorts."));

  const x = [0.4, DATA.cases.length + 0.6];
  const cards = measures.filter(differs).map((one) => el("div", { class: "card" }, el("h3", {}, one.name), plot({ x, y: span([one.values, close(one.limits, one.values)]), below: "case", left: unitOf(one), draw(pen, X, Y) {
    one.values.forEach((v, i) => { if (!Number.isFinite(v)) return; pen.fillStyle = shade(DATA.cases[i].outcome); pen.fillRect(X(i + 1) - 2, Y(v) - 2, 4, 4); });
    for (const limit of one.limits) line(pen, [[X(x[0]), Y(limit)], [X(x[1]), Y(limit)]], cssVar("--limit"), [5, 3]);
  } })));
  section("figures", "Figures of merit", el("div", { class: "plots" }, ...cards),
    constant.length ? el("p", { class: "note" }, `The same in all cases: ${constant.map((one) => `${one.name} ${Number.isNaN(one.values[0]) ? "not measured" : show(one.values[0]) + behind(one.unit)}`).join(", ")}.`) : null);
}
