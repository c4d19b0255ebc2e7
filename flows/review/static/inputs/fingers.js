// Two fingers on a picture: they move and zoom it, whatever the tool. What the first one had begun is cancelled.

export function followFingers(picture, signal) {
  const { container } = picture;
  const fingers = new Map();
  let last = null;
  const hold = () => {
    const [a, b] = [...fingers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, spread: Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)) };
  };
  // Before the tools' own listeners: a second finger is none of their business.
  container.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch") return;
    fingers.set(event.pointerId, picture.offset(event));
    if (fingers.size < 2) return;
    event.stopImmediatePropagation();
    if (fingers.size === 2) container.dispatchEvent(new PointerEvent("pointercancel"));
    last = hold();
  }, { signal, capture: true });
  container.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    fingers.set(event.pointerId, picture.offset(event));
    if (!last) return;
    event.stopImmediatePropagation();
    if (fingers.size < 2) return;
    const now = hold();
    picture.move(now.x - last.x, now.y - last.y);
    picture.zoomBy(now.spread / last.spread, now);
    last = now;
  }, { signal, capture: true });
  for (const name of ["pointerup", "pointercancel"]) {
    addEventListener(name, (event) => {
      if (!fingers.delete(event.pointerId)) return;
      if (fingers.size === 0) last = null;
      else if (last && fingers.size > 1) last = hold();
    }, { signal, capture: true });
  }
}
