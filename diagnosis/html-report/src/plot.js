// Shows the values of a plot's curves under the pointer, and, once it is dragged over, a stretch of them alone; plots over the same
// quantity follow. The curves are read back from the SVG paths, so that no number is in the page twice; without this script the page
// shows the same curves.
const create = (name, attributes) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};
/** Round values within a range, 1, 2 or 5 times a power of ten apart. */
const ticks = (low, high) => {
  const rough = (high - low) / 6, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= 0.999 * rough);
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, k) => (first + k) * step);
};
const digits = (span) => Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(span))));
const show = (value, span) => span < 1e-4 || span >= 1e6 ? value.toExponential(3) : value.toFixed(digits(span));

/** Numbers between blanks. */
const numbers = (text) => text.split(" ").map(Number);

/** The places of a plot in its picture, the ranges of its axes, and the stretch that is shown, as places of the whole plot. */
const scaleOf = (svg) => {
  const [left, right, top, bottom] = numbers(svg.dataset.box);
  const [x0, x1] = numbers(svg.dataset.x), [y0, y1] = numbers(svg.dataset.y);
  const scale = { left, right, top, bottom, from: left, to: right, ySpan: y1 - y0 };
  scale.toX = (px) => x0 + (px - left) / (right - left) * (x1 - x0);
  /** A place along the axis in words, on a logarithmic one the number itself. */
  scale.words = (x) => "log" in svg.dataset ? show(10 ** x, 10 ** x) : show(x, scale.xSpan());
  scale.toPx = (x) => left + (x - x0) / (x1 - x0) * (right - left);
  scale.toY = (py) => y1 - (py - top) / (bottom - top) * (y1 - y0);
  scale.xSpan = () => scale.toX(scale.to) - scale.toX(scale.from);
  scale.isWhole = () => scale.from === left && scale.to === right;
  /** The place in the whole plot that is shown at `px`. */
  scale.whole = (px) => scale.from + (px - left) / (right - left) * (scale.to - scale.from);
  /** The place at which one of the whole plot is shown. */
  scale.shown = (whole) => left + (whole - scale.from) / (scale.to - scale.from) * (right - left);
  /** The place in the picture of the pointer. */
  scale.within = (event) => {
    const box = svg.getBoundingClientRect();
    return (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
  };
  scale.inside = (px) => Math.min(right, Math.max(left, px));
  return scale;
};

/** Puts the curves into a frame that cuts off what is beside the plot. Returns them, the ticks along the whole, and a place for those of a stretch. */
const framed = (svg, scale, number) => {
  const { y, height } = svg.viewBox.baseVal;
  const marks = [...svg.children].filter((child) => !child.matches("title, text, .grid"));
  const along = [...svg.children].filter((child) => child.matches("text:not([text-anchor=end]), .grid")
    && (child.localName === "text" || child.getAttribute("x1") === child.getAttribute("x2")));
  const last = [...svg.querySelectorAll("text")].at(-1);
  if (last && !along.includes(last)) along.push(last);
  const clip = create("clipPath", { id: `plot-${number}` });
  clip.append(create("rect", { x: scale.left, y, width: scale.right - scale.left, height }));
  const frame = create("g", { "clip-path": `url(#plot-${number})` });
  const curves = create("g", {});
  const zoomed = create("g", {});
  curves.append(...marks);
  frame.append(curves);
  svg.append(clip, frame, zoomed);
  return { curves, along, zoomed, labelY: y + height - 8 };
};

/** Shows a stretch of the plot, with ticks of its own. */
const zoom = (scale, { curves, along, zoomed, labelY }, [from, to]) => {
  const { left, right, bottom, toX } = scale;
  Object.assign(scale, { from, to });
  const by = (right - left) / (to - from);
  curves.setAttribute("transform", `translate(${left - from * by} 0) scale(${by} 1)`);
  const isWhole = scale.isWhole();
  for (const tick of along) tick.style.display = isWhole ? "" : "none";
  zoomed.replaceChildren(...isWhole ? [] : ticks(toX(from), toX(to)).flatMap((value) => {
    const px = left + (value - toX(from)) / scale.xSpan() * (right - left);
    const label = create("text", { x: px, y: labelY, "text-anchor": px > right - 18 ? "end" : "middle" });
    label.textContent = scale.words(value);
    return [create("line", { class: "grid", x1: px, x2: px, y1: bottom + 1, y2: bottom + 6 }), label];
  }));
};

/** The curves of a plot with their points. */
const curvesOf = (svg) => [...svg.querySelectorAll("path[data-name]")].map((path) => ({
  name: path.dataset.name,
  // "M x y" and "L x y" are points; "M x y V y" is the range of a stretch.
  points: path.getAttribute("d").split(/(?=[ML])/).filter(Boolean)
    .map((part) => part.slice(1).split(/[ V]/).map(Number)),
}));

/** The values of the curves at a place of the whole plot, each in words; none of a curve with a gap there. */
const valuesAt = (curves, px, { left, right, toY, ySpan }) => curves.flatMap(({ name, points }) => {
  if (!points.length) return [];
  const near = points.reduce((a, b) => Math.abs(b[0] - px) < Math.abs(a[0] - px) ? b : a);
  // There is a gap if the nearest point is farther away than the points are apart.
  if (Math.abs(near[0] - px) > Math.max(8, (right - left) / points.length)) return [];
  return [`${name} ${near.slice(1).map((py) => show(toY(py), ySpan)).join(" to ")}`];
});

/** The line at the pointer, and below the plot the values there. */
const cursorOf = (svg, scale) => {
  const [name, unit = ""] = svg.dataset.of.split(", ");
  const line = create("line", { class: "cursor" });
  const readout = document.createElement("output");
  svg.after(readout);
  let curves = null;
  const hide = () => {
    line.remove();
    readout.textContent = scale.isWhole() ? "" : "double-click for the whole";
  };
  const moveTo = (shown) => {
    curves ??= curvesOf(svg);
    if (shown < scale.left || shown > scale.right) return hide();
    const px = scale.whole(shown);
    for (const [key, value] of [["x1", shown], ["x2", shown], ["y1", scale.top], ["y2", scale.bottom]]) line.setAttribute(key, value);
    svg.append(line);
    readout.textContent = [`${name} ${scale.words(scale.toX(px))} ${unit}`, ...valuesAt(curves, px, scale)].join(" · ");
  };
  return { moveTo, hide };
};

/** The stretch that is being dragged over; `choose` is called with it at the end. */
const dragOf = (svg, scale, choose) => {
  const chosen = create("rect", { class: "chosen", y: scale.top, height: scale.bottom - scale.top });
  let begun = null;
  const ends = (px) => [begun, scale.inside(px)].sort((one, other) => one - other);
  const cancel = () => {
    begun = null;
    chosen.remove();
  };
  const begin = (px) => { begun = px; };
  const moveTo = (px) => {
    if (begun === null) return;
    const [a, b] = ends(px);
    chosen.setAttribute("x", a);
    chosen.setAttribute("width", b - a);
    svg.append(chosen);
  };
  const end = (px) => {
    if (begun === null) return;
    const [a, b] = ends(px);
    cancel();
    // A click does not select a stretch, and no stretch is smaller than the numbers resolve.
    const isStretch = b - a > 6 && (b - a) * (scale.to - scale.from) > 1e-3 * (scale.right - scale.left) ** 2;
    if (isStretch) choose([scale.whole(a), scale.whole(b)]);
  };
  return { begin, moveTo, end, cancel };
};

/** Says above the first plot what the pointer does. */
const explain = (plot) => {
  const hint = document.createElement("p");
  hint.className = "note hint";
  hint.textContent = "Drag over a stretch of a plot to see it at full resolution, double-click for the whole; plots over the same quantity follow.";
  plot?.before(hint);
};

const plots = [...document.querySelectorAll("svg[data-x]")].map((svg, number) => {
  const scale = scaleOf(svg);
  return { svg, scale, parts: framed(svg, scale, number), cursor: cursorOf(svg, scale) };
});

/** The plots over the quantity that this one is over, itself among them. */
const linked = (plot) => plots.filter(({ svg }) => svg.dataset.of === plot.svg.dataset.of);

/** Shows a stretch of values in a plot and those linked to it; the whole of those that have none of it. */
const showIn = (plot, [low, high]) => {
  for (const { scale, parts } of linked(plot)) {
    const [from, to] = [low, high].map((x) => scale.inside(scale.toPx(x)));
    zoom(scale, parts, to - from > 1e-3 ? [from, to] : [scale.left, scale.right]);
  }
};

/** Points at a place of a plot, and at the same value in those linked to it. */
const pointAt = (plot, px) => {
  const x = plot.scale.toX(plot.scale.whole(px));
  for (const { scale, cursor } of linked(plot)) cursor.moveTo(scale.shown(scale.toPx(x)));
};

for (const plot of plots) {
  const { svg, scale } = plot;
  const drag = dragOf(svg, scale, (stretch) => showIn(plot, stretch.map(scale.toX)));
  const at = (event) => {
    const px = scale.within(event);
    drag.moveTo(px);
    pointAt(plot, px);
  };
  svg.addEventListener("pointermove", at);
  svg.addEventListener("pointerdown", (event) => {
    const px = scale.within(event);
    if (px >= scale.left && px <= scale.right) {
      drag.begin(px);
      svg.setPointerCapture(event.pointerId);
    }
    at(event);
  });
  svg.addEventListener("pointerup", (event) => drag.end(scale.within(event)));
  svg.addEventListener("pointercancel", drag.cancel);
  svg.addEventListener("pointerleave", () => linked(plot).forEach(({ cursor }) => cursor.hide()));
  svg.addEventListener("dblclick", () => showIn(plot, [scale.left, scale.right].map(scale.toX)));
}
explain(document.querySelector(".plot"));
