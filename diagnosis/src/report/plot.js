// Shows the values of a plot's curves under the pointer. The curves are read back from the SVG paths, so that no number is in the
// page twice; without this script the page shows the same curves.
for (const svg of document.querySelectorAll("svg[data-x]")) {
  const [left, right, top, bottom] = svg.dataset.box.split(" ").map(Number);
  const range = (text) => text.split(" ").map(Number);
  const [x0, x1] = range(svg.dataset.x), [y0, y1] = range(svg.dataset.y);
  const toX = (px) => x0 + (px - left) / (right - left) * (x1 - x0);
  const toY = (py) => y1 - (py - top) / (bottom - top) * (y1 - y0);
  const digits = (span) => Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(span))));
  const show = (value, span) => span < 1e-4 || span >= 1e6 ? value.toExponential(3) : value.toFixed(digits(span));
  let curves = null;
  const read = () => [...svg.querySelectorAll("path[data-name]")].map((path) => ({
    name: path.dataset.name,
    // "M x y" and "L x y" are points; "M x y V y" is the range of a stretch.
    points: path.getAttribute("d").split(/(?=[ML])/).filter(Boolean)
      .map((part) => part.slice(1).split(/[ V]/).map(Number)),
  }));
  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  line.setAttribute("class", "cursor");
  const readout = document.createElement("output");
  svg.after(readout);
  const at = (event) => {
    curves ??= read();
    const box = svg.getBoundingClientRect();
    const px = (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
    if (px < left || px > right) return gone();
    for (const [key, value] of [["x1", px], ["x2", px], ["y1", top], ["y2", bottom]]) line.setAttribute(key, value);
    svg.append(line);
    const values = curves.flatMap(({ name, points }) => {
      if (!points.length) return [];
      const near = points.reduce((a, b) => Math.abs(b[0] - px) < Math.abs(a[0] - px) ? b : a);
      // Farther than its neighbours stand apart is a gap.
      if (Math.abs(near[0] - px) > Math.max(8, (right - left) / points.length)) return [];
      return [`${name} ${near.slice(1).map((py) => show(toY(py), y1 - y0)).join(" to ")}`];
    });
    const [name, unit = ""] = svg.dataset.of.split(", ");
    readout.textContent = [`${name} ${show(toX(px), x1 - x0)} ${unit}`, ...values].join(" · ");
  };
  const gone = () => { line.remove(); readout.textContent = ""; };
  svg.addEventListener("pointermove", at);
  svg.addEventListener("pointerdown", at);
  svg.addEventListener("pointerleave", gone);
}
