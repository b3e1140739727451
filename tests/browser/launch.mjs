// Starts a headless Chromium: the one that came with npm's package, or else the system's.
// As a program: exits with 0 if one of them starts.
import { existsSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const ARGUMENTS = ["--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run",
  "--disable-background-networking", "--disable-component-update", "--disable-default-apps", "--disable-sync"];

async function packaged() {
  const { default: shipped } = await import("@sparticuz/chromium");
  return shipped.executablePath();
}

export async function launch() {
  const problems = [];
  for (const find of [packaged, async () => ["/usr/bin/chromium", "/usr/bin/chromium-headless-shell"].find(existsSync)]) {
    try {
      const executablePath = await find();
      if (executablePath) return await chromium.launch({ executablePath, args: ARGUMENTS, headless: true, timeout: 60_000 });
    } catch (error) {
      problems.push(String(error).split("\n")[0]);
    }
  }
  throw new Error("no Chromium starts: " + problems.join("; "));
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const browser = await launch();
  console.log("Chromium " + browser.version());
  await browser.close();
}
