// Runs in a page that a test has opened.
// boxes that overlap without one holding the other, and boxes that reach beyond the window
export function misplaced() {
  const TOLERANCE_PX = 1.5;
  const boxes = [], onPurpose = element => element.closest("[data-upon]") !== null;
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
    // what is placed upon something else lies there on purpose
    if (display !== "inline" && element.tagName !== "OPTION" && !onPurpose(element)) add(element, element.getBoundingClientRect(), "");
  }
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const node = texts.currentNode, words = node.textContent.trim();
    if (!words || onPurpose(node.parentElement) || ["SCRIPT", "OPTION"].includes(node.parentElement.tagName)) continue;
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
