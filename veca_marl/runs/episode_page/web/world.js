// The world in 3D: primitives, skinned bodies with their touched skin, light, and what hides them.

import * as THREE from "three";

const JUMP_M = 0.5; // per step; what moves farther was put there
const TEXTURE_WIDTH = 128;
const GHOST = 0.1;
const STRIP_M = 0.12; // of a wall that would hide the agents
const SKY = new THREE.Color().setRGB(0.6, 0.75, 0.95, THREE.SRGBColorSpace);

const linear = (r, g, b) => new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
const glsl = (c) => `vec3(${c.r.toFixed(5)}, ${c.g.toFixed(5)}, ${c.b.toFixed(5)})`;

// ---- motion between samples

export class Poses {
  constructor(motion) {
    this.motion = motion;
    this.position = new Float32Array(3 * motion.frames);
    this.quaternion = new Float32Array(4 * motion.frames);
    this.matrix = new Float32Array(12 * motion.frames); // rows of the rotation, and the position
    this.set(0, true);
  }

  // Interpolates at a time in steps: positions linearly, rotations by normalised quaternions.
  set(time, all = false) {
    const { motion } = this;
    const last = motion.samples - 1;
    const sample = Math.min(Math.floor(time), Math.max(last - 1, 0));
    const share = Math.min(Math.max(time - sample, 0), last ? 1 : 0);
    const frames = all ? Array.from({ length: motion.frames }, (_, n) => n) : motion.moving;
    for (const frame of frames) this.#setFrame(frame, sample, share, last);
  }

  #setFrame(frame, sample, share, last) {
    const { positions, quaternions, frames } = this.motion;
    const a = 3 * (sample * frames + frame);
    const b = last ? a + 3 * frames : a;
    const far = Math.hypot(positions[b] - positions[a], positions[b + 1] - positions[a + 1], positions[b + 2] - positions[a + 2]);
    const f = far > JUMP_M ? Math.floor(share) : share;
    const p = 3 * frame;
    for (let k = 0; k < 3; k++) this.position[p + k] = positions[a + k] + f * (positions[b + k] - positions[a + k]);
    const c = (4 * a) / 3;
    const d = (4 * b) / 3;
    const q = 4 * frame;
    let sum = 0;
    for (let k = 0; k < 4; k++) {
      const value = quaternions[c + k] + f * (quaternions[d + k] - quaternions[c + k]);
      this.quaternion[q + k] = value;
      sum += value * value;
    }
    const scale = 1 / Math.sqrt(sum || 1);
    for (let k = 0; k < 4; k++) this.quaternion[q + k] *= scale;
    this.#setMatrix(frame);
  }

  #setMatrix(frame) {
    const x = this.quaternion[4 * frame];
    const y = this.quaternion[4 * frame + 1];
    const z = this.quaternion[4 * frame + 2];
    const w = this.quaternion[4 * frame + 3];
    const m = this.matrix;
    const i = 12 * frame;
    m[i] = 1 - 2 * (y * y + z * z);
    m[i + 1] = 2 * (x * y - z * w);
    m[i + 2] = 2 * (x * z + y * w);
    m[i + 3] = this.position[3 * frame];
    m[i + 4] = 2 * (x * y + z * w);
    m[i + 5] = 1 - 2 * (x * x + z * z);
    m[i + 6] = 2 * (y * z - x * w);
    m[i + 7] = this.position[3 * frame + 1];
    m[i + 8] = 2 * (x * z - y * w);
    m[i + 9] = 2 * (y * z + x * w);
    m[i + 10] = 1 - 2 * (x * x + y * y);
    m[i + 11] = this.position[3 * frame + 2];
  }

  place(frame, object) {
    object.position.fromArray(this.position, 3 * frame);
    object.quaternion.fromArray(this.quaternion, 4 * frame);
  }

  point(frame, target = new THREE.Vector3()) {
    return target.fromArray(this.position, 3 * frame);
  }

  axis(frame, column) {
    const i = 12 * frame + column;
    return new THREE.Vector3(this.matrix[i], this.matrix[i + 4], this.matrix[i + 8]);
  }
}

// ---- primitives

function shapeOf({ shape, size, corners }) {
  const [a, b, c] = size;
  if (shape === "box") return new THREE.BoxGeometry(2 * a, 2 * b, 2 * c);
  if (shape === "sphere") return new THREE.SphereGeometry(a, a > 0.05 ? 40 : 16, a > 0.05 ? 24 : 10);
  if (shape === "cylinder") return new THREE.CylinderGeometry(a, a, b, 40).rotateX(Math.PI / 2);
  if (shape === "capsule") return new THREE.CapsuleGeometry(a, b, 10, 24).rotateX(Math.PI / 2);
  const solid = new THREE.BufferGeometry();
  solid.setAttribute("position", new THREE.Float32BufferAttribute(corners.flat(2), 3));
  solid.computeVertexNormals(); // without an index: flat
  return solid;
}

function reach({ shape, size, corners }) {
  if (shape === "box") return size;
  if (shape === "sphere") return [size[0], size[0], size[0]];
  if (shape === "polyhedron") {
    const points = corners.flat(1);
    return [0, 1, 2].map((axis) => Math.max(...points.map((point) => Math.abs(point[axis]))));
  }
  return [size[0], size[0], size[1] / 2 + (shape === "capsule" ? size[0] : 0)];
}

function plainMaterial(geometry, light) {
  const material = new THREE.MeshLambertMaterial({ transparent: true, opacity: geometry.transparent ? light.glass : 1 });
  if (geometry.transparent) material.depthWrite = false;
  if (!geometry.checker) return material;
  // a three-dimensional checker pattern in the frame's axes, as the agents see it
  material.onBeforeCompile = (shader) => {
    shader.uniforms.uEdge = { value: geometry.checker };
    shader.uniforms.uTile = { value: linear(light.tile, light.tile, light.tile).r };
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nvarying vec3 vFrame;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvFrame = position;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying vec3 vFrame;\nuniform float uEdge;\nuniform float uTile;")
      .replace(
        "#include <color_fragment>",
        `#include <color_fragment>
        vec3 cell = floor(vFrame / uEdge + 0.01);
        if (mod(cell.x + cell.y + cell.z, 2.0) > 0.5) diffuseColor.rgb *= uTile;`
      );
  };
  return material;
}

const ONE = new THREE.Vector3(1, 1, 1);
const A = new THREE.Vector3();
const D = new THREE.Vector3();

function isWall({ shape, rotation, checker }, [x, y, z]) {
  return shape === "box" && !checker && Math.abs(rotation[2][2]) > 0.999 && z > 0.3 && Math.min(x, y) < 0.13;
}

class Primitive {
  constructor(geometry, episode) {
    this.frame = geometry.frame;
    this.surface = geometry.surface;
    this.opacity = geometry.transparent ? episode.light.glass : 1;
    const [r0, r1, r2] = geometry.rotation;
    this.local = new THREE.Matrix4().set(...r0, geometry.offset[0], ...r1, geometry.offset[1], ...r2, geometry.offset[2], 0, 0, 0, 1);
    this.extent = reach(geometry);
    const solid = shapeOf(geometry).applyMatrix4(this.local);
    this.inverse = new THREE.Matrix4();
    this.mesh = new THREE.Mesh(solid, plainMaterial(geometry, episode.light));
    this.isFloor = episode.objects[geometry.object] === "floor" || Math.min(this.extent[0], this.extent[1]) > 8 * this.extent[2];
    this.mesh.castShadow = !this.isFloor && !geometry.transparent;
    this.mesh.receiveShadow = true;
    this.isWall = isWall(geometry, this.extent);
    this.mayGhost = !this.isFloor && !this.isWall && Math.max(...this.extent) > 0.25;
    this.isOwn = false;
    this.isHidden = false;
    this.shade = 1;
    this.height = 1; // share of it that is shown
    solid.computeBoundingBox();
  }

  // Prepares `isBetween` for where it is now.
  settle() {
    this.inverse.compose(this.mesh.position, this.mesh.quaternion, ONE).multiply(this.local).invert();
  }

  // Whether the straight line between two points passes through it.
  isBetween(from, to) {
    const a = A.copy(from).applyMatrix4(this.inverse);
    const d = D.copy(to).applyMatrix4(this.inverse).sub(a);
    const [x, y, z] = this.extent;
    this.enter = 0;
    this.leave = 0.96;
    return this.#slab(a.x, d.x, x) && this.#slab(a.y, d.y, y) && this.#slab(a.z, d.z, z);
  }

  #slab(start, along, extent) {
    const half = extent + 0.02;
    if (Math.abs(along) < 1e-9) return Math.abs(start) <= half;
    const one = (-half - start) / along;
    const two = (half - start) / along;
    this.enter = Math.max(this.enter, Math.min(one, two));
    this.leave = Math.min(this.leave, Math.max(one, two));
    return this.enter < this.leave;
  }

  // Whether a wall is between two points, beside its ends too: then all of a row of walls is.
  separates(from, to) {
    const across = this.extent[0] < this.extent[1] ? "x" : "y";
    const a = A.copy(from).applyMatrix4(this.inverse)[across];
    return a * D.copy(to).applyMatrix4(this.inverse)[across] < 0;
  }

  // Lowers a wall to a strip, or raises it; one that begins above the strip vanishes.
  lower(isLow, instantly) {
    const { min, max } = this.mesh.geometry.boundingBox;
    const { x, y } = this.mesh.quaternion;
    const bottom = this.mesh.position.z + min.z;
    const strip = bottom > 2 * STRIP_M ? 0 : STRIP_M / (max.z - min.z);
    const goal = isLow && Math.hypot(x, y) < 1e-3 ? strip : 1;
    this.height += instantly ? goal - this.height : 0.15 * (goal - this.height);
    this.mesh.scale.z = Math.max(this.height, 1e-3);
    this.mesh.position.z += min.z * (1 - this.height);
    this.mesh.visible = !this.isHidden && this.height > 0.02;
    return Math.abs(goal - this.height) > 0.01;
  }

  fade(ghost, instantly) {
    const goal = ghost ? GHOST : 1;
    this.shade += instantly ? goal - this.shade : 0.2 * (goal - this.shade);
    const material = this.mesh.material;
    material.opacity = this.opacity * this.shade;
    material.depthWrite = this.opacity === 1 && this.shade > 0.6;
    return Math.abs(goal - this.shade) > 0.01;
  }
}

// ---- skinned bodies

const TOUCH_COLOURS = [linear(0.98, 0.93, 0.35), linear(0.98, 0.55, 0.1), linear(0.85, 0.05, 0.1)];

function skinMaterial(taxels, uniforms) {
  const material = new THREE.MeshLambertMaterial({ vertexColors: true });
  const sites = taxels.map((site) => `vec3(${site.map((value) => value.toFixed(6)).join(", ")})`).join(", ");
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nattribute vec3 corner;\nattribute float triangle;\nvarying vec3 vCorner;\nflat varying float vTriangle;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvCorner = corner;\nvTriangle = triangle;");
    shader.fragmentShader = shader.fragmentShader
      .replace(
        "#include <common>",
        `#include <common>
        varying vec3 vCorner;
        flat varying float vTriangle;
        uniform highp sampler2D uTouch;
        uniform float uPale;
        const vec3 SITES[${taxels.length}] = vec3[${taxels.length}](${sites});
        float reading() {
          int nearest = 0;
          float least = 9.0;
          for (int i = 0; i < ${taxels.length}; i++) {
            vec3 away = vCorner - SITES[i];
            float d = dot(away, away);
            if (d < least) { least = d; nearest = i; }
          }
          int number = int(vTriangle + 0.5) * ${taxels.length} + nearest;
          return texelFetch(uTouch, ivec2(number % ${TEXTURE_WIDTH}, number / ${TEXTURE_WIDTH}), 0).r;
        }`
      )
      .replace(
        "#include <color_fragment>",
        `#include <color_fragment>
        diffuseColor.rgb = mix(diffuseColor.rgb, ${glsl(linear(0.86, 0.86, 0.84))}, uPale);
        float felt = reading();
        vec3 mark = felt < 0.5
          ? mix(${glsl(TOUCH_COLOURS[0])}, ${glsl(TOUCH_COLOURS[1])}, 2.0 * felt)
          : mix(${glsl(TOUCH_COLOURS[1])}, ${glsl(TOUCH_COLOURS[2])}, 2.0 * felt - 1.0);
        if (felt > 0.0) diffuseColor.rgb = vec3(0.0);`
      )
      .replace("#include <emissivemap_fragment>", "#include <emissivemap_fragment>\nif (felt > 0.0) totalEmissiveRadiance += mark;")
      .replace(
        "#include <opaque_fragment>",
        // the pale body is lit from the camera: neither its back nor its belly is dark
        `if (uPale > 0.5) {
          float facing = abs(dot(normalize(vNormal), normalize(vViewPosition)));
          outgoingLight = felt > 0.0 ? mark : diffuseColor.rgb * (0.28 + 0.72 * facing);
        }
        #include <opaque_fragment>`
      );
  };
  return material;
}

export class Skin {
  constructor(skin, episode, taxels) {
    this.object = skin.object;
    this.mesh0 = episode.meshes[skin.mesh];
    this.firstFrame = episode.firstFrames[skin.object];
    this.firstTriangle = episode.firstTriangles[skin.object];
    this.colours = episode.colours;
    const { triangles, frames } = this.mesh0;
    const corners = triangles.length;
    this.vertices = new Float32Array((frames.length / 2) * 3);
    this.normals = new Float32Array(this.vertices.length);
    const geometry = new THREE.BufferGeometry();
    for (const name of ["position", "normal", "color", "corner"]) {
      geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * corners), 3));
    }
    geometry.attributes.position.setUsage(THREE.DynamicDrawUsage);
    geometry.attributes.normal.setUsage(THREE.DynamicDrawUsage);
    const number = Float32Array.from({ length: corners }, (_, n) => Math.floor(n / 3));
    geometry.setAttribute("triangle", new THREE.BufferAttribute(number, 1));
    for (let n = 0; n < corners; n++) geometry.attributes.corner.array[3 * n + (n % 3)] = 1;
    this.texels = new Uint8Array(TEXTURE_WIDTH * Math.ceil(((corners / 3) * taxels.length) / TEXTURE_WIDTH));
    this.texture = new THREE.DataTexture(this.texels, TEXTURE_WIDTH, this.texels.length / TEXTURE_WIDTH, THREE.RedFormat);
    this.uniforms = { uTouch: { value: this.texture }, uPale: { value: 0 } };
    this.texture.needsUpdate = true;
    this.mesh = new THREE.Mesh(geometry, skinMaterial(taxels, this.uniforms));
    this.mesh.frustumCulled = false; // its vertices are in the world's axes
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.hidden = new Set();
    this.isHeadHidden = false;
    this.touchStep = -1;
    this.paint();
  }

  paint() {
    const colour = new THREE.Color();
    const { color } = this.mesh.geometry.attributes;
    for (let n = 0; n < color.count; n++) {
      const at = 3 * (this.firstTriangle + Math.floor(n / 3));
      colour.setRGB(this.colours[at], this.colours[at + 1], this.colours[at + 2], THREE.SRGBColorSpace);
      color.setXYZ(n, colour.r, colour.g, colour.b);
    }
    color.needsUpdate = true;
  }

  // Linear blend skinning: each vertex follows two frames, see Mesh in veca_marl.
  deform(poses) {
    const { frames, weights, offsets, triangles } = this.mesh0;
    const { vertices, normals } = this;
    const m = poses.matrix;
    for (let v = 0; 3 * v < vertices.length; v++) {
      let x = 0;
      let y = 0;
      let z = 0;
      for (let k = 0; k < 2; k++) {
        const weight = weights[2 * v + k];
        if (weight === 0) continue;
        const i = 12 * (this.firstFrame + frames[2 * v + k]);
        const o = 6 * v + 3 * k;
        const a = offsets[o];
        const b = offsets[o + 1];
        const c = offsets[o + 2];
        x += weight * (m[i] * a + m[i + 1] * b + m[i + 2] * c + m[i + 3]);
        y += weight * (m[i + 4] * a + m[i + 5] * b + m[i + 6] * c + m[i + 7]);
        z += weight * (m[i + 8] * a + m[i + 9] * b + m[i + 10] * c + m[i + 11]);
      }
      vertices[3 * v] = x;
      vertices[3 * v + 1] = y;
      vertices[3 * v + 2] = z;
    }
    normals.fill(0);
    for (let t = 0; t < triangles.length; t += 3) this.#addNormal(3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]);
    this.#fill(triangles);
  }

  #addNormal(a, b, c) {
    const { vertices: v, normals: n } = this;
    const ux = v[b] - v[a];
    const uy = v[b + 1] - v[a + 1];
    const uz = v[b + 2] - v[a + 2];
    const wx = v[c] - v[a];
    const wy = v[c + 1] - v[a + 1];
    const wz = v[c + 2] - v[a + 2];
    const x = uy * wz - uz * wy;
    const y = uz * wx - ux * wz;
    const z = ux * wy - uy * wx;
    n[a] += x;
    n[a + 1] += y;
    n[a + 2] += z;
    n[b] += x;
    n[b + 1] += y;
    n[b + 2] += z;
    n[c] += x;
    n[c + 1] += y;
    n[c + 2] += z;
  }

  #fill(triangles) {
    const { position, normal } = this.mesh.geometry.attributes;
    const { vertices, normals } = this;
    const [p, q] = [position.array, normal.array];
    for (let n = 0; n < triangles.length; n++) {
      const v = 3 * triangles[n];
      for (let k = 0; k < 3; k++) {
        p[3 * n + k] = vertices[v + k];
        q[3 * n + k] = normals[v + k];
      }
    }
    if (this.isHeadHidden) this.#hideHead(p);
    position.needsUpdate = normal.needsUpdate = true;
  }

  #hideHead(positions) {
    this.mesh0.owners.forEach((owner, t) => {
      if (this.hidden.has(owner)) positions.fill(0, 9 * t, 9 * t + 9);
    });
  }

  feel(touch, step) {
    if (step === this.touchStep) return;
    this.touchStep = step;
    this.texels.fill(0);
    for (let n = touch.firsts[step]; n < touch.firsts[step + 1]; n++) this.texels[touch.taxels[n]] = touch.readings[n];
    this.texture.needsUpdate = true;
  }
}

// ---- everything

export class World {
  constructor(episode, canvas) {
    this.episode = episode;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "high-performance" });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.poses = new Poses(episode.motion);
    this.scene = new THREE.Scene();
    this.primitives = episode.geometries.map((geometry) => new Primitive(geometry, episode));
    this.skins = episode.skins.map((skin) => new Skin(skin, episode, episode.taxels));
    const bodies = new Set(episode.skins.map((skin) => skin.object));
    this.primitives.forEach((primitive, n) => (primitive.isOwn = bodies.has(episode.geometries[n].object)));
    for (const { mesh } of [...this.primitives, ...this.skins]) this.scene.add(mesh);
    for (const agent of episode.agents) {
      const skin = this.skinOf(agent);
      if (skin) skin.hidden = new Set(agent.hiddenFrames);
    }
    this.#addLights();
    this.painted = -1;
    this.startColours = episode.colours.slice();
    this.paintUntil(0);
    this.setTime(0);
  }

  skinOf(agent) {
    return this.skins.find((skin) => skin.object === agent.object);
  }

  #addLights() {
    const [x, y, z] = this.episode.light.sun;
    this.toSun = new THREE.Vector3(x, y, z);
    this.sun = new THREE.DirectionalLight(0xfff4e6, 2.1);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.normalBias = 0.012;
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.radius = 3;
    const sky = new THREE.HemisphereLight(0xf4f7ff, 0xc2b6aa, 2.15);
    for (const light of [this.sun, sky]) light.layers.enable(1);
    this.scene.add(this.sun, this.sun.target, sky);
  }

  // Draws less, step by step, where pictures take too long, as without a graphics processor.
  relieve() {
    this.relief = (this.relief ?? 0) + 1;
    if (this.relief === 1) {
      this.renderer.shadowMap.enabled = this.sun.castShadow = false;
    } else if (this.relief <= 3) {
      this.renderer.setPixelRatio(0.7 * this.renderer.getPixelRatio());
    }
  }

  // The part of the world in which things cast shadows.
  lightUp(centre, radius) {
    this.sun.target.position.copy(centre);
    this.sun.position.copy(centre).addScaledVector(this.toSun, 12);
    const { camera } = this.sun.shadow;
    if (camera.right !== radius) {
      Object.assign(camera, { left: -radius, right: radius, top: radius, bottom: -radius, near: 0.5, far: 24 });
      camera.updateProjectionMatrix();
    }
  }

  paintUntil(step) {
    const { colours, repaintings } = this.episode;
    const done = repaintings.filter((change) => change.step <= step).length;
    if (done === this.painted) return;
    this.painted = done;
    colours.set(this.startColours);
    for (const change of repaintings.slice(0, done)) {
      change.surfaces.forEach((surface, n) => colours.set(change.colours[n], 3 * surface));
    }
    for (const { mesh, surface } of this.primitives) {
      mesh.material.color.setRGB(colours[3 * surface], colours[3 * surface + 1], colours[3 * surface + 2], THREE.SRGBColorSpace);
    }
    for (const skin of this.skins) skin.paint();
  }

  // Shows the state at a time in steps.
  setTime(time) {
    const step = Math.min(Math.floor(time + 1e-6), this.episode.steps);
    this.poses.set(time);
    for (const { mesh, frame } of this.primitives) this.poses.place(frame, mesh);
    for (const skin of this.skins) skin.deform(this.poses);
    for (const agent of this.episode.agents) {
      if (agent.touch) this.skinOf(agent)?.feel(agent.touch, step);
    }
    this.paintUntil(step);
    this.step = step;
  }

  focus(agent, target = new THREE.Vector3()) {
    return this.poses.point(this.episode.firstFrames[agent.object], target);
  }

  // Lets what stands between the camera and the agents become low or transparent. Returns whether
  // something is still on its way.
  clearSight(camera, centre, isInside, instantly) {
    const from = camera.position;
    const points = this.episode.agents.map((agent) => this.focus(agent));
    let isBusy = false;
    for (const primitive of this.primitives) {
      if (primitive.isOwn || !(primitive.mayGhost || primitive.isWall)) continue;
      this.poses.place(primitive.frame, primitive.mesh);
      primitive.settle();
      const moving = primitive.isWall
        ? primitive.lower(!isInside && primitive.separates(from, centre), instantly)
        : primitive.fade(!isInside && points.some((point) => primitive.isBetween(from, point)), instantly);
      isBusy = moving || isBusy;
    }
    return isBusy;
  }

  hideHeadOf(agent) {
    for (const skin of this.skins) {
      const hide = agent !== null && skin.object === agent.object;
      if (skin.isHeadHidden !== hide) {
        skin.isHeadHidden = hide;
        skin.deform(this.poses);
      }
    }
    const geometries = this.episode.geometries;
    this.primitives.forEach((primitive, n) => {
      const frame = primitive.frame - this.episode.firstFrames[geometries[n].object];
      const hide = agent !== null && geometries[n].object === agent.object && agent.hiddenFrames.includes(frame);
      primitive.isHidden = hide;
      primitive.mesh.visible = !hide && primitive.height > 0.02;
    });
  }

  render(camera, width, height, isInside) {
    this.renderer.setScissorTest(false);
    this.renderer.setViewport(0, 0, width, height);
    this.renderer.setClearColor(isInside ? SKY : 0x000000, isInside ? 1 : 0);
    this.renderer.shadowMap.autoUpdate = this.renderer.shadowMap.enabled;
    this.renderer.render(this.scene, camera);
  }

  // Front and back of a body in the pose of the chart, pale, with its touched skin, as a 2D picture.
  drawSkin(agent, step, context, width, height) {
    const chart = this.#chartOf(agent);
    if (!chart) return;
    chart.feel(agent.touch, step);
    const { renderer } = this;
    const ratio = renderer.getPixelRatio();
    const half = Math.floor(width / 2);
    const [w, h] = [Math.floor(half * ratio), Math.floor(height * ratio)];
    const camera = new THREE.PerspectiveCamera(28, half / height, 0.1, 10);
    camera.layers.set(1);
    camera.up.set(0, 0, 1);
    const distance = (1.06 * chart.size.z) / 2 / Math.tan((14 * Math.PI) / 180);
    chart.mesh.visible = true;
    renderer.shadowMap.autoUpdate = false;
    renderer.setClearColor(0x000000, 0);
    renderer.setViewport(0, 0, half, height);
    renderer.setScissor(0, 0, half, height);
    renderer.setScissorTest(true);
    context.clearRect(0, 0, context.canvas.width, context.canvas.height);
    for (const [n, way] of [1, -1].entries()) {
      camera.position.copy(chart.centre);
      camera.position.x += way * (distance + chart.size.x / 2);
      camera.lookAt(chart.centre);
      renderer.render(this.scene, camera);
      context.drawImage(renderer.domElement, 0, renderer.domElement.height - h, w, h, n * w, 0, w, h);
    }
    chart.mesh.visible = false;
    this.isOverdrawn = true;
  }

  #chartOf(agent) {
    const skin = this.episode.skins.find((each) => each.object === agent.object);
    if (!skin || !agent.touch) return null;
    this.charts ??= new Map();
    if (!this.charts.has(skin.mesh)) this.charts.set(skin.mesh, this.#makeChart(skin));
    const chart = this.charts.get(skin.mesh);
    if (chart.agent !== agent) Object.assign(chart, { agent, touchStep: -1 });
    return chart;
  }

  #makeChart(skin) {
    const chart = new Skin(skin, this.episode, this.episode.taxels);
    const own = chart.mesh0.frames.every((frame) => 12 * frame < this.episode.chart.length);
    chart.firstFrame = own ? 0 : this.episode.firstFrames[skin.object];
    chart.deform(own ? { matrix: this.episode.chart } : this.poses);
    chart.uniforms.uPale.value = 1;
    chart.mesh.castShadow = chart.mesh.receiveShadow = false;
    chart.mesh.layers.set(1);
    chart.mesh.geometry.computeBoundingBox();
    chart.centre = chart.mesh.geometry.boundingBox.getCenter(new THREE.Vector3());
    chart.size = chart.mesh.geometry.boundingBox.getSize(new THREE.Vector3());
    this.scene.add(chart.mesh);
    return chart;
  }
}
