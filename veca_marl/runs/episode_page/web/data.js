// Reads the episode that the page holds: a description in JSON and one block of bytes.

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n >>> 0;
});

function crc32(bytes) {
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) crc = CRC_TABLE[(crc ^ bytes[i]) & 255] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

const TYPES = { uint8: Uint8Array, uint16: Uint16Array, int32: Int32Array, float32: Float32Array };

const product = (shape) => shape.reduce((count, size) => count * size, 1);

// Differences along the first axis in planes of bytes of equal significance: see packing.py.
function accumulate(planes, { shape, unit }) {
  const count = product(shape);
  const steps = shape[0];
  const tracks = steps ? count / steps : 0;
  const values = new Float32Array(count);
  for (let track = 0; track < tracks; track++) {
    let sum = 0;
    for (let step = 0; step < steps; step++) {
      const at = track * steps + step;
      sum +=
        planes[at] | (planes[count + at] << 8) | (planes[2 * count + at] << 16) | (planes[3 * count + at] << 24);
      values[step * tracks + track] = sum * unit;
    }
  }
  return values;
}

class Store {
  constructor(entries, block) {
    this.entries = entries;
    this.block = block;
  }

  bytes(name) {
    const { at, bytes } = this.entries[name];
    return this.block.subarray(at, at + bytes);
  }

  async array(name) {
    const entry = this.entries[name];
    const raw = await inflate(this.bytes(name));
    if (entry.codec === "delta") return accumulate(raw, entry);
    return new TYPES[entry.dtype](raw.buffer, 0, product(entry.shape));
  }
}

async function readMotion(description, store) {
  const { moving, still } = description.motion;
  const frames = moving.length + still.length;
  const samples = description.steps + 1;
  const motion = { frames, samples, moving };
  for (const [kind, size] of [["positions", 3], ["quaternions", 4]]) {
    const all = new Float32Array(samples * frames * size);
    const part = await store.array(`moving/${kind}`);
    const fixed = await store.array(`still/${kind}`);
    const copy = (sample, list, from, start) =>
      list.forEach((frame, n) => {
        const to = (sample * frames + frame) * size;
        for (let k = 0; k < size; k++) all[to + k] = from[start + n * size + k];
      });
    for (let sample = 0; sample < samples; sample++) {
      copy(sample, moving, part, sample * moving.length * size);
      copy(sample, still, fixed, 0);
    }
    motion[kind] = all;
  }
  return motion;
}

async function readPictures(agent, store) {
  if (!agent.eyes) return;
  const sheets = agent.eyes.sheets.map((name) => new Blob([store.bytes(name)], { type: "image/webp" }));
  agent.eyes.images = await Promise.all(sheets.map((sheet) => createImageBitmap(sheet)));
}

async function readTouch(agent, at, store) {
  if (!agent.touch) return;
  const counts = await store.array(`${at}/touched`);
  const firsts = new Uint32Array(counts.length + 1);
  counts.forEach((count, step) => (firsts[step + 1] = firsts[step] + Math.round(count)));
  agent.touch = { firsts, taxels: await store.array(`${at}/taxels`), readings: await store.array(`${at}/readings`) };
}

async function readSound(agent, store) {
  if (!agent.sound) return;
  // a copy: decoding detaches the buffer
  const content = store.bytes(agent.sound.name).slice().buffer;
  agent.sound.buffer = await new OfflineAudioContext(2, 1, 48000).decodeAudioData(content);
}

async function readAgent(agent, number, store) {
  const at = `agents/${number}`;
  await readPictures(agent, store);
  await readTouch(agent, at, store);
  for (const curve of [...agent.terms, ...agent.actions]) curve.values = await store.array(curve.array);
  if (agent.solved) agent.solved = await store.array(agent.solved);
  try {
    await readSound(agent, store);
  } catch (error) {
    agent.sound = null; // a browser without that codec shows the rest
    console.warn(`sound of ${agent.name}: ${error.message}`);
  }
}

async function readMeshes(description, store) {
  const meshes = {};
  for (const { mesh } of description.skins) {
    if (meshes[mesh]) continue;
    meshes[mesh] = {};
    for (const name of ["frames", "weights", "offsets", "triangles", "owners"]) {
      meshes[mesh][name] = await store.array(`${mesh}/${name}`);
    }
  }
  return meshes;
}

export async function readEpisode() {
  const episode = JSON.parse(document.getElementById("episode").textContent);
  const element = document.getElementById("data");
  const block = fromBase64(element.textContent.trim());
  element.textContent = "";
  if (block.length !== episode.bytes || crc32(block) !== episode.crc) {
    throw new Error("its data were altered or cut off");
  }
  const store = new Store(episode.arrays, block);
  episode.motion = await readMotion(episode, store);
  episode.meshes = await readMeshes(episode, store);
  episode.colours = await store.array("colours");
  episode.chart = await store.array("chart");
  await Promise.all(episode.agents.map((agent, number) => readAgent(agent, number, store)));
  episode.duration = episode.steps * episode.stepS;
  return episode;
}
