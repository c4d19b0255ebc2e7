// Parts of others, each imported here only; see vendor/versions.json.

import "./vendor/konva-10.9.1/konva.min.js";

export const Konva = globalThis.Konva;
