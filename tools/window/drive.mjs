// Runs a browser: node drive.mjs PACKAGE_JSON BROWSER EXECUTABLE; a command per line of stdin, JSON to both sides.
import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";

const [packages, browser, executablePath] = process.argv.slice(2);
const { default: puppeteer } = await import(pathToFileURL(createRequire(packages).resolve("puppeteer-core")));
const started = await puppeteer.launch({
  browser: { chromium: "chrome" }[browser] ?? browser,
  executablePath,
  headless: browser === "chromium",
  protocolTimeout: 300_000,
  args: browser === "chromium" ? ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] : [],
  extraPrefsFirefox: { "webgl.force-enabled": true },
});
let page;
const remarks = [];

const commands = {
  async open({ url, width, height, dark, before }) {
    await page?.close();
    page = await started.newPage();
    remarks.length = 0;
    page.on("pageerror", (error) => remarks.push(String(error)));
    page.on("console", (message) => message.type() === "error" && remarks.push(message.text()));
    await page.setViewport({ width, height });
    if (dark !== null) await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: dark ? "dark" : "light" }]);
    if (before) await page.evaluateOnNewDocument(before);
    const start = performance.now();
    await page.goto(url, { timeout: 200_000 });
    await page.waitForSelector("[data-state=ready], [data-state=stills]", { timeout: 200_000 });
    return (performance.now() - start) / 1000;
  },
  run: ({ script }) => page.evaluate(script),
  press: ({ keys }) => keys.reduce((before, key) => before.then(() => page.keyboard.press(key)), Promise.resolve()),
  async judge() {
    await page.addScriptTag({ path: createRequire(packages).resolve("axe-core") });
    const { violations } = await page.evaluate("axe.run()");
    return violations.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html).join(" ")}`);
  },
  shoot: ({ path }) => page.screenshot({ path }).then(() => path),
  remarks: async () => remarks,
};
for await (const line of createInterface({ input: process.stdin })) {
  const { command, ...values } = JSON.parse(line);
  const answer = await commands[command](values).then(
    (value) => ({ value }),
    (error) => ({ error: String(error?.stack ?? error) }),
  );
  console.log(JSON.stringify(answer));
}
await started.close();
