// Turns, moves and zooms a 3D view by mouse, touch and keyboard.

const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Listens to a canvas. `draw` is called after each change; `more` are further keys and what they do. */
export function orbit(canvas, view, draw, more) {
  const pointers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY];
    const [dx, dy] = now.map((x, i) => x - before[i]);
    const height = canvas.clientHeight;
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([key]) => key !== event.pointerId).map(([, place]) => place);
      const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]) || 1;
      view.zoom(apart(before) / apart(now));
      view.pan(-dx / height / 2, dy / height / 2);
    } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) {
      view.pan(-dx / height, dy / height);
    } else {
      view.turn(-dx * 0.4, dy * 0.4);
    }
    pointers.set(event.pointerId, now);
    draw();
  });
  const release = (event) => pointers.delete(event.pointerId);
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  const wheel = (event) => {
    event.preventDefault();
    view.zoom(Math.exp(Math.sign(event.deltaY) * 0.1));
    draw();
  };
  canvas.addEventListener("wheel", wheel, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const keys = {
      "+": () => view.zoom(0.85),
      "=": () => view.zoom(0.85),
      "-": () => view.zoom(1.18),
      Home: () => view.fit(),
      ...more,
    };
    const arrow = ARROWS[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (arrow && event.shiftKey) view.pan(-0.05 * arrow[0], 0.05 * arrow[1]);
    else if (arrow) view.turn(6 * arrow[0], 6 * arrow[1]);
    else if (keys[event.key]) keys[event.key]();
    else return;
    event.preventDefault();
    draw();
  });
}
