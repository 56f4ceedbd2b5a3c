// What the chosen agent senses now: eyes, skin, and the terms of its reward.

const element = (tag, name, text) => {
  const made = document.createElement(tag);
  if (name) made.className = name;
  if (text !== undefined) made.textContent = text;
  return made;
};

export const number = (value) => {
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1000) return value.toFixed(0);
  if (size >= 10) return value.toFixed(1);
  if (size >= 0.095) return value.toFixed(2);
  return size >= 0.00095 ? value.toFixed(3) : value.toExponential(0);
};

export function fit(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  const changed = canvas.width !== width || canvas.height !== height;
  if (changed) Object.assign(canvas, { width, height });
  return changed;
}

class Eyes {
  constructor() {
    this.section = document.getElementById("eyes");
    this.canvases = [0, 1].map((n) => document.getElementById(`eye${n}`));
    this.contexts = this.canvases.map((canvas) => canvas.getContext("2d"));
  }

  setAgent(agent) {
    this.eyes = agent.eyes;
    this.section.hidden = !agent.eyes;
    this.step = -1;
    for (const canvas of agent.eyes ? this.canvases : []) {
      Object.assign(canvas, { width: agent.eyes.width, height: agent.eyes.height });
      canvas.style.aspectRatio = `${agent.eyes.width} / ${agent.eyes.height}`;
    }
  }

  show(step) {
    if (!this.eyes || step === this.step) return;
    this.step = step;
    const { images, width, height, steps } = this.eyes;
    const image = images[Math.floor(step / steps)];
    const row = (step % steps) * height;
    this.contexts.forEach((context, n) => context.drawImage(image, n * width, row, width, height, 0, 0, width, height));
  }
}

class SkinView {
  constructor(world) {
    this.world = world;
    this.section = document.getElementById("skin");
    this.canvas = document.getElementById("skinview");
    this.context = this.canvas.getContext("2d");
    this.label = document.getElementById("touched");
  }

  setAgent(agent) {
    this.agent = agent;
    this.section.hidden = !agent.touch;
    this.canvas.hidden = !this.world;
    this.isDue = true;
  }

  show(step) {
    const { touch } = this.agent;
    if (!touch || (!this.isDue && step === this.step)) return;
    const count = touch.firsts[step + 1] - touch.firsts[step];
    this.label.textContent = count === 0 ? "touches nothing" : `${count} of 9888 taxels`;
    // an empty chart stays as it is
    const isSame = !this.isDue && count === 0 && this.count === 0;
    this.step = step;
    this.count = count;
    if (!this.world || isSame) return;
    this.isDue = false;
    const ratio = this.world.renderer.getPixelRatio();
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const [w, h] = [2 * Math.floor(Math.floor(width / 2) * ratio), Math.floor(height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
    this.world.drawSkin(this.agent, step, this.context, width, height);
  }
}

class Rewards {
  constructor() {
    this.section = document.getElementById("rewards");
    this.list = document.getElementById("terms");
    this.total = document.getElementById("return");
  }

  setAgent(agent) {
    this.agent = agent;
    this.section.hidden = agent.terms.length === 0;
    this.list.replaceChildren();
    this.rows = agent.terms.map((term) => this.#row(term));
    this.step = -1;
  }

  #row(term) {
    const row = element("div", "term");
    const bar = element("i");
    const now = element("b");
    const sum = element("span", "sum");
    const track = element("div", "bar");
    track.append(bar);
    row.append(element("span", "name", term.name), track, now, sum);
    this.list.append(row);
    let largest = 0;
    for (const value of term.values) largest = Math.max(largest, Math.abs(value));
    return { term, bar, now, sum, largest: largest || 1 };
  }

  show(step) {
    if (step === this.step) return;
    this.step = step;
    let all = 0;
    for (const { term, bar, now, sum, largest } of this.rows) {
      const value = step ? term.values[step - 1] : 0;
      const total = term.sums[step];
      all += total;
      now.textContent = number(value);
      sum.textContent = number(total);
      const share = (50 * Math.abs(value)) / largest;
      bar.style.width = `${share}%`;
      bar.style.left = value < 0 ? `${50 - share}%` : "50%";
      bar.className = value < 0 ? "loss" : "gain";
    }
    const solved = this.agent.solved && step && this.agent.solved[step - 1] ? " · goal reached" : "";
    this.total.textContent = `return ${number(all)}${solved}`;
  }
}

export class Panels {
  constructor(world) {
    this.parts = [new Eyes(), new SkinView(world), new Rewards()];
  }

  setAgent(agent) {
    for (const part of this.parts) part.setAgent(agent);
    const sections = [...document.querySelectorAll("#senses > section")];
    document.getElementById("senses").hidden = sections.every((section) => section.hidden);
  }

  show(step, now) {
    for (const part of this.parts) part.show(step, now);
  }

  redraw() {
    this.parts[1].isDue = true;
  }
}
