finished(async () => {
  const frames = [...document.querySelectorAll(".frame")];
  const [first, second] = [[0.2, 0.3], [0.7, 0.8]];

  check("the page begins at the costliest pixel", /above (99\.\d|100)/.test(text("#readout .cell.on")));
  point("pointermove", frames[1], ...first);
  const here = text("#readout");
  point("pointermove", frames[1], ...second);
  check("hover changes the read-out", text("#readout") !== here && /x \d+ {2}y \d+/.test(text("#readout")));
  check("the read-out names the object", text("#readout .where b").length > 0);
  check("and its material", text("#readout .where .material").length > 0);
  const [columns, rows] = [one("#heat").width, one("#heat").height];
  const [, px, py] = text("#readout .xy").match(/x (\d+) {2}y (\d+)/).map(Number);
  check("it reads the pixel under the pointer", Math.abs(px + 0.5 - second[0] * columns) <= 1 && Math.abs(py + 0.5 - second[1] * rows) <= 1);
  check("the legend marks the value", one("#legend .here").style.left !== "");
  check("the read-out gives percentiles", /above [\d.]+\s%/.test(text("#readout")));
  point("click", frames[1], ...second);
  point("pointermove", frames[1], ...first);
  check("a click holds the place", text("#readout .held") !== "");
  const held = text("#readout .xy");
  frames[0].focus();
  press("ArrowRight", frames[0]);
  check("arrow keys move it", text("#readout .xy") !== held);
  press("Escape");
  check("Escape lets go", text("#readout .held") === "");
  const all = one("#readout details");
  if (all) {
    all.open = true;
    all.dispatchEvent(new Event("toggle"));
    await sleep(50);
    check("every layer can be read", document.querySelectorAll("#readout table tbody tr").length >= 15);
  }

  const heat = picture("#heat");
  const title = text("#legend .title");
  press("2");
  check("a number key chooses another map", text("#legend .title") !== title && picture("#heat") !== heat);
  check("and the read-out marks it", one("#choices [aria-pressed=true]").textContent.endsWith(text("#readout .cell.on .label")));
  one("#choices button").click();
  check("its button chooses the first again", text("#legend .title") === title && picture("#heat") === heat);
  const list = one("#choices select");
  list.value = list.options[1].value;
  list.dispatchEvent(new Event("change"));
  check("the list has the other maps", text("#legend .title") !== title);
  press("1");

  const value = () => Number(one("#range-hi").getAttribute("aria-valuenow"));
  const top = value();
  for (let i = 0; i < 20; i++) press("ArrowLeft", one("#range-hi"));
  check("keys move the upper end", value() < top && picture("#heat") !== heat);
  check("the focus stays on it", document.activeElement.id === "range-hi");
  one("#reset").click();
  check("reset brings the range back", Math.abs(value() - top) < 1e-6 * Math.abs(top) && picture("#heat") === heat);
  const handle = one("#range-lo");
  const bar = one("#legend .bar");
  point("pointerdown", handle, 0.5, 0.5);
  point("pointermove", bar, 0.4, 0.5);
  point("pointerup", one("#legend .bar"), 0.4, 0.5);
  check("dragging moves the lower end", Number(one("#range-lo").getAttribute("aria-valuenow")) > 0 && picture("#heat") !== heat);
  one("#reset").click();
  press("l");
  check("L makes the colours logarithmic", one("#log").getAttribute("aria-pressed") === "true" && picture("#heat") !== heat);
  one("#log").click();
  one("#colors").value = "viridis";
  one("#colors").dispatchEvent(new Event("change"));
  check("the colours can be chosen", picture("#heat") !== heat);
  one("#colors").value = "inferno";
  one("#colors").dispatchEvent(new Event("change"));
  check("and chosen back", picture("#heat") === heat);

  await playZoom(frames);

  const button = one(".card .show");
  check("there is a hotspot to show", button);
  button.click();
  const mask = frames[0].querySelector(".mask");
  check("a hotspot's pixels light up", !mask.hidden && !frames[0].querySelector(".spot").hidden && button.getAttribute("aria-pressed") === "true");
  const pixels = mask.getContext("2d").getImageData(0, 0, mask.width, mask.height).data;
  let [bright, dark] = [0, 0];
  for (let i = 3; i < pixels.length; i += 4) pixels[i] === 165 ? dark++ : bright++;
  check("and the others are dimmed", bright > 15 && dark > 15);
  const box = JSON.parse(one("#data").textContent).hotspots[0];
  let astray = 0;
  for (let i = 0; i < mask.width * mask.height; i++) {
    const [x, y] = [i % mask.width, Math.floor(i / mask.width)];
    const inside = x >= box.x && x < box.x + box.width && y >= box.y && y < box.y + box.height;
    if (pixels[i * 4 + 3] !== 165 && !inside) astray++;
  }
  check("none of them lies outside its box", astray === 0);
  button.click();
  check("a second click takes it back", mask.hidden && frames[0].querySelector(".spot").hidden);
  const ledger = [...document.querySelectorAll(".ledger button:not(:disabled)")];
  check("objects and materials of the ledgers can be shown", ["objects", "materials"].every((kind) => ledger.some((row) => row.dataset.kind === kind)));
  press("Escape");
  for (const row of ledger) {
    row.click();
    check(`the ledger's row ${row.textContent} can be shown`, row.getAttribute("aria-pressed") === "true");
    // A pixel that stays bright shows what the row names.
    const lit = mask.getContext("2d").getImageData(0, 0, columns, rows).data;
    let at = 0;
    while (at < columns * rows && lit[at * 4 + 3] === 165) at++;
    point("pointermove", frames[0], ((at % columns) + 0.5) / columns, (Math.floor(at / columns) + 0.5) / rows);
    const shown = text(row.dataset.kind === "materials" ? "#readout .where .material" : "#readout .where b");
    check(`and lights the pixels of ${row.textContent}, not of ${shown}`, !mask.hidden && shown === row.textContent);
    row.click();
  }
});
