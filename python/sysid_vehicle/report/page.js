"use strict";
// The charts are drawn already. This follows the pointer through all of them, and a brushed span of
// time or region is selected in all: time series zoom to it, maps ring its samples.
(() => {
  const S = JSON.parse(document.getElementById("samples").textContent);
  const n = S.t.length, first = S.selected, NS = "http://www.w3.org/2000/svg";
  const make = (tag, attributes, parent) => {
    const e = document.createElementNS(NS, tag);
    for (const k in attributes) e.setAttribute(k, attributes[k]);
    return parent.appendChild(e);
  };
  const known = v => v !== null && v !== undefined;
  const rounded = v => known(v) ? String(Number(v.toPrecision(4))).replace("-", "\u2212") : "?";

  const ticks = (low, high, most) => {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map(s => s * power).find(s => s >= raw * (1 - 1e-9));
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++)
      found.push([i * step, (i * step + 0).toFixed(digits).replace("-", "\u2212")]);
    return found;
  };

  class Chart {
    constructor(svg) {
      this.svg = svg;
      this.frame = svg.dataset.frame.split(" ").map(Number);
      this.view = svg.dataset.view.split(" ").map(Number);
      const link = svg.dataset.link;
      this.timed = !link.includes(",");
      this.zooms = link === "zoom";
      if (!this.timed) [this.x, this.y] = link.split(",").map(name => S[name]);
      this.data = svg.querySelector("svg.data");
      this.lines = [...svg.querySelectorAll("path[data-c]")].map(path => ({
        path, values: S[path.dataset.c], name: path.dataset.n }));
      this.spans = make("path", { class: "span" }, this.data);
      this.data.prepend(this.spans);
      this.rings = svg.querySelector("path.selected") ||
        (this.timed ? null : make("path", { class: "dots selected over" }, this.data));
      this.brush = make("rect", { class: "brush" }, this.data);
      this.cursor = make("path", { class: "cursor" }, this.data);
      this.marks = make("path", { class: "dots large ink" }, this.data);
      svg.querySelectorAll(".unseen").forEach(e => e.remove());
      svg.addEventListener("pointermove", e => this.hover(e));
      svg.addEventListener("pointerleave", () => point(-1));
      svg.addEventListener("pointerdown", e => this.begin(e));
      svg.addEventListener("dblclick", () => select(first));
      svg.addEventListener("keydown", e => this.key(e));
    }
    across(v) { const [l, , w] = this.frame, [a, b] = this.view; return l + w * (v - a) / (b - a); }
    down(v) { const [, t, , h] = this.frame, [, , a, b] = this.view; return t + h * (b - v) / (b - a); }
    place(e) { // of an event, within the frame
      const box = this.svg.getBoundingClientRect(), all = this.svg.viewBox.baseVal;
      const [l, t, w, h] = this.frame;
      const x = (e.clientX - box.left) * all.width / box.width;
      const y = (e.clientY - box.top) * all.height / box.height;
      return [Math.min(Math.max(x, l), l + w), Math.min(Math.max(y, t), t + h)];
    }
    value(x, y) {
      const [l, t, w, h] = this.frame, [a, b, c, d] = this.view;
      return [a + (b - a) * (x - l) / w, d - (d - c) * (y - t) / h];
    }
    nearest(x, y) {
      let best = -1, least = Infinity;
      for (let i = 0; i < n; i++) {
        if (!this.timed && !(known(this.x[i]) && known(this.y[i]))) continue;
        const away = this.timed ? Math.abs(this.across(S.t[i]) - x)
          : Math.hypot(this.across(this.x[i]) - x, this.down(this.y[i]) - y);
        if (away < least) { least = away; best = i; }
      }
      return this.timed || least < 40 ? best : -1;
    }
    hover(e) { point(this.nearest(...this.place(e)), e); }
    begin(e) {
      if (e.button) return;
      e.preventDefault();
      this.svg.focus({ preventScroll: true });
      const [x0, y0] = this.place(e), [, top, , height] = this.frame;
      const corners = f => {
        const [x1, y1] = this.place(f), low = (a, b) => [Math.min(a, b), Math.max(a, b)];
        return [...low(x0, x1), ...(this.timed ? [top, top + height] : low(y0, y1))];
      };
      const move = f => {
        const [a, b, c, d] = corners(f);
        for (const [k, v] of Object.entries({ x: a, y: c, width: b - a, height: d - c }))
          this.brush.setAttribute(k, v);
      };
      const end = f => {
        window.removeEventListener("pointermove", move);
        window.removeEventListener("pointerup", end);
        this.brush.setAttribute("width", 0);
        const [a, b, c, d] = corners(f);
        if (b - a > 3) this.take(a, b, c, d);
      };
      window.addEventListener("pointermove", move);
      window.addEventListener("pointerup", end);
    }
    take(a, b, c, d) {
      const [x0, y0] = this.value(a, d), [x1, y1] = this.value(b, c);
      select(S.t.map((t, i) => this.timed ? t >= x0 && t <= x1
        : known(this.x[i]) && known(this.y[i]) &&
          this.x[i] >= x0 && this.x[i] <= x1 && this.y[i] >= y0 && this.y[i] <= y1));
    }
    key(e) {
      if (e.key === "Escape") return select(first);
      const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
      if (!step) return;
      e.preventDefault();
      point(Math.min(Math.max(at + step * (e.shiftKey ? 20 : 1), 0), n - 1));
    }
    show(chosen, runs, from, until) {
      if (!this.timed) {
        let d = "";
        chosen.forEach((own, i) => {
          if (own && known(this.x[i]) && known(this.y[i]))
            d += `M${this.across(this.x[i]).toFixed(1)} ${this.down(this.y[i]).toFixed(1)}h0`;
        });
        this.rings.setAttribute("d", d);
        return;
      }
      if (this.zooms) this.zoom(from, until);
      const [, t, , h] = this.frame;
      const part = this.zooms && runs.length === 1 ? [] : runs;
      this.spans.setAttribute("d", part.map(([i, j]) => {
        const a = this.across(S.t[i]), b = Math.max(this.across(S.t[j]), a + 1);
        return `M${a.toFixed(1)} ${t}H${b.toFixed(1)}V${t + h}H${a.toFixed(1)}Z`;
      }).join(""));
    }
    zoom(from, until) {
      let low = Infinity, high = -Infinity, i0 = 0, i1 = n;
      while (i0 < n - 1 && S.t[i0 + 1] < from) i0++;
      while (i1 > 1 && S.t[i1 - 2] > until) i1--;
      for (const { values } of this.lines)
        for (let i = i0; i < i1; i++)
          if (known(values[i])) { low = Math.min(low, values[i]); high = Math.max(high, values[i]); }
      if (!(high > low)) { low = (low || 0) - 0.5; high = low + 1; }
      const room = 0.04 * (high - low);
      this.view = [from, until, low - room, high + room];
      for (const { path, values } of this.lines) {
        let d = "", pen = "M";
        for (let i = i0; i < i1; i++) {
          if (i && S.run[i] !== S.run[i - 1]) pen = "M";
          if (!known(values[i])) { pen = "M"; continue; }
          d += `${pen}${this.across(S.t[i]).toFixed(1)} ${this.down(values[i]).toFixed(1)}`;
          pen = "L";
        }
        path.setAttribute("d", d);
      }
      const zero = this.svg.querySelector(".zero"), [l, t, w, h] = this.frame;
      if (zero) zero.setAttribute("d", `M${l} ${this.down(0)}h${w}`);
      const grid = (name, all, mark) => {
        const g = this.svg.querySelector(name);
        g.replaceChildren();
        for (const [v, word] of all) mark(g, v, word);
      };
      if (!this.svg.dataset.bare)
        grid(".xt", ticks(from, until, Math.max(Math.floor(w / 50), 2)), (g, v, word) => {
          make("path", { d: `M${this.across(v)} ${t}v${h}` }, g);
          const half = 3.3 * word.length, wide = this.svg.viewBox.baseVal.width;
          const x = Math.min(Math.max(this.across(v), half), wide - half);
          make("text", { x, y: t + h + 13, "text-anchor": "middle" }, g).textContent = word;
        });
      grid(".yt", ticks(this.view[2], this.view[3], Math.max(Math.floor(h / 20), 2)), (g, v, word) => {
        make("path", { d: `M${l} ${this.down(v)}h${w}` }, g);
        make("text", { x: l - 4, y: this.down(v) + 4, "text-anchor": "end" }, g).textContent = word;
      });
    }
    mark(i) {
      const [l, t, w, h] = this.frame;
      let line = "", marks = "";
      const x = i < 0 ? NaN : this.timed ? this.across(S.t[i])
        : known(this.x[i]) ? this.across(this.x[i]) : NaN;
      if (x >= l - 0.1 && x <= l + w + 0.1) {
        if (this.timed) {
          line = `M${x} ${t}v${h}`;
          for (const { values } of this.lines)
            if (known(values[i])) marks += `M${x} ${this.down(values[i])}h0`;
        } else if (known(this.y[i])) {
          const y = this.down(this.y[i]);
          line = `M${x - 9} ${y}h18M${x} ${y - 9}v18`;
          marks = `M${x} ${y}h0`;
        }
      }
      this.cursor.setAttribute("d", line);
      this.marks.setAttribute("d", marks);
    }
  }

  const tip = document.body.appendChild(document.createElement("div"));
  tip.className = "tip";
  tip.hidden = true;
  let at = S.t.findIndex((_, i) => first[i]);

  // Shows one sample in all charts; beside the pointer, its values in the chart below that.
  const point = (i, event) => {
    charts.forEach(c => c.mark(i));
    tip.hidden = i < 0 || !event;
    if (i < 0) return;
    at = i;
    if (!event) return;
    const own = charts.find(c => c.svg === event.currentTarget);
    const told = [`${S.t[i].toFixed(2)} s, ${S.d[i].toFixed(0)} m` +
      (S.logs.length > 1 ? `, ${S.logs[S.run[i]]}` : ""),
      `${rounded(S.v[i])} m/s` + (known(S.ay[i]) ? `, a_y ${rounded(S.ay[i])} m/s\u00b2` : "")];
    for (const { values, name } of own.lines)
      if (known(values[i])) told.push(`${name}: ${rounded(values[i])}`);
    if (!own.timed)
      ["baseline", "final model"].forEach((name, k) => {
        if (S[`e${k}`] && known(S[`e${k}`][i])) told.push(`error, ${name}: ${rounded(S[`e${k}`][i])}`);
      });
    tip.textContent = told.join("\n");
    tip.style.left = `${Math.min(event.pageX + 14, scrollX + innerWidth - tip.offsetWidth - 8)}px`;
    tip.style.top = `${event.pageY + 14}px`;
  };

  const tools = document.createElement("span");
  const said = document.createElement("span");
  const button = (text, chosen) => {
    const b = tools.appendChild(document.createElement("button"));
    b.type = "button";
    b.textContent = text;
    b.addEventListener("click", () => select(chosen));
  };
  // Samples stand for as long as lies around them: the worst seconds are read more densely.
  const weight = S.t.map((t, i) => {
    const gap = j => S.run[j] === S.run[i] ? Math.abs(S.t[j] - t) / 2 : 0;
    return gap(i - 1) + gap(i + 1);
  });
  const size = (chosen, k) => {
    let sum = 0, all = 0;
    chosen.forEach((own, i) => {
      if (own && known(S[`s${k}`][i])) { sum += weight[i] * S[`s${k}`][i]; all += weight[i]; }
    });
    return all ? Math.sqrt(sum / all).toFixed(2) : "?";
  };

  // Selects samples in all charts, and says how large the errors are there.
  const select = chosen => {
    if (!chosen.some(Boolean)) return;
    const runs = [];
    let seconds = 0;
    chosen.forEach((own, i) => {
      if (!own) return;
      seconds += weight[i];
      if (i && chosen[i - 1]) runs[runs.length - 1][1] = i;
      else runs.push([i, i]);
    });
    let from = S.t[runs[0][0]], until = S.t[runs[runs.length - 1][1]];
    if (!(until > from)) { from -= 0.5; until += 0.5; }
    charts.forEach(c => c.show(chosen, runs, from, until));
    said.textContent = `${seconds.toFixed(1)} s: error ${size(chosen, 0)}` +
      (S.s1 ? ` \u2192 ${size(chosen, 1)}` : "") + " of the floor";
    point(-1);
  };

  const charts = [...document.querySelectorAll("svg[data-link]")].map(svg => new Chart(svg));
  button("worst seconds", first);
  button("all", S.t.map(() => true));
  tools.className = "tools";
  said.setAttribute("role", "status");
  tools.prepend(said);
  document.querySelector("p.legend").append(tools);
  select(first);
})();
