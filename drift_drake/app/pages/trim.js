document.addEventListener("pointerdown", event => {
  const handle = event.target.closest?.(".timeline .handle");
  if (!handle) return;
  event.preventDefault();
  handle.setPointerCapture(event.pointerId);
  const line = handle.parentElement, box = line.getBoundingClientRect();
  const share = e => Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
  handle.onpointermove = e => { handle.style.left = `${100 * share(e)}%`; };
  handle.onpointerup = e => {
    handle.onpointermove = handle.onpointerup = null;
    const at = Number(line.dataset.start) + share(e) * Number(line.dataset.length);
    line.dispatchEvent(new CustomEvent("trim", { bubbles: true, detail: { key: handle.dataset.key, at } }));
  };
});
