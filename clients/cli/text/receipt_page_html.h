#pragma once

#include <string_view>

namespace trammel::cli {

/// The page of a receipt: {{facts}}, {{targets}}, {{points}} and {{tolerance}} are filled in. The path turns and zooms
/// in a canvas of its own; nothing is loaded.
constexpr std::string_view kReceiptPage = R"page(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>Trammel: corrected program</title>
<style>
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; color: #1b1f24; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
table { border-collapse: collapse; width: 100%; font-size: 13px; }
th, td { text-align: left; padding: .25rem .6rem; border-bottom: 1px solid #dde1e6; vertical-align: top; }
table.facts { width: auto; } table.facts td:first-child { color: #5b6470; }
tr.left td { background: #fdecea; } tr.out_of_domain td { background: #fff6e0; } tr.verdict td { font-weight: 600; }
canvas { width: 100%; height: 28rem; border: 1px solid #dde1e6; border-radius: 6px; touch-action: none; cursor: grab; }
.bar { display: flex; gap: 1rem; align-items: center; margin: .5rem 0; flex-wrap: wrap; }
#scale { height: .8rem; width: 12rem; border-radius: 3px; }
#under { color: #5b6470; min-height: 1.4em; }
</style>
</head>
<body>
<h1>Corrected program</h1>
{{facts}}
<h2>Path</h2>
<div class="bar">
<label><input type="radio" name="by" value="after" checked> expected error after</label>
<label><input type="radio" name="by" value="before"> before</label>
<span id="low"></span><span id="scale"></span><span id="high"></span>
<span>ringed: out of domain; crossed: left as it was</span>
</div>
<canvas id="path"></canvas>
<div id="under">Drag to turn, wheel to zoom, shift and drag to move.</div>
<h2>Targets</h2>
{{targets}}
<script>
"use strict";
const points = {{points}}, tolerance = {{tolerance}};
const canvas = document.getElementById("path"), pen = canvas.getContext("2d");
const bounds = [0, 1, 2].map(k => [Math.min(...points.map(p => p[k])), Math.max(...points.map(p => p[k]))]);
const middle = bounds.map(b => (b[0] + b[1]) / 2);
const size = Math.max(1, Math.hypot(...bounds.map(b => b[1] - b[0])));
let yaw = -0.6, pitch = 0.4, zoom = 1, shiftX = 0, shiftY = 0, by = 4;
function colour(share) { return `hsl(${210 - 210 * Math.min(1, Math.max(0, share))}, 85%, 45%)`; }
function highest() {
  if (tolerance > 0) return tolerance;
  return Math.max(1e-6, ...points.map(p => p[by]).filter(v => v !== null));
}
function project(p) {
  const [x, y, z] = [0, 1, 2].map(k => (p[k] - middle[k]) / size);
  const cy = Math.cos(yaw), sy = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
  const right = -sy * x + cy * y, away = cy * x + sy * y;
  const scale = zoom * Math.min(canvas.width, canvas.height);
  return [canvas.width / 2 + shiftX + scale * right, canvas.height / 2 + shiftY - scale * (cp * z - sp * away), away * cp + z * sp];
}
function axes() {
  const length = size / 6, corner = bounds.map(b => b[0]);
  ["x", "y", "z"].forEach((name, k) => {
    const tip = corner.slice();
    tip[k] += length;
    const a = project(corner), b = project(tip);
    pen.strokeStyle = pen.fillStyle = ["#c0392b", "#27863d", "#2858c0"][k];
    pen.beginPath(); pen.moveTo(a[0], a[1]); pen.lineTo(b[0], b[1]); pen.stroke();
    pen.fillText(name, b[0] + 4, b[1]);
  });
}
let shown = [];
function draw() {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * ratio; canvas.height = canvas.clientHeight * ratio;
  pen.font = `${13 * ratio}px system-ui`; pen.lineWidth = ratio;
  axes();
  shown = points.map(project);
  pen.strokeStyle = "#b9c0c9";
  pen.beginPath();
  shown.forEach((s, i) => i === 0 ? pen.moveTo(s[0], s[1]) : pen.lineTo(s[0], s[1]));
  pen.stroke();
  const most = highest(), radius = (points.length > 3000 ? 2 : 4) * ratio;
  points.forEach((p, i) => {
    const s = shown[i], value = p[by];
    pen.fillStyle = pen.strokeStyle = value === null ? "#8a929c" : colour(value / most);
    pen.beginPath(); pen.arc(s[0], s[1], radius, 0, 7); pen.fill();
    if (p[5] === "out_of_domain") {
      pen.strokeStyle = "#b07800";
      pen.beginPath(); pen.arc(s[0], s[1], 2 * radius, 0, 7); pen.stroke();
    } else if (p[5] !== "ok") {
      pen.strokeStyle = "#c0392b";
      pen.beginPath(); pen.moveTo(s[0] - 2 * radius, s[1] - 2 * radius); pen.lineTo(s[0] + 2 * radius, s[1] + 2 * radius);
      pen.moveTo(s[0] - 2 * radius, s[1] + 2 * radius); pen.lineTo(s[0] + 2 * radius, s[1] - 2 * radius); pen.stroke();
    }
  });
  document.getElementById("low").textContent = "0";
  document.getElementById("high").textContent = most.toPrecision(3) + " mm";
  document.getElementById("scale").style.background =
    `linear-gradient(90deg, ${[0, .25, .5, .75, 1].map(colour).join(",")})`;
}
let held = null;
canvas.addEventListener("pointerdown", e => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
canvas.addEventListener("pointerup", () => { held = null; });
canvas.addEventListener("pointermove", e => {
  const ratio = window.devicePixelRatio || 1;
  if (held) {
    const dx = e.clientX - held[0], dy = e.clientY - held[1];
    held = [e.clientX, e.clientY];
    if (e.shiftKey) { shiftX += dx * ratio; shiftY += dy * ratio; }
    else { yaw -= dx / 150; pitch = Math.min(1.57, Math.max(-1.57, pitch + dy / 150)); }
    draw();
    return;
  }
  const x = e.offsetX * ratio, y = e.offsetY * ratio;
  let best = -1, least = 15 * ratio;
  shown.forEach((s, i) => { const d = Math.hypot(s[0] - x, s[1] - y); if (d < least) { least = d; best = i; } });
  if (best < 0) return;
  const p = points[best], mm = v => v === null ? "not known" : v.toFixed(4) + " mm";
  document.getElementById("under").textContent = `${p[6]}: ${p[5]}, before ${mm(p[3])}, after ${mm(p[4])}`;
});
canvas.addEventListener("wheel", e => { e.preventDefault(); zoom *= Math.exp(-e.deltaY / 600); draw(); }, { passive: false });
document.querySelectorAll("input[name=by]").forEach(i => i.addEventListener("change", () => { by = i.value === "after" ? 4 : 3; draw(); }));
window.addEventListener("resize", draw);
draw();
</script>
</body>
</html>
)page";

}  // namespace trammel::cli
