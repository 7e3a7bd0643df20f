"use strict";
(() => {
  const root = document.documentElement;
  const asks = matchMedia("(prefers-color-scheme: dark)");
  // Without a mouse the buttons would always be there, over the plot.
  const hasButtons = matchMedia("(hover: hover)").matches;
  const palette = ["#3d85e0", "#dd7426", "#22a37a", "#c25fa8", "#b8901a", "#4fa8c4"];
  const plots = [...document.querySelectorAll(".plot")].map((place) => {
    const { data, layout } = JSON.parse(place.querySelector("script").textContent);
    return { place, data, layout, width: 0, height: 0 };
  });

  // Colours of the theme, #rrggbb: of what a series shows, and of the page.
  const colours = () => {
    const style = getComputedStyle(root);
    const of = (name) => style.getPropertyValue(`--${name}`).trim();
    return Object.fromEntries(
      ["text", "line", "card", "back", "measured", "model", "input", "reference"].map((name) => [name, of(name)]));
  };
  // Between two colours a part of the way.
  const mixed = (from, to, part) => {
    const channel = (colour, at) => parseInt(colour.slice(at, at + 2), 16);
    const between = (at) => Math.round(channel(from, at) + part * (channel(to, at) - channel(from, at)));
    return `rgb(${[1, 3, 5].map(between)})`;
  };
  const coloured = (trace, theme, next) => {
    if (trace.kind === "regions") {
      const colorscale = [0, 1 / 3, 2 / 3, 1].map((at) => [at, mixed(theme.model, theme.back, 0.25 + 0.75 * at)]);
      return { ...trace, colorscale, line: { color: theme.model, width: 1 } };
    }
    if (trace.kind === "diverging") {
      const strong = (colour) => mixed(theme.back, colour, 0.75);
      const colorscale = [[0, strong(theme.input)], [0.5, theme.card], [1, strong(theme.model)]];
      return { ...trace, colorscale, textfont: { color: theme.text } };
    }
    const colour = trace.hue === "next" ? next() : theme[trace.hue];
    if (trace.fill) return { ...trace, fillcolor: `${colour}40` };
    return { ...trace, line: { ...trace.line, color: colour }, marker: { ...trace.marker, color: colour } };
  };

  const NARROW = 480;
  // A note that leaves the axes goes back between them.
  const between = ({ place, width, layout }) => {
    const edges = place.getBoundingClientRect();
    const [left, right] = [edges.left + layout.margin.l, edges.right - layout.margin.r];
    const moved = {};
    [...place.querySelectorAll(".annotation-text-g")].forEach((note, at) => {
      const box = note.getBoundingClientRect();
      const by = Math.max(left - box.left, 0) - Math.max(box.right - right, 0);
      const { ax, ay } = place.layout.annotations[at];
      if (by) moved[`annotations[${at}].ax`] = ax + by;
      const low = edges.top - box.top;
      if (low > 0) moved[`annotations[${at}].ay`] = ay + low;
    });
    if (width && Object.keys(moved).length) Plotly.relayout(place, moved);
  };

  const draw = (plot, theme) => {
    const { place, data, layout } = plot;
    let used = 0;
    const next = () => palette[used++ % palette.length];
    const axes = Object.entries(layout).filter(([name]) => /^[xy]axis/.test(name));
    const axis = (one) => ({ ...one, gridcolor: theme.line, linecolor: theme.line, zerolinecolor: theme.line });
    const { clientWidth: width, clientHeight: height } = place;
    Object.assign(plot, { width, height });
    Plotly.react(place, data.map((trace) => coloured(trace, theme, next)), {
      ...layout,
      width,
      height,
      ...Object.fromEntries(axes.map(([name, one]) => [name, axis(one)])),
      annotations: layout.annotations.map((note) => ({
        ...note, text: width < NARROW ? note.text.replace(/ \(.*\)$/, "") : note.text, arrowcolor: theme.text, bgcolor: `${theme.back}cc`, font: { size: 12 },
      })),
      shapes: (layout.shapes ?? []).map((shape) => ({ ...shape, fillcolor: `${theme.model}1f` })),
      font: { color: theme.text, family: "system-ui, sans-serif" },
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      hoverlabel: { bgcolor: theme.card, font: { color: theme.text } },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: theme.line, activecolor: theme.text },
    }, { displaylogo: false, displayModeBar: hasButtons && !place.closest(".small") ? "hover" : false });
    between(plot);
  };

  // What is on the screen is drawn at once, the rest while there is nothing else to do; what is folded, once it opens.
  let waiting = [];
  const idle = window.requestIdleCallback ?? ((work) => setTimeout(work, 0));
  const drawNext = () => {
    const plot = waiting.shift();
    if (plot) {
      draw(plot, colours());
      idle(drawNext);
    } else {
      root.dataset.drawn = root.dataset.theme;
    }
  };
  const isUnfolded = ({ place }) => place.clientWidth > 0 && !place.closest("details:not([open])");
  const isSeen = ({ place }) => {
    const { top, bottom } = place.getBoundingClientRect();
    return bottom > 0 && top < innerHeight;
  };
  const show = (theme, isWhole) => {
    root.dataset.theme = theme;
    const unfolded = plots.filter(isUnfolded);
    const now = unfolded.filter((plot) => isWhole || isSeen(plot));
    waiting = unfolded.filter((plot) => !now.includes(plot));
    plots.forEach((plot) => Object.assign(plot, { width: 0 }));
    now.forEach((plot) => draw(plot, colours()));
    idle(drawNext);
  };

  let chosen = null;
  const theme = () => chosen ?? (asks.matches ? "dark" : "light");
  document.getElementById("theme").addEventListener("click", () => {
    chosen = theme() === "dark" ? "light" : "dark";
    show(theme());
  });
  asks.addEventListener("change", () => show(theme()));
  // As wide as paper is, and with what belongs on it unfolded, before it is printed.
  let folded = [];
  addEventListener("beforeprint", () => {
    root.classList.add("paper");
    folded = [...document.querySelectorAll("details.group:not([open])")];
    folded.forEach((one) => { one.open = true; });
    show("light", true);
  });
  addEventListener("afterprint", () => {
    root.classList.remove("paper");
    folded.forEach((one) => { one.open = false; });
    show(theme());
  });

  // Tabs: one panel at a time, by mouse, arrows and the address.
  const list = document.querySelector("[role=tablist]");
  const tabs = [...document.querySelectorAll("[role=tab]")];
  const panel = (tab) => document.getElementById(tab.getAttribute("aria-controls"));
  const choose = (tab, hasFocus) => {
    tabs.forEach((one) => {
      one.setAttribute("aria-selected", one === tab);
      one.tabIndex = one === tab ? 0 : -1;
      panel(one).hidden = one !== tab;
    });
    if (hasFocus) tab.focus();
  };
  const pick = (tab) => {
    choose(tab, true);
    history.replaceState(null, "", `#${panel(tab).id}`);
  };
  tabs.forEach((tab, at) => {
    panel(tab).setAttribute("role", "tabpanel");
    tab.addEventListener("click", () => pick(tab));
    tab.addEventListener("keydown", (event) => {
      const last = tabs.length - 1;
      const to = { ArrowRight: at < last ? at + 1 : 0, ArrowLeft: at > 0 ? at - 1 : last, Home: 0, End: last }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      pick(tabs[to]);
    });
  });
  // What the address names is shown: its panel, and the group around it.
  const follow = () => {
    const there = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const tab = tabs.find((one) => there && panel(one).contains(there)) ?? tabs[0];
    if (tab) choose(tab, false);
    const group = there?.closest("details.group");
    if (group) group.open = true;
    if (there && there.className !== "panel") there.scrollIntoView();
    else if (there && tab) scrollTo(0, 0);
  };
  if (list) list.hidden = false;
  addEventListener("hashchange", follow);
  follow();

  // The clipboard, or where a browser gives none to files, a selection.
  const copied = async (text) => {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {
      const area = document.body.appendChild(document.createElement("textarea"));
      area.value = text;
      area.select();
      const done = document.execCommand("copy");
      area.remove();
      return done;
    }
  };
  document.querySelectorAll(".copy").forEach((place) => {
    const [button, said] = place.children;
    place.hidden = false;
    button.addEventListener("click", async () => {
      const done = await copied(button.dataset.text);
      said.textContent = done ? "Copied." : "The browser does not allow it: select the values in the table.";
    });
  });
  show(theme());

  // A window, a phone that is turned, and a click that unfolds change the width. What waits will be drawn anyway.
  const redraw = () => {
    const changed = plots.filter((plot) => {
      const { place, width, height } = plot;
      const isOther = width !== place.clientWidth || height !== place.clientHeight;
      return isOther && isUnfolded(plot) && !waiting.includes(plot);
    });
    changed.forEach((plot) => draw(plot, colours()));
  };
  const resized = new ResizeObserver(redraw);
  plots.forEach(({ place }) => resized.observe(place));
  document.querySelectorAll("details").forEach((one) => one.addEventListener("toggle", redraw));
})();
