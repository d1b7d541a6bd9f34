// Light and dark: the system's choice, or the reader's; on paper light, and as wide as paper.

const listeners = [];
let printing = false;

/** A colour of the style sheet by its name. */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** The colour of curve number i. */
export function curveColour(i) {
  return colour(`curve-${(i % 8) + 1}`);
}

/** Red, green and blue from 0 to 1 of a colour "#rrggbb". */
export function rgb(name) {
  const hex = colour(name).slice(1);
  return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
}

export function onTheme(listener) {
  listeners.push(listener);
}

function tell() {
  for (const listener of listeners) listener();
}

function apply(theme) {
  document.documentElement.dataset.theme = theme;
  tell();
}

function isDark() {
  const set = document.documentElement.dataset.theme;
  return set ? set === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

/** The switch in the page's head. */
export function startTheme(button) {
  button.addEventListener("click", () => apply(isDark() ? "light" : "dark"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", tell);
  let before;
  addEventListener("beforeprint", () => {
    if (printing) return;
    printing = true;
    before = document.documentElement.dataset.theme;
    document.documentElement.classList.add("paper");
    apply("light");
  });
  addEventListener("afterprint", () => {
    printing = false;
    document.documentElement.classList.remove("paper");
    if (before) apply(before);
    else {
      delete document.documentElement.dataset.theme;
      tell();
    }
  });
}
