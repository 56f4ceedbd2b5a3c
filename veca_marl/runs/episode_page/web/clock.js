// The time of the episode, and the sound at the ears, which runs with it.

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const SLACK_S = 0.06; // picture and sound may drift apart by so much

export class Clock {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.isPlaying = false;
    this.loops = true;
    this.sound = new Sound();
    this.last = null;
  }

  play() {
    if (this.time >= this.duration - 1e-6) this.time = 0;
    this.isPlaying = true;
    this.last = null;
    this.sound.start(this.time, this.speed);
  }

  pause() {
    this.isPlaying = false;
    this.sound.stop();
  }

  toggle() {
    if (this.isPlaying) this.pause();
    else this.play();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.last = null;
    if (this.isPlaying) this.sound.start(this.time, this.speed);
  }

  setSpeed(speed) {
    this.speed = speed;
    if (this.isPlaying) this.sound.start(this.time, speed);
  }

  setSound(buffer) {
    this.sound.buffer = buffer;
    if (this.isPlaying) this.sound.start(this.time, this.speed);
    else this.sound.stop();
  }

  // Advances to now, in milliseconds, and returns the time in seconds.
  tick(now) {
    if (!this.isPlaying) return this.time;
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 0.5);
    this.last = now;
    this.time += passed * this.speed;
    const heard = this.sound.position();
    if (heard !== null && heard < this.duration) {
      // the sound leads: ears notice a jump, eyes do not notice a small correction
      if (Math.abs(heard - this.time) > SLACK_S * Math.max(this.speed, 0.2)) this.time = heard;
      else this.time += 0.1 * (heard - this.time);
    }
    if (this.time >= this.duration) this.#end();
    return this.time;
  }

  #end() {
    if (this.loops) {
      this.seek(0);
      return;
    }
    this.time = this.duration;
    this.pause();
  }
}

class Sound {
  constructor() {
    this.buffer = null;
    this.isMuted = false;
    this.source = null;
  }

  start(time, speed) {
    this.stop();
    if (!this.buffer || this.isMuted || time >= this.buffer.duration) return;
    this.context ??= new AudioContext({ latencyHint: "interactive" });
    this.context.resume();
    this.source = this.context.createBufferSource();
    this.source.buffer = this.buffer;
    this.source.playbackRate.value = speed;
    this.source.connect(this.context.destination);
    this.source.start(0, time);
    this.began = { at: this.context.currentTime, time, speed };
  }

  stop() {
    this.source?.stop();
    this.source = null;
  }

  // Where in the episode the sound is that is heard now; null while nothing is.
  position() {
    if (!this.source || this.context.state !== "running") return null;
    const delay = this.context.outputLatency || 0;
    const played = this.context.currentTime - this.began.at - delay;
    return this.began.time + Math.max(played, 0) * this.began.speed;
  }
}
