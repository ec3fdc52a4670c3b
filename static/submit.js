// The form of a submission: a quick check of the chosen file before it is sent, a drop zone, and how far the upload
// is. Without any of this the form works as well; then the server alone checks.
"use strict";

const form = document.getElementById("submit");
const input = form.querySelector("input[type=file]");
const button = form.querySelector(".actions button");
const byId = (id) => document.getElementById(id);
const maxBytes = Number(form.dataset.maxBytes);
const grouped = (n) => n.toLocaleString("en-GB");
const fileSize = (n) => {
  const kilobytes = Math.ceil(n / 1000);
  if (n < 1000) return counted(n, "byte");
  return kilobytes % 1000 ? `${grouped(kilobytes)} kB` : `${grouped(kilobytes / 1000)} MB`;
};
const counted = (n, noun) => `${grouped(n)} ${noun}${n === 1 ? "" : "s"}`;

function element(tag, text = "", css = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  if (css) made.className = css;
  return made;
}

// --- the check: what can be seen here at once; the server names every problem -----------------------------------

const ENVELOPE = ["unit", "fps", "frame_gap", "meta", "predictions"];
const leftToTheServer = (kind) => ["", `The server checks ${kind} once it is sent.`];
let nChecks = 0;
// What is known of the chosen file: "" nothing, "checking", "good", "bad" or "too large"; `settled` calls whoever
// waits for it.
let verdict = "";
let settled = () => {};

function conclude(state, sentence = "") {
  verdict = state;
  button.textContent = state === "bad" ? "Submit anyway" : "Submit";
  const css = { good: "good", bad: "bad", "too large": "bad" }[state] ?? "quiet";
  byId("checked").replaceChildren(...(sentence ? [element("p", sentence, css)] : []));
  if (state !== "checking") settled();
}

async function check() {
  const number = ++nChecks;
  const file = input.files[0];
  input.setCustomValidity("");
  byId("chosen").textContent = file ? fileSize(file.size) : "";
  if (!file) return conclude("");
  if (file.size > maxBytes) {
    const sentence = `The file is ${fileSize(file.size)}; expected at most ${fileSize(maxBytes)}. gzip makes a prediction file much smaller: send FILE.json.gz.`;
    input.setCustomValidity(sentence);
    return conclude("too large", sentence);
  }
  conclude("checking", "Checking the file…");
  const found = await verdictOn(file).catch(() => leftToTheServer("this file"));
  if (number === nChecks) conclude(...found);
}

async function verdictOn(file) {
  const text = await file.text();
  if (text.startsWith("\x1f\ufffd")) return leftToTheServer("a gzip file");
  if (/^\s*"?\w+"?\s*,/.test(text)) return leftToTheServer("a CSV file");
  if (!text.trim()) return bad("The file is empty; expected JSON text with a number for every sequence.");
  let value;
  try {
    value = JSON.parse(text);
  } catch (fault) {
    // Python writes these; the server says of each where it stands.
    if (/\b(NaN|Infinity)\b/.test(text)) return leftToTheServer("this file");
    const at = /line (\d+),? column (\d+)/.exec(fault.message);
    return bad(at ? `The text is not JSON: line ${at[1]}, column ${at[2]}.` : "The text is not JSON.");
  }
  return verdictOnValue(value);
}

function verdictOnValue(value) {
  const isObject = (each) => each !== null && typeof each === "object" && !Array.isArray(each);
  const isEnvelope = isObject(value) && ENVELOPE.some((name) => Object.hasOwn(value, name));
  const predictions = isEnvelope ? value.predictions : value;
  const values = isObject(predictions) ? Object.values(predictions) : [];
  const n = counted(values.length, "prediction");
  if (values.length && values.every((each) => each === null)) {
    return bad(
      `This is the empty template: all ${grouped(values.length)} values are null; expected a number for every sequence.`,
    );
  }
  const split = form.querySelector("input[name=split]:checked");
  const expected = Number(split?.dataset.nSequences ?? 0);
  if (expected && values.length !== expected) {
    return bad(
      `The file has ${n}; ${split.dataset.title} expects ${grouped(expected)}, one for each sequence.`,
    );
  }
  return [
    "good",
    `${n}${expected ? ", one for each sequence" : ""}. The server checks them once the file is sent.`,
  ];
}

const bad = (sentence) => ["bad", `${sentence} The server would reject the file.`];

input.addEventListener("change", check);
for (const split of form.querySelectorAll("input[name=split]")) split.addEventListener("change", check);
check();

// --- who sees the result: of a method that others see, its own sentence alone; of a new one none -----------------

const method = form.querySelector("input[name=method]");
const notices = byId("notices");

method.addEventListener("input", () => {
  const found = [...document.querySelectorAll("#methods option")].find(
    (option) => option.value === method.value.trim(),
  );
  const told = found?.dataset.notice ? [element("p", found.dataset.notice)] : [];
  notices.replaceChildren(...told);
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
    progress(
      loaded < total ? `Sending: ${percent}%` : "Sent. The server saves the file…",
      loaded < total ? loaded / total : null,
    );
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
  else if (request.status === 403 || new URL(request.responseURL).pathname !== location.pathname)
    sessionEnded();
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
  (byId("form-errors").querySelector("input") ?? first ?? button).focus();
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
  complain(
    element("p", "The connection was lost. You can submit the same file again safely: it counts once."),
  );
}

function complain(words) {
  const alert = element("div", "", "form-errors");
  alert.setAttribute("role", "alert");
  alert.append(words);
  byId("form-errors").replaceChildren(alert);
}

// A file is sent once its check has ended; a bad one only if that is asked for once the reason is in sight.
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  if (isBusy) return;
  busy(true);
  if (verdict === "checking") {
    await new Promise((resolve) => (settled = resolve));
    if (verdict === "bad") {
      busy(false);
      byId("checked").focus();
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
