// Opens the live page of a match, does what a user does, and prints as JSON what it saw: node live_page.mjs ADDRESS PICTURE
import { launch } from "./launch.mjs";

const [address, picture] = process.argv.slice(2);
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
  await page.waitForFunction(() => status.paused, null, WAIT);
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
  await page.waitForFunction(before => status.back_s > 1 && Number(document.querySelector("article.card").dataset.number) < before - 20, before, WAIT);
  told.state = await page.textContent("#state");
  await page.keyboard.press("n");
  await page.waitForFunction(() => !status.paused && !status.stands_still, null, WAIT);
  await page.keyboard.press("Space");
  await page.waitForFunction(() => status.paused, null, WAIT);
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
  await page.screenshot({ path: picture });
  told.done = true;
} catch (error) {
  told.errors.push(`${told.stage}: ${error}`);
} finally {
  await browser.close();
}
console.log(JSON.stringify(told));
