// The check of a prediction file in a worker: the rules, codes and words of evaluator/predictions, which decide.
// Asked with {manifest, file}, it answers {n_problems, problems, warnings, n_found, n_sequences}, or {failed} if it
// cannot.
"use strict";

const MAX_LISTED = 20;
const MAX_DEPTH = 32;
const MAX_META_BYTES = 64 * 1024;
const FIELDS = ["unit", "fps", "frame_gap", "meta", "predictions"];
const EMPTY = "The file is empty; expected JSON text with a number for every sequence.";
const ZERO = "The value is 0; expected a time to contact other than 0, negative when moving away.";
const KINDS = [
  [[0xff, 0xfe], "UTF-16"],
  [[0xfe, 0xff], "UTF-16"],
  [[0x89, 0x50, 0x4e, 0x47], "a PNG image"],
  [[0xff, 0xd8, 0xff], "a JPEG image"],
  [[0x25, 0x50, 0x44, 0x46], "a PDF document"],
  [[0x50, 0x4b, 0x03, 0x04], "a ZIP archive or a NumPy .npz file; send the JSON file itself"],
  [[0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59], "a NumPy .npy file"],
  [[0x89, 0x48, 0x44, 0x46], "an HDF5 file"],
  [[0x50, 0x41, 0x52, 0x31], "a Parquet table; tsttc submit sends one, and tsttc convert makes JSON of it"],
  [[0x80], "a Python pickle"],
];

// --- words -------------------------------------------------------------------------------------------------

const grouped = (n) => n.toLocaleString("en-US");
const counted = (n, one, many) => `${grouped(n)} ${n === 1 ? one : many}`;
const first = (text, n) => (text.length <= n ? text : Array.from(text.slice(0, 2 * n)).slice(0, n).join(""));
const escaped = (text) =>
  JSON.stringify(text).replace(/[\u007f-\uffff]/g, (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`);

function quoted(text) {
  const shown = first(text, 60);
  return shown === text ? escaped(text) : `${escaped(shown).slice(0, -1)}…"`;
}

const pointer = (...parts) =>
  parts
    .map((part) => `/${escaped(first(part, 200).replaceAll("~", "~0").replaceAll("/", "~1")).slice(1, -1)}`)
    .join("");

function listed(names) {
  const text = names.slice(0, MAX_LISTED).join(", ");
  return names.length <= MAX_LISTED ? text : `${text}, … (the first ${MAX_LISTED})`;
}

function kindOf(value) {
  if (value === null) return "null";
  if (typeof value === "boolean") return `the boolean ${value}`;
  if (typeof value === "string") return `the string ${quoted(value)}`;
  if (value instanceof Num) return `the number ${value.words()}`;
  return value instanceof Members ? "an object" : "a list";
}

class Rejected extends Error {
  constructor(problems, nProblems) {
    super("rejected");
    this.problems = problems;
    this.nProblems = nProblems ?? problems.length;
  }
}

const reject = (code, message, where = "") => new Rejected([{ code, message, where }]);

// Equal problems share a line, which names the places of the others.
class Findings {
  lines = [];
  lineOf = new Map();
  kinds = new Map();
  nGrouped = 0;

  add(code, message, where = "") {
    if (!this.kinds.has(code)) this.kinds.set(code, { n: 0, nLines: 0, nUnlisted: 0 });
    const kind = this.kinds.get(code);
    const key = `${code} ${message}`;
    const line = where ? this.lineOf.get(key) : undefined;
    kind.n++;
    if (line) {
      line.nMore++;
      if (line.more.length <= MAX_LISTED) line.more.push(where);
    } else if (kind.nLines < MAX_LISTED) {
      kind.nLines++;
      this.lineOf.set(key, this.#line(code, message, where));
    } else kind.nUnlisted++;
  }

  group(code, message, where, nFaults) {
    this.#line(code, message, where);
    this.nGrouped += nFaults;
  }

  #line(code, message, where) {
    const line = { code, message, where, nMore: 0, more: [] };
    this.lines.push(line);
    return line;
  }

  throwIfAny() {
    if (!this.lines.length) return;
    const told = this.lines.map(({ code, message, where, nMore, more }) => {
      if (!nMore) return { code, message, where };
      const others = counted(nMore, "more place has", "more places have");
      return { code, message: `${message} ${others} this problem: ${listed(more)}.`, where };
    });
    const kinds = [...this.kinds];
    const rest = kinds
      .filter(([, { nUnlisted }]) => nUnlisted)
      .map(([code, { n, nUnlisted }]) => {
        const message = `And ${grouped(nUnlisted)} more like these: ${grouped(n)} in all.`;
        return { code, message, where: "" };
      });
    const nCounted = kinds.reduce((sum, [, { n }]) => sum + n, 0);
    throw new Rejected([...told, ...rest], nCounted + this.nGrouped);
  }
}

// --- JSON with its members in order, doubled ones included, read as Python reads it ------------------------

class Members {
  list = [];
}

class Num {
  constructor(literal) {
    this.literal = literal;
    this.isWhole = !/[.eIN]/.test(literal) && literal.length < 300;
    this.value = Number(literal);
  }

  words() {
    const text = this.repr();
    return text.length < 30 ? text : general17(this.value);
  }

  repr() {
    if (!this.isWhole) return reprOf(this.value);
    return this.literal === "-0" ? "0" : this.literal;
  }
}

// A float64 as Python writes it, whose exponents begin elsewhere than JavaScript's.
function reprOf(value) {
  if (Number.isNaN(value)) return "nan";
  if (!Number.isFinite(value)) return value > 0 ? "inf" : "-inf";
  if (Object.is(value, -0)) return "-0.0";
  if (value === 0) return "0.0";
  const [digits, exponent] = value.toExponential().split("e");
  const power = Number(exponent);
  const size = Math.abs(power).toString().padStart(2, "0");
  if (power < -4 || power >= 16) return `${digits}e${power < 0 ? "-" : "+"}${size}`;
  const places = Math.max(digits.replace(/^-?\d\.?/, "").length - power, 0);
  return places ? value.toFixed(Math.min(places, 100)) : `${BigInt(value)}.0`;
}

function general17(value) {
  const [digits, exponent] = value.toExponential(16).split("e");
  return `${digits.replace(/\.?0+$/, "")}e${exponent.replace(/^([+-])(\d)$/, "$10$2")}`;
}

const SPACE = new Set([" ", "\t", "\n", "\r"]);
const ESCAPES = { '"': '"', "\\": "\\", "/": "/", b: "\b", f: "\f", n: "\n", r: "\r", t: "\t" };
const NUMBER = /-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][+-]?\d+)?/y;
const WORDS = [
  ["null", () => null],
  ["true", () => true],
  ["false", () => false],
  ["NaN", () => new Num("NaN")],
  ["Infinity", () => new Num("Infinity")],
  ["-Infinity", () => new Num("-Infinity")],
];

class NotJson extends Error {
  constructor(fault, at) {
    super(fault);
    this.at = at;
  }
}

class Reader {
  constructor(text) {
    this.text = text;
    this.at = 0;
  }

  document() {
    if (this.text[0] === "\ufeff") throw new NotJson("unexpected UTF-8 BOM (decode using utf-8-sig)", 0);
    this.skip();
    const value = this.value();
    this.skip();
    if (this.at < this.text.length) throw new NotJson("extra data", this.at);
    return value;
  }

  skip() {
    while (SPACE.has(this.text[this.at])) this.at++;
  }

  value() {
    const mark = this.text[this.at];
    if (mark === '"') return this.string();
    if (mark === "{") return this.object();
    if (mark === "[") return this.array();
    for (const [word, made] of WORDS) {
      if (mark === word[0] && this.text.startsWith(word, this.at)) {
        this.at += word.length;
        return made();
      }
    }
    NUMBER.lastIndex = this.at;
    const found = NUMBER.exec(this.text);
    if (!found) throw new NotJson("expecting value", this.at);
    this.at = NUMBER.lastIndex;
    return new Num(found[0]);
  }

  expect(mark, fault) {
    if (this.text[this.at] !== mark) throw new NotJson(fault, this.at);
    this.at++;
  }

  object() {
    const members = new Members();
    this.at++;
    this.skip();
    if (this.text[this.at] === "}") return this.at++, members;
    for (;;) {
      if (this.text[this.at] !== '"') {
        throw new NotJson("expecting property name enclosed in double quotes", this.at);
      }
      const name = this.string();
      this.skip();
      this.expect(":", "expecting ':' delimiter");
      this.skip();
      members.list.push([name, this.value()]);
      this.skip();
      if (this.text[this.at] === "}") return this.at++, members;
      this.expect(",", "expecting ',' delimiter");
      this.skip();
    }
  }

  array() {
    const items = [];
    this.at++;
    this.skip();
    if (this.text[this.at] === "]") return this.at++, items;
    for (;;) {
      items.push(this.value());
      this.skip();
      if (this.text[this.at] === "]") return this.at++, items;
      this.expect(",", "expecting ',' delimiter");
      this.skip();
    }
  }

  string() {
    const begin = this.at++;
    let text = "";
    for (let start = this.at; ; ) {
      const mark = this.text[this.at];
      if (mark === undefined) throw new NotJson("unterminated string", begin);
      if (mark === '"') return (text += this.text.slice(start, this.at++));
      if (mark < " ") throw new NotJson("invalid control character", this.at);
      if (mark !== "\\") {
        this.at++;
        continue;
      }
      text += this.text.slice(start, this.at) + this.escape(begin);
      start = this.at;
    }
  }

  escape(begin) {
    const mark = this.text[this.at + 1];
    if (mark === undefined) throw new NotJson("unterminated string", begin);
    if (mark !== "u") {
      if (!Object.hasOwn(ESCAPES, mark)) throw new NotJson("invalid \\escape", this.at);
      this.at += 2;
      return ESCAPES[mark];
    }
    const digits = this.text.slice(this.at + 2, this.at + 6);
    const isWhole = this.at + 6 < this.text.length && /^[0-9a-fA-F]{4}$/.test(digits);
    if (!isWhole) throw new NotJson("invalid \\uXXXX escape", this.at + 1);
    this.at += 6;
    return String.fromCharCode(parseInt(digits, 16));
  }
}

function lookOf(bytes) {
  const found = KINDS.find(([start]) => start.every((byte, i) => bytes[i] === byte));
  return found ? ` The file looks like ${found[1]}.` : "";
}

// Where the first byte sequence stands that is no UTF-8.
function firstBadByte(bytes) {
  const decoder = new TextDecoder("utf-8", { fatal: true });
  const isGood = (from, to) => {
    try {
      decoder.decode(bytes.subarray(from, to));
      return true;
    } catch {
      return false;
    }
  };
  for (let at = 0; at < bytes.length; ) {
    const lead = bytes[at];
    const length = lead < 0x80 ? 1 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
    if (length > 1 && !isGood(at, at + length)) return at;
    at += length;
  }
  return bytes.length;
}

function require(bytes, maxMembers) {
  const count = (byte) => bytes.reduce((sum, each) => sum + (each === byte), 0);
  const nMembers = count(0x2c) + 1;
  if (nMembers > maxMembers) {
    const found = `The file has up to ${grouped(nMembers)} members and items`;
    throw reject("too-many-members", `${found}; expected at most ${grouped(maxMembers)}.`);
  }
  const nMarks = count(0x22);
  if (nMarks > 4 * maxMembers) {
    const expected = `expected at most ${grouped(4 * maxMembers)}, four for each member.`;
    throw reject("too-many-members", `The file has ${grouped(nMarks)} quotation marks; ${expected}`);
  }
  if (depthOf(bytes) > MAX_DEPTH) {
    const message = `Objects and lists are nested deeper than ${MAX_DEPTH} levels; expected 2, or a few in meta.`;
    throw reject("too-deep", message);
  }
}

function depthOf(bytes) {
  let depth = 0;
  let deepest = 0;
  let isInside = false;
  for (let at = 0; at < bytes.length && deepest <= MAX_DEPTH; at++) {
    const byte = bytes[at];
    if (isInside && byte === 0x5c) at++;
    else if (byte === 0x22) isInside = !isInside;
    else if (!isInside && (byte === 0x7b || byte === 0x5b)) deepest = Math.max(deepest, ++depth);
    else if (!isInside && (byte === 0x7d || byte === 0x5d)) depth--;
  }
  return deepest;
}

function parse(bytes, maxMembers) {
  const isMarked = bytes[0] === 0xef && bytes[1] === 0xbb && bytes[2] === 0xbf;
  const body = isMarked ? bytes.subarray(3) : bytes;
  let text;
  try {
    text = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(body);
  } catch {
    const at = firstBadByte(body) + bytes.length - body.length;
    const message = `Byte ${grouped(at)} of the file is not UTF-8; expected JSON text encoded in UTF-8.`;
    throw reject("not-utf8", message + lookOf(bytes), `byte ${at}`);
  }
  if (!/[^ \t\r\n]/.test(text)) throw reject("not-json", EMPTY);
  require(body, maxMembers);
  try {
    return new Reader(text).document();
  } catch (fault) {
    if (!(fault instanceof NotJson)) throw fault;
    const before = text.slice(0, fault.at).split("\n");
    const column = Array.from(before.at(-1)).length + 1;
    const found = fault.at < text.length ? quoted(first(text.slice(fault.at), 20)) : "the end of the file";
    const message = `The text is not JSON: ${fault.message}, found ${found}.${lookOf(bytes)}`;
    throw reject("not-json", message, `line ${before.length}, column ${column}`);
  }
}

// --- the envelope --------------------------------------------------------------------------------------------

function readDocument(value) {
  if (!(value instanceof Members)) {
    const expected = "expected an object of predictions or an envelope";
    throw reject("wrong-top-level", `The outermost value is ${kindOf(value)}; ${expected}.`);
  }
  if (!value.list.some(([name]) => FIELDS.includes(name))) {
    return { predictions: value.list, unit: "ttc", pointer: (key) => pointer(key) };
  }
  const findings = new Findings();
  const fields = new Map();
  for (const [name, content] of value.list) {
    if (fields.has(name)) {
      const message = `The field ${quoted(name)} appears twice; expected it once.`;
      findings.add("duplicate-keys", message, pointer(name));
    } else if (!FIELDS.includes(name)) {
      const expected = `expected only ${FIELDS.join(", ")} (put notes into meta)`;
      findings.add("unknown-field", `The envelope has a field ${quoted(name)}; ${expected}.`, pointer(name));
    }
    fields.set(name, content);
  }
  const predictions = fields.get("predictions");
  if (!fields.has("predictions")) {
    findings.add("missing-predictions", "The envelope has no predictions; expected an object of them.");
  }
  const unit = unitOf(fields, findings);
  const rateName = rateNameOf(fields, unit, findings);
  checkMeta(fields.get("meta") ?? null, findings);
  if (fields.has("predictions") && !(predictions instanceof Members)) {
    const message = `predictions is ${kindOf(predictions)}; expected an object from key to number.`;
    findings.add("wrong-top-level", message, "/predictions");
  }
  findings.throwIfAny();
  const place = (key) => pointer("predictions", key);
  return { predictions: predictions.list, unit, rateName, rate: fields.get(rateName), pointer: place };
}

function unitOf(fields, findings) {
  const unit = fields.get("unit");
  if (unit === "ttc" || unit === "scale_ratio") return unit;
  const found = fields.has("unit") ? kindOf(unit) : "none";
  findings.add("unknown-unit", `The unit is ${found}; expected "ttc" or "scale_ratio".`, "/unit");
  return "ttc";
}

function rateNameOf(fields, unit, findings) {
  const hasFps = fields.has("fps");
  const hasGap = fields.has("frame_gap");
  const name = hasFps ? "fps" : "frame_gap";
  if (hasFps && hasGap) {
    const message = "The envelope has both fps and frame_gap; expected one of them.";
    findings.add("bad-rate", message, "/frame_gap");
  } else if ((hasFps || hasGap) && fields.get("unit") === "ttc") {
    const message = `The envelope has ${name}, but values of unit "ttc" are seconds and have no rate; expected none.`;
    findings.add("bad-rate", message, pointer(name));
  } else if (unit === "scale_ratio" && !hasFps && !hasGap) {
    const message = "Scale ratios need the rate of their frame pairs; expected fps (Hz) or frame_gap (frames).";
    findings.add("bad-rate", message);
  }
  return unit === "ttc" || !(hasFps || hasGap) ? null : name;
}

function checkMeta(value, findings) {
  if (value === null) return;
  if (!(value instanceof Members)) {
    findings.add("bad-meta", `meta is ${kindOf(value)}; expected an object.`, "/meta");
    return;
  }
  let fault = null;
  try {
    const size = new TextEncoder().encode(dumped(value)).length;
    if (size > MAX_META_BYTES) fault = `it takes ${grouped(size)} bytes`;
  } catch (found) {
    if (typeof found !== "string") throw found;
    fault = found;
  }
  if (fault === null) return;
  const most = `at most ${grouped(MAX_META_BYTES)} bytes`;
  const expected = `an object of finite numbers and whole texts, ${most}`;
  findings.add("bad-meta", `meta cannot be kept: ${fault}; expected ${expected}.`, "/meta");
}

// The text of a JSON value as it is kept; throws what is wrong with it, as a string.
function dumped(value) {
  if (value instanceof Members) {
    const parts = value.list.map(([name, content]) => `${dumped(name)}: ${dumped(content)}`);
    if (new Set(value.list.map(([name]) => name)).size < parts.length) throw "a name appears twice in an object";
    return `{${parts.join(", ")}}`;
  }
  if (Array.isArray(value)) return `[${value.map(dumped).join(", ")}]`;
  if (value instanceof Num) {
    if (!value.isWhole && !Number.isFinite(value.value)) throw "a number is not finite";
    return value.repr();
  }
  if (typeof value === "string") {
    if (value.includes("\0")) throw "a text contains NUL";
    if (!value.isWellFormed()) throw "a text contains half of a surrogate pair";
  }
  return JSON.stringify(value);
}

// --- keys and values -----------------------------------------------------------------------------------------

// The manifest's CSV as its keys of both kinds, and the row of each key.
function readManifest(text) {
  const [head, ...lines] = text.trimEnd().split("\n").map((line) => line.split(","));
  const [id, bag, cam, ts, track] = ["anno_id", "bag_stamp", "cam_id", "ts", "track_id"].map((name) => head.indexOf(name));
  const ids = lines.map((line) => line[id]);
  const natural = lines.map((line) => [line[bag], line[cam], line[ts], line[track]].join("/"));
  const rows = (keys) => new Map(keys.map((key, row) => [key, row]));
  const windows = lines.map((line) => ({ camera: `${line[bag]}/${line[cam]}`, track: line[track], at: BigInt(line[ts]) }));
  return { ids, natural, windows, rowOfId: rows(ids), rowOfNatural: rows(natural), n: ids.length };
}

function checkKeys(members, manifest, findings, place) {
  const names = members.map(([name]) => name);
  const ids = names.filter((name) => manifest.rowOfId.has(name));
  const natural = names.filter((name) => manifest.rowOfNatural.has(name));
  const isNatural = natural.length > ids.length;
  const unknown = names.filter((name) => !manifest.rowOfId.has(name) && !manifest.rowOfNatural.has(name));
  if (unknown.length) {
    const found = counted(unknown.length, "key names", "keys name");
    const message =
      `${found} no sequence of the manifest: ${listed(unknown.slice(0, MAX_LISTED + 1).map(quoted))}; ` +
      "expected its anno_ids, as plain decimal numbers, or its natural keys bag_stamp/cam_id/ts/track_id.";
    findings.group("unknown-keys", message, place(unknown[0]), unknown.length);
  }
  requireOnce(names, findings, place);
  if (ids.length && natural.length) {
    const rare = isNatural ? ids : natural;
    const message =
      `The file mixes ${grouped(ids.length)} anno_ids with ${grouped(natural.length)} natural keys; ` +
      `the odd ones: ${listed(rare.slice(0, MAX_LISTED + 1).map(quoted))}; expected one kind of key.`;
    findings.group("mixed-keys", message, place(rare[0]), rare.length);
  }
  const given = new Set([
    ...ids.map((name) => manifest.rowOfId.get(name)),
    ...natural.map((name) => manifest.rowOfNatural.get(name)),
  ]);
  const nMissing = manifest.n - given.size;
  if (nMissing) {
    const missing = (isNatural ? manifest.natural : manifest.ids).filter((_, row) => !given.has(row));
    const found = counted(nMissing, "sequence has", "sequences have");
    const expected = `expected one for each of the manifest's ${grouped(manifest.n)} sequences`;
    const message = `${found} no value: ${listed(missing)}; ${expected}, by ${isNatural ? "natural key" : "anno_id"}.`;
    findings.group("missing-keys", message, place(missing[0]), nMissing);
  }
  return { isNatural, nFound: given.size };
}

function requireOnce(names, findings, place) {
  const counts = new Map();
  for (const name of names) counts.set(name, (counts.get(name) ?? 0) + 1);
  const repeated = [...counts].filter(([, count]) => count > 1).map(([name]) => name);
  if (!repeated.length) return;
  const found = counted(repeated.length, "key appears", "keys appear");
  const message = `${found} more than once: ${listed(repeated.slice(0, MAX_LISTED + 1).map(quoted))}; expected every key once.`;
  findings.group("duplicate-keys", message, place(repeated[0]), repeated.length);
}

// The values by the row of each member, NaN where none is given or usable.
function columnOf(members, manifest, findings, place, fault) {
  const values = new Float64Array(manifest.n).fill(NaN);
  for (const [name, value] of members) {
    const problem = fault(value);
    const row = manifest.rowOfId.get(name) ?? manifest.rowOfNatural.get(name);
    if (problem) findings.add(...problem, place(name));
    else if (row !== undefined) values[row] = value.value;
  }
  return values;
}

function numberFault(value, expected) {
  if (!(value instanceof Num)) return ["not-a-number", `The value is ${kindOf(value)}; expected ${expected}.`];
  if (Number.isNaN(value.value)) return ["nan", `The value is NaN; expected ${expected}.`];
  return null;
}

const secondsFault = (value) =>
  numberFault(value, "a number of seconds") ?? (value.value === 0 ? ["zero", ZERO] : null);

function ratioFault(value) {
  const problem = numberFault(value, "a scale ratio greater than 0");
  if (problem || value.value > 0) return problem;
  return ["not-positive", `The value is ${kindOf(value)}; expected a scale ratio greater than 0.`];
}

function fpsFault(value) {
  if (value instanceof Num && value.value > 0 && value.value < Infinity) return null;
  return ["bad-rate", `fps is ${kindOf(value)}; expected a rate in Hz, a finite number greater than 0.`];
}

function gapFault(value) {
  if (value instanceof Num && [1, 2, 3, 4, 5].includes(value.value)) return null;
  return ["bad-rate", `frame_gap is ${kindOf(value)}; expected a whole number of frames from 1 to 5.`];
}

// The rate in Hz of each row.
function ratesOf(document, manifest, findings) {
  const isGap = document.rateName === "frame_gap";
  const fault = isGap ? gapFault : fpsFault;
  const toHz = (value) => (isGap ? 10 / value : value);
  if (document.rate instanceof Members) {
    const place = (key) => pointer(document.rateName, key);
    checkKeys(document.rate.list, manifest, findings, place);
    const rates = columnOf(document.rate.list, manifest, findings, place, fault);
    return (row) => toHz(rates[row]);
  }
  const problem = fault(document.rate);
  if (problem) findings.add(...problem, `/${document.rateName}`);
  return () => (problem ? NaN : toHz(document.rate.value));
}

// JSON in gzip and CSV tables are left to the server, as evaluator/predictions/packages.py tells them.
const COLUMNS = ["anno_id", "bag_stamp", "cam_id", "ts", "track_id", "ttc", "ttc_s", "scale_ratio", "fps", "frame_gap"];

function isPackaged(bytes) {
  if (bytes[0] === 0x1f && bytes[1] === 0x8b) return true;
  const line = new TextDecoder().decode(bytes.subarray(0, 2000)).trimStart().split(/[\r\n]/, 1)[0];
  const fields = line.split(",").map((name) => name.trim().replace(/^"|"$/g, ""));
  return fields.length > 1 && !/^[{[]/.test(line) && fields.some((name) => COLUMNS.includes(name));
}

function check(bytes, manifest) {
  if (isPackaged(bytes)) throw new Error("not JSON as it comes");
  const document = readDocument(parse(bytes, 2 * manifest.n + 100_000));
  const findings = new Findings();
  const { isNatural, nFound } = checkKeys(document.predictions, manifest, findings, document.pointer);
  const isRatio = document.unit === "scale_ratio";
  const fault = isRatio ? ratioFault : secondsFault;
  const values = columnOf(document.predictions, manifest, findings, document.pointer, fault);
  if (isRatio) {
    const rateOf = ratesOf(document, manifest, findings);
    values.forEach((ratio, row) => {
      values[row] = 1 / (rateOf(row) * (1 / ratio - 1));
      if (values[row] !== 0) return;
      const found = `The scale ratio ${reprOf(ratio)} is a time to contact of 0`;
      const name = (isNatural ? manifest.natural : manifest.ids)[row];
      findings.add("zero", `${found}; expected one that is not 0.`, document.pointer(name));
    });
  }
  findings.throwIfAny();
  return { n_found: nFound, warnings: warningsOf(values, manifest) };
}

// --- another unit or sign, and good values under wrong keys, as in evaluator/predictions/plausibility.py --------------------------------

const MAX_STEP_NS = 1_000_000_000n;
const MIN_PAIRS = 100;
const MAX_ROUGHNESS = 0.8;
const MIN_VALUES = 100;
const MIN_SHARE = 0.99;
const NEAR_S = 10;
const MAX_RISING = 0.7;
const CAUSE =
  "Probably the anno_ids are those of the toolkit on a machine that lists the annotation files in another order: " +
  "tsttc convert FILE --annotations FOLDER writes natural keys.";

function warningsOf(seconds, manifest) {
  manifest.pairs ??= pairsOf(manifest.windows);
  return [...unitWarnings(seconds), ...signWarnings(seconds, manifest), ...orderWarnings(seconds, manifest)];
}

function unitWarnings(seconds) {
  const n = seconds.length;
  const nFar = seconds.filter((value) => Math.abs(value) > 20).length;
  const nRatios = seconds.filter((value) => value >= 0.5 && value <= 1.5).length;
  if (n < MIN_VALUES) return [];
  if (nFar >= MIN_SHARE * n) {
    const message =
      `${grouped(nFar)} of ${grouped(n)} values lie beyond ±20 s; expected most of them within. Probably they are ` +
      "milliseconds, or scale ratios of another frame gap than the file states.";
    return [{ code: "not-seconds", message }];
  }
  if (nRatios >= MIN_SHARE * n) {
    const message =
      `${grouped(nRatios)} of ${grouped(n)} values lie between 0.5 and 1.5 s; expected few. Probably they are scale ` +
      'ratios: these need "unit": "scale_ratio" and fps or frame_gap beside them.';
    return [{ code: "looks-like-ratios", message }];
  }
  return [];
}

function signWarnings(seconds, manifest) {
  const steps = manifest.pairs.same.map(([a, b]) => [seconds[a], seconds[b]]);
  const near = steps.filter(
    ([a, b]) => Math.sign(a) === Math.sign(b) && Math.abs(a) <= NEAR_S && Math.abs(b) <= NEAR_S && a !== b,
  );
  const nRising = near.filter(([a, b]) => b > a).length;
  if (near.length < MIN_PAIRS || nRising <= MAX_RISING * near.length) return [];
  const message =
    `The signs look flipped: from one window of an object to the next, ${grouped(nRising)} of ${grouped(near.length)} ` +
    "values rise; expected most of them to fall, as a time to contact does while time passes. Probably every sign is " +
    "wrong: τ is negative when the object moves away.";
  return [{ code: "flipped-signs", message }];
}

function orderWarnings(seconds, manifest) {
  const found = roughness(seconds, manifest);
  if (found === null || found <= MAX_ROUGHNESS) return [];
  const message =
    "The values look shuffled: from one window to the next those of one object differ " +
    `${found.toFixed(2)} times as much as those of two objects; expected at most ${MAX_ROUGHNESS}, since ` +
    `an object changes slowly. ${CAUSE}`;
  return [{ code: "shuffled-values", message }];
}

// How far neighbouring windows of one object differ, over how far successive windows of two objects do.
function roughness(seconds, manifest) {
  const { same, other } = manifest.pairs;
  if (Math.min(same.length, other.length) < MIN_PAIRS) return null;
  const ranks = ranksOf(seconds);
  const apart = meanDifference(ranks, other);
  return apart > 0 ? meanDifference(ranks, same) / apart : null;
}

// The rank of each value by scale ratio; equal values share the mean of theirs.
function ranksOf(seconds) {
  const growth = seconds.map((value) => -1 / value);
  const order = growth.map((_, row) => row).sort((a, b) => growth[a] - growth[b] || 0);
  const ranks = new Float64Array(order.length);
  for (let from = 0, to = 0; from < order.length; from = to) {
    while (to < order.length && growth[order[to]] === growth[order[from]]) to++;
    for (let i = from; i < to; i++) ranks[order[i]] = (from + 1 + to) / 2;
  }
  return ranks;
}

const meanDifference = (ranks, pairs) =>
  pairs.reduce((sum, [a, b]) => sum + Math.abs(ranks[a] - ranks[b]), 0) / pairs.length;

// Rows of neighbouring windows of one object, and of successive windows of two, of each camera.
function pairsOf(windows) {
  const compared = (a, b) => (a < b ? -1 : Number(a > b));
  const pairs = (names, isWanted) => {
    const by = (a, b) => names.reduce((found, name) => found || compared(windows[a][name], windows[b][name]), 0);
    const order = windows.map((_, row) => row).sort(by);
    const isPair = ([a, b]) => {
      const [first, second] = [windows[a], windows[b]];
      return first.camera === second.camera && second.at - first.at <= MAX_STEP_NS && isWanted(first.track === second.track);
    };
    return order.slice(1).map((row, i) => [order[i], row]).filter(isPair);
  };
  return {
    same: pairs(["camera", "track", "at"], (isOne) => isOne),
    other: pairs(["camera", "at", "track"], (isOne) => !isOne),
  };
}

// The answer for a file's bytes and the text of a manifest.
function checked(bytes, manifest) {
  const answer = { n_problems: 0, problems: [], warnings: [], n_found: 0, n_sequences: manifest.n };
  try {
    Object.assign(answer, check(bytes, manifest));
  } catch (fault) {
    if (!(fault instanceof Rejected)) throw fault;
    answer.problems = fault.problems;
    answer.n_problems = fault.nProblems;
  }
  return answer;
}

const manifests = new Map();

async function manifestAt(address) {
  if (!manifests.has(address)) {
    // Without the session, so that the browser may keep it.
    const answer = await fetch(address, { credentials: "omit" });
    if (!answer.ok) throw new Error(`${address} answers ${answer.status}`);
    manifests.set(address, readManifest(await answer.text()));
  }
  return manifests.get(address);
}

addEventListener("message", async ({ data: { id, manifest, file } }) => {
  try {
    const [bytes, read] = [new Uint8Array(await file.arrayBuffer()), await manifestAt(manifest)];
    postMessage({ id, ...checked(bytes, read) });
  } catch (fault) {
    postMessage({ id, failed: String(fault) });
  }
});
