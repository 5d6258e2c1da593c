document.addEventListener("pointerdown", event => {
  const handle = event.target.closest?.(".timeline .handle");
  if (!handle) return;
  event.preventDefault();
  const line = handle.parentElement, box = line.getBoundingClientRect();
  const host = line.closest(".trims");  // stays when what is in it is drawn anew
  const share = e => Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
  const move = e => { handle.style.left = `${100 * share(e)}%`; };
  addEventListener("pointermove", move);
  addEventListener("pointerup", e => {
    removeEventListener("pointermove", move);
    const at = Number(line.dataset.start) + share(e) * Number(line.dataset.length);
    host.dispatchEvent(new CustomEvent("trim", { detail: { key: handle.dataset.key, at } }));
  }, { once: true });
});
