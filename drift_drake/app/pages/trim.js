(() => {
  document.addEventListener("pointerdown", event => {
    const handle = event.target.closest?.(".timeline .handle");
    if (!handle) return;
    event.preventDefault();
    const line = handle.parentElement, box = line.getBoundingClientRect();
    const share = e => Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
    const move = e => { handle.style.left = `${100 * share(e)}%`; };
    const drop = e => {
      removeEventListener("pointermove", move);
      const at = Number(line.dataset.start) + share(e) * Number(line.dataset.length);
      line.dispatchEvent(new CustomEvent("trim", { bubbles: true, detail: { key: handle.dataset.key, at } }));
    };
    addEventListener("pointermove", move);
    addEventListener("pointerup", drop, { once: true });
  });
})();
