/**
 * Harmonics of an SPZ file (github.com/nianticlabs/spz, versions 2 and 3) for Spark's precise Gaussians.
 *
 * Spark 2.2 encodes the red, green and blue of a harmonic as bytes with one exponent, and cuts off what exceeds the power
 * of two below the largest: up to half of it. Here the exponent is that of the power above.
 */
const HEADER = 16; // bytes
const CHANNELS = 3;
const PLACES = ["sh1", "sh2", "sh3a", "sh3b"]; // arrays of Spark, four harmonics of a Gaussian in each

/**
 * Encode a harmonic as Spark decodes it (decodeExtRgb): three bytes, signs, and the exponent plus 15.
 * @param {Int8Array} values
 * @param {number} at place of red; 128 is 1
 */
function encode(values, at) {
  const largest = Math.max(...[0, 1, 2].map((channel) => Math.abs(values[at + channel]))) / 128;
  if (largest === 0) return 0;
  const exponent = Math.ceil(Math.log2(largest));
  let code = (exponent + 15) << 27;
  for (let channel = 0; channel < CHANNELS; channel++) {
    const value = values[at + channel] / 128;
    code |= Math.round((Math.abs(value) / 2 ** exponent) * 255) << (8 * channel);
    if (value < 0) code |= 1 << (24 + channel);
  }
  return code;
}

/**
 * Replace the harmonics that Spark has encoded.
 * @param {import("@sparkjsdev/spark").ExtSplats} splats
 * @param {Uint8Array} file of these, packed by gzip
 */
export async function restoreHarmonics(splats, file) {
  const unpacked = new Blob([file]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(unpacked).arrayBuffer());
  const count = new DataView(bytes.buffer).getUint32(8, true);
  const degree = bytes[12];
  const harmonics = (degree + 1) ** 2 - 1;
  const size = count * harmonics * CHANNELS;
  if (count !== splats.numSplats || HEADER + size > bytes.length) throw new RangeError("not an SPZ file");
  const values = Int8Array.from(bytes.subarray(bytes.length - size), (byte) => byte - 128);
  for (let gaussian = 0; gaussian < count; gaussian++) {
    for (let k = 0; k < harmonics; k++) {
      const code = encode(values, CHANNELS * (gaussian * harmonics + k));
      splats.extra[PLACES[k >> 2]][4 * gaussian + (k & 3)] = code;
    }
  }
}
