// What can be shown and hidden; the first ten have keys. Markings are found only while they are wanted: that takes long.
const LAYERS = [
  ["edge", "floor's edge", "#ff3b3b", "image"], ["lines", "points on lines", "#3ca0ff", "image"], ["goals", "goals at the pose", "#ffe14d", "image"],
  ["free", "free floor", "#62e06a", "both"], ["obstacles", "obstacles", "#ffa000", "both"], ["ball", "ball", "#ff3df2", "both"],
  ["field", "field at the pose", "#00e5ff", "image"], ["tracks", "tracked robots", "#ffcf33", "field"], ["map", "map of the floor", "#d9303c", "field"],
  ["truth", "truth", "#ffffff", "both"], ["found", "edges found", "#3ce63c", "image"], ["hidden", "edges hidden", "#969696", "image"],
  ["missing", "edges missing", "#ffdc00", "image"], ["candidates", "other candidates", "#7fefff", "field"], ["trail", "trail of the pose", "#b7f7ff", "field"],
  ["markings", "markings as measured", "#a05aff", "image", false]];
const WHERE = {image: "in the image", field: "on the field", both: "in the image and on the field"};
export const COLOR = Object.fromEntries(LAYERS.map(([name, , color]) => [name, color]));
export const shown = Object.fromEntries(LAYERS.map(([name, , , , from_start = true]) => [name, from_start]));

export function makeLegend(legend, make, changed) {
  LAYERS.forEach(([name, label, color, where], index) => {
    const line = make("label"), box = make("input"), dot = make("i");
    box.type = "checkbox";
    box.checked = shown[name];
    box.dataset.layer = name;
    box.onchange = () => { shown[name] = box.checked; changed(name); };
    dot.style.background = color;
    line.append(box, dot, make("span", label));
    if (index < 10) line.append(make("kbd", String((index + 1) % 10)));
    line.title = WHERE[where];
    legend.append(line);
  });
}
