// A loop of the frames around a highlight: the sheet tinted, the chrome sphere beside it, and the light's direction.

import { askPicture } from "../api.js";

const FRAMES_PER_SECOND = 24;
/** Colour of what is asked about. */
export const TINT = "#ffb02e";
/** Colours of marked highlights and their paths. */
export const KIND_COLOURS = { true: "#8fd6a5", false: "#ff9d8f" };
const PULSE_MS = 900;
/** Pixels of the canvas for one of the frame, so that rings and paths are drawn finely. */
const CANVAS_SCALE = 4;
const LINE_PX = 0.6;
const RING_PX = 9;
const MARK_PX = 4;

async function bitmap(address, signal) {
  return createImageBitmap(await askPicture(address, signal));
}

export class Loop {
  /** object, sphere, light: canvases. */
  constructor({ object, sphere, light }, signal) {
    Object.assign(this, { object, sphere, light, tracks: [], playing: !matchMedia("(prefers-reduced-motion: reduce)").matches, tinted: true, index: 0 });
    signal.addEventListener("abort", () => cancelAnimationFrame(this.request));
  }

  /** Shows nothing until the next question. */
  forget() {
    cancelAnimationFrame(this.request);
    this.question = this.asked = null;
  }

  /** Shows a question's loop from its own frame on. */
  async show(question, path, signal) {
    this.forget();
    const asked = (this.asked = question);
    const { frame, x, y, loop } = question;
    const place = `${path}/loop?frame=${frame}&x=${x}&y=${y}`;
    const [strip, sphereStrip] = await Promise.all([
      bitmap(`${place}&part=object`, signal),
      question.sphere ? bitmap(`${place}&part=sphere`, signal) : null,
    ]);
    if (signal.aborted || this.asked !== asked) return;
    Object.assign(this, { question, strip, sphereStrip });
    this.object.width = loop.width * CANVAS_SCALE;
    this.object.height = loop.height * CANVAS_SCALE;
    this.object.dataset.shown = `${frame} ${x} ${y}`;
    this.sphere.hidden = !question.sphere;
    if (question.sphere) Object.assign(this.sphere, { width: question.sphere.width, height: question.sphere.height });
    this.index = frame - loop.first;
    this.began = performance.now() - (this.index / FRAMES_PER_SECOND) * 1000;
    this.draw();
    if (this.playing) this.play();
  }

  toggle() {
    this.playing = !this.playing;
    this.onplaying?.();
    if (!this.playing) cancelAnimationFrame(this.request);
    else if (this.question) {
      this.began = performance.now() - (this.index / FRAMES_PER_SECOND) * 1000;
      this.play();
    }
  }

  step(by) {
    if (this.playing) this.toggle();
    if (!this.question) return;
    const { count } = this.question.loop;
    this.index = (this.index + by + count) % count;
    this.draw();
  }

  play() {
    this.request = requestAnimationFrame((now) => {
      if (!this.question || !this.playing) return;
      this.index = Math.floor(((now - this.began) / 1000) * FRAMES_PER_SECOND) % this.question.loop.count;
      this.draw(now);
      this.play();
    });
  }

  get frame() {
    return this.question ? this.question.loop.first + this.index : null;
  }

  draw(now = 0) {
    const { loop, sphere, sheet } = this.question;
    const context = this.object.getContext("2d");
    context.setTransform(CANVAS_SCALE, 0, 0, CANVAS_SCALE, 0, 0);
    context.imageSmoothingEnabled = false;
    context.lineWidth = LINE_PX;
    context.drawImage(this.strip, 0, this.index * loop.height, loop.width, loop.height, 0, 0, loop.width, loop.height);
    if (this.tinted) {
      // The tint comes and goes, so that the highlight under it can be seen.
      context.globalAlpha = this.playing ? 0.3 + 0.3 * Math.sin((now / PULSE_MS) * Math.PI) : 0.45;
      context.fillStyle = TINT;
      for (const [x, y] of sheet) context.fillRect(x - loop.x, y - loop.y, 1, 1);
      context.globalAlpha = 1;
      // A sheet may be no more than a few pixels: the ring shows where.
      context.strokeStyle = TINT;
      context.beginPath();
      context.arc(this.question.x - loop.x + 0.5, this.question.y - loop.y + 0.5, RING_PX, 0, 2 * Math.PI);
      context.stroke();
    }
    for (const { kind, track } of this.tracks) this.drawTrack(context, kind, track);
    if (sphere) this.sphere.getContext("2d").drawImage(this.sphereStrip, 0, this.index * sphere.height, sphere.width, sphere.height, 0, 0, sphere.width, sphere.height);
    this.drawLight(this.question.lights[this.index]);
    this.onframe?.(this.frame);
  }

  /** Draws the path of a marked highlight, and where it is in this frame. */
  drawTrack(context, kind, track) {
    const { loop } = this.question;
    const shown = track.filter(([frame]) => frame >= loop.first && frame < loop.first + loop.count);
    if (!shown.length) return;
    const place = ([, x, y]) => [x - loop.x + 0.5, y - loop.y + 0.5];
    context.strokeStyle = KIND_COLOURS[kind] ?? TINT;
    context.beginPath();
    for (const point of shown) context.lineTo(...place(point));
    context.stroke();
    const now = shown.find(([frame]) => frame === this.frame);
    if (!now) return;
    const [x, y] = place(now);
    context.beginPath();
    if (kind === "false") {
      for (const slope of [1, -1]) {
        context.moveTo(x - MARK_PX, y - slope * MARK_PX);
        context.lineTo(x + MARK_PX, y + slope * MARK_PX);
      }
    } else context.arc(x, y, MARK_PX, 0, 2 * Math.PI);
    context.stroke();
  }

  /** Draws the half vector on the hemisphere seen from the camera. */
  drawLight(direction) {
    const context = this.light.getContext("2d");
    const radius = this.light.width / 2;
    context.clearRect(0, 0, 2 * radius, 2 * radius);
    context.strokeStyle = "#7d8087";
    context.lineWidth = 2;
    context.beginPath();
    context.arc(radius, radius, radius - 2, 0, 2 * Math.PI);
    context.stroke();
    if (!direction) return;
    const [x, y] = direction;
    context.strokeStyle = context.fillStyle = "#e0b96f";
    context.beginPath();
    context.moveTo(radius, radius);
    context.lineTo(radius + x * (radius - 2), radius - y * (radius - 2));
    context.stroke();
    context.beginPath();
    context.arc(radius + x * (radius - 2), radius - y * (radius - 2), 6, 0, 2 * Math.PI);
    context.fill();
  }
}
