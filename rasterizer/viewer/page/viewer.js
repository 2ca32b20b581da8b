// The viewer: what is done to the picture goes out as messages, pictures come back. All that a gesture means for the
// camera is decided by the program that draws.
//
//   pointer, wheel, keys, switches ── events ──> message ── send() ──> { status, picture } ──> canvas, text
//
// One message is on its way at a time, and while its picture is decoded the next one. Where the way takes longer than the
// drawing, as in a notebook, there are some more. Moves that come meanwhile are added up, so that nothing piles up.
// The same file serves a page of its own (page.js) and a notebook (`export default`, as anywidget wants it).

const REST = 120; // milliseconds without an event, after which the picture is drawn as good as it gets
const SLOW = 700; // milliseconds, after which waiting is mentioned
const LOOK = 500; // milliseconds between looks at the page's background
const CLICK = 4; // CSS pixels that a pointer may move in a click
const DOUBLE = 350; // milliseconds between the clicks of a double one
const LINE = 16; // CSS pixels of a wheel's line; a page of a wheel is the view's height
const ZOOM = 1.0015; // enlargement for a CSS pixel of the wheel
const MOST_ZOOM = 50; // in one event
const MOST_SIDE = 8192; // pixels of a picture
const MOST_EVENTS = 200; // in one message
const QUICK = 30; // milliseconds of a picture, up to which more messages than one are on their way
const MOST_SHOWING = 2; // pictures that are decoded
const KEYS = new Set([
  "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "Escape", "Enter", " ",
  "+", "=", "-", "_", "0", "1", "2", "3", "4", "5", "6", "7", "s", "l", "o",
]);
const SWITCHES = {
  shading: { label: "Shading", words: { flat: "flat", gouraud: "Gouraud", phong: "Phong" } },
  lights: { label: "Lights", words: { own: "of the scene", studio: "studio", headlight: "headlight" } },
  projection: { label: "Projection", words: { perspective: "perspective", orthographic: "orthographic" } },
};
const HELP = [
  ["Drag, arrow keys", "turn"],
  ["Shift and drag, right button, two fingers, Shift and arrow keys", "move sideways"],
  ["Wheel, pinch, + and −", "zoom, about the pointer (in a notebook: click the picture first)"],
  ["Click, Enter", "tell what is seen there (Enter: in the middle)"],
  ["Double click, Shift and Enter", "turn about that point from now on"],
  ["1 2 3 4 5 6 7", "front, back, left, right, top, bottom, iso"],
  ["0, Home", "the first view"],
  ["s, l, o", "next shading, next lights, other projection"],
  ["Esc", "forget the point"],
];

export function mount(root, send, { onStatus = () => {}, size = null, ahead = 1 } = {}) {
  const parts = build(root, size);
  const { canvas } = parts;
  const context = canvas.getContext("2d", { alpha: false });
  let events = [];
  let nWaiting = 0; // messages without an answer
  let nShowing = 0; // pictures that are not shown yet
  let showing = Promise.resolve(); // one after the other
  let isPaced = false; // until the screen shows the next picture
  let isQuick = false; // whether the last picture was
  let isFull = false; // whether the picture that is shown is as good as it gets
  let isEnded = false;
  let restTimer = 0;
  let faults = 0;
  let background = ""; // of the picture that is shown

  // --- messages -----------------------------------------------------------------------------------------------

  function push(event) {
    const last = events[events.length - 1];
    if (last && event.type === "drag" && last.type === "drag" && last.action === event.action) {
      last.dx += event.dx;
      last.dy += event.dy;
    } else if (events.length < MOST_EVENTS) {
      events.push(event);
    }
    isFull = false;
    ask(false);
  }

  function ask(isRest) {
    clearTimeout(restTimer);
    const isBusy = nWaiting >= (isQuick && !isRest ? ahead : 1) || nShowing >= MOST_SHOWING || isPaced;
    if (isBusy || isEnded || !canvas.clientWidth) {
      return; // where there is nothing to be seen yet, the observer of sizes asks again
    }
    exchange(isRest);
  }

  async function exchange(isRest) {
    const message = { size: sizeNow(), background: backgroundNow(), is_rest: isRest, events };
    events = [];
    nWaiting += 1;
    isPaced = true; // at most one picture for each that the screen shows
    requestAnimationFrame(() => {
      isPaced = false;
      goOn();
    });
    const slow = setTimeout(() => parts.numbers.textContent = "drawing …", SLOW);
    try {
      const { status, picture } = await send(message);
      nShowing += 1;
      showing = showing.then(() => show(message, status, picture)).then(() => { faults = 0; }, failed).then(() => {
        nShowing -= 1;
        goOn();
      });
    } catch (fault) {
      failed(fault);
    }
    clearTimeout(slow);
    nWaiting -= 1;
    goOn();
  }

  function failed(fault) {
    faults += 1;
    say(`${fault.message || fault}`);
  }

  function goOn() {
    if (events.length) {
      ask(false);
    } else if (!nWaiting && !nShowing && !isPaced && !isFull && faults < 3) {
      clearTimeout(restTimer);
      restTimer = setTimeout(() => ask(true), REST);
    }
  }

  async function show(message, status, picture) {
    const bitmap = await createImageBitmap(new Blob([picture], { type: status.type }));
    const [width, height] = status.size;
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    context.drawImage(bitmap, 0, 0, width, height);
    bitmap.close();
    background = message.background;
    const isOutdated = String(sizeNow()) !== String(message.size) || backgroundNow() !== background;
    isFull = status.is_full && !events.length && !nWaiting && !isOutdated;
    isQuick = status.milliseconds <= QUICK;
    canvas.dataset.state = isFull ? "rest" : "moving";
    tell(status);
  }

  function tell(status) {
    for (const [name, value] of Object.entries(status.switches)) {
      parts.switches[name].value = value;
    }
    parts.title.textContent = status.title;
    canvas.setAttribute("aria-label", `3-D view of ${status.title}`);
    parts.mark.hidden = !status.marker;
    if (status.marker) {
      const [x, y] = status.marker;
      parts.mark.style.left = `${(100 * x) / status.size[0]}%`;
      parts.mark.style.top = `${(100 * y) / status.size[1]}%`;
    }
    const scale = status.divisor > 1 ? `, 1/${status.divisor} size` : "";
    parts.numbers.textContent =
      `${status.n_face.toLocaleString("en")} faces, ${status.size.join("×")}${scale}, ${status.milliseconds} ms`;
    parts.camera.textContent = status.camera || "there are none for it";
    parts.status.textContent = status.picked || "";
    if (status.said) {
      say(status.said);
    }
    onStatus(status);
  }

  function say(text) {
    parts.spoken.textContent = text;
    if (!parts.status.textContent || faults) {
      parts.status.textContent = text;
    }
  }

  // --- the picture's size and background ---------------------------------------------------------------------

  function sizeNow() {
    const { width, height } = canvas.getBoundingClientRect();
    const ratio = Math.min(window.devicePixelRatio || 1, MOST_SIDE / Math.max(width, height, 1));
    const [across, down] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
    const tooMany = Math.sqrt((across * down) / 2 ** 25); // pixels in all
    return tooMany <= 1 ? [across, down] : [Math.floor(across / tooMany), Math.floor(down / tooMany)];
  }

  function backgroundNow() {
    const numbers = getComputedStyle(parts.view).backgroundColor.match(/[\d.]+/g) || [];
    if (numbers.length < 3 || (numbers.length > 3 && Number(numbers[3]) === 0)) {
      return "#ffffff";
    }
    return "#" + numbers.slice(0, 3).map((each) => Math.round(Number(each)).toString(16).padStart(2, "0")).join("");
  }

  function redraw() {
    isFull = false;
    ask(true);
  }

  const observer = new ResizeObserver(redraw);
  observer.observe(canvas);
  // The background is that of the page. Whatever changes it, a theme or a setting of the system, no event tells when its
  // style has arrived: it is looked at now and then.
  const looks = setInterval(() => isFull && backgroundNow() !== background && redraw(), LOOK);

  // --- gestures -----------------------------------------------------------------------------------------------

  const pointers = new Map(); // by id: where they were, in pixels of the picture
  let pressed = null; // where and when the first pointer went down, until it has moved
  let clicked = { time: -Infinity, x: 0, y: 0 };

  function positionOf(event) {
    const box = canvas.getBoundingClientRect();
    const [width, height] = sizeNow();
    return { x: ((event.clientX - box.left) / box.width) * width, y: ((event.clientY - box.top) / box.height) * height };
  }

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, positionOf(event));
    pressed = pointers.size === 1 && event.button === 0 ? { x: event.clientX, y: event.clientY } : null;
    canvas.classList.add("raster-dragged");
  });

  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) {
      return;
    }
    if (pressed && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) <= CLICK) {
      return; // may become a click
    }
    pressed = null;
    const now = positionOf(event);
    if (pointers.size === 1) {
      const action = event.buttons & 6 || event.shiftKey ? "pan" : event.ctrlKey ? "zoom" : "rotate";
      push({ type: "drag", action, dx: now.x - before.x, dy: now.y - before.y });
    } else if (pointers.size === 2) {
      pinch(event.pointerId, before, now);
    }
    pointers.set(event.pointerId, now);
  });

  function pinch(moved, before, now) {
    const [other] = [...pointers].filter(([id]) => id !== moved).map(([, at]) => at);
    const middle = { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 };
    push({ type: "drag", action: "pan", dx: (now.x - before.x) / 2, dy: (now.y - before.y) / 2 });
    const factor = distance(now, other) / Math.max(distance(before, other), 1);
    push({ type: "zoom", factor: limited(factor), ...middle });
  }

  function lift(event) {
    pointers.delete(event.pointerId);
    if (pressed && event.type === "pointerup") {
      const at = positionOf(event);
      const isDouble = event.timeStamp - clicked.time < DOUBLE && distance(at, clicked) < 2 * CLICK;
      push({ type: "click", x: at.x, y: at.y, is_double: isDouble });
      clicked = { time: isDouble ? -Infinity : event.timeStamp, ...at };
    }
    pressed = null;
    if (!pointers.size) {
      canvas.classList.remove("raster-dragged");
    }
  }
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());

  canvas.addEventListener("wheel", (event) => {
    if (size && document.activeElement !== canvas) {
      return; // a notebook is scrolled with the wheel, until the picture is clicked
    }
    event.preventDefault();
    const unit = [1, LINE, canvas.clientHeight][event.deltaMode] || 1;
    push({ type: "zoom", factor: limited(ZOOM ** (-event.deltaY * unit)), ...positionOf(event) });
  }, { passive: false });

  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !KEYS.has(event.key)) {
      return; // the browser's own, or somebody else's
    }
    event.preventDefault();
    event.stopPropagation();
    push({ type: "key", key: event.key, is_shift: event.shiftKey });
  });

  for (const [name, select] of Object.entries(parts.switches)) {
    select.addEventListener("change", () => push({ type: "switch", name, value: select.value }));
  }
  parts.reset.addEventListener("click", () => push({ type: "key", key: "0", is_shift: false }));

  return {
    end(text) {
      isEnded = true;
      clearTimeout(restTimer);
      parts.numbers.textContent = "";
      parts.status.textContent = text;
      parts.spoken.textContent = text;
      canvas.dataset.state = "ended";
    },
    close() {
      isEnded = true;
      clearTimeout(restTimer);
      clearInterval(looks);
      observer.disconnect();
    },
  };
}

function distance(a, b) {
  return Math.hypot(a.x - b.x, a.y - b.y);
}

function limited(factor) {
  return Math.min(MOST_ZOOM, Math.max(1 / MOST_ZOOM, factor));
}

// --- what is on the page ----------------------------------------------------------------------------------------

let count = 0; // viewers on this page, for names that are unique

function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

function build(root, size) {
  count += 1;
  const help = `raster-help-${count}`;
  const title = make(size ? "strong" : "h1", { class: "raster-title" });
  const switches = {};
  const bar = make("div", { class: "raster-bar", role: "group", "aria-label": "how the scene is shown" }, title);
  for (const [name, { label, words }] of Object.entries(SWITCHES)) {
    const options = Object.entries(words).map(([value, text]) => make("option", { value }, text));
    switches[name] = make("select", { name }, ...options);
    bar.append(make("label", {}, label, switches[name]));
  }
  const reset = make("button", { type: "button" }, "First view");
  bar.append(reset);
  const canvas = make("canvas", {
    tabindex: "0",
    role: "application", // arrow keys are the view's own
    "aria-label": "3-D view",
    "aria-describedby": help,
  });
  const mark = make("div", { class: "raster-mark", hidden: "", "aria-hidden": "true" });
  const view = make("div", { class: "raster-view" }, canvas, mark);
  const status = make("div", { class: "raster-status" });
  const numbers = make("div", { class: "raster-numbers" }, "drawing the first picture …");
  const spoken = make("div", { class: "raster-hidden", role: "status", "aria-live": "polite" });
  const camera = make("code", { class: "raster-camera" });
  const list = make("dl", { id: help });
  for (const [keys, text] of HELP) {
    list.append(make("dt", {}, keys), make("dd", {}, text));
  }
  const all = make("section", { class: "raster-viewer", "aria-label": "viewer" },
    bar, view, make("div", { class: "raster-foot" }, status, numbers),
    make("details", { class: "raster-help" }, make("summary", {}, "Keys, mouse and camera"), list,
      make("p", {}, "This view as flags of raster render: ", camera)), spoken);
  // Jupyter has shortcuts of single letters, such as d d. It leaves those elements alone that say so themselves.
  for (const each of all.querySelectorAll("canvas, select, button, summary")) {
    each.setAttribute("data-lm-suppress-shortcuts", "true");
  }
  if (size) {
    view.style.aspectRatio = `${size[0]} / ${size[1]}`;
    all.style.maxWidth = `${size[0]}px`;
  }
  root.replaceChildren(all);
  return { view, canvas, mark, title, switches, reset, status, numbers, spoken, camera };
}

// --- a notebook -------------------------------------------------------------------------------------------------

let widgetCount = 0;

function render({ model, el }) {
  widgetCount += 1;
  const view = `${Date.now()}-${widgetCount}`; // several cells may show one widget: each takes its own answers
  const waiting = []; // for answers, which come in the order of the messages

  function send(message) {
    return new Promise((resolve, reject) => {
      waiting.push({ resolve, reject });
      model.send({ view, message });
    });
  }

  function take(content, buffers) {
    if (content.view !== view || !waiting.length) {
      return;
    }
    const { resolve, reject } = waiting.shift();
    if (content.error) {
      reject(new Error(content.error));
    } else {
      resolve({ status: content.status, picture: buffers[0] });
    }
  }

  model.on("msg:custom", take);
  const viewer = mount(el, send, { size: model.get("size"), ahead: 4 });
  return () => {
    model.off("msg:custom", take);
    viewer.close();
  };
}

export default { render };
