// What scripts of others leave in pages.

interface Window {
  d3: typeof import("d3");
  Plot: typeof import("@observablehq/plot");
}

declare const wasm_bindgen: any;
