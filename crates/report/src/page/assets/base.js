// Small things everything uses: elements, numbers, arrays, the shared clock and the shared range of time.
let DATA = JSON.parse(document.getElementById("data").textContent);
let RUNS = DATA.runs;

function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "style") node.style.cssText = value;
    else if (value === true && !name.startsWith("aria-")) node.setAttribute(name, "");
    else if ((value !== false || name.startsWith("aria-")) && value != null) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child != null));
  return node;
}

/** What is kept of an array, and what comes behind it. */
function joined(array, keep, more) {
  const out = new array.constructor(keep + more.length);
  out.set(array.subarray(0, keep)); out.set(more, keep);
  return out;
}

function decode(text, Type) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Type(bytes.buffer);
}

/** A number for people: six significant digits. */
function show(x) {
  if (!Number.isFinite(x)) return String(x);
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e6 || size < 1e-4) return x.toExponential(3).replace("e-", "e−").replace("-", "−");
  return String(Number(x.toPrecision(6))).replace("-", "−");
}

const showTime = (t) => t.toFixed(2) + " s";
/** Whether the page is laid out for paper. */
const printing = () => document.documentElement.classList.contains("printing");
const cssVar = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const COLOURS = 8, colour = (i) => cssVar("--c" + (i % COLOURS));

/** The first index whose value is not below x, in a sorted array (or anything with `length` and `at(i)`). */
function lowerBound(length, at, x) {
  let lo = 0, hi = length;
  while (lo < hi) {
    const mid = (lo + hi) >> 1;
    if (at(mid) < x) lo = mid + 1; else hi = mid;
  }
  return lo;
}

/** The multiple of a unit in which values of this size read best: [factor, name]. The same rule as that of the figures' files. */
function bestScale(scales, size) {
  let exponent = 0;
  if (size > 0 && Number.isFinite(size) && !(size >= 0.1 && size < 1e4)) exponent = 3 * Math.floor((Math.log10(size) + 1 + 1e-9) / 3);
  exponent = Math.min(scales[scales.length - 1].exponent, Math.max(scales[0].exponent, exponent));
  const scale = scales.find((one) => one.exponent === exponent);
  return scale ? [10 ** scale.exponent, scale.name] : [1, ""];
}

/** A value with its unit, in the multiple that fits it. */
function quantity(y, axis) {
  if (!Number.isFinite(y)) return String(y);
  const named = axis.names && axis.names.find(({ value }) => value === y);
  if (named) return named.name;
  const [factor, name] = bestScale(axis.scales, Math.abs(y));
  return `${show(y / factor)}${name && " " + (/^10/.test(name) ? "× " : "") + name}`;
}

/** A curve as the page holds it: `t(k)` in seconds, `x(k)` along the horizontal axis, `y[k]` in the figure's unit. */
class Series {
  constructor(raw, run) {
    this.label = raw.label; this.origin = raw.origin; this.step = raw.step; this.run = run;
    this.samples = raw.samples;
    this.y = decode(raw.y, Float64Array);
    this.index = raw.index && decode(raw.index, Uint32Array);
    this.along = raw.x && decode(raw.x, Float64Array);
    this.raw = raw; this.visible = true;
  }
  get length() { return this.y.length; }
  /** Whether every sample of the stream is there. */
  get whole() { return this.length === this.samples; }
  /** News of a run that is going on. */
  append({ keep, index, x, y, samples }) {
    this.y = joined(this.y, keep, decode(y, Float64Array));
    this.index = joined(this.index, keep, decode(index, Uint32Array));
    if (this.along && x) this.along = joined(this.along, keep, decode(x, Float64Array));
    this.samples = samples;
  }
  t(k) { return this.raw.t0 + (this.raw.first + (this.index ? this.index[k] : k)) * this.raw.dt; }
  x(k) { return this.along ? this.along[k] : this.t(k); }
  /** The first point that is not before t. */
  from(t) { return lowerBound(this.length, (i) => this.t(i), t); }
  /** The point nearest to t; of a curve in steps the one that holds there. */
  nearest(t) {
    const k = this.from(t);
    if (k === 0) return 0;
    if (k === this.length) return k - 1;
    if (this.step) return this.t(k) <= t ? k : k - 1;
    return this.t(k) - t < t - this.t(k - 1) ? k : k - 1;
  }
  /** Least, greatest, mean and effective value of what lies between two instants; the last two weighted by time. */
  statistics(lo, hi) {
    let min = Infinity, max = -Infinity, area = 0, square = 0, span = 0, last = -1;
    for (let k = this.from(lo); k < this.length && this.t(k) <= hi; k++) {
      const y = this.y[k];
      if (!Number.isFinite(y)) { last = -1; continue; }
      if (y < min) min = y;
      if (y > max) max = y;
      if (last >= 0) {
        const h = this.t(k) - this.t(last), a = this.y[last], b = this.step ? a : y;
        area += h * (a + b) / 2; square += h * (a * a + a * b + b * b) / 3; span += h;
      }
      last = k;
    }
    if (!(min <= max)) return null;
    return { min, max, mean: span ? area / span : min, rms: span ? Math.sqrt(square / span) : Math.abs(min) };
  }
}

/** The curves of each figure, whether it is on the page yet or not. */
const curves = new Map();
function seriesOf(id) {
  if (!curves.has(id)) curves.set(id, RUNS.flatMap((run, r) => (run.figures[id] || []).map((raw) => new Series(raw, r))));
  return curves.get(id);
}

/** Something that tells others when it changed. */
class Signal {
  constructor() { this.listeners = []; }
  listen(f) { this.listeners.push(f); }
  tell() { for (const f of this.listeners) f(); }
}

/** The instant the playback shows, which every figure marks. */
const clock = Object.assign(new Signal(), {
  t: 0, start: 0, end: 1, playing: false, speed: 1,
  set(t) { this.t = Math.min(this.end, Math.max(this.start, t)); this.tell(); },
  play(on) {
    if (on && this.t >= this.end) this.t = this.start;
    this.playing = on; this.last = undefined; this.tell();
    if (on) requestAnimationFrame((now) => this.tick(now));
  },
  tick(now) {
    if (!this.playing) return;
    if (this.last !== undefined) {
      this.t += this.speed * Math.min(0.1, (now - this.last) / 1000);
      if (this.t >= this.end) { this.t = this.end; this.playing = false; }
    }
    this.last = now; this.tell();
    if (this.playing) requestAnimationFrame((next) => this.tick(next));
  },
});

/** The range of time all figures show; null is all of it. */
const range = Object.assign(new Signal(), {
  lo: null, hi: null,
  set(lo, hi) { this.lo = lo; this.hi = hi; this.tell(); },
});

/** Two instants between which figures are measured; null while there are none. */
const cursors = Object.assign(new Signal(), {
  a: null, b: null,
  set(a, b) { this.a = a; this.b = b; this.tell(); },
});

/** What a link keeps: the instant, the zoom and the cursors stand behind the address's `#`. */
const link = {
  read() {
    const told = new URLSearchParams(location.hash.slice(1)), number = (key) => (told.has(key) && Number.isFinite(Number(told.get(key))) ? Number(told.get(key)) : null);
    if (number("from") !== null && number("to") > number("from")) range.set(number("from"), number("to"));
    if (number("a") !== null && number("b") !== null) cursors.set(number("a"), number("b"));
    if (number("t") !== null) clock.set(number("t"));
  },
  text() {
    const parts = { t: clock.t, from: range.lo, to: range.hi, a: cursors.a, b: cursors.b };
    return "#" + Object.entries(parts).filter(([, x]) => x !== null).map(([key, x]) => `${key}=${Number(x.toPrecision(9))}`).join("&");
  },
  /** Writes it once nothing has changed for a moment. */
  write() {
    clearTimeout(this.soon);
    this.soon = setTimeout(() => { try { history.replaceState(null, "", this.text()); } catch { /* a viewer that allows no change */ } }, 250);
  },
};

const themeChanged = new Signal();
function setTheme(name) {
  document.documentElement.dataset.theme = name;
  themeChanged.tell();
}
