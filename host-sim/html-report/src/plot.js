// Shows the values of a plot's curves under the pointer, and, once it is dragged over, a stretch of them alone. The curves are read back
// from the SVG paths, so that no number is in the page twice; without this script the page shows the same curves.
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

document.querySelectorAll("svg[data-x]").forEach((svg, number) => {
  const [left, right, top, bottom] = svg.dataset.box.split(" ").map(Number);
  const range = (text) => text.split(" ").map(Number);
  const [x0, x1] = range(svg.dataset.x), [y0, y1] = range(svg.dataset.y);
  const toX = (px) => x0 + (px - left) / (right - left) * (x1 - x0);
  const toY = (py) => y1 - (py - top) / (bottom - top) * (y1 - y0);
  /** The stretch that is shown, as places of the whole plot. */
  let [from, to] = [left, right];
  /** The place in the whole plot that is shown at `px`. */
  const whole = (px) => from + (px - left) / (right - left) * (to - from);
  const [name, unit = ""] = svg.dataset.of.split(", ");

  const { y, height } = svg.viewBox.baseVal;
  const marks = [...svg.children].filter((child) => !child.matches("title, text, .grid"));
  const along = [...svg.children].filter((child) => child.matches("text:not([text-anchor=end]), .grid")
    && (child.localName === "text" || child.getAttribute("x1") === child.getAttribute("x2")));
  const last = [...svg.querySelectorAll("text")].at(-1);
  if (last && !along.includes(last)) along.push(last);
  const clip = create("clipPath", { id: `plot-${number}` });
  clip.append(create("rect", { x: left, y, width: right - left, height }));
  const frame = create("g", { "clip-path": `url(#plot-${number})` });
  const curvesOf = create("g", {});
  const zoomed = create("g", {});
  curvesOf.append(...marks);
  frame.append(curvesOf);
  svg.append(clip, frame, zoomed);

  /** Shows a stretch of the plot, with ticks of its own. */
  const zoom = (a, b) => {
    [from, to] = [a, b];
    const by = (right - left) / (to - from);
    curvesOf.setAttribute("transform", `translate(${left - from * by} 0) scale(${by} 1)`);
    const isWhole = from === left && to === right;
    for (const tick of along) tick.style.display = isWhole ? "" : "none";
    zoomed.replaceChildren(...isWhole ? [] : ticks(toX(from), toX(to)).flatMap((value) => {
      const px = left + (value - toX(from)) / (toX(to) - toX(from)) * (right - left);
      const label = create("text", { x: px, y: y + height - 8, "text-anchor": px > right - 18 ? "end" : "middle" });
      label.textContent = show(value, toX(to) - toX(from));
      return [create("line", { class: "grid", x1: px, x2: px, y1: bottom + 1, y2: bottom + 6 }), label];
    }));
  };

  let curves = null;
  const read = () => [...svg.querySelectorAll("path[data-name]")].map((path) => ({
    name: path.dataset.name,
    // "M x y" and "L x y" are points; "M x y V y" is the range of a stretch.
    points: path.getAttribute("d").split(/(?=[ML])/).filter(Boolean)
      .map((part) => part.slice(1).split(/[ V]/).map(Number)),
  }));
  const line = create("line", { class: "cursor" });
  const chosen = create("rect", { class: "chosen", y: top, height: bottom - top });
  const readout = document.createElement("output");
  svg.after(readout);
  const within = (event) => {
    const box = svg.getBoundingClientRect();
    return (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
  };
  let begun = null;
  const at = (event) => {
    curves ??= read();
    const shown = within(event);
    if (begun !== null) {
      const [a, b] = [begun, Math.min(right, Math.max(left, shown))].sort((one, other) => one - other);
      chosen.setAttribute("x", a);
      chosen.setAttribute("width", b - a);
      svg.append(chosen);
    }
    if (shown < left || shown > right) return gone();
    const px = whole(shown);
    for (const [key, value] of [["x1", shown], ["x2", shown], ["y1", top], ["y2", bottom]]) line.setAttribute(key, value);
    svg.append(line);
    const values = curves.flatMap(({ name: curve, points }) => {
      if (!points.length) return [];
      const near = points.reduce((a, b) => Math.abs(b[0] - px) < Math.abs(a[0] - px) ? b : a);
      // There is a gap if the nearest point is farther away than the points are apart.
      if (Math.abs(near[0] - px) > Math.max(8, (right - left) / points.length)) return [];
      return [`${curve} ${near.slice(1).map((py) => show(toY(py), y1 - y0)).join(" to ")}`];
    });
    readout.textContent = [`${name} ${show(toX(px), toX(to) - toX(from))} ${unit}`, ...values].join(" · ");
  };
  const gone = () => {
    line.remove();
    readout.textContent = from === left && to === right ? "" : "double-click for the whole";
  };
  const end = (event) => {
    if (begun === null) return;
    const [a, b] = [begun, Math.min(right, Math.max(left, within(event)))].sort((one, other) => one - other);
    begun = null;
    chosen.remove();
    // A click does not select a stretch, and no stretch is smaller than the numbers resolve.
    if (b - a > 6 && (b - a) * (to - from) > 1e-3 * (right - left) ** 2) zoom(whole(a), whole(b));
  };
  svg.addEventListener("pointermove", at);
  svg.addEventListener("pointerdown", (event) => {
    const px = within(event);
    if (px >= left && px <= right) {
      begun = px;
      svg.setPointerCapture(event.pointerId);
    }
    at(event);
  });
  svg.addEventListener("pointerup", end);
  svg.addEventListener("pointercancel", () => { begun = null; chosen.remove(); });
  svg.addEventListener("pointerleave", gone);
  svg.addEventListener("dblclick", () => zoom(left, right));
  const hint = create("title", {});
  hint.textContent = `${svg.querySelector("title")?.textContent ?? ""}: drag over a stretch to see it alone, double-click for the whole`;
  svg.querySelector("title")?.replaceWith(hint);
});
