// Unpacks the modules of this page and starts them: nothing is loaded from elsewhere.
(async () => {
  const message = document.getElementById("message");
  try {
    if (!("DecompressionStream" in window) || !HTMLScriptElement.supports?.("importmap")) {
      throw new Error("this browser is too old: Chrome 89+, Firefox 113+ or Safari 16.4+ is needed");
    }
    message.textContent = "Loading the episode ...";
    const imports = {};
    for (const element of document.querySelectorAll("script[data-module]")) {
      const bytes = Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0));
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
      const code = await new Response(stream).text();
      const file = new Blob([code], { type: "text/javascript" });
      imports[element.dataset.module] = URL.createObjectURL(file);
    }
    const map = document.createElement("script");
    map.type = "importmap";
    map.textContent = JSON.stringify({ imports });
    document.head.append(map);
    const { start } = await import("main");
    await start();
    message.remove();
  } catch (error) {
    document.getElementById("app").hidden = true;
    message.textContent = `The episode cannot be shown: ${error.message}.`;
    message.classList.add("failed");
    console.error(error);
  }
})();
