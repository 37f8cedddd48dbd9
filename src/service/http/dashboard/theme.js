// The colours that were chosen last, before anything is painted. Without a choice the system's apply.
(() => {
  let chosen = null;
  try {
    chosen = localStorage.getItem("gridfall-theme");
  } catch {
    // No storage: the choice lasts as long as the page.
  }
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
})();
