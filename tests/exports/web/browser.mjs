// A local server and Debian's Chromium for one page; every wait is bounded.
import { createReadStream } from "node:fs";
import { createServer } from "node:http";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const MODULES = join(dirname(fileURLToPath(import.meta.url)), "node_modules");
const FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--force-color-profile=srgb"];
const KINDS = { ".html": "text/html", ".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm" };

// Serves folders by their first path part, and texts by their whole path: the base address and a way to stop.
async function serve(folders, texts) {
  const server = createServer((request, response) => {
    const path = decodeURIComponent(new URL(request.url, "http://local").pathname);
    const kind = KINDS[extname(path)] || (path in texts ? "text/html" : "application/octet-stream");
    if (path in texts) return response.writeHead(200, { "Content-Type": kind }).end(texts[path]);
    const [, first, ...rest] = path.split("/");
    if (!(first in folders)) return response.writeHead(404).end();
    const file = createReadStream(join(folders[first], normalize(rest.join("/"))));
    file.on("open", () => { response.writeHead(200, { "Content-Type": kind }); file.pipe(response); });
    file.on("error", () => response.writeHead(404).end());
  });
  await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
  return [`http://127.0.0.1:${server.address().port}`, () => server.close()];
}

// Runs `work(page, base)`; what the page throws or logs as an error fails it.
export async function withPage({ folders = {}, texts = {}, viewport = { width: 640, height: 480 }, scale = 1 }, work) {
  const [base, stop] = await serve(folders, texts);
  const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: FLAGS, timeout: 60000 });
  const problems = [], log = [];
  try {
    const page = await browser.newPage({ viewport, deviceScaleFactor: scale });
    page.setDefaultTimeout(60000);
    page.on("pageerror", (error) => problems.push(error.message));
    page.on("console", (message) => {
      log.push(message.text());
      const icon = message.location().url.endsWith("/favicon.ico");  // which every browser asks for
      if (message.type() === "error" && !icon) problems.push(`${message.text()} ${message.location().url}`);
    });
    const found = await work(page, base, log);
    if (problems.length) throw new Error(problems.join("\n"));
    return found;
  } catch (error) {
    throw new Error([error.message, ...problems, ...log.slice(-20)].join("\n"));
  } finally {
    await browser.close();
    stop();
  }
}
