// Colours of scalars and endpoints: the hues of the pictures that the server makes.

import { h, svg } from "../parts/dom.js";

/** Of endpoints, as the classes c0 to c9 of the style sheet: dark enough for white numerals. */
export const PALETTE = ["#0072b2", "#c04f00", "#007d5c", "#a8507f", "#8a6608", "#2779ab", "#7b3f9e", "#6b6b6b", "#8c1d40", "#3d5a1f"];

export const endpointColour = (number) => PALETTE[number % PALETTE.length];

/** Five stops of each scale. signed: zero is the pale middle; sequential: dark is little. */
export const SCALES = {
  signed: ["#2a5b9c", "#8fb4dc", "#f4f1ec", "#e5a06b", "#b0501c"],
  sequential: ["#2e1e5b", "#35608d", "#2a9d8f", "#8fd14f", "#f5e34b"],
};

export const SKIN = "#b3c2d6";

const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;

/** Of a skeleton's lines, to be seen on the page's ground. */
export const ink = () => (dark() ? "#e4ebf1" : "#26323d");

/** Of a glass surface where it turns away. */
export const glassEdge = () => (dark() ? "#b9cbe0" : "#64748a");

/** "#rrggbb" as three numbers in [0, 1], as the screen has them. */
export const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);

/** A bar that says which colour is which value. */
export function legend(title, scale, low, high) {
  const stops = SCALES[scale].map((colour, i) => svg("stop", { offset: i / 4, "stop-color": colour }));
  return h("div", { class: "legend" }, h("span", {}, low),
    svg("svg", { viewBox: "0 0 100 8", preserveAspectRatio: "none", role: "img", "aria-label": `${title} from ${low} to ${high}` },
      svg("defs", {}, svg("linearGradient", { id: `scale-${scale}` }, stops)),
      svg("rect", { width: 100, height: 8, rx: 2, fill: `url(#scale-${scale})` })),
    h("span", {}, high));
}
