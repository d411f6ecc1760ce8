"use strict";
// Draws each chart from its specification.

for (const place of document.querySelectorAll(".chart")) {
  const spec = JSON.parse(place.querySelector("script").textContent);
  const drawn = place.appendChild(document.createElement("div"));
  vegaEmbed(drawn, spec, { actions: false }).then(() => (place.dataset.ready = "true"));
}
