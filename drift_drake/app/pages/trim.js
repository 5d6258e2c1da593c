// Ends of a timeline are dragged; stretches of it are chosen by dragging, a whole run, or none of it, by a click.
document.addEventListener("pointerdown", event => {
  const handle = event.target.closest?.(".timeline .handle"), line = event.target.closest?.(".timeline");
  const run = handle ? undefined : line?.dataset.run;
  if (!handle && run === undefined) return;
  event.preventDefault();
  const box = line.getBoundingClientRect(), host = line.closest(".trims");  // stays when what is in it is drawn anew
  const share = e => Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
  const second = part => Number(line.dataset.start) + part * Number(line.dataset.length);
  const from = share(event), chosen = handle ? null : line.appendChild(document.createElement("u"));
  const ends = e => [Math.min(from, share(e)), Math.max(from, share(e))];
  const move = e => {
    if (handle) handle.style.left = `${100 * share(e)}%`;
    else Object.assign(chosen.style, { left: `${100 * ends(e)[0]}%`, width: `${100 * (ends(e)[1] - ends(e)[0])}%` });
  };
  const done = e => {
    removeEventListener("pointermove", move);
    removeEventListener("pointerup", done);
    removeEventListener("pointercancel", done);
    chosen?.remove();
    if (e.type === "pointercancel") return;
    const [start, end] = ends(e), dragged = Math.abs(e.clientX - event.clientX) > 4;
    const detail = handle ? { key: handle.dataset.key, at: second(share(e)) }
      : { run, start: dragged ? second(start) : null, end: second(end) };
    host.dispatchEvent(new CustomEvent(handle ? "trim" : "keep", { detail }));
  };
  addEventListener("pointermove", move);
  addEventListener("pointerup", done);
  addEventListener("pointercancel", done);
});
