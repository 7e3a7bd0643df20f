"use strict";
(() => {
  const root = document.documentElement;
  const asks = matchMedia("(prefers-color-scheme: dark)");
  const colours = ["#3d85e0", "#dd7426", "#22a37a", "#c25fa8", "#b8901a", "#4fa8c4"];
  const plots = [...document.querySelectorAll(".plot")].map((place) => {
    const { data, layout } = JSON.parse(place.querySelector("script").textContent);
    return { place, data, layout };
  });

  const draw = () => {
    const style = getComputedStyle(root);
    const [text, line] = ["--text", "--line"].map((name) => style.getPropertyValue(name).trim());
    for (const { place, data, layout } of plots) {
      const axis = (one) => ({ ...one, gridcolor: line, linecolor: line, zerolinecolor: line });
      Plotly.react(place, data, {
        ...layout,
        xaxis: axis(layout.xaxis),
        yaxis: axis(layout.yaxis),
        colorway: colours,
        font: { color: text, family: "system-ui, sans-serif" },
        paper_bgcolor: "rgba(0,0,0,0)",
        plot_bgcolor: "rgba(0,0,0,0)",
        modebar: { bgcolor: "rgba(0,0,0,0)", color: line, activecolor: text },
      }, { displaylogo: false });
    }
  };
  const show = (theme) => {
    root.dataset.theme = theme;
    draw();
  };

  let chosen = null;
  const theme = () => chosen ?? (asks.matches ? "dark" : "light");
  document.getElementById("theme").addEventListener("click", () => {
    chosen = theme() === "dark" ? "light" : "dark";
    show(theme());
  });
  asks.addEventListener("change", () => show(theme()));
  addEventListener("beforeprint", () => show("light"));
  addEventListener("afterprint", () => show(theme()));
  show(theme());

  // A window, a phone turned and a sheet of paper all change the width.
  const follow = new ResizeObserver((changed) => changed.forEach(({ target }) => Plotly.Plots.resize(target)));
  plots.forEach(({ place }) => follow.observe(place));
})();
