(() => {
  const said = (words, bad) => {
    const place = document.getElementById("uploads");
    if (!place) return;
    const line = document.createElement("p");
    line.textContent = words;
    if (bad) { line.className = "refusal"; line.setAttribute("role", "alert"); }
    place.append(line);
    return line;
  };
  const send = async files => {
    for (const file of files) {
      const line = said(`${file.name}: is being read`);
      try {
        const done = await fetch(`/upload?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
        const { taken, refused } = await done.json();
        line?.remove();
        said(taken ?? refused, refused !== undefined);
      } catch {
        line?.remove();
        said(`${file.name}: could not be sent; is the workbench still running, and the file at most 1 GB?`, true);
      }
    }
  };
  document.addEventListener("change", event => {
    if (event.target.id === "recordings") { send([...event.target.files]); event.target.value = ""; }
  });
  const zone = event => event.target.closest?.(".drop");
  for (const name of ["dragover", "dragleave", "drop"])
    document.addEventListener(name, event => {
      const place = zone(event);
      if (!place || ![...event.dataTransfer.types].includes("Files")) return;
      event.preventDefault();
      place.classList.toggle("over", name === "dragover");
      if (name === "drop") send([...event.dataTransfer.files]);
    });
})();
