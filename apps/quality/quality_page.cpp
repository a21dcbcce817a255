#include <nlohmann/json.hpp>

#include "apps/quality/quality_results.h"
#include "crypto/encoding.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

constexpr const char* kBegin = R"page(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<title>What each coding leaves of a clip</title>
<style>
body { margin: 0; font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff; }
main { max-width: 110rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.4rem; margin: 0 0 .5rem; }
h2 { font-size: 1.1rem; margin: 1.5rem 0 .5rem; }
.bar { display: flex; flex-wrap: wrap; gap: .5rem 1rem; align-items: end; margin: .5rem 0; }
label { display: flex; flex-direction: column; font-size: .85rem; }
select, button { font: inherit; min-height: 2.4rem; padding: 0 .6rem; }
.panes { display: grid; grid-template-columns: 1fr 1fr; gap: 4px; background: #111; }
.pane { position: relative; }
canvas { display: block; width: 100%; touch-action: none; cursor: grab; background: #000; }
canvas:focus-visible { outline: 3px solid #f7a600; outline-offset: -3px; }
.pane span { position: absolute; left: 0; top: 0; padding: .1rem .5rem; background: #000b; color: #fff; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .6rem; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
tr.ours td:first-child { font-weight: 600; }
.plots { display: flex; flex-wrap: wrap; gap: 1rem; }
.plots img { width: 32rem; max-width: 100%; }
.small { color: #555; font-size: .9rem; max-width: 60rem; }
@media (max-width: 45rem) { .panes { grid-template-columns: 1fr; } }
</style>
</head>
<body>
<main>
<h1>What each coding leaves of a clip</h1>
<div class="bar">
<label>clip <select id="clip"></select></label>
<label>picture <select id="picture"></select></label>
<label>left <select id="left"></select></label>
<label>right <select id="right"></select></label>
<button id="swap" type="button">swap</button>
<button id="difference" type="button" aria-pressed="false">difference, 8 times</button>
<button id="fit" type="button">whole picture</button>
<button id="one" type="button">pixel for pixel</button>
<span id="zoom" role="status"></span>
</div>
<div class="panes" id="panes">
<div class="pane"><canvas id="c0" tabindex="0" aria-label="left picture"></canvas><span id="n0"></span></div>
<div class="pane"><canvas id="c1" tabindex="0" aria-label="right picture"></canvas><span id="n1"></span></div>
</div>
<p class="small">Both pictures move and grow together: drag, turn the wheel, or use the arrow keys, + and -. From twice its size on, each pixel is shown as a square. Pictures are shown without further loss.</p>
<h2>Figures</h2>
<p id="facts"></p>
<div class="table"><table id="table"></table></div>
<div id="refused"></div>
<p class="small">Bold: what Kiroku's recorder writes. Fine texture: the share of the original's energy in patterns of about four pixels that comes back in phase. False: energy there that the original does not have. dE: CIEDE2000; about 1 can just be told apart side by side.</p>
<h2>By rate</h2>
<div class="plots" id="plots"></div>
</main>
<script type="application/json" id="data">)page";

constexpr const char* kEnd = R"page(</script>
<script>
'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const $ = (id) => document.getElementById(id);
const canvases = [$('c0'), $('c1')], names = [$('n0'), $('n1')];
const view = { x: 0, y: 0, scale: 0 };  // the picture's point in the pane's middle, and pane pixels for each of its own
let images = [null, null], size = [1, 1], difference = false, asked = 0;

function fill(select, items) {
  select.replaceChildren(...items.map((text, i) => new Option(text, String(i))));
}
const clip = () => data.clips[Number($('clip').value)];
const source = (side) => {
  const one = clip().codings[Number($(side).value)];
  const n = Number($('picture').value);
  return one.pictures.length > 0 ? one.pictures[n] : clip().codings[0].pictures[n];
};
async function decoded(text) {
  const image = new Image();
  image.src = 'data:image/png;base64,' + text;
  await image.decode();
  return image;
}
async function show() {
  const mine = ++asked;
  const loaded = await Promise.all([decoded(source('left')), decoded(source('right'))]);
  if (mine !== asked) return;
  images = loaded;
  const changed = size[0] !== images[0].width || size[1] !== images[0].height;
  size = [images[0].width, images[0].height];
  names[0].textContent = $('left').selectedOptions[0].text;
  names[1].textContent = $('right').selectedOptions[0].text;
  if (difference) {
    names[1].textContent = 'difference from left, 8 times: ' + names[1].textContent;
    images[1] = apart(images[0], images[1]);
  }
  if (changed || view.scale === 0) fit(); else draw();
}
function apart(a, b) {
  const made = document.createElement('canvas');
  [made.width, made.height] = size;
  const to = made.getContext('2d', { willReadFrequently: true });
  to.drawImage(a, 0, 0);
  const one = to.getImageData(0, 0, size[0], size[1]);
  to.drawImage(b, 0, 0);
  const two = to.getImageData(0, 0, size[0], size[1]);
  for (let i = 0; i < one.data.length; ++i) {
    if (i % 4 !== 3) two.data[i] = 128 + 8 * (two.data[i] - one.data[i]);
  }
  to.putImageData(two, 0, 0);
  return made;
}
function fit() {
  view.scale = canvases[0].clientWidth * devicePixelRatio / size[0];
  view.x = size[0] / 2;
  view.y = size[1] / 2;
  draw();
}
function draw() {
  view.x = Math.min(Math.max(view.x, 0), size[0]);
  view.y = Math.min(Math.max(view.y, 0), size[1]);
  for (let i = 0; i < 2; ++i) {
    if (!images[i]) continue;
    const canvas = canvases[i];
    canvas.width = Math.round(canvas.clientWidth * devicePixelRatio);
    canvas.height = Math.round(canvas.width * size[1] / size[0]);
    const to = canvas.getContext('2d');
    to.imageSmoothingEnabled = view.scale < 2;
    to.setTransform(view.scale, 0, 0, view.scale, canvas.width / 2 - view.x * view.scale, canvas.height / 2 - view.y * view.scale);
    to.drawImage(images[i], 0, 0);
  }
  $('zoom').textContent = (view.scale * 100).toFixed(0) + ' %';
}
function zoom(factor, px, py) {
  const canvas = canvases[0];
  const scale = Math.min(Math.max(view.scale * factor, 0.1), 32);
  const dx = px - canvas.width / 2, dy = py - canvas.height / 2;
  view.x += dx / view.scale - dx / scale;
  view.y += dy / view.scale - dy / scale;
  view.scale = scale;
  draw();
}
for (const canvas of canvases) {
  const fingers = new Map();
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX * devicePixelRatio, event.offsetY * devicePixelRatio);
  }, { passive: false });
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  });
  canvas.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY];
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    fingers.set(event.pointerId, now);
    if (other) {
      const was = Math.hypot(before[0] - other[0], before[1] - other[1]), is = Math.hypot(now[0] - other[0], now[1] - other[1]);
      if (was > 0) zoom(is / was, (now[0] + other[0]) / 2 * devicePixelRatio, (now[1] + other[1]) / 2 * devicePixelRatio);
    } else {
      view.x -= (now[0] - before[0]) * devicePixelRatio / view.scale;
      view.y -= (now[1] - before[1]) * devicePixelRatio / view.scale;
      draw();
    }
  });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener('keydown', (event) => {
    const step = 60 / view.scale, middle = [canvas.width / 2, canvas.height / 2];
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    if (moves[event.key]) {
      view.x += moves[event.key][0];
      view.y += moves[event.key][1];
      draw();
    } else if (event.key === '+' || event.key === '=') zoom(1.25, ...middle);
    else if (event.key === '-') zoom(0.8, ...middle);
    else return;
    event.preventDefault();
  });
}
function open() {
  const one = clip();
  fill($('picture'), one.shown.map((number) => 'number ' + (number + 1)));
  for (const side of ['left', 'right']) fill($(side), one.codings.map((coding) => coding.name));
  const usual = one.codings.findIndex((coding) => coding.usual);
  $('right').value = String(usual < 0 ? one.codings.length - 1 : usual);
  $('facts').textContent = one.facts;
  const [head, ...rows] = one.table;
  const cells = (kind, row) => row.map((text) => Object.assign(document.createElement(kind), { textContent: text }));
  const line = (kind, row) => {
    const tr = document.createElement('tr');
    tr.append(...cells(kind, row));
    return tr;
  };
  $('table').replaceChildren(line('th', head), ...rows.map((row) => {
    const tr = line('td', row);
    tr.classList.toggle('ours', one.codings.some((coding) => coding.name === row[0] && coding.ours));
    return tr;
  }));
  $('refused').replaceChildren(...one.refused.map((text) => Object.assign(document.createElement('p'), { textContent: text })));
  $('plots').replaceChildren(...one.plots.map((plot) => Object.assign(new Image(), { src: 'data:image/svg+xml;base64,' + plot.svg, alt: plot.name })));
  const pictures = one.shown.length > 0;
  $('panes').hidden = !pictures;
  if (pictures) show();
}
fill($('clip'), data.clips.map((one) => one.name));
$('clip').addEventListener('change', open);
for (const id of ['picture', 'left', 'right']) $(id).addEventListener('change', show);
$('swap').addEventListener('click', () => {
  [$('left').value, $('right').value] = [$('right').value, $('left').value];
  show();
});
$('difference').addEventListener('click', () => {
  difference = !difference;
  $('difference').setAttribute('aria-pressed', String(difference));
  show();
});
$('fit').addEventListener('click', fit);
$('one').addEventListener('click', () => {
  view.scale = 1;
  draw();
});
addEventListener('resize', draw);
open();
</script>
</body>
</html>
)page";

std::string base64(ByteView bytes) { return crypto::to_base64(bytes, crypto::Base64Padding::kPadded); }

ordered_json pictures_of(const std::vector<Bytes>& files) {
  ordered_json pictures = ordered_json::array();
  for (const Bytes& file : files) pictures.push_back(base64(file));
  return pictures;
}

}  // namespace

std::string quality_page(const std::vector<ClipResult>& clips) {
  ordered_json data{{"clips", ordered_json::array()}};
  for (const ClipResult& clip : clips) {
    ordered_json codings = ordered_json::array();
    codings.push_back({{"name", "the clip itself"},
                       {"ours", false},
                       {"usual", false},
                       {"pictures", pictures_of(clip.trial.facts.originals)}});
    for (const recorder::CodingFigures& one : clip.trial.codings) {
      if (!one.refused.empty()) continue;
      constexpr std::int64_t kUsualRate = 4'000'000;
      codings.push_back({{"name", one.coding.name()},
                         {"ours", one.coding.is_ours()},
                         {"usual", one.coding.family == recorder::CodingFamily::kMpeg2 &&
                                       one.coding.bit_rate == kUsualRate},
                         {"pictures", pictures_of(one.pictures)}});
    }
    ordered_json plots = ordered_json::array();
    for (const NamedPlot& plot : quality_plots(clip))
      plots.push_back({{"name", plot.name}, {"svg", base64(plot.svg)}});
    data["clips"].push_back({{"name", clip.name},
                             {"facts", quality_facts(clip)},
                             {"table", quality_table(clip)},
                             {"refused", not_tried(clip)},
                             {"shown", clip.trial.facts.shown},
                             {"codings", std::move(codings)},
                             {"plots", std::move(plots)}});
  }
  std::string text = data.dump(-1, ' ', true, ordered_json::error_handler_t::replace);
  // Nothing in it may end the element that it stands in.
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  return kBegin + text + kEnd;
}

}  // namespace kiroku::apps
