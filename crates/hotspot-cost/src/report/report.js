// The page of one render.

let current = 0;
// Per pixel: what the camera sees first, as indices into the names of `data.objects` and `data.materials`.
const groups = {};
// Per pixel: 0, or the rank of the hotspot that it belongs to.
let spots = null;
let allOpen = false;

function bigOf(layer, value) {
  const big = make("div", "big");
  if (layer.share) big.append(percent(value));
  else if (layer.median > 0 && Number.isFinite(value)) big.append(`${short(value / layer.median)}×`, make("small", "", " median"));
  else big.append(short(value));
  return big;
}

function rawOf(layer, value) {
  if (!Number.isFinite(value)) return "";
  const rank = rankOf(layer, value);
  const text = layer.share || !(layer.median > 0) ? "" : `${amount(layer, value)} · `;
  return `${text}above ${Math.floor(rank * 1000) / 10}\u00a0% of pixels`;
}

function cellOf(index, at) {
  const layer = data.maps[index];
  const cell = make("div", index === current ? "cell on" : "cell");
  const value = layer.values[at];
  cell.append(make("div", "label", layer.label), bigOf(layer, value), make("div", "raw", rawOf(layer, value)));
  return cell;
}

function tableOfAll(at) {
  const table = make("table");
  const head = make("tr");
  for (const text of ["layer", "to the median", "value", "above"]) head.append(make("th", "", text));
  table.createTHead().append(head);
  const body = table.createTBody();
  for (const layer of data.maps) {
    const value = layer.values[at];
    const row = body.insertRow();
    const ratio = !layer.share && layer.median > 0 ? `${short(value / layer.median)}×` : "–";
    const above = `${Math.floor(rankOf(layer, value) * 100)} %`;
    for (const text of [layer.label, ratio, amount(layer, value), above]) row.append(make("td", "", text));
  }
  return table;
}

function readOut(at) {
  const cells = make("div", "cells");
  const shown = new Set([0, 1, 2].filter((i) => i < data.maps.length));
  if (!shown.has(current)) shown.add(current);
  for (const index of shown) cells.append(cellOf(index, at));
  const parts = [whereLine(...["objects", "materials"].filter((kind) => groups[kind]).map((kind) => data[kind].names[groups[kind][at]])), cells];
  if (data.maps.length > 3) {
    const all = make("details", "all");
    all.open = allOpen;
    all.append(make("summary", "", `All ${data.maps.length} layers at this pixel`));
    if (allOpen) all.append(tableOfAll(at));
    all.addEventListener("toggle", () => {
      if (all.open === allOpen) return;
      allOpen = all.open;
      moveTo(position.x, position.y);
      $("readout").querySelector("summary").focus();
    });
    parts.push(all);
  }
  $("readout").replaceChildren(...parts);
  $("legend").show?.(data.maps[current].values[at]);
}

function drawCrops(card, box) {
  // The box with a margin, in the shape of the crop, moved inside the picture where it fits.
  const shape = 8 / 5;
  const reach = Math.max(box.width * 1.5, box.height * 1.5 * shape, 24);
  const [w, h] = [Math.min(reach, width), Math.min(reach / shape, height)];
  const x = Math.min(Math.max(box.x + box.width / 2 - w / 2, 0), width - w);
  const y = Math.min(Math.max(box.y + box.height / 2 - h / 2, 0), height - h);
  const sources = [document.querySelector(".frame img"), $("heat")];
  [...card.querySelectorAll(".crops canvas")].forEach((canvas, i) => {
    canvas.width = 400;
    canvas.height = 250;
    const context = canvas.getContext("2d");
    const zoom = Math.min(canvas.width / w, canvas.height / h);
    const [left, top] = [(canvas.width - w * zoom) / 2, (canvas.height - h * zoom) / 2];
    context.imageSmoothingEnabled = zoom < 2;
    if (sources[i]) context.drawImage(sources[i], x, y, w, h, left, top, w * zoom, h * zoom);
    const rect = [left + (box.x - x) * zoom, top + (box.y - y) * zoom, box.width * zoom, box.height * zoom];
    context.lineWidth = 5;
    context.strokeStyle = "#000";
    context.strokeRect(...rect);
    context.lineWidth = 2.5;
    context.strokeStyle = "#52d6ff";
    context.strokeRect(...rect);
  });
}

function choose(index) {
  current = index;
  mark(index);
  const layer = data.maps[index];
  const repaint = () => paint($("heat"), layer.values, scaleOf(layer, layer.scale));
  repaint();
  drawLegend(titleOf(layer, ""), layer, layer.scale, repaint);
  moveTo(position.x, position.y);
}

const mark = mapChoices(3, choose);

const cards = [...document.querySelectorAll(".card")];

// One thing at a time is shown in the pictures: a hotspot's card or a ledger's row.
let shown = null;

function show(control, box, member) {
  if (shown) shown.setAttribute("aria-pressed", "false");
  shown?.closest(".card")?.classList.remove("on");
  shown = shown === control ? null : control;
  outline(shown ? box : null);
  highlight(shown ? member : null);
  if (!shown) return;
  shown.setAttribute("aria-pressed", "true");
  shown.closest(".card")?.classList.add("on");
  if (box) {
    zoom.reveal(box);
    position.held = true;
    moveTo(box.x + box.width / 2, box.y + box.height / 2);
  }
  $("viewer").scrollIntoView({ block: "nearest" });
}

function memberOfHotspot(chosen) {
  const { x, y, width: w, height: h } = data.hotspots[chosen];
  if (spots) return (i) => spots[i] === chosen + 1;
  return (i) => i % width >= x && i % width < x + w && Math.floor(i / width) >= y && Math.floor(i / width) < y + h;
}

start(async () => {
  for (const map of data.maps) map.values = map.plane ? await valuesOf(map.plane) : new Float32Array(width * height).fill(NaN);
  for (const kind of ["objects", "materials"]) if (data[kind]) groups[kind] = await quantaOf(data[kind].plane);
  if (data.spots) spots = await quantaOf(data.spots);
  moved = readOut;
  choose(0);
  const first = data.maps[0].values;
  let costliest = 0;
  for (let i = 1; i < first.length; i++) if (first[i] > first[costliest]) costliest = i;
  moveTo(costliest % width, Math.floor(costliest / width));
  await document.querySelector(".frame img")?.decode();
  cards.forEach((card, i) => {
    drawCrops(card, data.hotspots[i]);
    const toggle = () => show(card.querySelector(".show"), data.hotspots[i], memberOfHotspot(i));
    card.querySelector(".show").addEventListener("click", toggle);
    card.querySelector(".crops").addEventListener("click", toggle);
  });
  for (const button of document.querySelectorAll(".ledger button")) {
    const { kind, id } = button.dataset;
    // The plane counts the names that occur; ledgers name all.
    const place = data[kind]?.ids.indexOf(Number(id)) ?? -1;
    if (place > 0) button.addEventListener("click", () => show(button, null, (i) => groups[kind][i] === place));
    else [button.disabled, button.title] = [true, "The camera does not see it directly"];
  }
  const legendKey = (id) => () => $(id)?.click();
  onKeys({ map: choose, Escape: () => shown && show(shown), l: legendKey("log"), r: legendKey("reset") });
});
