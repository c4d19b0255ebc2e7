// Numbers as coarse as anybody needs them.

/** Returns a number with two decimals. */
export function hundredths(value) {
  return Math.round(value * 100) / 100;
}

/** Returns the pixel in which a point of the full frame lies. */
export function pixelAt({ x, y }) {
  return { x: Math.round(x), y: Math.round(y) };
}
