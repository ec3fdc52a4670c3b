// Draws the charts of a page with Apache ECharts, which is fetched when the first of them comes into view.
// Numbers, texts and links come from the page; here are only colours, the pointer, and pictures to keep.
"use strict";

(() => {
  const LIBRARY = document.currentScript.dataset.library;
  const NEAR_PX = 40; // a mark farther away is not meant
  const SAME_PX = 2; // marks that nobody can tell apart are read together
  const MAX_TOGETHER = 6;
  const CLICK_PX = 4; // a pointer that moved more while it was down has dragged
  const PAPER = { width: 760, height: 440, scale: 3, font: "Helvetica, Arial, sans-serif" };

  // --- the library and the options ------------------------------------------------------------------------

  let fetched;
  const library = () =>
    (fetched ??= new Promise((done, failed) => {
      const script = document.createElement("script");
      script.src = LIBRARY;
      script.onload = () => done(window.echarts);
      script.onerror = () => failed(new Error("The chart library did not arrive."));
      document.head.append(script);
    }));

  async function optionsOf(figure) {
    const text = figure.querySelector("script[type='application/json']")?.textContent;
    return text ? JSON.parse(text) : (await fetch(figure.dataset.options)).json();
  }

  function inksOf(element) {
    const style = getComputedStyle(element);
    return (name) => style.getPropertyValue(name).trim();
  }

  // What options ask for with `call`; each gets what it is about, and its chart.
  const CALLS = {
    name: () => (mark) => mark.data.name,
    text: () => (mark) => mark.data.text,
    number: () => (value) => String(value).replace("-", "−"),
    texts: (places) => (value) => places.find(([place]) => Math.abs(place - value) < 1e-6)?.[1] ?? "",
    // A name begins below its mark. It moves to the left where it would cross the next step or leave the drawing; where
    // it would then read as the next mark's it ends below its own. It goes where there is no room for it, where the next
    // mark is so near that the name would read as its, or where it would lie below the mark before, too. The last
    // mark, the best, keeps its name.
    below:
      (places, chart) =>
      ({ dataIndex, rect, labelRect: { width, height } }) => {
        const [left, own, bottom] = [rect.x + rect.width / 2, rect.x + rect.width, rect.y + rect.height];
        const pixels = (place) => place && chart.convertToPixel({ xAxisIndex: 0, yAxisIndex: 0 }, place);
        const [before, next] = places[dataIndex].map(pixels);
        let end = next ? next[0] - 6 : chart.getWidth() - 18;
        if (next && left + width > end && Math.abs(next[1] - bottom - height) < height) end = own;
        const dx = Math.min(0, end - left - width);
        const isBelowBoth = next && before && left + dx <= before[0] && bottom - before[1] < 2 * height;
        const isNearNext = next && next[0] - left < 16 && next[1] - bottom < 2 * height;
        return left + dx < 40 || isBelowBoth || isNearNext ? { x: -1000 } : { hideOverlap: true, dx };
      },
    whisker: (ink) => (_, api) => {
      const [x, low] = api.coord([api.value(0), api.value(1)]);
      const high = api.coord([api.value(0), api.value(2)])[1];
      const line = (x1, y1, x2, y2) => ({
        type: "line",
        shape: { x1, y1, x2, y2 },
        style: { stroke: ink, lineWidth: 1.5 },
      });
      return {
        type: "group",
        children: [line(x, low, x, high), line(x - 3, low, x + 3, low), line(x - 3, high, x + 3, high)],
      };
    },
    strip:
      (ink) =>
      ({ coordSys }, api) => {
        const [left, right] = [0, 1].map((end) => api.coord([api.value(end), api.value(2)])[0]);
        return {
          type: "rect",
          shape: { x: left, y: coordSys.y, width: right - left, height: coordSys.height },
          style: { fill: ink },
        };
      },
    // Drawn once, through all of its points.
    band: (ink) => (place, api) => {
      if (place.dataIndexInside) return null;
      const along = (end) =>
        Array.from({ length: place.dataInsideLength }, (_, i) =>
          api.coord([api.value(0, i), api.value(end, i)]),
        );
      return {
        type: "polygon",
        shape: { points: [...along(1), ...along(2).reverse()] },
        style: { fill: ink, opacity: 0.2 },
      };
    },
  };

  // The options with the page's colours and this script's functions in their places.
  function resolved(option, ink, chart) {
    if (typeof option === "string") return option.startsWith("--") ? ink(option) : option;
    if (option === null || typeof option !== "object") return option;
    if (Array.isArray(option)) return option.map((each) => resolved(each, ink, chart));
    if (option.call) return CALLS[option.call](resolved(option.of, ink, chart), chart);
    return Object.fromEntries(
      Object.entries(option).map(([key, value]) => [key, resolved(value, ink, chart)]),
    );
  }

  function draw(chart, options, ink, font) {
    const full = resolved(options, ink, chart);
    full.baseOption.textStyle.fontFamily = font;
    chart.setOption(full, true);
  }

  // --- one chart on the page ------------------------------------------------------------------------------

  class Live {
    constructor(figure, options, echarts) {
      this.figure = figure;
      this.options = options;
      this.plot = figure.querySelector(".plot");
      this.drawing = figure.querySelector(".drawing");
      this.hidden = new Set();
      this.chart = echarts.init(this.drawing, null, { renderer: "svg" });
      this.card = this.plot.appendChild(element("div", "card"));
      this.ring = this.plot.appendChild(element("div", "here"));
      this.drawing.tabIndex = 0;
      this.redraw();
      this.hide();
      this.follow();
      this.plot.classList.add("is-drawn");
    }

    redraw(paper) {
      draw(this.chart, this.options, inksOf(paper ?? this.plot), getComputedStyle(document.body).fontFamily);
      const zooms = { key: "dataZoomSelect", dataZoomSelectActive: matchMedia("(pointer: fine)").matches };
      if (this.options.baseOption.toolbox) this.chart.dispatchAction({ type: "takeGlobalCursor", ...zooms });
      this.moved();
    }

    // Pixels are other ones: after a resize, a zoom, a click on the legend.
    moved() {
      this.found = null;
      // On paper it is as wide as the sheet.
      this.drawing
        .querySelector("svg")
        ?.setAttribute("viewBox", `0 0 ${this.chart.getWidth()} ${this.chart.getHeight()}`);
    }

    follow() {
      const { chart, drawing } = this;
      new ResizeObserver(() => {
        if (matchMedia("print").matches) return;
        chart.resize();
        this.moved();
        this.hide();
      }).observe(drawing);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
      window.addEventListener("beforeprint", () => this.redraw(paper()));
      window.addEventListener("afterprint", () => this.redraw());
      chart.on("legendselectchanged", ({ selected }) => {
        this.hidden = new Set(Object.keys(selected).filter((name) => !selected[name]));
        this.moved();
        this.hide();
      });
      chart.on("datazoom", () => this.moved());
      drawing.addEventListener("pointermove", (event) => this.point(event));
      drawing.addEventListener("pointerdown", (event) => {
        this.down = [event.clientX, event.clientY];
        this.point(event);
      });
      this.plot.addEventListener("pointerleave", () => this.hide());
      drawing.addEventListener("click", (event) => this.click(event));
      drawing.addEventListener("dblclick", () =>
        chart.dispatchAction({ type: "dataZoom", start: 0, end: 100 }),
      );
      drawing.addEventListener("keydown", (event) => this.key(event));
      drawing.addEventListener("blur", () => this.hide());
    }

    // Every mark that is drawn, with its pixels, from left to right.
    marks() {
      if (this.found) return this.found;
      this.found = [];
      this.options.baseOption.series.forEach((series, seriesIndex) => {
        if (this.hidden.has(series.name)) return;
        for (const mark of series.data) {
          if (!mark?.read) continue;
          const at = this.chart.convertToPixel({ seriesIndex }, mark.value);
          if (this.isInside(at, 1)) this.found.push({ mark, at, isUpright: Boolean(series.upright) });
        }
      });
      return this.found.sort((a, b) => a.at[0] - b.at[0] || a.at[1] - b.at[1]);
    }

    isInside([x, y], margin) {
      return [-margin, margin].some((dx) =>
        [-margin, margin].some((dy) => this.chart.containPixel("grid", [x + dx, y + dy])),
      );
    }

    // The nearest mark in both directions; of a bar or a step the one above or below the pointer.
    nearest(x, y) {
      if (!this.isInside([x, y], 10)) return null;
      const far = ({ at, isUpright }) => Math.hypot(at[0] - x, isUpright ? 0 : at[1] - y);
      let best = null;
      for (const each of this.marks())
        if (far(each) <= NEAR_PX && (!best || far(each) < far(best))) best = each;
      return best;
    }

    point(event) {
      const box = this.drawing.getBoundingClientRect();
      const near = this.nearest(event.clientX - box.left, event.clientY - box.top);
      if (near) this.show(near);
      else this.hide();
    }

    click(event) {
      const [x, y] = this.down ?? [event.clientX, event.clientY];
      if (event.detail > 1 || Math.hypot(event.clientX - x, event.clientY - y) > CLICK_PX) return;
      // A finger has nothing but the click to read with: it opens by the link of the card.
      if (event.pointerType === "mouse") this.open(event.ctrlKey || event.metaKey);
    }

    key(event) {
      const all = this.marks();
      const i = all.indexOf(this.current);
      const steps = {
        ArrowRight: i + 1,
        ArrowDown: i + 1,
        ArrowLeft: i < 0 ? -1 : i - 1,
        ArrowUp: i < 0 ? -1 : i - 1,
        Home: 0,
        End: -1,
      };
      if (event.key === "Enter") return this.open(false);
      if (event.key === "Escape") return this.hide();
      if (!(event.key in steps) || !all.length) return undefined;
      event.preventDefault();
      const next = steps[event.key];
      return this.show(all.at(next < all.length ? next : 0), true);
    }

    open(isApart) {
      const href = this.current?.mark.href;
      if (href && isApart) window.open(href);
      else if (href) window.location.assign(href);
    }

    show(near, isSpoken = false) {
      if (near === this.current) return;
      this.current = near;
      const [x, y] = near.at;
      const same = this.marks().filter(
        (each) => each !== near && Math.hypot(each.at[0] - x, each.at[1] - y) <= SAME_PX,
      );
      const told = [near, ...same.slice(0, MAX_TOGETHER - 1)].map(({ mark }) => entryOf(mark));
      if (same.length >= MAX_TOGETHER)
        told.push(element("p", "", `and ${same.length + 1 - MAX_TOGETHER} more here`));
      this.card.replaceChildren(...told);
      this.card.setAttribute("role", isSpoken ? "status" : "presentation");
      this.card.hidden = this.ring.hidden = false;
      place(this.ring, x - 9, y - 9);
      const [wide, high] = [this.card.offsetWidth, this.card.offsetHeight];
      const left = x + 14 + wide <= this.plot.clientWidth ? x + 14 : Math.max(0, x - 14 - wide);
      place(this.card, left, Math.max(0, Math.min(y - high / 2, this.plot.clientHeight - high)));
      this.drawing.classList.toggle("is-link", Boolean(near.mark.href));
    }

    hide() {
      this.current = null;
      this.card.hidden = this.ring.hidden = true;
      this.drawing.classList.remove("is-link");
    }
  }

  function element(tag, css, text = "") {
    const made = document.createElement(tag);
    made.className = css;
    made.textContent = text;
    return made;
  }

  function entryOf(mark) {
    const entry = element("div", "entry");
    const name = element(mark.href ? "a" : "b", "", mark.name);
    if (mark.href) name.href = mark.href;
    entry.append(name, ...mark.read.map((line) => element("span", "", line)));
    return entry;
  }

  function place(what, left, top) {
    what.style.left = `${left}px`;
    what.style.top = `${top}px`;
  }

  // --- pictures for a paper -------------------------------------------------------------------------------

  let sheet;
  const paper = () => (sheet ??= document.body.appendChild(element("div", "paper")));

  async function picture(figure) {
    const echarts = await library();
    const options = await optionsOf(figure);
    const size = { width: PAPER.width, height: Number(figure.dataset.paperHeight) || PAPER.height };
    const chart = echarts.init(null, null, { renderer: "svg", ssr: true, ...size });
    const ink = inksOf(paper());
    options.baseOption.backgroundColor = ink("--ground");
    delete options.baseOption.toolbox;
    draw(chart, options, ink, PAPER.font);
    const svg = chart.renderToSVGString();
    chart.dispose();
    return { svg, ...size };
  }

  async function download(figure, kind) {
    const { svg, width, height } = await picture(figure);
    if (kind === "svg") return keep(new Blob([svg], { type: "image/svg+xml" }), `${figure.dataset.name}.svg`);
    const image = new Image();
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
    await image.decode();
    const canvas = element("canvas", "");
    canvas.width = width * PAPER.scale;
    canvas.height = height * PAPER.scale;
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    return canvas.toBlob((blob) => keep(blob, `${figure.dataset.name}.png`), "image/png");
  }

  function keep(blob, name) {
    const link = element("a", "");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  }

  // --- the page -------------------------------------------------------------------------------------------

  async function start(figure) {
    try {
      const [echarts, options] = await Promise.all([library(), optionsOf(figure)]);
      new Live(figure, options, echarts);
    } catch (fault) {
      figure.querySelector(".plot").textContent = "The chart could not be loaded; the data are in the table.";
      console.info(fault);
    }
  }

  const seen = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      seen.unobserve(target);
      start(target.closest("figure"));
    }
  });

  function watch(root) {
    root.querySelectorAll("figure.chart .plot").forEach((plot) => seen.observe(plot));
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-download]");
    if (button) download(button.closest("figure"), button.dataset.download);
  });
  document.addEventListener("htmx:load", (event) => watch(event.target));
  watch(document);
})();
