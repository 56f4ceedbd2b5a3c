// The camera: around a point or an agent with the pointer, or in an agent's eye.

import * as THREE from "three";

const HIGHEST = 1.5;
const LOWEST = 0.02;

export const MODES = [
  { id: "follow", label: "follow", hint: "turns about the agent" },
  { id: "room", label: "room", hint: "turns about the middle of the room" },
  { id: "left", label: "left eye", hint: "what the left eye looks at" },
  { id: "right", label: "right eye", hint: "what the right eye looks at" },
];

export class View {
  constructor(canvas, world) {
    this.world = world;
    this.camera = new THREE.PerspectiveCamera(42, 1, 0.02, 120);
    this.camera.up.set(0, 0, 1);
    this.mode = "follow";
    this.azimuth = -2.2;
    this.elevation = 0.5;
    this.distance = 3;
    this.target = new THREE.Vector3();
    this.shift = new THREE.Vector3(); // of the target, by dragging
    this.centre = new THREE.Vector3(); // what it looks at
    this.pointers = new Map();
    this.changed = true;
    this.#listen(canvas);
  }

  get isInside() {
    return this.mode === "left" || this.mode === "right";
  }

  setAgent(agent, instantly = true) {
    this.agent = agent;
    if (instantly) this.target.copy(this.#goal());
    this.changed = true;
  }

  setMode(mode) {
    this.mode = mode;
    this.shift.set(0, 0, 0);
    const radius = this.radius();
    if (mode === "room") Object.assign(this, { distance: Math.min(2.5 * radius, 16), elevation: 0.75 });
    if (mode === "follow") Object.assign(this, { distance: 1.8, elevation: 0.4 });
    this.target.copy(this.#goal());
    this.changed = true;
  }

  // Begins behind the agent, to the side, where it and what it faces are seen.
  aim(agent) {
    this.agent = agent;
    const ahead = this.world.poses.axis(this.world.episode.firstFrames[agent.object], 0);
    this.azimuth = Math.atan2(ahead.y, ahead.x) + 0.9;
    this.setMode("follow");
  }

  room() {
    const point = this.world.focus(this.agent);
    const boxes = this.world.episode.rooms.map(([low, high]) => new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high)));
    boxes.sort((a, b) => a.distanceToPoint(point) - b.distanceToPoint(point));
    return boxes[0] ?? new THREE.Box3(new THREE.Vector3(-3, -3, 0), new THREE.Vector3(3, 3, 2));
  }

  radius() {
    const size = this.room().getSize(new THREE.Vector3());
    return 0.5 * Math.hypot(size.x, size.y);
  }

  #goal() {
    if (this.mode === "room") return this.room().getCenter(new THREE.Vector3()).setZ(0.2);
    const goal = this.world.focus(this.agent);
    return goal.setZ(Math.max(goal.z, 0.15) + 0.05);
  }

  // Places the camera; `share` of the way to where the agent is, for a smooth ride.
  update(share, aspect) {
    const { camera, world, agent } = this;
    if (this.isInside) {
      const frame = agent.firstEye + (this.mode === "right" ? 1 : 0);
      world.poses.point(frame, camera.position);
      camera.up.copy(world.poses.axis(frame, 2));
      camera.lookAt(camera.position.clone().add(world.poses.axis(frame, 0)));
      this.#lens(aspect < 1 ? (360 / Math.PI) * Math.atan(Math.tan((agent.fov * Math.PI) / 360) / aspect) : agent.fov, aspect, 0.02);
      return;
    }
    this.target.lerp(this.#goal(), share);
    const centre = this.centre.copy(this.target).add(this.shift);
    const flat = Math.cos(this.elevation) * this.distance;
    camera.up.set(0, 0, 1);
    camera.position.set(
      centre.x + flat * Math.cos(this.azimuth + Math.PI),
      centre.y + flat * Math.sin(this.azimuth + Math.PI),
      Math.max(centre.z + Math.sin(this.elevation) * this.distance, 0.05)
    );
    camera.lookAt(centre);
    this.#lens(aspect < 1 ? 42 / Math.sqrt(aspect) : 42, aspect, 0.05);
  }

  #lens(fov, aspect, near) {
    Object.assign(this.camera, { fov, aspect, near });
    this.camera.updateProjectionMatrix();
  }

  turn(right, up) {
    if (this.isInside) return;
    this.azimuth -= right;
    this.elevation = Math.min(Math.max(this.elevation + up, LOWEST), HIGHEST);
    this.changed = true;
  }

  zoom(factor) {
    if (this.isInside) return;
    this.distance = Math.min(Math.max(this.distance * factor, 0.4), 40);
    this.changed = true;
  }

  pan(right, up) {
    if (this.isInside) return;
    const scale = 0.0016 * this.distance;
    this.shift.x += scale * (-right * Math.sin(this.azimuth) * -1 + up * Math.cos(this.azimuth));
    this.shift.y += scale * (-right * Math.cos(this.azimuth) + up * Math.sin(this.azimuth));
    this.changed = true;
  }

  #listen(canvas) {
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    canvas.addEventListener("pointermove", (event) => this.#drag(event));
  }

  #drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    const spread = this.#spread();
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.pointers.size === 2) {
      this.zoom(spread / Math.max(this.#spread(), 1));
      this.pan(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons & 6) {
      this.pan(dx, dy);
    } else {
      this.turn(0.006 * dx, 0.006 * dy);
    }
  }

  #spread() {
    const [a, b] = [...this.pointers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 1;
  }
}
