// The board answers while one types, and what is ticked to compare stays ticked on every page of its split.
"use strict";

const view = () => document.getElementById("view");

// --- search and filters ---------------------------------------------------------------------------------

const isEmpty = ([, value]) => value === "";

// Addresses name only what is set.
document.addEventListener("formdata", (event) => {
  for (const [name] of [...event.formData].filter(isEmpty)) event.formData.delete(name);
});
document.addEventListener("htmx:configRequest", ({ detail }) => {
  for (const [name] of [...detail.formData].filter(isEmpty)) detail.formData.delete(name);
});
document.addEventListener("htmx:afterSettle", () => {
  const address = view()?.dataset.address;
  if (address) history.replaceState(null, "", address);
  for (const fault of document.querySelectorAll(".fault")) {
    document
      .querySelector(`[aria-describedby="${fault.id}"]`)
      ?.setAttribute("aria-invalid", String(fault.textContent !== ""));
  }
});

// --- menus close where one clicks beside them, and with Escape -------------------------------------------

// A menu ends above the tray and the end of the window.
document.addEventListener(
  "toggle",
  ({ target }) => {
    const body = target.open && target.matches("details.menu") && target.querySelector(".menu-body");
    if (!body) return;
    const end = tray && !tray.hidden ? tray.getBoundingClientRect().top : innerHeight;
    body.style.maxHeight = `${Math.max(160, end - body.getBoundingClientRect().top - 8)}px`;
  },
  true,
);
const closeMenus = (except) => {
  for (const menu of document.querySelectorAll("details.menu[open]")) if (menu !== except) menu.open = false;
};
document.addEventListener("click", (event) => closeMenus(event.target.closest("details.menu")));
document.addEventListener("keydown", (event) => {
  const menu = event.key === "Escape" && document.querySelector("details.menu[open]");
  if (!menu) return;
  menu.open = false;
  menu.querySelector("summary").focus();
});

// --- the tray: what is ticked to compare, for this tab and this split ------------------------------------

const tray = document.getElementById("tray");
const MAX_METHODS = Number(tray?.dataset.max);
const KEY = `compare on ${tray?.dataset.split}`;

const chosen = () => {
  try {
    return JSON.parse(sessionStorage.getItem(KEY)) ?? [];
  } catch {
    return [];
  }
};

const choose = (methods) => {
  try {
    sessionStorage.setItem(KEY, JSON.stringify(methods));
  } catch {
    // Without storage the ticks of this page still count.
  }
  show(methods);
};

const address = (methods) => {
  const query = new URLSearchParams([["split", tray.dataset.split], ...methods.map(({ id }) => ["m", id])]);
  return `${tray.dataset.href}?${query}`;
};

const words = (n) => {
  if (n === 0) return `Tick 2 to ${MAX_METHODS} methods.`;
  if (n === 1) return `1 method selected; tick at least one more.`;
  return n === MAX_METHODS
    ? `${n} methods selected, which is the maximum.`
    : `${n} of at most ${MAX_METHODS} methods selected.`;
};

function show(methods, isAsked = false) {
  for (const box of document.querySelectorAll("#compare-form input[name=m]")) {
    box.checked = methods.some(({ id }) => id === box.value);
    box.disabled = !box.checked && methods.length >= MAX_METHODS;
  }
  // The page that asks which methods says so from the beginning.
  tray.hidden = methods.length === 0 && !isAsked && view() !== null;
  tray.querySelector("[role=status]").textContent = words(methods.length);
  tray.querySelector("ul").replaceChildren(
    ...methods.map(({ id, name }) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      Object.assign(button, { type: "button", className: "chip", textContent: name });
      button.setAttribute("aria-label", `Remove ${name} from the comparison`);
      button.addEventListener("click", () => choose(chosen().filter((each) => each.id !== id)));
      item.append(button);
      return item;
    }),
  );
  const link = tray.querySelector("a");
  link.setAttribute("aria-disabled", String(methods.length < 2));
  if (methods.length < 2) link.removeAttribute("href");
  else link.href = address(methods);
  tray.querySelector("[data-clear]").hidden = methods.length === 0;
}

if (tray) {
  const ticked = [...document.querySelectorAll("#compare-form input[name=m]:checked")];
  const before = chosen();
  const added = ticked.filter((box) => !before.some(({ id }) => id === box.value));
  const both = [...before, ...added.map((box) => ({ id: box.value, name: box.dataset.name }))];
  choose(both.slice(0, MAX_METHODS));
  document.addEventListener("change", ({ target: box }) => {
    if (!box.matches?.("#compare-form input[name=m]")) return;
    const others = chosen().filter(({ id }) => id !== box.value);
    choose(box.checked ? [...others, { id: box.value, name: box.dataset.name }] : others);
  });
  document.addEventListener("submit", (event) => {
    if (event.target.id !== "compare-form") return;
    event.preventDefault();
    const methods = chosen();
    if (methods.length >= 2) location.assign(address(methods));
    else show(methods, true);
  });
  tray.querySelector("[data-clear]").addEventListener("click", () => choose([]));
  document.addEventListener("htmx:afterSettle", () => show(chosen()));
  // A page that comes back from the browser's memory shows what was ticked since.
  addEventListener("pageshow", ({ persisted }) => persisted && show(chosen()));
}

// --- copying an export ------------------------------------------------------------------------------------

const offerCopies = () => {
  for (const button of document.querySelectorAll("[data-copy-from]")) button.hidden = !navigator.clipboard;
};
offerCopies();
document.addEventListener("htmx:afterSettle", offerCopies);
document.addEventListener("click", async ({ target }) => {
  const button = target.closest("[data-copy-from]");
  if (!button) return;
  const text = fetch(button.dataset.copyFrom).then((answer) =>
    answer.ok ? answer.text() : Promise.reject(answer.statusText),
  );
  try {
    // Given as a promise, the text may come after the click, which Safari would refuse else.
    const type = "text/plain";
    await navigator.clipboard.write([
      new ClipboardItem({ [type]: text.then((found) => new Blob([found], { type })) }),
    ]);
    button.textContent = "Copied";
  } catch {
    button.textContent = "Not copied";
  }
  setTimeout(() => (button.textContent = "Copy"), 3000);
});
