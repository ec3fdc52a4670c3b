// The form of a submission: the size of the chosen file, a check of it before it is sent (see check.js), a drop
// zone, and how far the upload is. Without any of this the form works as well; then the server alone checks.
"use strict";

const form = document.getElementById("submit");
const input = form.querySelector("input[type=file]");
const button = form.querySelector(".actions button");
const byId = (id) => document.getElementById(id);
const maxBytes = Number(form.dataset.maxBytes);
const grouped = (n) => n.toLocaleString("en-GB");

function element(tag, text = "", css = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  if (css) made.className = css;
  return made;
}

// --- the check -----------------------------------------------------------------------------------------------

const MAX_SHOWN = 20;
let worker = null;
let asked = 0;
// What is known of the chosen file: "" nothing, "checking", "good", "doubtful", "bad"; `settled` calls whoever waits
// for it.
let verdict = "";
let settled = () => {};

function say(...parts) {
  byId("checked").replaceChildren(...parts);
}

const isDoubted = () => verdict === "bad" || verdict === "doubtful";

function conclude(state, ...parts) {
  verdict = state;
  button.textContent = isDoubted() ? "Submit anyway" : "Submit";
  say(...parts);
  if (state !== "checking") settled();
}

function answered({ data }) {
  if (data.id !== asked) return;
  if (data.failed) conclude("", element("p", "The file could not be checked here. The server checks it.", "quiet"));
  else if (data.n_problems === 0) {
    const found = `${grouped(data.n_found)} of ${grouped(data.n_sequences)} sequences found.`;
    const told = element("p", `Checked: ${found} No problems.`, "good");
    conclude(data.warnings.length ? "doubtful" : "good", told, ...data.warnings.map(warning));
  } else conclude("bad", ...problems(data));
}

function warning({ message, code }) {
  const told = element("p", "", "notice doubtful");
  told.append(element("strong", "Warning."), ` ${message} `, element("span", code, "quiet code"));
  return told;
}

function problems({ n_problems: n, problems: all }) {
  const told = `${grouped(n)} problem${n === 1 ? "" : "s"} in the file. The server would reject it.`;
  const head = element("p", all.length < n ? `${told} Equal problems share a point.` : told, "bad");
  const list = element("ol", "", "problems");
  for (const { where, message, code } of all.slice(0, MAX_SHOWN)) {
    const item = element("li");
    if (where) item.append(element("code", where, "where"), " ");
    item.append(`${message} `, element("span", code, "quiet code"));
    list.append(item);
  }
  return [head, list];
}

function check() {
  asked++;
  const file = input.files[0];
  const split = form.querySelector("input[name=split]:checked");
  if (!file || file.size > maxBytes || !window.Worker) return conclude("");
  if (file.size === 0) {
    const message = "The file is empty; expected JSON text with a number for every sequence.";
    return conclude("bad", ...problems({ n_problems: 1, problems: [{ where: "", message, code: "not-json" }] }));
  }
  if (!split) return conclude("", element("p", "Choose a split: then the file is checked here before it is sent.", "quiet"));
  if (!worker) {
    worker = new Worker(form.dataset.checker);
    worker.addEventListener("message", answered);
    worker.addEventListener("error", () => answered({ data: { id: asked, failed: true } }));
  }
  conclude("checking", element("p", "Checking the file…", "quiet"));
  worker.postMessage({ id: asked, manifest: split.dataset.manifest, file });
}

function judge() {
  const file = input.files[0];
  input.setCustomValidity("");
  byId("chosen").textContent = "";
  if (file) {
    const found = grouped(file.size);
    if (file.size > maxBytes) {
      input.setCustomValidity(
        `The file has ${found} bytes; expected at most ${grouped(maxBytes)} (${maxBytes / 1e6} MB).`,
      );
      input.reportValidity();
    }
    byId("chosen").textContent = `${found} bytes`;
  }
  check();
}

input.addEventListener("change", judge);
for (const split of form.querySelectorAll("input[name=split]")) split.addEventListener("change", check);
judge();

// --- who sees the result: of a method that others see, its own sentence alone; of a new one none -----------------

const method = form.querySelector("input[name=method]");
const notices = byId("notices");
const allNotices = [...notices.children];

method.addEventListener("input", () => {
  const found = [...document.querySelectorAll("#methods option")].find((option) => option.value === method.value.trim());
  const told = found?.dataset.notice ? [element("p", found.dataset.notice)] : [];
  notices.replaceChildren(...(method.value.trim() ? told : allNotices));
});

// --- a file that is dropped: beside the form a browser would open it, and what was written would be gone ---------

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

// --- sending ---------------------------------------------------------------------------------------------------

let isBusy = false;
let hasSessionEnded = false;

function busy(is) {
  isBusy = is;
  button.setAttribute("aria-disabled", String(is));
}

function progress(words, share) {
  byId("sending").hidden = !words;
  byId("sending-words").textContent = words;
  const bar = byId("sending").querySelector("progress");
  if (share === null) bar.removeAttribute("value");
  else bar.value = share;
}

function send() {
  const request = new XMLHttpRequest();
  request.open("POST", location.href);
  request.setRequestHeader("Accept", "application/json, text/html");
  request.upload.addEventListener("progress", ({ loaded, total }) => {
    const percent = Math.round((100 * loaded) / total);
    progress(loaded < total ? `Sending: ${percent} %` : "Sent. The server saves the file…", loaded < total ? loaded / total : null);
  });
  request.addEventListener("load", () => received(request));
  request.addEventListener("error", () => lost());
  progress("Sending…", 0);
  request.send(new FormData(form));
}

function received(request) {
  if (request.status === 201) {
    location.assign(JSON.parse(request.responseText).page);
    return;
  }
  progress("", 0);
  busy(false);
  const answer = new DOMParser().parseFromString(request.responseText, "text/html");
  if (answer.getElementById("submit")) correct(answer);
  else if (request.status === 403 || new URL(request.responseURL).pathname !== location.pathname) sessionEnded();
  else replace(answer);
}

// The sentences of a refusal go to their fields; all that was filled in stays, the chosen file as well.
function correct(answer) {
  byId("form-errors").replaceChildren(...answer.getElementById("form-errors").childNodes);
  let first = null;
  for (const place of form.querySelectorAll(".errors[id]")) {
    const told = answer.getElementById(place.id);
    place.replaceChildren(...(told?.childNodes ?? []));
    const isWrong = place.textContent.trim() !== "";
    const field = place.closest(".field, fieldset");
    field.classList.toggle("wrong", isWrong);
    const entry = field.querySelector("input, textarea, select");
    if (isWrong) entry.setAttribute("aria-invalid", "true");
    else entry.removeAttribute("aria-invalid");
    if (isWrong) field.closest("details")?.setAttribute("open", "");
    if (isWrong) first ??= entry;
  }
  (first ?? button).focus();
}

// What was filled in stays here. After signing in elsewhere the form needs a token of the new session.
function sessionEnded() {
  hasSessionEnded = true;
  const link = element("a", "Sign in (new tab)");
  link.href = `/accounts/login/?next=${encodeURIComponent(location.pathname)}`;
  link.target = "_blank";
  const words = element("p", "Your session has ended, and the file was not sent. ");
  words.append(link, ", then press Submit again here: everything that you filled in is kept.");
  complain(words);
  link.focus();
}

async function renewToken() {
  const answer = new DOMParser().parseFromString(await (await fetch(location.pathname)).text(), "text/html");
  const fresh = answer.querySelector("#submit input[name=csrfmiddlewaretoken]");
  if (!fresh) return false;
  form.querySelector("input[name=csrfmiddlewaretoken]").value = fresh.value;
  hasSessionEnded = false;
  byId("form-errors").replaceChildren();
  return true;
}

// Any other answer is a page of its own.
function replace(answer) {
  const main = answer.querySelector("main");
  if (!main) return lost();
  document.title = answer.title;
  document.querySelector("main").replaceWith(main);
  main.focus();
}

function lost() {
  busy(false);
  progress("", 0);
  complain(element("p", "The connection was lost. You can submit the same file again safely: it counts once."));
}

function complain(words) {
  const alert = element("div", "", "form-errors");
  alert.setAttribute("role", "alert");
  alert.append(words);
  byId("form-errors").replaceChildren(alert);
}

// A file is sent once its check has ended; one with problems or warnings only if that is asked for once they are in
// sight.
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  if (isBusy) return;
  busy(true);
  if (verdict === "checking") {
    await new Promise((resolve) => (settled = resolve));
    if (isDoubted()) {
      busy(false);
      button.focus();
      return;
    }
  }
  if (!hasSessionEnded || (await renewToken().catch(() => false))) return send();
  busy(false);
  sessionEnded();
});
window.addEventListener("pageshow", () => {
  busy(false);
  progress("", 0);
});
