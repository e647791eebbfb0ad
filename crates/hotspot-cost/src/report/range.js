// The legend: histogram, colours with two ends to drag, linear or logarithmic, choice of colours.

const RANGE_BINS = 160;
let colors = null;
let logarithmic = false;

// The scale as the reader set it: own ends, log, colours; else the file's.
function scaleOf(layer, base) {
  const own = layer.range ?? base;
  const diverging = base.lo < 0 && base.map === "red-blue";
  return { ...base, lo: own.lo, hi: own.hi, log: logarithmic && !diverging && own.hi > 0, map: diverging ? base.map : (colors ?? base.map), diverging };
}

// What the axis under the histogram spans: all values, but a few outliers do not flatten the rest.
function spanOf(layer, base, scale) {
  layer.extent ??= layer.values.reduce(([lo, hi], v) => (Number.isFinite(v) ? [Math.min(lo, v), Math.max(hi, v)] : [lo, hi]), [Infinity, -Infinity]);
  let [lo, hi] = layer.extent;
  if (!(lo <= hi)) [lo, hi] = [0, 1];
  const reach = base.hi + 0.35 * (base.hi - Math.min(base.lo, lo));
  hi = Math.max(Math.min(hi, reach), scale.hi);
  lo = Math.min(Math.max(lo, base.lo - 0.35 * (base.hi - base.lo)), scale.lo);
  if (scale.diverging) [lo, hi] = [-Math.max(hi, -lo), Math.max(hi, -lo)];
  if (!(hi > lo)) hi = lo + 1;
  if (!scale.log) return { lo, hi, log: false };
  return { lo: lo > 0 ? lo : Math.min(hi * 1e-4, floorOf(scale)), hi, log: true };
}

// Round numbers on an axis: at 1, 2, 5 times a power of ten.
function roundTicks(span) {
  if (span.log) {
    const decades = Math.log10(span.hi / floorOf(span));
    const steps = decades > 2.5 ? [1] : [1, 2, 5];
    const out = [];
    for (let e = Math.floor(Math.log10(floorOf(span))); e <= Math.ceil(Math.log10(span.hi)); e++) for (const m of steps) out.push(m * 10 ** e);
    return out.filter((v) => v >= floorOf(span) * 0.999 && v <= span.hi * 1.001);
  }
  const raw = (span.hi - span.lo) / 5;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const out = [];
  for (let k = Math.ceil(span.lo / step - 1e-9); k * step <= span.hi * (1 + 1e-9); k++) out.push(k * step);
  return out;
}

function drawHistogram(canvas, layer, span, scale) {
  const counts = new Uint32Array(RANGE_BINS);
  for (const value of layer.values) {
    if (Number.isFinite(value)) counts[Math.min(Math.floor(placeOn(span, value) * RANGE_BINS), RANGE_BINS - 1)]++;
  }
  const tallest = Math.sqrt(Math.max(...counts, 1));
  const [w, h] = [RANGE_BINS * 4, 88];
  [canvas.width, canvas.height] = [w, h];
  const context = canvas.getContext("2d");
  const table = tableOf(scale.map);
  const last = table.length / 3 - 1;
  counts.forEach((count, bin) => {
    if (!count) return;
    const entry = Math.round(placeOn(scale, valueAt(span, (bin + 0.5) / RANGE_BINS)) * last) * 3;
    const tall = Math.max((Math.sqrt(count) / tallest) * h, 2);
    context.fillStyle = "#7d858f";
    context.fillRect(bin * 4, h - tall, 4, tall);
    context.fillStyle = `rgb(${table[entry]},${table[entry + 1]},${table[entry + 2]})`;
    context.fillRect(bin * 4, h - tall + 1.5, 4, tall);
  });
}

function drawBar(canvas, span, scale) {
  const table = tableOf(scale.map);
  const last = table.length / 3 - 1;
  [canvas.width, canvas.height] = [512, 1];
  const context = canvas.getContext("2d");
  const line = context.createImageData(512, 1);
  for (let i = 0; i < 512; i++) {
    const entry = Math.round(placeOn(scale, valueAt(span, (i + 0.5) / 512)) * last) * 3;
    line.data.set([table[entry], table[entry + 1], table[entry + 2], 255], i * 4);
  }
  context.putImageData(line, 0, 0);
}

// `base`: the scale of the file. `repaint` is called after each change. A diverging scale stays symmetric.
function drawLegend(title, layer, base, repaint, notes = []) {
  const legend = $("legend");
  const redraw = () => {
    repaint();
    drawLegend(title, layer, base, repaint, notes);
  };
  const scale = scaleOf(layer, base);
  const span = spanOf(layer, base, scale);
  const histogram = make("canvas", "histogram");
  histogram.setAttribute("role", "img");
  histogram.setAttribute("aria-label", "Histogram: pixels by value; heights are square roots of counts");
  histogram.title = "pixels by value (heights: square roots of counts)";
  drawHistogram(histogram, layer, span, scale);
  const bar = make("div", "bar");
  const strip = make("canvas");
  drawBar(strip, span, scale);
  const here = make("div", "here");
  bar.append(strip, here);
  for (const end of ["lo", "hi"]) bar.append(handleOf(end, layer, base, scale, span, bar, redraw));
  const ticks = make("div", "ticks");
  const put = (place, text, className) => {
    const tick = make("span", className, minus(text));
    tick.style.left = `${place * 100}%`;
    if (place < 0.03) tick.style.transform = "none";
    if (place > 0.97) tick.style.transform = "translateX(-100%)";
    ticks.append(tick);
  };
  const median = layer.median > span.lo && layer.median < span.hi && !scale.diverging ? placeOn(span, layer.median) : -1;
  let before = -1;
  // "median" and a number beside it take 44 pixels, whatever the width.
  const clear = Math.max(0.09, 44 / Math.max(legend.clientWidth, 1));
  for (const value of roundTicks(span)) {
    const place = placeOn(span, value);
    if (place - before < 0.075 || (median >= 0 && Math.abs(place - median) < clear)) continue;
    put(place, short(value), "");
    before = place;
  }
  if (median >= 0) put(median, "median", "median");
  const own = layer.range ? [`colours from ${short(scale.lo)} to ${short(scale.hi)}, as you set them`] : base.notes;
  const head = make("div", "head");
  head.append(make("span", "title", title), toolsOf(layer, scale, redraw));
  legend.replaceChildren(head, histogram, bar, ticks, make("div", "notes", minus([...own, ...notes].join(" · "))));
  legend.show = (value) => {
    here.hidden = !Number.isFinite(value);
    if (!here.hidden) here.style.left = `${placeOn(span, value) * 100}%`;
  };
  legend.show(layer.values[position.y * width + position.x]);
}

function handleOf(end, layer, base, scale, span, bar, redraw) {
  const handle = make("div", `handle ${end}`);
  const value = scale.log ? Math.max(scale[end], floorOf(scale)) : scale[end];
  handle.id = `range-${end}`;
  handle.tabIndex = 0;
  handle.setAttribute("role", "slider");
  handle.setAttribute("aria-label", end === "lo" ? "Lower end of the colours" : "Upper end of the colours");
  handle.setAttribute("aria-valuemin", String(span.lo));
  handle.setAttribute("aria-valuemax", String(span.hi));
  handle.setAttribute("aria-valuenow", String(value));
  handle.setAttribute("aria-valuetext", short(value));
  handle.style.left = `${placeOn(span, value) * 100}%`;
  const move = (place) => {
    const gap = 0.005;
    const other = placeOn(span, end === "lo" ? scale.hi : scale.log ? floorOf(scale) : scale.lo);
    const held = end === "lo" ? Math.min(Math.max(place, 0), other - gap) : Math.max(Math.min(place, 1), other + gap);
    const next = valueAt(span, held);
    layer.range = { lo: scale.lo, hi: scale.hi, [end]: next };
    if (scale.diverging) layer.range = { lo: -Math.max(Math.abs(next), span.hi * gap), hi: Math.max(Math.abs(next), span.hi * gap) };
    redraw();
    $(`range-${end}`).focus({ preventScroll: true });
  };
  handle.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.01, ArrowDown: -0.01, ArrowRight: 0.01, ArrowUp: 0.01, PageDown: -0.1, PageUp: 0.1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    move(placeOn(span, value) + step);
  });
  handle.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    // The legend is drawn anew with each step: the document outlives it. The span stays, so that the axis does not run away.
    const box = bar.getBoundingClientRect();
    const follow = (e) => move((e.clientX - box.left) / box.width);
    const done = () => {
      document.removeEventListener("pointermove", follow);
      document.removeEventListener("pointerup", done);
      document.removeEventListener("pointercancel", done);
    };
    document.addEventListener("pointermove", follow);
    document.addEventListener("pointerup", done);
    document.addEventListener("pointercancel", done);
  });
  return handle;
}

function toolsOf(layer, scale, redraw) {
  const tools = make("span", "tools");
  const log = make("button", "", "log");
  log.type = "button";
  log.id = "log";
  log.title = "Logarithmic colours (L)";
  log.setAttribute("aria-pressed", String(Boolean(scale.log)));
  log.disabled = scale.diverging;
  log.addEventListener("click", () => {
    logarithmic = !logarithmic;
    redraw();
    $("log").focus();
  });
  tools.append(log);
  if (!scale.diverging) {
    const list = make("select");
    list.id = "colors";
    list.setAttribute("aria-label", "Colours");
    for (const name of Object.keys(data.tables).filter((name) => name !== "red-blue")) {
      const option = make("option", "", name);
      option.selected = name === scale.map;
      list.append(option);
    }
    list.addEventListener("change", () => {
      colors = list.value;
      redraw();
      $("colors").focus();
    });
    tools.append(list);
  }
  const reset = make("button", "", "reset");
  reset.type = "button";
  reset.id = "reset";
  reset.title = "Back to the range of the file (R)";
  reset.disabled = !layer.range;
  reset.addEventListener("click", () => {
    layer.range = null;
    redraw();
    $("log").focus();
  });
  tools.append(reset);
  return tools;
}
