// A canvas that stays as sharp as the screen, and the colours of style.css for those who draw.

const MOST_PIXELS_PER_POINT = 2;

/** Keeps `canvas` at its size on screen; `surface.width` and `height` are in points, and so are all
 *  drawings. A point is `surface.unit` CSS pixels: a tenth of the size of text of the whole page
 *  (style.css), so that words on a canvas grow with those next to it. */
export function surface(canvas) {
  const context = canvas.getContext("2d", { alpha: false });
  const result = { canvas, context, width: 1, height: 1, unit: 1 };
  const fit = () => {
    const ratio = Math.min(window.devicePixelRatio || 1, MOST_PIXELS_PER_POINT);
    const root = getComputedStyle(document.documentElement);
    result.unit = parseFloat(root.fontSize) / 10 || 1;
    result.width = Math.max(1, canvas.clientWidth) / result.unit;
    result.height = Math.max(1, canvas.clientHeight) / result.unit;
    const pixels = ratio * result.unit;
    canvas.width = Math.round(result.width * pixels);
    canvas.height = Math.round(result.height * pixels);
    context.setTransform(pixels, 0, 0, pixels, 0, 0);
    // What cannot be seen through is black until it is drawn on, and after every change of size.
    context.fillStyle = root.getPropertyValue("--panel").trim();
    context.fillRect(0, 0, result.width, result.height);
  };
  new ResizeObserver(fit).observe(canvas);
  fit();
  return result;
}

const NAMES = [
  "panel", "line", "good", "bad", "text", "muted", "depth", "force", "motor", "grid", "sky", "skin", "skin-edge", "fat", "muscle",
  "bursa", "tendon", "cartilage", "other", "ruler", "ruler-edge", "vessel-wall", "vessel-edge", "lumen", "haematoma", "catheter", "fibre", "on-tissue", "steel-light", "steel", "steel-dark", "grip",
];

/** The colours by name, and again whenever light changes to dark. */
export function colours() {
  const result = { font: "" };
  const read = () => {
    const style = getComputedStyle(document.documentElement);
    for (const name of NAMES) result[name] = style.getPropertyValue(`--${name}`).trim();
    result.font = getComputedStyle(document.body).fontFamily;
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", read);
  read();
  return result;
}
