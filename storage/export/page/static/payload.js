// Packed arrays and files of a capture, unpacked as storage/export/page/packing.py packed them.

const ELEMENTS = { u8: [1, Uint8Array], u16: [2, Uint16Array], u32: [4, Uint32Array] };
export const NO_DEPTH = 0;
export const NO_CONFIDENCE = 255;

/** Parts that stand in the page itself, in script elements of base64. */
export class EmbeddedParts {
  constructor(root = document) {
    this.root = root;
  }

  async bytes(name) {
    const element = this.root.querySelector(`script[data-part="${CSS.escape(name)}"]`);
    if (!element) throw new Error(`the page holds no part ${name}`);
    const text = atob(element.textContent.trim());
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    return bytes;
  }
}

/** Parts that a server sends, each under its name below an address. */
export class ServedParts {
  constructor(address, options = {}) {
    this.address = address;
    this.options = options;
  }

  async bytes(name) {
    const answer = await fetch(`${this.address}/${encodeURIComponent(name)}`, this.options);
    if (!answer.ok) {
      const { error, remedy } = await answer.json().catch(() => ({ error: `status ${answer.status}` }));
      throw new Error(`${name} could not be read: ${[error, remedy].filter(Boolean).join(" → ")}`);
    }
    return new Uint8Array(await answer.arrayBuffer());
  }
}

/** The array of a part: values in the order of its shape. */
export async function unpack(bytes, { kind, shape }) {
  const [size, Values] = ELEMENTS[kind];
  const [height, width, channels = 1] = shape;
  const planes = await inflate(bytes);
  const pixels = height * width;
  if (planes.length !== pixels * channels * size) throw new Error("a part of this page is damaged");
  const values = new Values(pixels * channels);
  for (let channel = 0; channel < channels; channel++) {
    const start = channel * size * pixels;
    for (let row = 0; row < height; row++) {
      let value = 0;
      for (let pixel = row * width, end = pixel + width; pixel < end; pixel++) {
        let difference = planes[start + pixel];
        for (let octet = 1; octet < size; octet++) difference |= planes[start + octet * pixels + pixel] << (8 * octet);
        value = value + difference;
        values[pixel * channels + channel] = value;
      }
    }
  }
  return values;
}

/** Unit vectors, three floats each, of their octahedral codes, two integers each. */
export function unitVectors(codes) {
  const vectors = new Float32Array((codes.length / 2) * 3);
  for (let i = 0, o = 0; i < codes.length; i += 2, o += 3) {
    let x = codes[i] / 32767.5 - 1, y = codes[i + 1] / 32767.5 - 1;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
    const length = Math.hypot(x, y, z);
    vectors[o] = x / length;
    vectors[o + 1] = y / length;
    vectors[o + 2] = z / length;
  }
  return vectors;
}

/** A capture whose parts are unpacked when they are first asked for. */
export class Capture {
  constructor(facts, parts, prefix = "") {
    this.facts = facts;
    this.parts = parts;
    this.prefix = prefix;
    [this.width, this.height] = facts.size ?? [0, 0];
    this.read = new Map();
  }

  has(name) {
    return name in this.facts.parts;
  }

  bytes(name) {
    return this.parts.bytes(this.prefix + name);
  }

  array(name) {
    if (!this.read.has(name)) {
      const made = this.bytes(name).then((bytes) => unpack(bytes, this.facts.parts[name]));
      // What could not be read is asked for again.
      made.catch(() => this.read.delete(name));
      this.read.set(name, made);
    }
    return this.read.get(name);
  }

  async normals() {
    if (!this.vectors) this.vectors = unitVectors(await this.array("normals"));
    return this.vectors;
  }

  /** Depth in its unit, NaN where it is not known. */
  async depth() {
    const codes = await this.array("depth"), { low, high } = this.facts.depth;
    return Float32Array.from(codes, (code) => (code === NO_DEPTH ? NaN : low + ((code - 1) / 65534) * (high - low)));
  }

  async picture(name) {
    return createImageBitmap(new Blob([await this.bytes(name)], { type: this.facts.parts[name].kind }));
  }
}

/** Positions, normals, triangles and confidence of a mesh, as three.js takes them. */
export async function meshArrays(capture) {
  const { origin, step } = capture.facts.mesh;
  const codes = await capture.array("positions"), corners = await capture.array("triangles");
  const positions = new Float32Array(codes.length);
  for (let i = 0; i < codes.length; i++) positions[i] = origin[i % 3] + codes[i] * step;
  const triangles = new Uint32Array(corners);
  for (let i = 0; i < triangles.length; i += 3) {
    triangles[i + 1] += triangles[i];
    triangles[i + 2] += triangles[i];
  }
  const normals = unitVectors(await capture.array("vertex_normals"));
  const confidence = capture.has("vertex_confidence") ? await capture.array("vertex_confidence") : null;
  const source = capture.has("vertex_source") ? await capture.array("vertex_source") : null;
  return { positions, normals, triangles, confidence, source };
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
