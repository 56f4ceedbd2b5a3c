// Wires the parts of the page: one clock, one chosen agent, one camera.

import { MODES, View } from "camera";
import { Clock, SPEEDS } from "clock";
import { readEpisode } from "data";
import { number, Panels } from "panels";
import { Timeline } from "timeline";
import { World } from "world";

const KEYS = [
  ["space", "play or pause"],
  ["← →", "one step; with shift one second"],
  ["home, end", "start, end"],
  ["↓ ↑", "slower, faster"],
  ["1 2 3 4", "camera: follow, room, left eye, right eye"],
  ["A", "next agent"],
  ["L, M, D", "loop, sound, dark"],
  ["drag, wheel", "turn, come nearer; with shift move"],
];
const SLOW_MS = 60; // from one picture to the next; above it less is drawn
const SLOW_FRAMES = 8;

const find = (id) => document.getElementById(id);

function button(label, hint, act) {
  const made = document.createElement("button");
  made.textContent = label;
  made.title = hint;
  made.addEventListener("click", act);
  return made;
}

function withSums(episode) {
  for (const agent of episode.agents) {
    for (const term of agent.terms) {
      let sum = 0;
      term.sums = [0, ...Array.from(term.values, (value) => (sum += value))];
    }
  }
}

function makeWorld(episode) {
  try {
    return new World(episode, find("view"));
  } catch (error) {
    const notice = find("notice");
    notice.hidden = false;
    notice.textContent =
      "This browser offers no WebGL 2, so the 3D view is missing; pictures, sound and curves are shown all the same.";
    find("cameras").hidden = true;
    console.warn(error.message);
    return null;
  }
}

class Page {
  constructor(episode) {
    this.episode = episode;
    this.clock = new Clock(episode.duration);
    this.world = makeWorld(episode);
    this.view = this.world && new View(find("view"), this.world);
    this.panels = new Panels(this.world);
    this.timeline = new Timeline(episode, this.clock);
    this.frames = this.slow = this.lively = 0;
    this.#fillHeader();
    this.#fillTransport();
    this.#listen();
    this.setAgent(0);
    if (this.view) this.view.aim(episode.agents[0]);
    this.setCamera("follow");
    this.#readAddress();
    new ResizeObserver(() => this.#resize()).observe(find("stage"));
    this.#resize();
  }

  #fillHeader() {
    const { title, details, isCut } = this.episode;
    find("title").textContent = title;
    const lines = Object.entries(details).map(([name, value]) => `${name} ${value}`);
    if (isCut) lines.push(`the first ${this.episode.duration.toFixed(0)} s`);
    find("details").textContent = lines.join(" · ");
    const list = this.episode.agents;
    find("agents").hidden = list.length < 2;
    list.forEach((agent, n) => {
      const chip = button(agent.name, `sees, hears and feels as ${agent.name}`, () => this.setAgent(n));
      const surface = this.#shirt(agent);
      if (surface) chip.style.setProperty("--shirt", surface);
      find("agents").append(chip);
    });
  }

  // The colour of an agent's shirt: that of the largest number of triangles which differs in teams.
  #shirt(agent) {
    const skin = this.episode.skins.find((each) => each.object === agent.object);
    if (!skin) return null;
    const { owners } = this.episode.meshes[skin.mesh];
    const chest = 3 * (this.episode.firstTriangles[skin.object] + owners.indexOf(2));
    return `rgb(${[0, 1, 2].map((k) => Math.round(255 * this.episode.colours[chest + k])).join(" ")})`;
  }

  #fillTransport() {
    const { clock } = this;
    const act = { play: () => this.toggle(), back: () => this.stepBy(-1), forward: () => this.stepBy(1) };
    for (const [id, call] of Object.entries(act)) find(id).addEventListener("click", call);
    for (const speed of SPEEDS) {
      find("speeds").append(button(`${speed}×`, `speed ${speed}`, () => this.setSpeed(speed)));
    }
    for (const mode of MODES) {
      find("cameras").append(button(mode.label, mode.hint, () => this.setCamera(mode.id)));
    }
    find("loop").addEventListener("click", () => this.setLoop(!clock.loops));
    find("mute").addEventListener("click", () => this.setMuted(!clock.sound.isMuted));
    find("theme").addEventListener("click", () => this.toggleTheme());
    find("help").addEventListener("click", () => this.help());
    const rows = KEYS.map(([key, text]) => `<tr><td><kbd>${key}</kbd></td><td>${text}</td></tr>`);
    find("keys").innerHTML = `<h2>Keys</h2><table>${rows.join("")}</table>`;
    find("keys").addEventListener("click", () => find("keys").close());
    this.setSpeed(1);
    this.setLoop(true);
  }

  #listen() {
    const steps = { ArrowLeft: -1, ArrowRight: 1 };
    const codes = {
      " ": () => this.toggle(),
      Home: () => this.clock.seek(0),
      End: () => this.clock.seek(this.clock.duration),
      ArrowDown: () => this.changeSpeed(-1),
      ArrowUp: () => this.changeSpeed(1),
      a: () => this.setAgent((this.number + 1) % this.episode.agents.length),
      l: () => this.setLoop(!this.clock.loops),
      m: () => this.setMuted(!this.clock.sound.isMuted),
      d: () => this.toggleTheme(),
      "?": () => this.help(),
    };
    MODES.forEach((mode, n) => (codes[n + 1] = () => this.setCamera(mode.id)));
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      const call = steps[name] ? () => this.stepBy(steps[name] * (event.shiftKey ? Math.round(1 / this.episode.stepS) : 1)) : codes[name];
      if (!call) return;
      event.preventDefault();
      call();
    });
    for (const name of ["pointerdown", "pointermove", "wheel", "keydown", "click"]) {
      document.addEventListener(name, () => this.stir(), { passive: true });
    }
    // the space bar then plays, whatever was clicked last
    document.addEventListener("click", (event) => event.detail && event.target.closest("button")?.blur());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#recolour());
  }

  toggle() {
    this.clock.toggle();
  }

  stepBy(steps) {
    this.clock.pause();
    const step = Math.round(this.clock.time / this.episode.stepS) + steps;
    this.clock.seek(step * this.episode.stepS);
  }

  changeSpeed(by) {
    const at = SPEEDS.indexOf(this.clock.speed) + by;
    if (SPEEDS[at]) this.setSpeed(SPEEDS[at]);
  }

  setSpeed(speed) {
    this.clock.setSpeed(speed);
    [...find("speeds").children].forEach((each, n) => each.classList.toggle("on", SPEEDS[n] === speed));
  }

  setLoop(loops) {
    this.clock.loops = loops;
    find("loop").classList.toggle("on", loops);
  }

  setMuted(isMuted) {
    this.clock.sound.isMuted = isMuted;
    this.clock.setSound(this.agent.sound?.buffer ?? null);
    find("mute").classList.toggle("on", !isMuted);
  }

  setAgent(n) {
    this.number = n;
    this.agent = this.episode.agents[n];
    [...find("agents").children].forEach((chip, at) => chip.classList.toggle("on", at === n));
    find("mute").hidden = !this.agent.sound;
    this.setMuted(this.clock.sound.isMuted);
    this.panels.setAgent(this.agent);
    this.timeline.setAgent(this.agent);
    this.view?.setAgent(this.agent, true);
    this.jumped = true;
    this.stir();
  }

  setCamera(mode) {
    if (!this.view) return;
    if (this.view.mode !== mode) this.view.setMode(mode);
    this.jumped = true;
    [...find("cameras").children].forEach((each, n) => each.classList.toggle("on", MODES[n].id === mode));
  }

  help() {
    if (find("keys").open) find("keys").close();
    else find("keys").showModal();
  }

  toggleTheme() {
    const root = document.documentElement;
    const isDark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = isDark ? "light" : "dark";
    this.#recolour();
  }

  #recolour() {
    this.timeline.draw();
    this.panels.redraw();
    this.stir();
  }

  // #t=3.2&agent=1&camera=left&play&theme=dark
  #readAddress() {
    const asked = new URLSearchParams(location.hash.slice(1));
    if (asked.has("theme")) document.documentElement.dataset.theme = asked.get("theme");
    const agent = Number(asked.get("agent") ?? 0);
    if (this.episode.agents[agent] && agent) {
      this.setAgent(agent);
      this.view?.aim(this.agent);
    }
    if (asked.has("t")) this.clock.seek(Number(asked.get("t")) || 0);
    if (MODES.some((mode) => mode.id === asked.get("camera"))) this.setCamera(asked.get("camera"));
    if (this.view && asked.has("azimuth")) this.view.azimuth = Number(asked.get("azimuth"));
    if (this.view && asked.has("elevation")) this.view.elevation = Number(asked.get("elevation"));
    if (this.view && asked.has("distance")) this.view.distance = Number(asked.get("distance"));
    if (asked.has("play")) this.clock.play();
  }

  #resize() {
    const stage = find("stage");
    this.size = [Math.max(stage.clientWidth, 1), Math.max(stage.clientHeight, 1)];
    if (!this.world) return;
    this.world.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.world.renderer.setSize(...this.size);
    this.panels.redraw();
    this.shown = null;
    this.stir();
  }

  run() {
    const draw = (now) => {
      requestAnimationFrame(draw);
      this.draw(now);
    };
    requestAnimationFrame(draw);
  }

  draw(now) {
    const { clock, episode } = this;
    const time = clock.tick(now);
    const exact = time / episode.stepS;
    const step = Math.min(Math.floor(exact + 1e-4), episode.steps);
    const seconds = this.last ? Math.min((now - this.last) / 1000, 0.5) : 0;
    this.last = now;
    const moved = exact !== this.shown;
    if (this.world && moved) this.world.setTime(exact);
    this.panels.show(step, now); // before the world, on the same canvas
    if (this.world && (moved || this.isBusy || this.view.changed || this.world.isOverdrawn || now < this.lively)) this.#drawWorld(exact, seconds);
    this.timeline.show(time, step);
    find("time").textContent = `${time.toFixed(2)} / ${episode.duration.toFixed(2)} s · step ${step}`;
    find("play").textContent = clock.isPlaying ? "❚❚" : "▶";
    this.#relieve(seconds);
  }

  #drawWorld(exact, seconds) {
    const { world, view } = this;
    const jumped = this.shown === null || Math.abs(exact - this.shown) > 12 || this.jumped;
    this.shown = exact;
    this.jumped = view.changed = false;
    view.update(jumped ? 1 : 1 - Math.exp(-6 * seconds), this.size[0] / this.size[1]);
    world.hideHeadOf(view.isInside ? this.agent : null);
    this.isBusy = world.clearSight(view.camera, view.centre, view.isInside, jumped);
    const room = view.radius();
    const small = room < 7 && view.mode !== "follow";
    world.lightUp(small ? view.room().getCenter(view.target.clone()).setZ(0) : view.target, small ? room : 3.5);
    world.render(view.camera, ...this.size, view.isInside);
    world.isOverdrawn = false;
    this.frames += 1;
  }

  #relieve(seconds) {
    this.slow = 1000 * seconds > SLOW_MS ? this.slow + 1 : 0;
    if (this.slow < SLOW_FRAMES || !this.world) return;
    this.slow = 0;
    this.world.relieve();
    this.panels.redraw();
    this.stir();
  }

  // Draws for a while although the time stands: the camera comes to rest.
  stir() {
    this.lively = performance.now() + 1200;
  }
}

export async function start() {
  const episode = await readEpisode();
  withSums(episode);
  find("app").hidden = false;
  const page = new Page(episode);
  page.run();
  window.episodePage = page;
  document.documentElement.dataset.state = "ready";
}

export { number };
