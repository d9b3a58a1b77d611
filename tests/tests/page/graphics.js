// Runs in the page: the same limb drawn by WebGL 2 and by WebGPU into canvases of their own, compared pixel by pixel.
(async () => {
  const names = ["picture", "tissue3d", "limb_webgl", "limb_webgpu", "canvas"];
  const [{ Picture }, { Tissue3d }, { WebGl }, { WebGpu }, { colours }] =
    await Promise.all(names.map((name) => import(`/${name}.js`)));
  const scene = await new Promise((resolve) => {
    const socket = new WebSocket(`ws://${location.host}/live`);
    socket.onmessage = ({ data }) => {
      const message = JSON.parse(data);
      if (message.type === "scene") socket.close(), resolve(message);
    };
  });
  const picture = await Picture.load();
  const angle = 0.5;
  if (!picture.build(scene, angle)) return { error: "the scene cannot be built" };
  const canvas = () => {
    const made = document.createElement("canvas");
    made.style.cssText = "position: fixed; top: 0; left: 0; width: 480px; height: 320px; z-index: 9";
    document.body.append(made);
    return made;
  };
  const [first, second] = [canvas(), canvas()];
  const gpu = await WebGpu.open(second, true);
  if (!gpu) return { error: "this browser has no WebGPU" };
  const limbs = [new Tissue3d(first, colours(), new WebGl(first)), new Tissue3d(second, colours(), gpu)];
  for (const limb of limbs) limb.build(picture, scene);
  for (let depth = 0; depth < 8; depth += 0.1) picture.step(1 / 60, { depth, angle, origin: [0, 0] });
  const probe = { along: 8, across: 0, azimuth: 0, lean: 0, depth: 16 };
  const frame = () => new Promise(requestAnimationFrame);
  const drawn = async (limb, wait) => {
    limb.draw(picture, { depth: 8, angle, origin: [0, 0], flashback: true }, probe);
    await wait();
    const { width, height } = limb.canvas;
    const file = await new Promise((resolve) => limb.canvas.toBlob(resolve));
    const flat = new OffscreenCanvas(width, height).getContext("2d");
    flat.drawImage(await createImageBitmap(file), 0, 0);
    return flat.getImageData(0, 0, width, height).data;
  };
  // WebGL's canvas is emptied after the task that drew it, that of WebGPU is filled after it.
  const one = await drawn(limbs[0], () => {});
  const two = await drawn(limbs[1], frame);
  let [sum, unlike, tones] = [0, 0, new Set()];
  for (let i = 0; i < one.length; i += 4) {
    const difference = Math.max(...[0, 1, 2].map((part) => Math.abs(one[i + part] - two[i + part])));
    sum += difference;
    unlike += difference > 24;
    tones.add((two[i] >> 3) + 32 * (two[i + 1] >> 3) + 1024 * (two[i + 2] >> 3));
  }
  const pixels = one.length / 4;
  return { mean: sum / pixels, unlike: unlike / pixels, tones: tones.size };
})();
