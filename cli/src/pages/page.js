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
        ...note, arrowcolor: theme.text, bgcolor: `${theme.back}cc`, font: { size: 12 },
      })),
      shapes: (layout.shapes ?? []).map((shape) => ({ ...shape, fillcolor: `${theme.model}1f` })),
      font: { color: theme.text, family: "system-ui, sans-serif" },
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      hoverlabel: { bgcolor: theme.card, font: { color: theme.text } },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: theme.line, activecolor: theme.text },
    }, { displaylogo: false, displayModeBar: hasButtons && !place.closest(".small") ? "hover" : false });
  };

  // What is on the screen is drawn at once, the rest while there is nothing else to do.
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
  const isSeen = ({ place }) => {
    const { top, bottom } = place.getBoundingClientRect();
    return bottom > 0 && top < innerHeight;
  };
  const show = (theme, isWhole) => {
    root.dataset.theme = theme;
    const now = plots.filter((plot) => isWhole || isSeen(plot));
    waiting = plots.filter((plot) => !now.includes(plot));
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
  // As wide as paper is, before it is printed.
  addEventListener("beforeprint", () => {
    root.classList.add("paper");
    show("light", true);
  });
  addEventListener("afterprint", () => {
    root.classList.remove("paper");
    show(theme());
  });
  show(theme());

  // A window, and a phone that is turned, change the width.
  const follow = new ResizeObserver(() => {
    const changed = plots.filter(({ place, width, height }) =>
      width > 0 && (width !== place.clientWidth || height !== place.clientHeight));
    changed.forEach((plot) => draw(plot, colours()));
  });
  plots.forEach(({ place }) => follow.observe(place));
})();
