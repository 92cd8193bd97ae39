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

/** A curve as the page holds it: `x(k)` in seconds, `y[k]` in the figure's unit. */
class Series {
  constructor(raw, run, slot) {
    this.label = raw.label; this.origin = raw.origin; this.run = run; this.slot = slot;
    this.samples = raw.samples;
    this.y = decode(raw.y, Float64Array);
    this.index = raw.index && decode(raw.index, Uint32Array);
    this.raw = raw; this.visible = true;
  }
  get length() { return this.y.length; }
  /** News of a run that is going on. */
  append({ keep, index, y, samples }) {
    this.y = joined(this.y, keep, decode(y, Float64Array));
    this.index = joined(this.index, keep, decode(index, Uint32Array));
    this.samples = samples;
  }
  x(k) { return this.raw.t0 + (this.raw.first + (this.index ? this.index[k] : k)) * this.raw.dt; }
  /** The point nearest to t. */
  nearest(t) {
    const k = lowerBound(this.length, (i) => this.x(i), t);
    if (k === 0) return 0;
    if (k === this.length) return k - 1;
    return this.x(k) - t < t - this.x(k - 1) ? k : k - 1;
  }
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

const themeChanged = new Signal();
function setTheme(name) {
  document.documentElement.dataset.theme = name;
  themeChanged.tell();
}
