export async function open(root, capture) { root.textContent = `${capture.object}/${capture.capture}`; }
