// Opens a report at three widths, in light and dark, and prints as JSON what it saw: node report_page.mjs FILE PICTURES
import { pathToFileURL } from "node:url";
import { launch } from "./launch.mjs";

const [file, pictures] = process.argv.slice(2);
const browser = await launch();
const told = { widths: {}, errors: [], console: [] };

// in the page: boxes that overlap without one holding the other, and boxes that reach beyond the window
function misplaced() {
  const TOLERANCE_PX = 1.5;
  const boxes = [];
  // what a scrolling ancestor hides is not seen
  const add = (element, rect, text) => {
    let { left, right, top, bottom } = rect;
    for (let outer = text ? element : element.parentElement; outer; outer = outer.parentElement) {
      if (getComputedStyle(outer).overflowX === "visible") continue;
      const clip = outer.getBoundingClientRect();
      [left, right] = [Math.max(left, clip.left), Math.min(right, clip.right)];
      [top, bottom] = [Math.max(top, clip.top), Math.min(bottom, clip.bottom)];
    }
    if (right - left > TOLERANCE_PX && bottom - top > TOLERANCE_PX) {
      boxes.push({ element, left, right, top, bottom, name: text || `<${element.tagName.toLowerCase()}> ${element.textContent.trim().slice(0, 40)}` });
    }
  };
  for (const element of document.body.querySelectorAll("*")) {
    const display = getComputedStyle(element).display;
    if (display !== "inline" && element.tagName !== "OPTION") add(element, element.getBoundingClientRect(), "");
  }
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const node = texts.currentNode, words = node.textContent.trim();
    if (!words || ["SCRIPT", "OPTION"].includes(node.parentElement.tagName)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const rect of range.getClientRects()) add(node.parentElement, rect, words.slice(0, 40));
  }
  boxes.sort((one, other) => one.top - other.top);
  const overlaps = [];
  boxes.forEach((one, index) => {
    for (const other of boxes.slice(index + 1)) {
      if (other.top > one.bottom - TOLERANCE_PX) break;
      const beside = Math.min(one.right, other.right) - Math.max(one.left, other.left) <= TOLERANCE_PX;
      if (!beside && !one.element.contains(other.element) && !other.element.contains(one.element)) overlaps.push([one.name, other.name]);
    }
  });
  const beyond = boxes.filter(box => box.left < -TOLERANCE_PX || box.right > innerWidth + TOLERANCE_PX).map(box => box.name);
  return { boxes: boxes.length, overlaps, beyond, document_px: document.documentElement.scrollWidth };
}

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
