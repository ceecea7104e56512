// node ktx.mjs FILE...: what ktx-parse makes of KTX2 files, as JSON; pixels as bytes in base64.
import { readFileSync } from "node:fs";
import { read } from "ktx-parse";

const found = process.argv.slice(2).map((path) => {
  const { levels, keyValue, dataFormatDescriptor, ...rest } = read(new Uint8Array(readFileSync(path)));
  const pixels = levels.map((level) => Buffer.from(level.levelData).toString("base64"));
  const text = (value) => typeof value === "string" ? value : Buffer.from(value).toString("utf8").replace(/\0$/, "");
  const notes = Object.fromEntries(Object.entries(keyValue).map(([key, value]) => [key, text(value)]));
  return { ...rest, globalData: null, keyValue: notes, descriptor: dataFormatDescriptor, pixels };
});
console.log(JSON.stringify(found));
