// The two vendored libraries, which stand in the page as scripts of their own before this one.

export const d3 = window.d3;
export const Plot = window.Plot;
