/** Bundle the page into dist/: index.html with its style, page.js, and the licenses of what page.js contains. */
import { mkdir, readFile, readdir, rm, writeFile } from "node:fs/promises";
import { build, transform } from "esbuild";

await rm("dist", { recursive: true, force: true });
await mkdir("dist");
const { metafile } = await build({
  entryPoints: ["src/main.js"],
  outfile: "dist/page.js",
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "none",
  metafile: true,
});
const { code: style } = await transform(await readFile("style.css", "utf8"), { loader: "css", minify: true });
const index = await readFile("index.html", "utf8");
await writeFile("dist/index.html", index.replace(/<link rel="stylesheet"[^>]*>/, () => `<style>${style}</style>`));

const inputs = Object.keys(metafile.inputs).map((path) => path.match(/^(?:.*\/)?node_modules\/((?:@[^/]+\/)?[^/]+)\//)?.[1]);
let licenses = "page.js contains these packages.\n";
for (const name of [...new Set(inputs.filter(Boolean))].sort()) {
  const folder = `node_modules/${name}`;
  const { version, homepage } = JSON.parse(await readFile(`${folder}/package.json`, "utf8"));
  const file = (await readdir(folder)).find((each) => /^licen[cs]e/i.test(each));
  if (!file) throw new Error(`${name} comes without a license`);
  licenses += `\n${"-".repeat(80)}\n${name} ${version}, ${homepage}\n\n${(await readFile(`${folder}/${file}`, "utf8")).trim()}\n`;
}
await writeFile("dist/licenses.txt", licenses);
