// The page of a comparison.

let current = 0;
let maps = false;
let cycle = 0;

function cellOf(layer, at, on) {
  const cell = make("div", on ? "cell on" : "cell");
  const [a, change] = [layer.a[at], layer.values[at]];
  const relative = change / a;
  const big = make("div", "big");
  if (Math.abs(change) > 0) big.classList.add(change > 0 ? "red-text" : "blue-text");
  const sign = change > 0 ? "+" : "";
  if (layer.share) big.append(`${sign}${short(change * 100)}`, make("small", "", " points"));
  else if (Number.isFinite(relative)) big.append(`${sign}${percent(relative)}`);
  else big.append(`${sign}${short(change)}`);
  const noise = layer.clear && layer.clear[at] === 0 ? " · not significant" : "";
  const rank = `larger than ${Math.floor(sizeRank(layer, change) * 1000) / 10}\u00a0% of pixels`;
  const raw = `${amount({ ...layer, unit: "" }, a)} → ${amount(layer, a + change)}${noise} · ${rank}`;
  cell.append(make("div", "label", layer.label), big, make("div", "raw", raw));
  return cell;
}

// Share of the pixels whose change is smaller, whatever its sign.
function sizeRank(layer, change) {
  layer.sizes ??= { values: layer.values.map(Math.abs) };
  return rankOf(layer.sizes, Math.abs(change));
}

function tableOfAll(at) {
  return tableOfRows(
    ["layer", "A", "B", "change", "larger than", "significant"],
    data.maps.map((layer) => {
      const [a, change] = [layer.a[at], layer.values[at]];
      const clear = layer.clear ? (layer.clear[at] ? "yes" : "no") : "–";
      const sign = change > 0 ? "+" : "";
      return [layer.label, amount(layer, a), amount(layer, a + change), `${sign}${amount({ ...layer, unit: "" }, change)}`, `${Math.floor(sizeRank(layer, change) * 100)} %`, clear];
    }),
  );
}

function readOut(at) {
  const cells = make("div", "cells");
  const shown = new Set([0, 1, 2].filter((i) => i < data.maps.length));
  shown.add(current);
  for (const index of shown) cells.append(cellOf(data.maps[index], at, index === current));
  const parts = [whereLine(...namesAt(at)), cells];
  if (data.maps.length > 3) parts.push(allLayers(data.maps.length, tableOfAll, at));
  $("readout").replaceChildren(...parts);
  $("legend").show?.(data.maps[current].values[at]);
}

function showSides() {
  const layer = data.maps[current];
  $("kind").setAttribute("aria-pressed", String(maps));
  for (const [picture, heat] of [["beautyA", "heatA"], ["beautyB", "heatB"]]) {
    if ($(picture)) $(picture).hidden = maps;
    $(heat).hidden = !maps;
  }
  if (maps) {
    const heat = { ...layer.heat, map: colors ?? layer.heat.map, log: logarithmic };
    paint($("heatA"), layer.a, heat);
    paint($("heatB"), layer.a.map((a, i) => a + layer.values[i]), heat);
  }
  $("sides").textContent = maps ? `A | B: ${layer.label}` : "A | B";
}

// The seam stands at this share of the frame, whatever the zoom; B is cut at what lies there of the picture.
function wipe(percentOfA) {
  $("wipe").value = String(percentOfA);
  const cut = (zoom.x + percentOfA / 100 / zoom.scale) * 100;
  for (const id of ["beautyB", "heatB"]) if ($(id)) $(id).style.clipPath = `inset(0 0 0 ${cut}%)`;
  $("seam").style.left = `${percentOfA}%`;
}

// The seam can be taken by hand.
$("seam").addEventListener("pointerdown", (event) => {
  event.preventDefault();
  event.stopPropagation();
  const frame = $("seam").parentElement;
  const follow = (e) => wipe(Math.min(Math.max(shareOf(frame, e)[0] * 100, 0), 100));
  const done = () => {
    // Letting go is no click on the picture.
    zoom.dragged = true;
    document.removeEventListener("pointermove", follow);
    for (const end of ["pointerup", "pointercancel"]) document.removeEventListener(end, done);
  };
  document.addEventListener("pointermove", follow);
  for (const end of ["pointerup", "pointercancel"]) document.addEventListener(end, done);
});
zoom.changed = () => wipe(Number($("wipe").value));

function flicker() {
  cycle = (cycle + 1) % 3;
  wipe([50, 100, 0][cycle]);
  $("flicker").textContent = ["flicker", "A", "B"][cycle];
  $("flicker").setAttribute("aria-pressed", String(cycle > 0));
}

function choose(index) {
  current = index;
  mark(index);
  const layer = data.maps[index];
  const repaint = () => paint($("heat"), layer.values, scaleOf(layer, layer.scale), layer.clear);
  repaint();
  drawLegend(titleOf(layer, ", B − A"), layer, layer.scale, repaint, layer.clear ? ["grey: not significant"] : []);
  showSides();
  moveTo(position.x, position.y);
}

const mark = mapChoices(3, choose);

start(async () => {
  for (const map of data.maps) {
    map.values = await valuesOf(map.plane);
    map.a = await valuesOf(map.planeA);
    if (map.significant) map.clear = await quantaOf(map.significant);
  }
  await unpackGroups();
  moved = readOut;
  choose(0);
  const first = data.maps[0].values;
  let largest = 0;
  for (let i = 1; i < first.length; i++) if (Math.abs(first[i]) > Math.abs(first[largest])) largest = i;
  moveTo(largest % width, Math.floor(largest / width));
  wipe(50);
  $("wipe").addEventListener("input", () => wipe(Number($("wipe").value)));
  const toggle = () => {
    maps = !maps;
    showSides();
  };
  $("kind").addEventListener("click", toggle);
  $("flicker").addEventListener("click", flicker);
  onKeys({ map: choose, p: toggle, f: flicker, r: () => $("reset")?.click() });
});
