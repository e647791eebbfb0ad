// The page of one render.

let current = 0;
let objects = null;
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
  const parts = [whereLine(objects ? data.objects.names[objects[at]] : undefined), cells];
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
  paint($("heat"), layer.values, layer.scale);
  drawLegend(titleOf(layer, ""), layer.scale, layer.median);
  moveTo(position.x, position.y);
}

const mark = mapChoices(3, choose);

const cards = [...document.querySelectorAll(".card")];

function select(chosen) {
  cards.forEach((card, i) => {
    const on = i === chosen;
    card.classList.toggle("on", on);
    const button = card.querySelector(".show");
    button.setAttribute("aria-pressed", String(on));
    button.textContent = on ? "Shown in the pictures" : "Show in the pictures";
  });
  const box = data.hotspots[chosen];
  outline(box ?? null);
  if (!box) return;
  position.held = true;
  moveTo(box.x + box.width / 2, box.y + box.height / 2);
  $("viewer").scrollIntoView({ block: "nearest" });
}

start(async () => {
  for (const map of data.maps) map.values = map.plane ? await valuesOf(map.plane) : new Float32Array(width * height).fill(NaN);
  if (data.objects) objects = await quantaOf(data.objects.plane);
  moved = readOut;
  choose(0);
  const first = data.maps[0].values;
  let costliest = 0;
  for (let i = 1; i < first.length; i++) if (first[i] > first[costliest]) costliest = i;
  moveTo(costliest % width, Math.floor(costliest / width));
  await document.querySelector(".frame img")?.decode();
  cards.forEach((card, i) => {
    drawCrops(card, data.hotspots[i]);
    const toggle = () => select(card.classList.contains("on") ? -1 : i);
    card.querySelector(".show").addEventListener("click", toggle);
    card.querySelector(".crops").addEventListener("click", toggle);
  });
  onKeys({ map: choose, Escape: () => select(-1) });
});
