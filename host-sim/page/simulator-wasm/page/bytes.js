// Binary files inside the page: a folder opened without a server may fetch nothing.

import { files } from "./files.js";

/** @returns {Promise<BufferSource>} the file */
export async function bytes(name) {
  const text = files[name];
  if (!text) throw new Error(`${name} is not part of this page`);
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}
