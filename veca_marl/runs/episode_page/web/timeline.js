// Curves, actions and sound of the chosen agent over time, with one cursor.

import { fit, number } from "panels";

const FFT = 1024;
const HIGHEST_HZ = 5500;

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// ---- rows: each draws itself once, and tells its value at a step

class Row {
  constructor(label, height, hint = "") {
    this.label = label;
    this.height = height;
    this.hint = hint;
  }

  value() {
    return "";
  }

  name() {
    return "";
  }
}

class Curve extends Row {
  // values[n] belongs to step n + first
  constructor(label, values, first, colour, hint) {
    super(label, 34, hint);
    Object.assign(this, { values, first, colour });
    this.low = Math.min(0, values.reduce((a, b) => Math.min(a, b), 0));
    this.high = Math.max(0, values.reduce((a, b) => Math.max(a, b), 0));
    if (this.low === this.high) this.high = 1;
  }

  value(step) {
    const value = this.values[step - this.first];
    return value === undefined ? "" : number(value);
  }

  draw(context, width, height, steps) {
    const margin = 0.12 * height;
    const y = (value) => margin + ((this.high - value) / (this.high - this.low)) * (height - 2 * margin);
    const x = (n) => ((n + this.first) / steps) * width;
    context.strokeStyle = style("--line");
    context.beginPath();
    context.moveTo(0, y(0));
    context.lineTo(width, y(0));
    context.stroke();
    const path = new Path2D();
    this.values.forEach((value, n) => path.lineTo(x(n), y(value)));
    const area = new Path2D(path);
    area.lineTo(x(this.values.length - 1), y(0));
    area.lineTo(x(0), y(0));
    context.fillStyle = context.strokeStyle = style(this.colour);
    context.globalAlpha = 0.16;
    context.fill(area);
    context.globalAlpha = 1;
    context.lineWidth = 1.5 * (window.devicePixelRatio || 1);
    context.lineJoin = "round";
    context.stroke(path);
    context.lineWidth = 1;
  }
}

class Choice extends Row {
  constructor(label, values, choices) {
    super(label, 24, `choices: ${choices.join(", ")}`);
    Object.assign(this, { values, choices });
  }

  value(step) {
    return step ? this.choices[Math.round(this.values[step - 1])] ?? "" : "";
  }

  draw(context, width, height, steps) {
    const list = Array.from(this.values, Math.round);
    for (let n = 0; n < list.length; n++) {
      if (this.choices[list[n]] === "none") continue;
      context.fillStyle = `hsl(${(list[n] * 137.5 + 200) % 360} 60% 55%)`;
      context.fillRect((n / steps) * width, 0.2 * height, Math.ceil(width / steps), 0.6 * height);
    }
  }
}

// Many values in [-1, 1]: a row of pixels for each, blue for negative, orange for positive ones.
class HeatMap extends Row {
  constructor(label, values, names, count) {
    super(label, Math.min(Math.max(3 * count, 44), 96), `${count} values from -1 (blue) to 1 (orange)`);
    Object.assign(this, { values, names, count });
  }

  value(step, share) {
    if (!step || share === undefined) return "";
    return number(this.values[(step - 1) * this.count + this.#index(share)]);
  }

  name(share) {
    return this.names[this.#index(share)];
  }

  #index(share) {
    return Math.min(Math.floor(share * this.count), this.count - 1);
  }

  draw(context, width, height, steps) {
    const columns = this.values.length / this.count;
    const image = new ImageData(Math.max(columns, 1), this.count);
    for (let step = 0; step < columns; step++) {
      for (let row = 0; row < this.count; row++) {
        const value = this.values[step * this.count + row];
        const at = 4 * (row * columns + step);
        const [r, g, b] = value < 0 ? [58, 126, 224] : [240, 138, 36];
        image.data.set([r, g, b, 255 * Math.min(Math.abs(value), 1)], at);
      }
    }
    paint(context, image, (columns / steps) * width, height);
  }
}

function paint(context, image, width, height) {
  const small = new OffscreenCanvas(image.width, image.height);
  small.getContext("2d").putImageData(image, 0, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, 0, 0, width, height);
}

// ---- sound: the spectra over time, left ear above, right ear below

function spectra(samples, rate, columns, duration) {
  const bins = Math.round((HIGHEST_HZ / rate) * FFT);
  const levels = new Float32Array(columns * bins);
  const window = Float32Array.from({ length: FFT }, (_, n) => 0.5 - 0.5 * Math.cos((2 * Math.PI * n) / FFT));
  const real = new Float32Array(FFT);
  const imaginary = new Float32Array(FFT);
  for (let column = 0; column < columns; column++) {
    const first = Math.round((((column + 0.5) * duration) / columns) * rate) - FFT / 2;
    for (let n = 0; n < FFT; n++) real[n] = (samples[first + n] ?? 0) * window[n];
    imaginary.fill(0);
    transform(real, imaginary);
    for (let k = 0; k < bins; k++) levels[column * bins + k] = Math.log10(Math.hypot(real[k], imaginary[k]) + 1e-9);
  }
  return { levels, bins };
}

// Fast Fourier transform in place (Cooley & Tukey 1965).
function transform(real, imaginary) {
  const size = real.length;
  for (let i = 1, j = 0; i < size; i++) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [real[i], real[j]] = [real[j], real[i]];
      [imaginary[i], imaginary[j]] = [imaginary[j], imaginary[i]];
    }
  }
  for (let length = 2; length <= size; length <<= 1) {
    const angle = (-2 * Math.PI) / length;
    for (let k = 0; k < length / 2; k++) {
      const [c, s] = [Math.cos(angle * k), Math.sin(angle * k)];
      for (let start = k; start < size; start += length) {
        const other = start + length / 2;
        const r = real[other] * c - imaginary[other] * s;
        const i = real[other] * s + imaginary[other] * c;
        real[other] = real[start] - r;
        imaginary[other] = imaginary[start] - i;
        real[start] += r;
        imaginary[start] += i;
      }
    }
  }
}

class Spectrogram extends Row {
  constructor(buffer, duration) {
    super("ears", 72, "spectra up to 5.5 kHz, left ear above, right ear below");
    const columns = Math.min(Math.max(Math.round(duration * 50), 100), 1500);
    this.columns = columns;
    this.ears = [0, 1].map((ear) => spectra(buffer.getChannelData(ear), buffer.sampleRate, columns, duration));
    let highest = -9;
    for (const { levels } of this.ears) for (const level of levels) highest = Math.max(highest, level);
    this.highest = highest;
  }

  name(share) {
    return share < 0.5 ? "left ear" : "right ear";
  }

  draw(context, width, height) {
    const ramp = style("--spectrum").split(",").map((part) => part.trim().split(" ").map(Number));
    const { bins } = this.ears[0];
    const image = new ImageData(this.columns, 2 * bins + 2);
    this.ears.forEach(({ levels }, ear) => {
      for (let column = 0; column < this.columns; column++) {
        for (let k = 0; k < bins; k++) {
          const row = (ear ? 2 * bins + 1 : bins - 1) - k;
          const share = Math.min(Math.max(1 + (levels[column * bins + k] - this.highest) / 3.2, 0), 1);
          image.data.set([...mixed(ramp, share), 255], 4 * (row * this.columns + column));
        }
      }
    });
    paint(context, image, width, height);
  }
}

function mixed(ramp, share) {
  const place = share * (ramp.length - 1);
  const low = Math.min(Math.floor(place), ramp.length - 2);
  return [0, 1, 2].map((k) => ramp[low][k] + (place - low) * (ramp[low + 1][k] - ramp[low][k]));
}

// ---- all rows of an agent

function rowsOf(agent, episode) {
  const rows = [];
  if (agent.terms.length) {
    const sums = agent.terms[0].sums.map((_, step) => agent.terms.reduce((sum, term) => sum + term.sums[step], 0));
    rows.push(new Curve("return", sums, 0, "--accent", "sum of the rewards since the start"));
  }
  for (const term of agent.terms) rows.push(new Curve(term.name, Array.from(term.values), 1, "--reward", "term of the reward, weight included"));
  if (agent.sound) rows.push(new Spectrogram(agent.sound.buffer, episode.duration));
  if (agent.touch) rows.push(new Curve("touch", touched(agent.touch), 0, "--touch", "sum of the readings of all taxels"));
  for (const action of agent.actions) rows.push(...actionRows(action));
  return rows;
}

function touched({ firsts, readings }) {
  return Array.from({ length: firsts.length - 1 }, (_, step) => {
    let sum = 0;
    for (let n = firsts[step]; n < firsts[step + 1]; n++) sum += readings[n] / 255;
    return sum;
  });
}

function actionRows({ part, names, choices, values }) {
  if (choices?.length) return [new Choice(part, values, choices)];
  const count = names.length;
  if (count > 3) return [new HeatMap(part, values, names, count)];
  return names.map((name, n) => new Curve(name, Array.from(values).filter((_, at) => at % count === n), 1, "--action", "action"));
}

export class Timeline {
  constructor(episode, clock) {
    this.episode = episode;
    this.clock = clock;
    this.box = document.getElementById("tracks");
    this.cursor = document.createElement("div");
    this.cursor.id = "cursor";
    this.#listen();
    new ResizeObserver(() => this.draw()).observe(this.box);
  }

  setAgent(agent) {
    agent.rows ??= rowsOf(agent, this.episode);
    this.rows = agent.rows.map((row) => this.#show(row));
    this.box.replaceChildren(this.cursor, ...this.rows.map(({ line }) => line));
    this.step = -1;
    this.draw();
  }

  #show(row) {
    const line = document.createElement("div");
    line.className = row.height > 60 ? "track tall" : "track";
    line.title = row.hint;
    line.style.setProperty("--height", `${row.height}px`);
    const label = document.createElement("span");
    label.className = "label";
    label.textContent = row.label.replaceAll("_", " ");
    const canvas = document.createElement("canvas");
    const value = document.createElement("span");
    value.className = "value";
    line.append(label, canvas, value);
    return { row, line, label, canvas, value };
  }

  draw() {
    for (const { row, canvas } of this.rows ?? []) {
      fit(canvas);
      const context = canvas.getContext("2d");
      context.clearRect(0, 0, canvas.width, canvas.height);
      if (canvas.width && canvas.height) row.draw(context, canvas.width, canvas.height, Math.max(this.episode.steps, 1));
    }
    const first = this.rows?.[0]?.canvas;
    if (first) this.area = { left: first.offsetLeft, width: first.clientWidth };
    this.step = -1;
  }

  show(time, step) {
    if (!this.area) return;
    const share = this.episode.duration ? time / this.episode.duration : 0;
    this.cursor.style.transform = `translateX(${this.area.left + share * this.area.width}px)`;
    this.cursor.style.height = `${this.box.scrollHeight}px`;
    if (step === this.step) return;
    this.step = step;
    for (const { row, value } of this.rows) value.textContent = row.value(step, row === this.pointed?.row ? this.pointed.share : undefined);
  }

  #listen() {
    let isDown = false;
    const seek = (event) => {
      const at = event.clientX - this.box.getBoundingClientRect().left - this.area.left;
      this.clock.seek((Math.min(Math.max(at / this.area.width, 0), 1)) * this.episode.duration);
    };
    this.box.addEventListener("pointerdown", (event) => {
      if (!this.area || event.button !== 0) return;
      isDown = true;
      this.box.setPointerCapture(event.pointerId);
      seek(event);
    });
    this.box.addEventListener("pointermove", (event) => {
      if (isDown) seek(event);
      this.#point(event);
    });
    for (const name of ["pointerup", "pointercancel"]) this.box.addEventListener(name, () => (isDown = false));
  }

  // Names the value of a heat map that the pointer is on.
  #point(event) {
    for (const { row, canvas, label } of this.rows ?? []) {
      const { top, height } = canvas.getBoundingClientRect();
      const share = (event.clientY - top) / height;
      const isOn = share >= 0 && share < 1;
      label.textContent = (isOn && row.name(share)) || row.label.replaceAll("_", " ");
      if (isOn) this.pointed = { row, share };
    }
    this.step = -1;
  }
}
