// A run in progress: polls the server of the page for news, and sends it commands. Nothing here waits for
// the run, and the run does not wait for anything here.
class Live {
  constructor() {
    this.about = DATA.live; this.page = Array.from(crypto.getRandomValues(new Uint8Array(8)), (b) => b.toString(16).padStart(2, "0")).join("");
    this.have = []; this.follow = true; this.rate = null; this.over = false;
    window.escapement.live = this;
    this.bar();
    this.show(this.about.state);
    clock.set(clock.end);
    clock.listen(() => { if (!this.moving) this.follow = clock.t >= clock.end - 1e-9; });
    this.ask();
  }

  bar() {
    const button = (name, title, what) => el("button", { title, onclick: what }, name);
    this.dot = el("i", { class: "dot" }); this.text = el("span", { class: "state" });
    this.pause = button("Pause", "Pause as soon as possible", () => this.command({ do: this.paused ? "resume" : "pause" }));
    this.unit = el("select", { title: "The unit of a step", "aria-label": "The unit of a step", onchange: () => { this.time.hidden = this.unit.value !== "time"; } },
      ...this.about.participants.map((one) => el("option", { value: "of " + one.name }, `one of ${one.name}, ${show(one.period_s)} s`)), el("option", { value: "time" }, "a time"));
    this.time = el("input", { type: "text", value: "100 ms", size: 8, hidden: true, "aria-label": "Step, with its unit", title: "Such as 10 ms or 1/300 s" });
    this.step = button("Step", "Advance by one step and pause", () => this.command(this.unit.value === "time"
      ? { do: "step", time: this.time.value } : { do: "step", participant: this.unit.value.slice(3) }));
    this.time.addEventListener("keydown", (event) => { if (event.key === "Enter") this.step.click(); });
    const bar = document.getElementById("live");
    bar.hidden = false;
    bar.replaceChildren(this.dot, this.text, this.pause, this.step, this.unit, this.time);
  }

  async command(body) {
    try {
      const answer = await fetch("control", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
      if (answer.ok) this.show(await answer.json()); else { this.say(await answer.text()); this.until = performance.now() + 4000; }
    } catch { this.gone(); }
  }

  /** One question after the other: a slow page asks less often, and nothing piles up. */
  async ask() {
    const began = performance.now();
    try {
      const answer = await fetch(`news?page=${this.page}&have=${this.have.join("-")}`);
      if (!answer.ok) throw new Error(await answer.text());
      const news = await answer.json();
      this.take(news);
      if (news.state.ended) return this.finish(news.state.ended);
    } catch { return this.gone(); }
    const took = performance.now() - began;
    setTimeout(() => this.ask(), Math.min(1000, Math.max(document.hidden ? 1000 : 200, 4 * took)));
  }

  take(news) {
    const { figures, player } = window.escapement;
    if (news.have) {
      for (const [id, list] of Object.entries(news.figures)) {
        const own = seriesOf(id);
        list.forEach((one, i) => own[i] && own[i].append(one));
        if (figures[id]) { figures[id].invalidate(); figures[id].measure(); }
      }
      this.have = news.have;
      this.moving = true;
      const motion = news.motion && player;
      if (motion) player.grow(news.motion);
      const all = motion ? [player.scenes[0].motion] : [...curves.values()].flat().filter((s) => s.length).map((s) => ({ t: [s.t(0), s.t(s.length - 1)] }));
      if (all.length) {
        clock.start = Math.min(...all.map(({ t }) => t[0])); clock.end = Math.max(...all.map(({ t }) => t[t.length - 1]));
        clock.bounds();
        if (this.follow && !clock.playing) clock.set(clock.end);
      }
      this.moving = false;
    }
    this.show(news.state);
  }

  show(state) {
    const now = performance.now();
    if (this.last && now > this.last.now + 150) {
      this.rate = (state.t - this.last.t) / ((now - this.last.now) / 1000);
      this.last = { now, t: state.t };
    } else if (!this.last) this.last = { now, t: state.t };
    this.paused = state.paused;
    this.pause.textContent = state.paused ? "Resume" : "Pause";
    this.step.disabled = this.unit.disabled = this.time.disabled = !state.paused;
    this.dot.dataset.state = state.paused ? (state.resting ? "paused" : "stopping") : "running";
    const at = state.paused && state.resting ? state.horizon : state.t;
    this.say(`t = ${at.toFixed(3)} s of ${show(this.about.duration_s)} s` + (state.paused ? (state.resting ? ", paused" : ", pausing") : this.rate ? `, ${this.rate.toFixed(1)} × real time` : "") + this.pace(state.pace));
  }

  /** How the pace of the wall clock is kept, and which participants are late. */
  pace(pace) {
    if (!pace) return "";
    const late = Object.entries(pace.participants).filter(([, one]) => one.overruns > 0).sort((a, b) => b[1].overruns - a[1].overruns)
      .map(([name, one]) => `${name} overran ${one.overruns} of ${one.steps} steps, p99 ${show(one.lateness_p99_s * 1e3)} ms, largest ${show(one.lateness_largest_s * 1e3)} ms late`);
    return `; ${pace.achieved === null ? "" : `${show(pace.achieved)} of `}${show(pace.requested)} × real time ${pace.met ? "met" : "not met"}` + (late.length ? ": " + late.join("; ") : "");
  }

  /** What the server refused stays to be read for a while. */
  say(text) { if (!(performance.now() < this.until)) this.text.textContent = text.trim(); }

  /** The run is over: the same page with everything that its folder holds. */
  async finish(how) {
    this.over = true;
    try {
      const answer = await fetch("result?page=" + this.page);
      if (!answer.ok) throw new Error();
      const camera = window.escapement.player && window.escapement.player.view, at = clock.t, scroll = window.scrollY;
      DATA = await answer.json(); RUNS = DATA.runs;
      build();
      const player = window.escapement.player;
      if (player && camera) { player.preset(camera.name); Object.assign(player.view, { pan: camera.pan, yaw: camera.yaw, pitch: camera.pitch }); }
      clock.set(this.follow ? clock.end : at);
      window.scrollTo(0, scroll);
    } catch { return this.gone(); }
    this.end("complete", how === "complete" ? "the run is complete" : how);
  }

  gone() { this.end("gone", "the run's program has ended; this is what the page had until then"); }

  end(state, text) {
    this.dot.dataset.state = state;
    document.getElementById("live").replaceChildren(this.dot, this.text);
    this.say(text);
  }
}
