// What a figure is saved as: a picture of lines and texts (SVG), or its numbers (CSV).

/** Takes the strokes of a figure as a canvas does, and keeps them as SVG. */
class SvgPen {
  constructor(width, height) {
    this.width = width; this.height = height; this.parts = []; this.clips = 0; this.group = 0; this.saved = [];
    Object.assign(this, { lineWidth: 1, strokeStyle: "#000", fillStyle: "#000", globalAlpha: 1, textAlign: "start", textBaseline: "alphabetic", font: "11px sans-serif", dash: [], path: "", offset: [0, 0] });
  }
  number(x) { return Number(x.toFixed(2)); }
  at(x, y) { return `${this.number(x + this.offset[0])} ${this.number(y + this.offset[1])}`; }
  save() { this.saved.push(this.group); }
  restore() { for (const before = this.saved.pop(); this.group > before; this.group--) this.parts.push("</g>"); }
  beginPath() { this.path = ""; }
  moveTo(x, y) { this.path += `M${this.at(x, y)}`; }
  lineTo(x, y) { this.path += `L${this.at(x, y)}`; }
  arc(x, y, r) { this.path += `M${this.at(x - r, y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`; }
  rect(x, y, w, h) { this.path += `M${this.at(x, y)}h${this.number(w)}v${this.number(h)}h${this.number(-w)}Z`; }
  clip() {
    this.parts.push(`<clipPath id="c${++this.clips}"><path d="${this.path}"/></clipPath><g clip-path="url(#c${this.clips})">`); this.group += 1;
  }
  setLineDash(dash) { this.dash = dash; }
  stroke() {
    if (!this.path) return;
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.join(" ")}"` : "", faint = this.globalAlpha < 1 ? ` stroke-opacity="${this.globalAlpha}"` : "";
    this.parts.push(`<path d="${this.path}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}"${dash}${faint} stroke-linejoin="round"/>`);
  }
  fill() { this.parts.push(`<path d="${this.path}" fill="${this.fillStyle}" fill-opacity="${this.globalAlpha}"/>`); }
  strokeRect(x, y, w, h) { this.beginPath(); this.rect(x, y, w, h); this.stroke(); }
  fillRect(x, y, w, h) { this.beginPath(); this.rect(x, y, w, h); this.fill(); }
  measureText(text) { return { width: 6 * text.length }; }
  fillText(text, x, y) {
    const [px, py] = this.at(x, y).split(" "), anchor = { center: "middle", right: "end", end: "end" }[this.textAlign] || "start";
    const base = { top: "0.8em", middle: "0.35em", bottom: "-0.2em" }[this.textBaseline] || "0", [, weight, size] = this.font.match(/^(\d{3} )?([\d.]+)px/) || [, , 11];
    this.parts.push(`<text x="${px}" y="${py}" dy="${base}" text-anchor="${anchor}" font-size="${size}"${weight ? ` font-weight="${weight.trim()}"` : ""} fill="${this.fillStyle}">${text.replace(/&/g, "&amp;").replace(/</g, "&lt;")}</text>`);
  }
  text() {
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${this.width}" height="${this.height}" viewBox="0 0 ${this.width} ${this.height}" font-family="system-ui, sans-serif">${this.parts.join("")}</svg>\n`;
  }
}

/** Curves as a table: an instant a line, a curve a column; a cell is empty where a curve has no point. */
function table(series, unit, [lo, hi]) {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
  const along = series.some((s) => s.along), rows = new Map();
  series.forEach((s, column) => {
    for (let k = s.from(lo); k < s.length && s.t(k) <= hi; k++) {
      const t = s.t(k);
      if (!rows.has(t)) rows.set(t, new Array(series.length * (along ? 2 : 1)).fill(""));
      if (along) { rows.get(t)[2 * column] = s.along[k]; rows.get(t)[2 * column + 1] = s.y[k]; } else rows.get(t)[column] = s.y[k];
    }
  });
  const named = (s) => [s.name || s.label || s.origin, unit === "1" ? "" : `[${unit}]`].filter(Boolean).join(" ");
  const head = ["t [s]", ...series.flatMap((s) => (along ? [`${named(s)}, along`, named(s)] : [named(s)]))];
  const lines = [...rows].sort((a, b) => a[0] - b[0]).map(([t, cells]) => [t, ...cells].join(","));
  return [head.map(quoted).join(","), ...lines].join("\n") + "\n";
}

function download(name, content, type) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
