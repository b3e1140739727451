// Opens the live page of a match, does what a user does, and prints as JSON what it saw: node live_page.mjs ADDRESS PICTURES
import { misplaced } from "./boxes.mjs";
import { launch } from "./launch.mjs";

const [address, pictures] = process.argv.slice(2);
const browser = await launch();
const told = { stage: "open", version: browser.version(), console: [], requests: [], errors: [] };
const WAIT = { timeout: 60_000 };
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 860 } });
  page.on("console", message => { if (["error", "warning"].includes(message.type())) told.console.push(message.text()); });
  page.on("pageerror", error => told.errors.push(String(error)));
  page.on("request", request => told.requests.push(request.url()));
  page.on("websocket", socket => told.requests.push(socket.url()));
  await page.goto(address);
  const card = page.locator("article.card").first();
  const at = () => card.evaluate(element => ({ ...element.dataset, text: element.querySelector(".pose").textContent }));
  const number = async () => Number((await at()).number || 0);
  const beyond = least => page.waitForFunction(least => Number(document.querySelector("article.card")?.dataset.number || 0) > least, least, WAIT);
  const canvas = part => card.locator(`canvas[data-part="${part}"]`).evaluate(element => element.toDataURL());

  told.stage = "it comes to life";
  // it comes to life, and the image changes
  await beyond(3);
  told.robots = await page.locator("article.card").count();
  const first = await canvas("image");
  await beyond((await number()) + 5);
  told.image_changes = first !== await canvas("image");

  told.stage = "the pose";
  // the pose that is shown, beside the truth, both of one moment
  told.poses = [];
  for (let i = 0; i < 25; i++) {
    const { x, y, truth, text, number: shown } = await at();
    if (x && truth) told.poses.push({ number: Number(shown), shown: [Number(x), Number(y)], truth: JSON.parse(truth), text });
    await beyond(Number(shown));
  }

  told.stage = "pause and step";
  // pause, step, back
  await page.keyboard.press("Space");
  await page.waitForFunction(() => document.body.dataset.paused === "true", null, WAIT);
  await page.waitForTimeout(700);
  const paused = await number();
  await page.waitForTimeout(1000);
  told.stands_still = paused === await number();
  await page.keyboard.press("ArrowRight");
  await beyond(paused);
  await page.waitForTimeout(500);
  told.step_on = (await number()) - paused;
  const before = await number();
  await page.keyboard.press("ArrowLeft");
  await page.waitForFunction(before => Number(document.querySelector("article.card").dataset.number) < before, before, WAIT);
  told.step_back = (await number()) - before;
  await page.click("#back30");
  await page.waitForFunction(before => Number(document.body.dataset.back) > 1 && Number(document.querySelector("article.card").dataset.number) < before - 20, before, WAIT);
  told.state = await page.textContent("#state");
  await page.keyboard.press("n");
  await page.waitForFunction(() => document.body.dataset.paused === "false" && document.body.dataset.still === "false", null, WAIT);
  await page.keyboard.press("Space");
  await page.waitForFunction(() => document.body.dataset.paused === "true", null, WAIT);
  await page.waitForTimeout(700);

  told.stage = "layers";
  // every layer can be switched, and those that show something change the pictures
  told.layers = {};
  for (const name of await page.locator("#legend input").evaluateAll(boxes => boxes.map(box => box.dataset.layer))) {
    const both = async () => (await canvas("image")) + (await canvas("field"));
    const on = await both();
    await page.click(`#legend input[data-layer="${name}"]`);
    const off = await both();
    await page.click(`#legend input[data-layer="${name}"]`);
    told.layers[name] = { changes: on !== off, returns: on === await both() };
  }
  await page.keyboard.press("7");
  told.key_switches = !await page.isChecked('#legend input[data-layer="field"]');
  await page.keyboard.press("7");

  told.stage = "zoom and pointer";
  // what lies under the pointer, before and after the middle is enlarged
  const field = card.locator('canvas[data-part="field"]'), where = card.locator('[data-part="field-where"]');
  await field.scrollIntoViewIfNeeded();
  const under = async (fx, fy, canvas = field, text = where) => {
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + fx * box.width, box.y + fy * box.height);
    return (await text.textContent()).replaceAll("−", "-").match(/-?[0-9.]+/g).map(Number);
  };
  told.middle = await under(.5, .5);
  told.right = await under(.75, .5);
  told.pixel = await under(.5, .5, card.locator('canvas[data-part="image"]'), card.locator('[data-part="image-where"]'));
  const small = await canvas("field");
  await card.locator('canvas[data-part="field"] ~ .zoom button').first().click();
  told.zoom_changes = small !== await canvas("field");
  told.zoomed = await under(.75, .5);
  await card.locator('canvas[data-part="field"] ~ .zoom button').last().click();
  told.zoom_returns = small === await canvas("field");
  told.plots = await card.locator(".plots figure").evaluateAll(all => all.map(one => one.textContent));

  told.stage = "put elsewhere";
  // the robot is dragged from where it is to a place of the field, while the match stands still
  const truth = JSON.parse((await at()).truth), [x75] = told.right, [, y25] = await under(.5, .25);
  const place = (x, y) => [.5 + .25 * x / x75, .5 - .25 * y / y25];
  told.asked = [-.3 * Math.sign(truth[0]), .4];
  const stood = await number();
  await under(...place(...truth));
  await page.mouse.down();
  await under(...place(...told.asked));
  await page.mouse.up();
  await beyond(stood);
  await page.waitForTimeout(500);
  told.put = JSON.parse((await at()).truth);

  told.stage = "save";
  // save the frame; light and dark
  await page.keyboard.press("s");
  await page.waitForFunction(() => document.querySelector("#lines").textContent.includes("saved"), null, WAIT);
  told.saved = (await page.textContent("#lines")).match(/saved (\S+)/)[1];
  const theme = () => page.evaluate(() => document.documentElement.dataset.theme);
  const light = await theme();
  await page.keyboard.press("t");
  told.theme_switches = light !== await theme();
  await page.keyboard.press("t");

  told.stage = "go on";
  // and on
  const still = await number();
  await page.keyboard.press("Space");
  await beyond(still + 3);
  // it fits windows of all widths
  await page.keyboard.press("Space");
  await page.waitForFunction(() => document.body.dataset.paused === "true", null, WAIT);
  told.widths = {};
  for (const width of [390, 1920, 1280]) {
    await page.setViewportSize({ width, height: 900 });
    await page.waitForTimeout(700);
    told.widths[width] = await page.evaluate(misplaced);
    await page.screenshot({ path: `${pictures}/live-${width}.png`, fullPage: true });
  }
  told.done = true;
} catch (error) {
  told.errors.push(`${told.stage}: ${error}`);
} finally {
  await browser.close();
}
console.log(JSON.stringify(told));
