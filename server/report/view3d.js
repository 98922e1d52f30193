
"use strict";
/* A canvas that turns, zooms and moves. `points` are what must be seen, `paint(view)` draws with view.pen and
   view.project (pixels and depth, nearer is larger), `touched(x, y, ratio)` hears where the pointer rests. */
function view3d(canvas, points, paint, touched) {
  const bounds = [0, 1, 2].map(k => points.reduce((b, p) => [Math.min(b[0], p[k]), Math.max(b[1], p[k])], [Infinity, -Infinity]));
  const middle = bounds.map(b => (b[0] + b[1]) / 2);
  const size = Math.max(1, Math.hypot(...bounds.map(b => b[1] - b[0])));
  const view = {pen: canvas.getContext("2d"), bounds, size, ratio: 1, yaw: -0.6, pitch: 0.4, zoom: 1, shift: [0, 0]};
  view.scale = () => view.zoom * Math.min(canvas.width, canvas.height) / size;
  view.project = p => {
    const [x, y, z] = p.map((v, k) => v - middle[k]);
    const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
    const right = -sy * x + cy * y, near = cy * x + sy * y, scale = view.scale();
    return [canvas.width / 2 + view.shift[0] + scale * right, canvas.height / 2 + view.shift[1] - scale * (cp * z - sp * near), near * cp + z * sp];
  };
  view.line = path => {
    view.pen.beginPath();
    path.map(view.project).forEach((s, i) => i === 0 ? view.pen.moveTo(s[0], s[1]) : view.pen.lineTo(s[0], s[1]));
    view.pen.stroke();
  };
  view.axes = () => {
    const corner = bounds.map(b => b[0]);
    ["x", "y", "z"].forEach((name, k) => {
      const tip = corner.slice();
      tip[k] += size / 6;
      view.pen.strokeStyle = view.pen.fillStyle = ["#d55e00", "#009e73", "#0072b2"][k];
      view.line([corner, tip]);
      const end = view.project(tip);
      view.pen.fillText(name, end[0] + 4 * view.ratio, end[1]);
    });
  };
  view.draw = () => {
    view.ratio = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * view.ratio;
    canvas.height = canvas.clientHeight * view.ratio;
    view.pen.font = `${13 * view.ratio}px system-ui, sans-serif`;
    view.pen.lineWidth = view.ratio;
    view.axes();
    paint(view);
  };
  let held = null;
  canvas.addEventListener("pointerdown", e => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointerup", () => { held = null; });
  canvas.addEventListener("pointermove", e => {
    if (!held) return touched(e.offsetX * view.ratio, e.offsetY * view.ratio, view.ratio);
    const dx = e.clientX - held[0], dy = e.clientY - held[1];
    held = [e.clientX, e.clientY];
    if (e.shiftKey) view.shift = [view.shift[0] + dx * view.ratio, view.shift[1] + dy * view.ratio];
    else { view.yaw -= dx / 150; view.pitch = Math.min(1.57, Math.max(-1.57, view.pitch + dy / 150)); }
    view.draw();
  });
  canvas.addEventListener("wheel", e => { e.preventDefault(); view.zoom *= Math.exp(-e.deltaY / 600); view.draw(); }, {passive: false});
  window.addEventListener("resize", view.draw);
  return view;
}
/* Of the projected points the nearest to the pointer, -1 where none is near. */
function nearest3d(shown, x, y, ratio) {
  let best = -1, least = 15 * ratio;
  shown.forEach((s, i) => { const d = Math.hypot(s[0] - x, s[1] - y); if (d < least) { least = d; best = i; } });
  return best;
}
