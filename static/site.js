// Copy buttons, messages that can be put away, and passwords that can be looked at. Without this every text can
// be selected, and messages stand at the top of the page.
"use strict";

const SHOWN_MS = 2_000;
const TOAST_MS = 10_000;

async function copied(source) {
  const range = document.createRange();
  range.selectNodeContents(source);
  try {
    await navigator.clipboard.writeText(source.textContent.trim());
    return true;
  } catch {
    // Without TLS there is no clipboard to write to: the text is selected, and copied where browsers still do it.
    const selection = getSelection();
    selection.removeAllRanges();
    selection.addRange(range);
    return document.execCommand("copy");
  }
}

document.addEventListener("click", async ({ target }) => {
  const button = target.closest("button.copy");
  if (!button) return;
  const label = button.firstChild;
  const source = document.getElementById(button.dataset.copy) ?? button.parentElement.querySelector("code");
  label.data = (await copied(source)) ? "Copied" : "Selected";
  setTimeout(() => (label.data = "Copy"), SHOWN_MS);
});

// The documentation has many examples: each gets its button, in room that the stylesheet keeps. Outputs get none.
for (const example of document.querySelectorAll(
  ".docs pre:has(code:not(.language-console, .language-text))",
)) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "copy";
  button.setAttribute("aria-live", "polite");
  button.innerHTML = 'Copy<span class="spoken"> the example</span>';
  example.append(button);
}
// Code that scrolls is reached by the keyboard.
const reached = new ResizeObserver((entries) => {
  for (const { target } of entries)
    target.scrollWidth > target.clientWidth ? (target.tabIndex = 0) : target.removeAttribute("tabindex");
});
for (const code of document.querySelectorAll(".docs pre > code")) reached.observe(code);

for (const message of document.querySelectorAll(".messages .message")) {
  const close = document.createElement("button");
  close.type = "button";
  close.className = "close";
  close.textContent = "×";
  close.setAttribute("aria-label", "Close");
  close.addEventListener("click", () => message.remove());
  message.append(close);
  const isInUse = () => message.matches(":hover, :focus-within");
  const fade = () => (isInUse() ? setTimeout(fade, TOAST_MS) : message.remove());
  if (!message.classList.contains("error")) setTimeout(fade, TOAST_MS);
}

for (const box of document.querySelectorAll("input.show-password")) {
  box.addEventListener("change", () => {
    for (const field of box.form.querySelectorAll("input[name*=password]"))
      field.type = box.checked ? "text" : "password";
  });
}
