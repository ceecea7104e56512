// node page.mjs PAGE PICTURE: opens the page from the disk, offline, works its controls by mouse; what it shows, as JSON.
import { writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { withPage } from "./browser.mjs";

const [file, picture] = process.argv.slice(2);

const found = await withPage({ viewport: { width: 720, height: 460 }, scale: 0.5 }, async (page) => {
  const asked = [], steps = [];
  page.on("request", (request) => { if (!/^(data|blob):/.test(request.url())) asked.push(request.url()); });
  await page.context().setOffline(true);
  await page.goto(pathToFileURL(file).href + "#3");
  const frames = (n) => page.waitForFunction((count) => Number(document.body.dataset.frames) >= count, n);
  await frames(1);
  const drawn = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

  // The pixel in the middle of the swatch on the screen, decoded by the browser itself, and the sliders' values.
  async function look() {
    await drawn();
    const box = await page.locator("#swatch").boundingBox();
    const clip = { x: Math.round(box.x + box.width / 2), y: Math.round(box.y + box.height / 2), width: 1, height: 1 };
    const shot = (await page.screenshot({ clip })).toString("base64");
    return page.evaluate(async (shot) => {
      const image = await createImageBitmap(await (await fetch("data:image/png;base64," + shot)).blob());
      const context = new OffscreenCanvas(1, 1).getContext("2d");
      context.drawImage(image, 0, 0);
      const skin = [...document.querySelectorAll("output")].map((one) => Number(one.dataset.value));
      return { skin, pixel: [...context.getImageData(0, 0, 1, 1).data].slice(0, 3), told: document.querySelector("#note b").textContent };
    }, shot);
  }

  async function drag(name, from, to) {
    const box = await page.locator("#" + name).boundingBox(), y = box.y + box.height / 2;
    await page.mouse.move(box.x + from * box.width, y);
    await page.mouse.down();
    await page.mouse.move(box.x + to * box.width, y, { steps: 4 });
    await page.mouse.up();
  }

  steps.push(await look());
  for (const [name, from, to] of [["melanin", 0.3, 0.75], ["eumelanin", 0.7, 0.1], ["hemoglobin", 0.3, 0.9], ["melanin", 0.75, 0.0]]) {
    await drag(name, from, to);
    steps.push(await look());
  }
  for (const name of ["preset-dark", "preset-very-light"]) {
    await page.locator("#" + name).click();
    steps.push(await look());
  }
  await drawn();
  await frames(3);
  writeFileSync(picture, await page.screenshot());
  await page.locator("#scatters").click();
  await drawn();
  await frames(3);
  writeFileSync(picture.replace(".png", "_flat.png"), await page.screenshot());
  return { steps, asked };
});
console.log(JSON.stringify(found));
