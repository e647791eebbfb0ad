// One zoom for all frames: wheel, pinch, buttons, keys; dragging moves what is enlarged.

const zoom = {
  // Magnification, and the picture's share left of and above the frame.
  scale: 1,
  x: 0,
  y: 0,
  dragging: false,
  // A drag ends in a click, which is none.
  dragged: false,
  changed: () => {},
  across: (share) => (share - zoom.x) * zoom.scale,
  down: (share) => (share - zoom.y) * zoom.scale,
  set(scale, x, y) {
    zoom.scale = Math.min(Math.max(scale, 1), 32);
    const most = 1 - 1 / zoom.scale;
    zoom.x = Math.min(Math.max(x, 0), most);
    zoom.y = Math.min(Math.max(y, 0), most);
    const move = `scale(${zoom.scale}) translate(${-zoom.x * 100}%, ${-zoom.y * 100}%)`;
    for (const frame of frames) {
      for (const layer of frame.querySelectorAll(":scope > img, :scope > canvas")) layer.style.transform = zoom.scale > 1 ? move : "";
    }
    document.body.classList.toggle("zoomed", zoom.scale > 1);
    for (const label of document.querySelectorAll(".zoom output")) label.textContent = `${Math.round(zoom.scale * 10) / 10}×`;
    magnify();
    placeMarks();
    zoom.changed();
  },
  // Enlarges about the share (fx, fy) of the frame, which keeps what it shows.
  about(factor, fx, fy) {
    const scale = Math.min(Math.max(zoom.scale * factor, 1), 32);
    zoom.set(scale, zoom.x + fx / zoom.scale - fx / scale, zoom.y + fy / zoom.scale - fy / scale);
  },
  key(key) {
    if (key === "0") return zoom.set(1, 0, 0);
    // About the crosshair.
    const [fx, fy] = [zoom.across((position.x + 0.5) / width), zoom.down((position.y + 0.5) / height)];
    zoom.about(key === "-" ? 1 / 1.5 : 1.5, Math.min(Math.max(fx, 0), 1), Math.min(Math.max(fy, 0), 1));
  },
  // Brings a box of pixels into view where it lies outside.
  reveal(box) {
    const middle = [(box.x + box.width / 2) / width, (box.y + box.height / 2) / height];
    const hidden = [zoom.across(middle[0]), zoom.down(middle[1])].some((share) => share < 0 || share > 1);
    if (hidden) zoom.set(zoom.scale, middle[0] - 0.5 / zoom.scale, middle[1] - 0.5 / zoom.scale);
  },
};

// Share of the frame under a pointer.
function shareOf(frame, event) {
  const box = frame.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
}

function pixelAt(frame, event) {
  const [fx, fy] = shareOf(frame, event);
  return [(zoom.x + fx / zoom.scale) * width, (zoom.y + fy / zoom.scale) * height];
}

for (const frame of frames) {
  frame.addEventListener(
    "wheel",
    (event) => {
      // Plain turning scrolls the page while nothing is enlarged; with Ctrl, or once enlarged, it zooms.
      if (!event.ctrlKey && zoom.scale === 1 && document.activeElement !== frame) return;
      event.preventDefault();
      zoom.about(Math.exp(-event.deltaY * 0.002), ...shareOf(frame, event));
    },
    { passive: false },
  );
  const pointers = new Map();
  const gesture = () => {
    const points = [...pointers.values()];
    const middle = [0, 1].map((axis) => points.reduce((sum, p) => sum + p[axis], 0) / points.length);
    const spread = points.length > 1 ? Math.hypot(points[0][0] - points[1][0], points[0][1] - points[1][1]) : 0;
    return { middle, spread };
  };
  frame.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, shareOf(frame, event));
    zoom.dragged = false;
  });
  frame.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId)) return;
    const before = gesture();
    const start = pointers.get(event.pointerId);
    const now = shareOf(frame, event);
    // A hand that shakes is no drag.
    const far = Math.hypot((now[0] - start[0]) * frame.clientWidth, (now[1] - start[1]) * frame.clientHeight) > 4;
    if (!zoom.dragging && !(far && (zoom.scale > 1 || pointers.size > 1))) return;
    zoom.dragging = zoom.dragged = true;
    pointers.set(event.pointerId, now);
    const after = gesture();
    if (before.spread > 0 && after.spread > 0) zoom.about(after.spread / before.spread, ...after.middle);
    zoom.set(zoom.scale, zoom.x - (after.middle[0] - before.middle[0]) / zoom.scale, zoom.y - (after.middle[1] - before.middle[1]) / zoom.scale);
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
    frame.addEventListener(end, (event) => {
      pointers.delete(event.pointerId);
      if (!pointers.size) zoom.dragging = false;
    });
  }
}

// − 1× + at the end of the first caption.
const zoomTools = make("span", "zoom");
for (const [key, name] of [["-", "Zoom out (−)"], ["0", "Whole picture (0)"], ["+", "Zoom in (+)"]]) {
  const button = make(key === "0" ? "output" : "button", "", key === "0" ? "1×" : minus(key));
  button.title = name;
  if (key === "0") button.setAttribute("role", "button");
  else button.type = "button";
  button.setAttribute("aria-label", name);
  button.addEventListener("click", () => zoom.key(key));
  zoomTools.append(button);
}
document.querySelector("figcaption").append(zoomTools);
