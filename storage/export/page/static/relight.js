// Normals of one capture under a light that moves: WebGL2, drawn only when something changed.

import { VERTEX, fragment } from "./shaders.js";

const UNIFORMS = ["normals", "lens", "photograph", "size", "corner", "pixel", "canvasHeight", "light", "ground", "relief", "lensShare", "wipe", "gamma"];
const UNITS = { normals: 0, lens: 1, photograph: 2 };
/** Level of the background of the stage, 0 to 1. */
export const GROUND = [0.071, 0.078, 0.086];

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
      light: [0, 0, 1], material: "matte", relief: 3, lensShare: 0, wipe: 0, gamma: 1, ground: GROUND, corner: [0, 0], pixel: 1,
    };
    this.isAsked = false;
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
    this.bind("normals");
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, width, height, 0, gl.RGBA, gl.FLOAT, texels);
    if (this.hasMipmaps) gl.generateMipmap(gl.TEXTURE_2D);
    this.filter(gl.LINEAR, this.hasMipmaps ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
    this.ask();
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

  /** Change light, material, relief, lensShare, wipe, gamma, corner, pixel or ground, and draw soon. */
  set(changes) {
    Object.assign(this.state, changes);
    this.ask();
  }

  ask() {
    if (this.isAsked || !this.size) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      this.draw();
    });
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

  /** Draw now. */
  draw() {
    const { gl, state, canvas } = this;
    if (!this.size) return;
    const places = this.select();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.uniform2fv(places.size, this.size);
    gl.uniform2fv(places.corner, state.corner);
    gl.uniform1f(places.pixel, state.pixel);
    gl.uniform1f(places.canvasHeight, canvas.height);
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
    const { gl, canvas, state } = this, [width, height] = this.size;
    const kept = [canvas.width, canvas.height, state.corner, state.pixel, state.ground];
    [canvas.width, canvas.height] = this.size;
    Object.assign(state, { corner: [0, 0], pixel: 1, ground: [0, 0, 0] });
    this.draw();
    const upwards = new Uint8Array(width * height * 4), downwards = new Uint8Array(upwards.length);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upwards);
    for (let row = 0; row < height; row++) {
      downwards.set(upwards.subarray((height - 1 - row) * width * 4, (height - row) * width * 4), row * width * 4);
    }
    [canvas.width, canvas.height, state.corner, state.pixel, state.ground] = kept;
    this.ask();
    return downwards;
  }

  dispose() {
    this.size = null;
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
