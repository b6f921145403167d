/** Files of the page: from beside it, or from within a page of one file. */

/** A file that is missing or damaged; its message is a sentence for the reader. */
export class FileError extends Error {}

/** @type {Record<string, string>} base64 data by file name, of a page of one file; else empty */
const embedded = JSON.parse(document.getElementById("karf-files")?.textContent ?? "{}");

/**
 * Return a file's address for an image or a link.
 * @param {string} name
 */
export function addressOf(name) {
  const kinds = { webp: "image/webp", png: "image/png", svg: "image/svg+xml", jpg: "image/jpeg", jpeg: "image/jpeg" };
  return name in embedded ? `data:${kinds[name.split(".").pop()] ?? ""};base64,${embedded[name]}` : name;
}

/**
 * Read a file.
 * @param {string} name
 * @param {(received: number, expected: number) => void} onBytes called with the bytes of each part, and before the first
 *   one with those of the whole
 * @returns {Promise<Uint8Array>}
 */
export async function read(name, onBytes = () => {}) {
  if (name in embedded) {
    const bytes = Uint8Array.from(atob(embedded[name]), (each) => each.charCodeAt(0));
    onBytes(bytes.length, bytes.length);
    return bytes;
  }
  const answer = await fetch(name).catch(() => null);
  if (!answer?.ok) throw new FileError(`The file ${name} of this page could not be loaded.`);
  onBytes(0, Number(answer.headers.get("content-length")));
  const counted = new TransformStream({
    transform(part, controller) {
      onBytes(part.length, 0);
      controller.enqueue(part);
    },
  });
  const whole = await new Response(answer.body.pipeThrough(counted)).arrayBuffer().catch(() => null);
  if (!whole) throw new FileError(`The file ${name} of this page was cut off while loading.`);
  return new Uint8Array(whole);
}

/**
 * Read a file of JSON.
 * @param {string} name
 */
export async function readJson(name) {
  const text = new TextDecoder().decode(await read(name));
  try {
    return JSON.parse(text);
  } catch {
    throw damaged(name);
  }
}

/**
 * Read and unpack a gzip file of a known size.
 * @param {string} name
 * @param {number} size in bytes, unpacked
 * @param {(received: number, expected: number) => void} [onBytes]
 * @returns {Promise<ArrayBuffer>}
 */
export async function readPacked(name, size, onBytes) {
  const bytes = await read(name, onBytes);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const data = await new Response(stream).arrayBuffer().catch(() => null);
  if (data?.byteLength !== size) throw damaged(name);
  return data;
}

/**
 * Return the error for a file that cannot be understood.
 * @param {string} name
 */
export function damaged(name) {
  return new FileError(`The file ${name} of this page is damaged. Ask its sender for a new copy.`);
}
