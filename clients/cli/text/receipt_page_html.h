#pragma once

#include <string_view>

namespace trammel::cli {

/// The page of a receipt, with `{{...}}` where its content goes. The path turns and zooms in a
/// canvas (view3d_script()); nothing is loaded.
constexpr std::string_view kReceiptPage = R"page(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
{{mark}}
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Trammel: corrected program</title>
<style>{{page_css}}</style>
<style>
.targets { font-size: 13px; } .targets td:nth-child(n+3):nth-child(-n+13) { white-space: nowrap; } .targets td:nth-child(-n+2) { overflow-wrap: anywhere; } .targets td:nth-child(n+7):nth-child(-n+13) { text-align: right; }
table.facts { width: auto; } table.facts td:first-child { color: var(--soft); }
tr.left td { background: #fbe6da; } tr.out_of_domain td { background: #fff6e0; }
#path { display: block; width: 100%; height: 28rem; border: 1px solid var(--line); border-radius: 6px; touch-action: none; cursor: grab; }
.bar { display: flex; gap: 6px 16px; align-items: center; margin: .5rem 0; flex-wrap: wrap; }
#scale { height: .8rem; width: 12rem; border-radius: 3px; }
#under { color: var(--soft); min-height: 1.4em; }
@media screen and (max-width: 860px) {
  #path { height: 18rem; }
  /* A target is a card: names of columns stand in the style, for there may be thousands of targets. */
  .targets, .targets tbody, .targets tr { display: block; } .targets thead, .targets td:empty { display: none; }
  .targets tr { padding: 6px 8px; border-bottom: 1px solid var(--line); }
  .targets td, .targets td:nth-child(n) { display: inline-block; border: 0; padding: 0 14px 0 0; text-align: left; white-space: normal; background: none; }
  .targets td:nth-child(-n+2) { font-weight: 600; } tr.left { background: #fbe6da; } tr.out_of_domain { background: #fff6e0; }
  .targets td:nth-child(n+4)::before { color: var(--soft); } .targets td:nth-child(4)::before { content: "tool "; } .targets td:nth-child(5)::before { content: "frame "; }
  .targets td:nth-child(7)::before { content: "dx, mm "; } .targets td:nth-child(8)::before { content: "dy, mm "; } .targets td:nth-child(9)::before { content: "dz, mm "; }
  .targets td:nth-child(10)::before { content: "before, mm "; } .targets td:nth-child(11)::before { content: "after, mm "; }
  .targets td:nth-child(12)::before { content: "sigma, mm "; } .targets td:nth-child(13)::before { content: "rounding, mm "; }
}
@media print { tr { break-inside: avoid; } #path { height: 16rem; break-inside: avoid; } .targets { font-size: 8px; } .targets td:nth-child(n) { white-space: normal; } }
</style>
</head>
<body>
<main>
<h1>Corrected program</h1>
<p class="subtitle">{{subtitle}}</p>
<nav class="beside"></nav>
<section>
<p class="verdict" id="verdict">{{verdict}}</p>
{{facts}}
</section>
<section>
<h2>Path</h2>
<div class="bar">
<label class="screen"><input type="radio" name="by" value="after" checked> expected error after</label>
<label class="screen"><input type="radio" name="by" value="before"> before</label>
<span>expected error:</span> <span id="low"></span><span id="scale"></span><span id="high"></span>
<span>ringed: out of domain; crossed: left as it was</span>
</div>
<canvas id="path"></canvas>
<div id="under" class="screen">Drag to turn, wheel to zoom, shift and drag to move.</div>
</section>
<section>
<h2>Targets</h2>
{{targets}}
</section>
</main>
<script>{{view3d_js}}</script>
<script>
const points = {{points}}, tolerance = {{tolerance}};
let by = 4, shown = [];
/* Viridis, light to dark: readable without colours, too. */
const shades = [[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]];
function colour(share) {
  const at = Math.min(1, Math.max(0, share)) * (shades.length - 1), low = Math.min(Math.floor(at), shades.length - 2);
  return `rgb(${shades[low].map((c, k) => Math.round(c + (at - low) * (shades[low + 1][k] - c))).join(",")})`;
}
function highest() {
  if (tolerance > 0) return tolerance;
  return points.reduce((most, p) => Math.max(most, p[by] === null ? 0 : p[by]), 1e-6);
}
function mark(view, place, status, radius) {
  const {pen} = view;
  if (status === "ok") return;
  pen.beginPath();
  if (status === "out_of_domain") {
    pen.strokeStyle = "#b07800";
    pen.arc(place[0], place[1], 2 * radius, 0, 7);
  } else {
    pen.strokeStyle = "#b23c00";
    for (const side of [-1, 1]) {
      pen.moveTo(place[0] - 2 * radius, place[1] - 2 * side * radius);
      pen.lineTo(place[0] + 2 * radius, place[1] + 2 * side * radius);
    }
  }
  pen.stroke();
}
const view = view3d(document.getElementById("path"), points.length ? points : [[0, 0, 0]], view => {
  const {pen} = view, most = highest(), radius = (points.length > 3000 ? 2 : 4) * view.ratio;
  pen.strokeStyle = "#b9c0c9";
  view.line(points.map(p => p.slice(0, 3)));
  shown = points.map(p => view.project(p.slice(0, 3)));
  points.forEach((p, i) => {
    pen.fillStyle = p[by] === null ? "#8a929c" : colour(p[by] / most);
    pen.beginPath(); pen.arc(shown[i][0], shown[i][1], radius, 0, 7); pen.fill();
    mark(view, shown[i], p[5], radius);
  });
  document.getElementById("low").textContent = "0";
  document.getElementById("high").textContent = most.toPrecision(3) + " mm";
  document.getElementById("scale").style.background =
    `linear-gradient(90deg, ${[0, .25, .5, .75, 1].map(colour).join(",")})`;
}, (x, y, ratio) => {
  const best = nearest3d(shown, x, y, ratio);
  if (best < 0) return;
  const p = points[best], mm = v => v === null ? "not known" : v.toFixed(4) + " mm";
  document.getElementById("under").textContent = `${p[6]}: ${p[5]}, before ${mm(p[3])}, after ${mm(p[4])}`;
});
view.zoom = 0.8;
document.querySelectorAll("input[name=by]").forEach(i => i.addEventListener("change", () => { by = i.value === "after" ? 4 : 3; view.draw(); }));
view.draw();
</script>
</body>
</html>
)page";

}  // namespace trammel::cli
