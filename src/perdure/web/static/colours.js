// A colour for every id, the same as in the films (src/perdure/draw/colours.py): hues turn by the golden angle.

const ANGLE = Math.PI * (3 - Math.sqrt(5));
const LIGHTNESS = [0.74, 0.84, 0.66];
const known = new Map();

export function colourOf(id) {
  let found = known.get(id);
  if (!found) known.set(id, (found = computed(id)));
  return found;
}

export const css = ([red, green, blue], alpha = 1) => `rgb(${red} ${green} ${blue} / ${alpha})`;
export const dimmer = (colour) => colour.map((value) => Math.trunc(0.6 * value + 62));
export const readableOn = ([red, green, blue]) =>
  0.299 * red + 0.587 * green + 0.114 * blue > 110 ? "rgb(22 24 30)" : "rgb(240 242 246)";

function computed(id) {
  const hue = id * ANGLE, lightness = LIGHTNESS[id % 3];
  for (let chroma = 0.17; ; chroma -= 0.01) {
    const linear = linearRgb(lightness, chroma * Math.cos(hue), chroma * Math.sin(hue));
    if (chroma < 0.02 || (Math.min(...linear) >= 0 && Math.max(...linear) <= 1)) return linear.map(gamma);
  }
}

// OKLab to linear sRGB (Ottosson 2020).
function linearRgb(lightness, a, b) {
  const long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const short = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short,
    -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short,
    -0.0041960863 * long - 0.7034186147 * medium + 1.707614701 * short,
  ];
}

function gamma(value) {
  const held = Math.min(Math.max(value, 0), 1);
  return Math.round(255 * (held <= 0.0031308 ? 12.92 * held : 1.055 * held ** (1 / 2.4) - 0.055));
}
