// A chart that has the focus is zoomed and moved by keys, as by dragging.
{
  const asked = new WeakMap();  // axes' ranges as the last key left them: a slower answer to the key before counts less
  document.addEventListener("keydown", event => {
    const chart = event.target, layout = chart._fullLayout;
    if (!chart.matches?.(".chart") || !layout || event.ctrlKey || event.altKey || event.metaKey) return;
    const zoom = { "+": 0.5, "=": 0.5, "-": 2 }[event.key], whole = ["0", "Home"].includes(event.key);
    const [way, step] = { ArrowLeft: ["x", -1], ArrowRight: ["x", 1], ArrowDown: ["y", -1], ArrowUp: ["y", 1] }[event.key] ?? [];
    const both = layout.hovermode === "closest", change = {};  // else lines over time: their height stays
    const last = asked.get(chart), ranges = last && performance.now() - last.at < 2000 ? last.ranges : {};
    for (const name of Object.keys(layout).filter(one => /^[xy]axis\d*$/.test(one))) {
      const axis = layout[name], [a, b] = (ranges[name] ?? axis.range).map(Number), kind = name[0];
      if (whole && axis._rangeInitial0 !== undefined && kind === "y")
        Object.assign(change, { [`${name}.range[0]`]: axis._rangeInitial0, [`${name}.range[1]`]: axis._rangeInitial1 });
      else if (whole) change[`${name}.autorange`] = true;
      else if ((zoom || kind === way) && (kind === "x" || both)) {
        const middle = (a + b) / 2 + (step ?? 0) * (b - a) / 4, half = (b - a) / 2 * (zoom ?? 1);
        ranges[name] = [middle - half, middle + half];
        Object.assign(change, { [`${name}.range[0]`]: middle - half, [`${name}.range[1]`]: middle + half });
      }
    }
    if (!Object.keys(change).length) return;
    event.preventDefault();
    whole ? asked.delete(chart) : asked.set(chart, { at: performance.now(), ranges });
    Plotly.relayout(chart, change);
  });
}
