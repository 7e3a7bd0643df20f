"use strict";
// Drawings as SVG: curves, bands and marks in a frame with ticks.
const plots = (() => {
  const number = (value, digits = 4) => {
    if (value === 0) return "0";
    const size = Math.abs(value);
    if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace("e+", "e").replace("-", "−");
    return String(Number(value.toPrecision(digits))).replace("-", "−");
  };
  // Ticks and their labels, with as many digits as tell neighbours apart.
  const labelled = (low, high, count) => {
    const all = ticks(low, high, count), digits = Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high)) / (all[1] - all[0]))) + 1;
    return all.map((at) => [at, number(at, Math.min(Math.max(digits || 0, 4), 15))]);
  };
  // Round values in a range, about `count` of them.
  const ticks = (low, high, count) => {
    const step = (high - low) / count, power = 10 ** Math.floor(Math.log10(step));
    const each = [1, 2, 5, 10].map((of) => of * power).find((of) => of >= step) ?? step;
    const all = [];
    for (let k = Math.ceil(low / each); k * each <= high * (1 + 1e-12) + 1e-300 && all.length < 50; k++) all.push(k * each);
    return all;
  };
  const range = (curves, column = 1, include = []) => {
    let low = Infinity, high = -Infinity;
    const add = (value) => { if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); } };
    include.forEach(add);
    for (const points of curves) for (const point of points) add(point[column]);
    if (!(high > low)) { const middle = Number.isFinite(low) ? low : 0; return [middle - 1, middle + 1]; }
    const room = 0.06 * (high - low);
    return [low - room, high + room];
  };
  const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
  // of: { title, x, y: labels, xs, ys: ranges, curves: [{ points, hue, dash }], bands: [{ rows: [[x, low, high]], hue }],
  // circles: [{ at, radius }], marks: [{ at, text }], square }
  const draw = (place, of) => {
    const width = Math.max(place.clientWidth, 150), isSmall = width < 240;
    const height = of.height ?? (of.square ? Math.min(width, 380) : isSmall ? 165 : innerHeight < 700 ? 190 : 230);
    const [left, right, top, bottom] = [isSmall ? 44 : 54, isSmall ? 2 : 10, 8, 38];
    const [w, h] = [width - left - right, height - top - bottom];
    let { xs, ys } = of;
    if (of.square) {
      // Equal scales, so that a circle is one.
      const scale = Math.max((xs[1] - xs[0]) / w, (ys[1] - ys[0]) / h);
      const about = ([low, high], size) => [(low + high - scale * size) / 2, (low + high + scale * size) / 2];
      xs = about(xs, w); ys = about(ys, h);
    }
    const X = (value) => left + (value - xs[0]) / (xs[1] - xs[0]) * w;
    const Y = (value) => top + (ys[1] - value) / (ys[1] - ys[0]) * h;
    const limit = (value) => Math.min(Math.max(value, -1e5), 1e5).toFixed(1);
    const line = (points) => {
      let path = "", pen = "M";
      for (const [x, y] of points) {
        if (!Number.isFinite(y)) { pen = "M"; continue; }
        path += `${pen}${limit(X(x))} ${limit(Y(y))}`;
        pen = "L";
      }
      return path;
    };
    const id = `clip-${place.id}`;
    let svg = `<svg viewBox="0 0 ${width} ${height}" width="${width}" height="${height}" role="img" aria-label="${escaped(of.title)}">`;
    svg += `<clipPath id="${id}"><rect x="${left}" y="${top}" width="${w}" height="${h}"/></clipPath>`;
    for (const [at, label] of labelled(...xs, Math.max(2, w / 90))) svg += `<path class="grid" d="M${limit(X(at))} ${top}v${h}"/><text x="${limit(X(at))}" y="${top + h + 15}" text-anchor="middle">${label}</text>`;
    for (const [at, label] of labelled(...ys, Math.max(3, h / 38))) svg += `<path class="grid" d="M${left} ${limit(Y(at))}h${w}"/><text x="${left - 5}" y="${(Y(at) + 4).toFixed(1)}" text-anchor="end">${label}</text>`;
    svg += `<text x="${left + w / 2}" y="${height - 4}" text-anchor="middle">${escaped(of.x)}</text>`;
    svg += `<text transform="translate(11 ${top + h / 2}) rotate(-90)" text-anchor="middle">${escaped(of.y)}</text>`;
    svg += `<g clip-path="url(#${id})">`;
    for (const { from, to, chosen } of of.spans ?? []) svg += `<rect class="span${chosen ? " chosen" : ""}" x="${limit(X(from))}" y="${top}" width="${limit(Math.max(1, X(to) - X(from)))}" height="${h}"/>`;
    for (const { rows, hue } of (of.bands ?? []).filter(({ rows }) => rows.length)) {
      const there = rows.map(([x, , high]) => [x, high]), back = rows.map(([x, low]) => [x, low]).reverse();
      svg += `<path class="band ${hue}" d="${line(there.concat(back))}Z"/>`;
    }
    for (const { at: [x, y], radius } of of.circles ?? []) svg += `<circle class="limit" cx="${limit(X(x))}" cy="${limit(Y(y))}" r="${limit(X(radius) - X(0))}"/>`;
    for (const { points, hue, dash } of of.curves) svg += `<path class="curve ${hue}${dash ? " dash" : ""}" d="${line(points)}"/>`;
    for (const { at: [x, y] } of of.marks ?? []) svg += `<path class="mark" d="M${limit(X(x) - 5)} ${limit(Y(y))}h10m-5 -5v10"/>`;
    svg += `</g><rect class="frame" x="${left}" y="${top}" width="${w}" height="${h}"/></svg>`;
    place.innerHTML = svg;
    return { left, width: w, xs };
  };
  return { draw, range, number };
})();
