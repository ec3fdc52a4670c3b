// Says how large the chosen file is, stops one over the limit before it is sent in vain, and takes a file that
// is dropped anywhere on the form.
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

// Of a method that others see, its own sentence alone; of a new one none.
const method = form.querySelector("input[name=method]");
const notices = document.getElementById("notices");
const allNotices = [...notices.children];

method.addEventListener("input", () => {
  const found = [...document.querySelectorAll("#methods option")].find((option) => option.value === method.value.trim());
  const told = document.createElement("p");
  told.textContent = found?.dataset.notice ?? "";
  notices.replaceChildren(...(method.value.trim() ? [told] : allNotices));
});

// Beside the field a browser would open the file, and what was written on the page would be gone.
const hasFile = (event) => event.dataTransfer.types.includes("Files");
const mark = (isOver) => form.classList.toggle("dropping", isOver);

document.addEventListener("dragover", (event) => {
  if (!hasFile(event)) return;
  event.preventDefault();
  mark(form.contains(event.target));
});
document.addEventListener("dragleave", (event) => {
  if (!event.relatedTarget) mark(false);
});
document.addEventListener("drop", (event) => {
  if (!hasFile(event)) return;
  event.preventDefault();
  mark(false);
  if (!form.contains(event.target)) return;
  const taken = new DataTransfer();
  taken.items.add(event.dataTransfer.files[0]);
  input.files = taken.files;
  input.dispatchEvent(new Event("change"));
});

// A second press while the file is on its way would only send it twice.
form.addEventListener("submit", () => {
  form.querySelector(".actions button").setAttribute("aria-disabled", "true");
  form.addEventListener("submit", (event) => event.preventDefault());
});
window.addEventListener("pageshow", () => form.querySelector(".actions button").removeAttribute("aria-disabled"));
