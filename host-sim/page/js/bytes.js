// Where binary files of the page come from: the server. The static site has another module in this place.

/** @returns {Promise<BufferSource>} the file */
export async function bytes(name) {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
  return answer.arrayBuffer();
}
