// A mask as one byte for each pixel of the full frame: drawn into by discs and polygons, tinted, encoded as PNG.

const INSIDE = [112, 214, 150, 44];
const RIM = [140, 240, 175, 230];
/** Bytes that are turned into text at once: more are too many arguments of a call. */
const TEXT_BLOCK = 32768;

/** Returns the box around two boxes: [left, top, right, bottom], the last column and row included. */
export function union(first, second) {
  const [left, top] = [0, 1].map((side) => Math.min(first[side], second[side]));
  const [right, bottom] = [2, 3].map((side) => Math.max(first[side], second[side]));
  return [left, top, right, bottom];
}

export class PixelMask {
  constructor(width, height, pixels = new Uint8Array(width * height)) {
    Object.assign(this, { width, height, pixels });
  }

  copy() {
    return new PixelMask(this.width, this.height, this.pixels.slice());
  }

  get whole() {
    return [0, 0, this.width - 1, this.height - 1];
  }

  /** Takes the pixels that `isIn` names by their index, and no others. */
  take(isIn) {
    for (let index = 0; index < this.pixels.length; index += 1) this.pixels[index] = isIn(index) ? 1 : 0;
  }

  /** Sets the pixels that `isIn` names by their index to 0 or 1. */
  fill(isIn, value) {
    for (let index = 0; index < this.pixels.length; index += 1) if (isIn(index)) this.pixels[index] = value;
  }

  /** Sets the pixels of a disc to 0 or 1; returns the box around those in the frame, null without any. */
  fillDisc(x, y, radius, value) {
    const { width, height } = this;
    const [left, right] = [Math.max(0, Math.ceil(x - radius)), Math.min(width - 1, Math.floor(x + radius))];
    const [top, bottom] = [Math.max(0, Math.ceil(y - radius)), Math.min(height - 1, Math.floor(y + radius))];
    if (left > right || top > bottom) return null;
    for (let row = top; row <= bottom; row += 1) {
      for (let column = left; column <= right; column += 1) {
        if ((row - y) ** 2 + (column - x) ** 2 <= radius * radius) this.pixels[row * width + column] = value;
      }
    }
    return [left, top, right, bottom];
  }

  /** Returns whether each pixel lies in a polygon with these corners, as a function of its index. */
  inPolygon(corners) {
    const context = new OffscreenCanvas(this.width, this.height).getContext("2d");
    context.beginPath();
    for (const { x, y } of corners) context.lineTo(x + 0.5, y + 0.5);
    context.closePath();
    context.fill();
    const { data } = context.getImageData(0, 0, this.width, this.height);
    return (index) => data[4 * index + 3] >= 128;
  }

  /** Returns the pixels of a box. */
  cut([left, top, right, bottom]) {
    const columns = right - left + 1;
    const part = new Uint8Array(columns * (bottom - top + 1));
    for (let row = top; row <= bottom; row += 1) {
      const start = row * this.width + left;
      part.set(this.pixels.subarray(start, start + columns), (row - top) * columns);
    }
    return part;
  }

  /** Puts pixels that were cut back into their box. */
  paste([left, top, right, bottom], part) {
    const columns = right - left + 1;
    for (let row = top; row <= bottom; row += 1) this.pixels.set(part.subarray((row - top) * columns, (row - top + 1) * columns), row * this.width + left);
  }

  /** Draws a box and the pixels beside it: the mask tinted, brighter at its rim. */
  draw(context, [left, top, right, bottom]) {
    const { pixels, width, height } = this;
    const [x, y] = [Math.max(0, left - 1), Math.max(0, top - 1)];
    const part = context.createImageData(Math.min(width, right + 2) - x, Math.min(height, bottom + 2) - y);
    for (let row = y; row < y + part.height; row += 1) {
      for (let column = x; column < x + part.width; column += 1) {
        const index = row * width + column;
        if (!pixels[index]) continue;
        const isRim = column === 0 || row === 0 || column === width - 1 || row === height - 1 || !pixels[index - 1] || !pixels[index + 1] || !pixels[index - width] || !pixels[index + width];
        part.data.set(isRim ? RIM : INSIDE, 4 * ((row - y) * part.width + column - x));
      }
    }
    context.putImageData(part, x, y);
  }

  count() {
    let count = 0;
    for (const pixel of this.pixels) count += pixel;
    return count;
  }

  get touchesEdge() {
    const { pixels, width, height } = this;
    for (let column = 0; column < width; column += 1) if (pixels[column] || pixels[(height - 1) * width + column]) return true;
    for (let row = 0; row < height; row += 1) if (pixels[row * width] || pixels[row * width + width - 1]) return true;
    return false;
  }

  /** Returns a PNG, white on black, as base64. */
  async encoded() {
    const canvas = new OffscreenCanvas(this.width, this.height);
    const context = canvas.getContext("2d");
    const image = context.createImageData(this.width, this.height);
    for (let index = 0; index < this.pixels.length; index += 1) image.data.fill(this.pixels[index] ? 255 : 0, 4 * index, 4 * index + 3);
    for (let index = 3; index < image.data.length; index += 4) image.data[index] = 255;
    context.putImageData(image, 0, 0);
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer());
    let text = "";
    for (let start = 0; start < bytes.length; start += TEXT_BLOCK) text += String.fromCharCode(...bytes.subarray(start, start + TEXT_BLOCK));
    return btoa(text);
  }
}
