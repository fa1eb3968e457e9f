// How the page's scripts are checked: npm install, then npm run lint.
import js from "@eslint/js";

const browser = ["document", "window", "matchMedia", "innerHeight", "innerWidth", "scrollY", "devicePixelRatio",
  "requestAnimationFrame", "addEventListener", "getComputedStyle", "atob", "EventSource", "Option", "performance"];

export default [
  { ignores: ["**/.venv/**", "**/build/**", "**/install/**"] },
  js.configs.recommended,
  {
    files: ["src/**/view/web/page.js"],
    languageOptions: {
      sourceType: "script",
      globals: Object.fromEntries([...browser, "decode", "framesOf", "whenAskedFor", "cycleNumber", "ranked",
        "movingMean", "chartTop"].map((name) => [name, "readonly"])),
    },
    rules: {
      "no-var": "error", "prefer-const": "error", eqeqeq: "error", 
      "consistent-return": "error",
    },
  },
  {
    files: ["src/**/view/web/pure.js"],
    languageOptions: { sourceType: "script", globals: { atob: "readonly" } },
    rules: { "no-var": "error", "prefer-const": "error", eqeqeq: "error", "no-unused-vars": "off" },
  },
  {
    files: ["**/*.mjs", "src/**/examples/**/*.js"],
    languageOptions: {
      globals: Object.fromEntries(["require", "process", "console", "TextDecoder", "Buffer", "setTimeout", "setInterval"]
        .map((name) => [name, "readonly"])),
    },
  },
];
