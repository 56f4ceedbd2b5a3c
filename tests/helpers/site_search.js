// What the search of a built site finds: node site_search.js SITE QUERY... prints a JSON line each.
const fs = require("fs");
const path = require("path");
const vm = require("vm");

const [site, ...queries] = process.argv.slice(2);
const nothing = () => {};
const context = {
  document: { addEventListener: nothing, getElementById: () => null },
  window: { addEventListener: nothing },
  localStorage: { setItem: nothing },
  DOCUMENTATION_OPTIONS: {},
  SPHINX_HIGHLIGHT_ENABLED: false,
  Documentation: { ngettext: nothing },
  _: (text) => text,
  _ready: nothing,
  console,
};
vm.createContext(context);
const run = (file) => {
  // `const` at the top of a script is no property of its context
  vm.runInContext(fs.readFileSync(path.join(site, file), "utf8"), context);
};
run("_static/language_data.js");
vm.runInContext("var Stemmer = window.Stemmer", context);
run("_static/searchtools.js");
run("searchindex.js");
context.queries = queries;
const found = vm.runInContext(
  "queries.map((q) => Search._performSearch(...Search._parseQuery(q)).reverse().slice(0, 8))",
  context,
);
for (const results of found) console.log(JSON.stringify(results.map((r) => r[1])));
