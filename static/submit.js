// Says how large the chosen file is, and stops one over the limit before it is sent in vain.
"use strict";

const form = document.querySelector("form[data-max-bytes]");
const input = form.querySelector("input[type=file]");
const chosen = document.getElementById("chosen");
const maxBytes = Number(form.dataset.maxBytes);

function judge() {
  const file = input.files[0];
  input.setCustomValidity("");
  chosen.textContent = "";
  if (!file) return;
  const found = file.size.toLocaleString("en-GB");
  if (file.size > maxBytes) {
    input.setCustomValidity(
      `The file has ${found} bytes; expected at most ${maxBytes.toLocaleString("en-GB")} (${maxBytes / 1e6} MB).`,
    );
    input.reportValidity();
  }
  chosen.textContent = `${found} bytes`;
}

input.addEventListener("change", judge);
judge();

// A second press while the file is on its way would only send it twice.
form.addEventListener("submit", () => {
  form.querySelector(".actions button").setAttribute("aria-disabled", "true");
  form.addEventListener("submit", (event) => event.preventDefault());
});
window.addEventListener("pageshow", () => form.querySelector(".actions button").removeAttribute("aria-disabled"));
