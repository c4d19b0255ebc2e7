// Normals averaged around each pixel, which the relief is enlarged against: made once, for every light and strength.

/** Part of the picture's longer side over which normals are averaged. */
const RADIUS_SHARE = 1 / 40;
/** Cells of the coarse picture in a radius: the average varies no faster. */
const CELLS_PER_RADIUS = 3;
const PASSES = 2;

/** The sum of the unit vectors (three floats a pixel) of the object around each cell: four floats a cell, and the size in cells. */
export function smoothed(vectors, mask, width, height) {
  const radius = Math.max(width, height) * RADIUS_SHARE, side = Math.max(1, Math.round(radius / CELLS_PER_RADIUS));
  const columns = Math.ceil(width / side), rows = Math.ceil(height / side);
  let cells = new Float32Array(columns * rows * 4);
  for (let y = 0, i = 0; y < height; y++) {
    const start = Math.floor(y / side) * columns;
    for (let x = 0; x < width; x++, i++) {
      if (!mask[i]) continue;
      const cell = 4 * (start + Math.floor(x / side));
      for (let k = 0; k < 3; k++) cells[cell + k] += vectors[3 * i + k];
    }
  }
  const reach = Math.max(1, Math.round(radius / side));
  for (let pass = 0; pass < PASSES; pass++) {
    cells = summed(cells, columns, rows, reach, 4, 4 * columns);
    cells = summed(cells, rows, columns, reach, 4 * columns, 4);
  }
  // A cell of the texture is so many pixels across; the last ones reach beyond the picture.
  return { texels: unit(cells), columns, rows, share: [width / (columns * side), height / (rows * side)] };
}

/** Sums over `reach` cells to both sides along lines: `length` cells a line at distance `step`, `count` lines at `next`. */
function summed(cells, length, count, reach, step, next) {
  const sums = new Float32Array(cells.length);
  for (let line = 0; line < count; line++) {
    for (let k = 0; k < 3; k++) {
      const start = line * next + k;
      let sum = 0;
      for (let i = -reach; i < length; i++) {
        if (i + reach < length) sum += cells[start + (i + reach) * step];
        if (i - reach > 0) sum -= cells[start + (i - reach - 1) * step];
        if (i >= 0) sums[start + i * step] = sum;
      }
    }
  }
  return sums;
}

function unit(cells) {
  for (let i = 0; i < cells.length; i += 4) {
    const length = Math.hypot(cells[i], cells[i + 1], cells[i + 2]) || 1;
    for (let k = 0; k < 3; k++) cells[i + k] /= length;
  }
  return cells;
}
