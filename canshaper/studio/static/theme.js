// The theme that was chosen last on any of the pages, else that of the system.
export const chosenTheme = () =>
  localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");

/** How much larger than on a desk the page is written. */
export const large = () => parseFloat(getComputedStyle(document.body).fontSize) / 13;
