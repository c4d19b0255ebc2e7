// Normals of one capture under a light that moves: WebGL2, drawn only when something changed.

import { smoothed } from "./relief.js";
import { VERTEX, fragment } from "./shaders.js";

const UNIFORMS = ["normals", "lens", "photograph", "mean", "meanShare", "size", "corner", "pixel", "canvasHeight", "light", "ground", "relief", "lensShare", "wipe", "gamma"];
/** Time for a picture while something moves, in milliseconds: 60 of them a second. */
const MOVING_MS = 16;
/** Time without a change after which the whole picture is drawn, in milliseconds. */
const REST_MS = 150;
const MAX_COARSENESS = 16;
const POLL_MS = 4;
const UNITS = { normals: 0, lens: 1, photograph: 2, mean: 3 };
/** Level of the background of the stage, 0 to 1. */
const GROUND = [0.071, 0.078, 0.086];

export class Relight {
  /** Raises an Error where the browser has no WebGL2. */
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "low-power" });
    if (!gl) throw new Error("This browser does not offer WebGL2, which relighting needs.");
    this.gl = gl;
    this.hasMipmaps = Boolean(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"));
    this.linear = gl.getExtension("OES_texture_float_linear");
    this.programs = new Map();
    for (const name of Object.keys(UNITS)) {
      this[name + "Texture"] = gl.createTexture();
      this.setPicture(name, new Uint8Array(4), 1, 1);
    }
    this.state = {
      extent: [canvas.width, canvas.height], light: [0, 0, 1], material: "matte", relief: 3, lensShare: 0, wipe: 0, gamma: 1, ground: GROUND, corner: [0, 0], pixel: 1,
    };
    this.isAsked = false;
    /** Milliseconds of a whole picture, as last measured. */
    this.cost = 0;
  }

  /** Show other normals: unit vectors, three floats a pixel, and the mask, not 0 on the object. */
  setNormals(vectors, mask, width, height) {
    const gl = this.gl, texels = new Float32Array(width * height * 4);
    for (let i = 0; i < mask.length; i++) {
      if (!mask[i]) continue;
      texels[4 * i] = vectors[3 * i];
      texels[4 * i + 1] = vectors[3 * i + 1];
      texels[4 * i + 2] = vectors[3 * i + 2];
      texels[4 * i + 3] = 1;
    }
    this.size = [width, height];
    this.source = { vectors, mask };
    this.meanShare = null;
    this.bind("normals");
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, width, height, 0, gl.RGBA, gl.FLOAT, texels);
    if (this.hasMipmaps) gl.generateMipmap(gl.TEXTURE_2D);
    this.filter(gl.LINEAR, this.hasMipmaps ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
    this.ask();
  }

  /** Make the means that the relief needs, once for these normals. */
  setMean() {
    const gl = this.gl, { vectors, mask } = this.source, { texels, columns, rows, share } = smoothed(vectors, mask, ...this.size);
    this.meanShare = share;
    this.bind("mean");
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, columns, rows, 0, gl.RGBA, gl.FLOAT, texels);
    this.filter(gl.LINEAR, gl.LINEAR);
  }

  /** Set `lens` or `photograph`: four bytes a pixel. */
  setPicture(name, bytes, width, height, isSmooth = true) {
    const gl = this.gl;
    this.bind(name);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    const filter = isSmooth ? gl.LINEAR : gl.NEAREST;
    this.filter(filter, filter);
    this.ask();
  }

  /** Set the photograph from a decoded picture. */
  setPhotograph(bitmap) {
    const gl = this.gl;
    this.bind("photograph");
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    this.filter(gl.LINEAR, gl.LINEAR);
    this.ask();
  }

  /** Change extent (pixels of the canvas across and down), light, material, relief, lensShare, wipe, gamma, corner, pixel
      or ground, and draw soon: coarsely where a whole picture takes too long, wholly when nothing changes for a while. */
  set(changes) {
    Object.assign(this.state, changes);
    clearTimeout(this.rest);
    if (this.coarseness > 1) this.rest = setTimeout(() => this.ask(), REST_MS);
    this.ask(this.coarseness);
  }

  /** How many pixels of the extent one is across that is drawn while something moves. */
  get coarseness() {
    const wanted = Math.ceil(Math.sqrt(this.cost / MOVING_MS));
    return Math.max(1, Math.min(MAX_COARSENESS, wanted));
  }

  ask(coarseness = 1) {
    this.asked = coarseness;
    if (this.isAsked || !this.size) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      if (this.asked > 1) this.draw(this.asked);
      else this.drawMeasured();
    });
  }

  /** Draw, and note how long it takes until the picture is there. */
  drawMeasured() {
    const { gl } = this, start = performance.now();
    this.draw();
    if (!this.size || this.fence) return;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const look = () => {
      if (!this.size || gl.isContextLost()) return;
      if (gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return void setTimeout(look, POLL_MS);
      gl.deleteSync(this.fence);
      this.fence = null;
      this.cost = performance.now() - start;
    };
    setTimeout(look, 0);
  }

  /** Use the program for the present state, made when it is first needed; returns the places of its uniforms. */
  select() {
    const { gl, state } = this, wanted = [state.material, state.lensShare > 0, state.wipe > 0], key = wanted.join();
    if (!this.programs.has(key)) {
      const program = linked(gl, fragment(...wanted)), places = {};
      for (const name of UNIFORMS) places[name] = gl.getUniformLocation(program, name);
      gl.useProgram(program);
      for (const [name, unit] of Object.entries(UNITS)) gl.uniform1i(places[name], unit);
      this.programs.set(key, { program, places });
    }
    const { program, places } = this.programs.get(key);
    gl.useProgram(program);
    return places;
  }

  /** Draw now, with pixels that are so many of the extent across; the page stretches the canvas. */
  draw(coarseness = 1) {
    const { gl, state, canvas } = this;
    if (!this.size) return;
    const [width, height] = state.extent.map((length) => Math.max(1, Math.round(length / coarseness)));
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const places = this.select();
    gl.viewport(0, 0, width, height);
    if (state.material === "relief" && !this.meanShare) this.setMean();
    gl.uniform2fv(places.size, this.size);
    gl.uniform2fv(places.meanShare, this.meanShare ?? [1, 1]);
    gl.uniform2fv(places.corner, state.corner);
    gl.uniform1f(places.pixel, state.pixel * (state.extent[0] / width));
    gl.uniform1f(places.canvasHeight, height);
    gl.uniform3fv(places.light, state.light);
    gl.uniform3fv(places.ground, state.ground);
    gl.uniform1f(places.relief, state.relief);
    gl.uniform1f(places.lensShare, state.lensShare);
    gl.uniform1f(places.wipe, state.wipe);
    gl.uniform1f(places.gamma, state.gamma);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Pixels of the picture under the present state, one to one, on black: four bytes each, the top row first. */
  pixels() {
    const { gl, state } = this, [width, height] = this.size;
    const { extent, corner, pixel, ground } = state;
    Object.assign(state, { extent: this.size, corner: [0, 0], pixel: 1, ground: [0, 0, 0] });
    this.draw();
    const upwards = new Uint8Array(width * height * 4), downwards = new Uint8Array(upwards.length);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upwards);
    for (let row = 0; row < height; row++) {
      downwards.set(upwards.subarray((height - 1 - row) * width * 4, (height - row) * width * 4), row * width * 4);
    }
    this.set({ extent, corner, pixel, ground });
    return downwards;
  }

  dispose() {
    this.size = null;
    clearTimeout(this.rest);
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  bind(name) {
    this.gl.activeTexture(this.gl.TEXTURE0 + UNITS[name]);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this[name + "Texture"]);
  }

  filter(near, far) {
    const gl = this.gl;
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, near);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, far);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }
}

function linked(gl, source) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, source]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}
