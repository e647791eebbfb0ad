// A reader's hands and eyes.
const checks = [];
const check = (name, held) => checks.push([name, Boolean(held)]);
const one = (selector) => document.querySelector(selector);
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const text = (selector) => one(selector)?.textContent ?? "";
const picture = (selector) => one(selector).toDataURL();

function point(type, element, across, down, more = {}) {
  const box = element.getBoundingClientRect();
  const at = { clientX: box.left + across * box.width, clientY: box.top + down * box.height, bubbles: true, cancelable: true, pointerId: 1, ...more };
  element.dispatchEvent(new (type === "wheel" ? WheelEvent : type === "click" ? MouseEvent : PointerEvent)(type, at));
}

const press = (key, element = document.body, more = {}) => element.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more }));

async function finished(run) {
  for (let i = 0; i < 200 && !one("#readout .cell"); i++) await sleep(25);
  try {
    check("the page comes to life", one("#readout .cell"));
    await run();
  } catch (error) {
    troubles.push(`${error.message} ${error.stack}`);
  }
  check("nothing is wider than the window", document.documentElement.scrollWidth <= innerWidth);
  const out = document.createElement("pre");
  out.id = "played";
  out.textContent = JSON.stringify({ checks, errors: troubles });
  document.body.append(out);
}

// Zoom is one for all frames, keeps the place under the pointer, and goes back.
async function playZoom(frames) {
  const shown = (frame) => frame.querySelector(":scope > img, :scope > canvas").style.transform;
  frames[0].focus();
  point("wheel", frames[0], 0.25, 0.25, { deltaY: -600 });
  check("the wheel zooms", shown(frames[0]).startsWith("scale("));
  check("zoom is linked", frames.every((frame) => shown(frame) === shown(frames[0])));
  const before = shown(frames[0]);
  point("pointerdown", frames[1], 0.5, 0.5);
  point("pointermove", frames[1], 0.6, 0.6);
  point("pointermove", frames[1], 0.7, 0.65);
  point("pointerup", frames[1], 0.7, 0.65);
  check("dragging moves the picture", shown(frames[0]) !== before);
  press("0");
  check("0 shows the whole picture", shown(frames[0]) === "" && shown(frames[1]) === "");
  press("+");
  check("+ zooms", shown(frames[0]) !== "");
  press("0");
}
