// Opens a report at three widths, in light and dark, and prints as JSON what it saw: node report_page.mjs FILE PICTURES
import { pathToFileURL } from "node:url";
import { misplaced } from "./boxes.mjs";
import { launch } from "./launch.mjs";

const [file, pictures] = process.argv.slice(2);
const browser = await launch();
const told = { widths: {}, errors: [], console: [] };

try {
  const page = await browser.newPage();
  page.on("console", message => { if (["error", "warning"].includes(message.type())) told.console.push(message.text()); });
  page.on("pageerror", error => told.errors.push(String(error)));
  for (const colorScheme of ["light", "dark"]) {
    await page.emulateMedia({ colorScheme });
    for (const width of [390, 1280, 1920]) {
      await page.setViewportSize({ width, height: 1000 });
      await page.goto(pathToFileURL(file).href);
      await page.evaluate(() => Promise.all([...document.images].map(image => { image.loading = "eager"; return image.decode(); })));
      if (colorScheme === "light") told.widths[width] = await page.evaluate(misplaced);
      await page.screenshot({ path: `${pictures}/${colorScheme}-${width}.png`, fullPage: true });
    }
    told[colorScheme] = await page.evaluate(() => {
      const { color, backgroundColor } = getComputedStyle(document.body);
      return [color, backgroundColor].map(text => text.match(/\d+/g).slice(0, 3).reduce((sum, part) => sum + Number(part), 0));
    });
  }
  const shown = () => page.locator("details tbody tr:visible td:first-child").allTextContents();
  told.all = await shown();
  told.by_reason = {};
  for (const reason of await page.locator("#reason option").evaluateAll(options => options.map(option => option.value))) {
    await page.selectOption("#reason", reason);
    told.by_reason[reason] = await shown();
  }
} catch (error) {
  told.errors.push(String(error));
} finally {
  console.log(JSON.stringify(told));
  await browser.close();
}
