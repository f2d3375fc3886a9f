"use strict";
mermaid.initialize({
  startOnLoad: true,
  theme: /navy|coal|ayu/.test(document.documentElement.className) ? "dark" : "neutral",
  securityLevel: "strict",
});
