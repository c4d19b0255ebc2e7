// The catalogue view (filled in below).
export async function open(root) { root.textContent = "Catalogue"; }
