// Shared by both pages: planes, colours, crosshairs, numbers.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const { width, height } = data;

function make(tag, className, text) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text !== undefined) element.textContent = text;
  return element;
}

// ---- Planes: base64 → PNG without filters → deflate stream → folded differences → values (codec.rs is the inverse).

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function inflated(png) {
  const parts = [];
  const view = new DataView(png.buffer);
  for (let at = 8; at + 12 <= png.length;) {
    const length = view.getUint32(at);
    if (view.getUint32(at + 4) === 0x49444154) parts.push(png.subarray(at + 8, at + 8 + length));
    at += 12 + length;
  }
  const stream = new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function quantaOf(plane) {
  const bytes = await inflated(bytesOf(plane.png));
  const shrink = plane.shrink ?? 1;
  const [columns, rows] = [Math.ceil(width / shrink), Math.ceil(height / shrink)];
  const quanta = new Uint16Array(columns * rows);
  const half = rows * (columns + 1);
  for (let y = 0, i = 0; y < rows; y++) {
    let at = y * (columns + 1) + 1;
    for (let x = 0; x < columns; x++, i++, at++) {
      const folded = bytes[at] | (bytes[at + half] << 8);
      let guess = 0;
      if (x > 0 && y > 0 && plane.mean) guess = (quanta[i - 1] + quanta[i - columns]) >> 1;
      else if (x > 0) guess = quanta[i - 1];
      else if (y > 0) guess = quanta[i - columns];
      quanta[i] = guess + ((folded >> 1) ^ -(folded & 1));
    }
  }
  return quanta;
}

async function valuesOf(plane) {
  const quanta = await quantaOf(plane);
  const table = new Float32Array(plane.steps + 2);
  for (let q = 0; q <= plane.steps; q++) {
    table[q] = plane.knee * Math.sinh(plane.start + (q / plane.steps) * (plane.reach - plane.start));
  }
  table[plane.steps + 1] = NaN;
  if (!plane.shrink) return Float32Array.from(quanta, (q) => table[q]);
  // Squares of pixels that share a mean.
  const out = new Float32Array(width * height);
  const columns = Math.ceil(width / plane.shrink);
  for (let y = 0, i = 0; y < height; y++) {
    const row = Math.floor(y / plane.shrink) * columns;
    for (let x = 0; x < width; x++, i++) out[i] = table[quanta[row + Math.floor(x / plane.shrink)]];
  }
  return out;
}

// Share of the pixels that are cheaper than a value.
function rankOf(layer, value) {
  layer.sorted ??= layer.values.filter(Number.isFinite).sort();
  let low = 0;
  let high = layer.sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (layer.sorted[middle] < value) low = middle + 1;
    else high = middle;
  }
  return layer.sorted.length ? low / layer.sorted.length : 0;
}

// ---- Pictures

function middleAround(values, i) {
  const x = i % width;
  const y = (i - x) / width;
  const around = [];
  for (let v = Math.max(y - 1, 0); v <= Math.min(y + 1, height - 1); v++) {
    for (let u = Math.max(x - 1, 0); u <= Math.min(x + 1, width - 1); u++) around.push(values[v * width + u]);
  }
  const sorted = around.filter(Number.isFinite).sort((a, b) => a - b);
  const middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

// First what is above the percentile, then what stands out of its surroundings (view.rs).
function despiked(values, above, spike) {
  if (above === null) return values;
  const first = values.slice();
  for (let i = 0; i < values.length; i++) if (values[i] > above) first[i] = middleAround(values, i);
  const out = first.slice();
  for (let i = 0; i < first.length; i++) {
    // A value that does not exceed its neighbours on both sides tenfold is soon passed over.
    if (!(first[i] > 0 && first[i] < Infinity)) continue;
    const left = first[i % width ? i - 1 : i + 1] * spike >= first[i];
    const right = first[(i + 1) % width ? i + 1 : i - 1] * spike >= first[i];
    const up = first[i >= width ? i - width : i + width] * spike >= first[i];
    const down = first[i + width < first.length ? i + width : i - width] * spike >= first[i];
    if (left && right && up && down) continue;
    const middle = middleAround(first, i);
    if (middle > 0 && first[i] > spike * middle) out[i] = middle;
  }
  return out;
}

const tables = {};
function tableOf(name) {
  tables[name] ??= bytesOf(data.tables[name]);
  return tables[name];
}

// Where a value lies between the ends of a scale, 0 to 1. A logarithmic scale that begins at 0 or below shows four decades.
function placeOn(scale, value) {
  const place = scale.log
    ? Math.log(Math.max(value, 1e-30) / floorOf(scale)) / Math.log(scale.hi / floorOf(scale))
    : (value - scale.lo) / (scale.hi - scale.lo);
  return Math.min(Math.max(place, 0), 1);
}

const floorOf = (scale) => (scale.lo > 0 ? scale.lo : scale.hi * 1e-4);

// The inverse of placeOn.
const valueAt = (scale, place) =>
  scale.log ? floorOf(scale) * (scale.hi / floorOf(scale)) ** place : scale.lo + place * (scale.hi - scale.lo);

function paint(canvas, values, scale, grey) {
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const picture = context.createImageData(width, height);
  const pixels = picture.data;
  const table = tableOf(scale.map);
  const last = table.length / 3 - 1;
  const shown = despiked(values, scale.despikeAbove, scale.spike);
  for (let i = 0; i < shown.length; i++) {
    const at = i * 4;
    if (!Number.isFinite(shown[i])) {
      pixels[at] = pixels[at + 2] = 255;
    } else if (grey && grey[i] === 0) {
      pixels[at] = pixels[at + 1] = pixels[at + 2] = 150;
    } else {
      const entry = Math.round(placeOn(scale, shown[i]) * last) * 3;
      pixels[at] = table[entry];
      pixels[at + 1] = table[entry + 1];
      pixels[at + 2] = table[entry + 2];
    }
    pixels[at + 3] = 255;
  }
  context.putImageData(picture, 0, 0);
}

// ---- Numbers

const minus = (text) => text.replaceAll("-", "−");

function short(value) {
  const size = Math.abs(value);
  if (!Number.isFinite(value)) return "not a number";
  if (size === 0) return "0";
  if (size < 1e-3 || size >= 1e6) return minus(value.toExponential(1));
  if (size >= 99.95) return minus(value.toFixed(0));
  return minus(String(Number(value.toPrecision(3))));
}

// "Time [µs]", but "Rays" rather than "Rays [rays]".
function titleOf(layer, suffix) {
  const named = !layer.unit || layer.label.toLowerCase().includes(layer.unit.toLowerCase());
  return `${layer.label}${suffix}${named ? "" : ` [${layer.unit}]`}`;
}

const percent = (share) => `${short(share * 100)}\u00a0%`;
const amount = (layer, value) => (layer.share ? percent(value) : `${short(value)} ${layer.unit.replace(/ per path$/, "")}`.trim());

// ---- One position for all frames: pointer, keyboard, crosshair, outlined box

const frames = [...document.querySelectorAll(".frame")];
const position = { x: 0, y: 0, held: false };
let moved = () => {};

for (const frame of frames) {
  const across = make("div", "cross h");
  const down = make("div", "cross v");
  const spot = make("div", "spot");
  spot.hidden = true;
  frame.append(across, down, spot);
  Object.assign(frame, { across, down, spot });
  frame.addEventListener("pointermove", (event) => {
    if (!position.held && !zoom.dragging) moveTo(...pixelAt(frame, event));
  });
  frame.addEventListener("click", (event) => {
    if (zoom.dragged) return;
    position.held = !position.held;
    moveTo(...pixelAt(frame, event));
  });
}

function moveTo(x, y) {
  position.x = Math.min(Math.max(Math.floor(x), 0), width - 1);
  position.y = Math.min(Math.max(Math.floor(y), 0), height - 1);
  placeMarks();
  moved(position.y * width + position.x);
}

let outlined = null;
function outline(box) {
  outlined = box;
  placeMarks();
}

// Crosshairs and the outlined box, where the zoom puts them.
function placeMarks() {
  const at = (x, y) => [zoom.across(x / width), zoom.down(y / height)].map((share) => `${share * 100}%`);
  for (const { spot, across, down } of frames) {
    [down.style.left, across.style.top] = at(position.x + 0.5, position.y + 0.5);
    spot.hidden = !outlined;
    if (!outlined) continue;
    [spot.style.left, spot.style.top] = at(outlined.x, outlined.y);
    spot.style.width = `${(outlined.width / width) * zoom.scale * 100}%`;
    spot.style.height = `${(outlined.height / height) * zoom.scale * 100}%`;
  }
}

// Per pixel: what the camera sees first, as indices into the names of `data.objects` and `data.materials`.
const groups = {};

async function unpackGroups() {
  for (const kind of ["objects", "materials"]) if (data[kind]) groups[kind] = await quantaOf(data[kind].plane);
}

const namesAt = (at) => ["objects", "materials"].map((kind) => groups[kind] && data[kind].names[groups[kind][at]]);

// A folded table of every layer at the pixel; it stays open or folded while the crosshair moves.
let allOpen = false;
function allLayers(count, tableAt, at) {
  const all = make("details", "all");
  all.open = allOpen;
  all.append(make("summary", "", `All ${count} layers at this pixel`));
  if (allOpen) all.append(tableAt(at));
  all.addEventListener("toggle", () => {
    if (all.open === allOpen) return;
    allOpen = all.open;
    moveTo(position.x, position.y);
    $("readout").querySelector("summary").focus();
  });
  return all;
}

function tableOfRows(headings, rows) {
  const table = make("table");
  const head = make("tr");
  for (const text of headings) head.append(make("th", "", text));
  table.createTHead().append(head);
  const body = table.createTBody();
  for (const cells of rows) {
    const row = body.insertRow();
    for (const text of cells) row.append(make("td", "", text));
  }
  return table;
}

// Where the crosshair is: the object, then the material that the camera sees there, where they are known.
function whereLine(object, material) {
  const line = make("p", "where");
  line.append(make("span", "xy", `x ${position.x}  y ${position.y}`));
  if (object !== undefined) line.append(make("b", "", object || "background"));
  if (material) line.append(make("span", "material", material));
  if (position.held) line.append(make("span", "held", "held: click or Esc to release"));
  return line;
}

// Buttons for the first maps, a list for the others; number keys for the first nine.
function mapChoices(count, onChoose) {
  const choices = $("choices");
  const direct = data.maps.length <= count + 1 ? data.maps.length : count;
  const buttons = data.maps.slice(0, direct).map((map, index) => {
    const button = make("button");
    button.type = "button";
    button.append(make("kbd", "", String(index + 1)), map.label);
    button.addEventListener("click", () => onChoose(index));
    return button;
  });
  choices.append(...buttons);
  const list = make("select");
  list.setAttribute("aria-label", "More cost maps");
  if (direct < data.maps.length) {
    const first = make("option", "", `${data.maps.length - direct} more…`);
    first.value = "";
    list.append(first);
    data.maps.slice(direct).forEach((map, i) => {
      const option = make("option", "", map.label);
      option.value = String(direct + i);
      list.append(option);
    });
    list.addEventListener("change", () => list.value && onChoose(Number(list.value)));
    choices.append(list);
  }
  return (index) => {
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === index)));
    list.value = index >= direct ? String(index) : "";
    list.classList.toggle("on", index >= direct);
  };
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
let pointing = false;
$("viewer").addEventListener("pointerenter", () => (pointing = true));
$("viewer").addEventListener("pointerleave", () => (pointing = false));

function onKeys(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input, textarea, [role=slider]")) return;
    const arrow = ARROWS[event.key];
    // Elsewhere the arrow keys scroll the page.
    const ours = $("viewer").contains(document.activeElement) || (pointing && document.activeElement === document.body);
    if (arrow && ours) {
      const step = event.shiftKey ? 10 : 1;
      position.held = true;
      moveTo(position.x + arrow[0] * step, position.y + arrow[1] * step);
      event.preventDefault();
    } else if (event.key === "Escape") {
      position.held = false;
      outline(null);
      highlight(null);
      actions.Escape?.();
      moveTo(position.x, position.y);
    } else if (event.key >= "1" && event.key <= "9" && Number(event.key) <= data.maps.length) {
      actions.map(Number(event.key) - 1);
    } else if ("+=-0".includes(event.key)) {
      zoom.key(event.key);
    } else {
      actions[event.key.toLowerCase()]?.();
    }
  });
}

function magnify() {
  const enlarged = frames.some((frame) => frame.clientWidth * zoom.scale > width * 1.5);
  document.body.classList.toggle("magnified", enlarged);
}
new ResizeObserver(magnify).observe(frames[0]);

// ---- Pixels that belong to something: all others are dimmed, its rim is drawn. `member(index)` tells; null: none.

for (const frame of frames) {
  frame.mask = make("canvas", "mask");
  frame.mask.hidden = true;
  frame.append(frame.mask);
}

function highlight(member) {
  let count = 0;
  const inside = new Uint8Array(width * height);
  if (member) for (let i = 0; i < inside.length; i++) count += inside[i] = member(i) ? 1 : 0;
  for (const { mask } of frames) mask.hidden = !count;
  if (!count) return 0;
  const picture = new ImageData(width, height);
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i++) {
      const rim = inside[i] && !(x > 0 && y > 0 && x < width - 1 && y < height - 1 && inside[i - 1] && inside[i + 1] && inside[i - width] && inside[i + width]);
      if (rim) picture.data.set([82, 214, 255, 255], i * 4);
      else if (!inside[i]) picture.data[i * 4 + 3] = 165;
    }
  }
  for (const { mask } of frames) {
    [mask.width, mask.height] = [width, height];
    mask.getContext("2d").putImageData(picture, 0, 0);
  }
  return count;
}

// ---- Start: unpack, then run; what fails is said on the page.

async function start(run) {
  if (!width || !height) $("viewer").hidden = true;
  if (!data.maps.length) for (const part of document.querySelectorAll(".pane:nth-of-type(2), .legend, .hint, .cross")) part.hidden = true;
  if (!width || !height || !data.maps.length) return;
  try {
    await run();
  } catch (error) {
    const old = typeof DecompressionStream === "undefined";
    $("trouble").textContent = old
      ? "This browser is too old for the cost maps (it lacks DecompressionStream); a release of 2023 or later shows them."
      : `The cost maps could not be shown: ${error.message}`;
    $("trouble").hidden = false;
  }
}
