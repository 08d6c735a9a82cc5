// Buttons beneath charts and drawings: the numbers as CSV, the picture as SVG or PNG.
(function() {
'use strict';

function escape(text) {
  return String(text).replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');
}

function word(value) {
  return String(+value.toPrecision(6)).replace('-', '\u2212');
}

// A number of the axis as a place between two pixels.
function place(range, log, from, to) {
  return function(v) {
    var s = log ? Math.log(v / range[0]) / Math.log(range[1] / range[0]) : (v - range[0]) / (range[1] - range[0]);
    return from + s * (to - from);
  };
}

function curve(s, xs, x, y, log) {
  var out = '', dots = '', down = false;
  s.y.forEach(function(v, i) {
    if (v === null || (log.y && v <= 0) || (log.x && xs[i] <= 0)) {
      down = false;
      return;
    }
    var at = x(xs[i]).toFixed(1) + ' ' + y(v).toFixed(1);
    dots += 'M' + at + 'h0';
    out += (down ? 'L' : 'M') + at;
    down = true;
  });
  // As on the page: few dots are large, and a line through few places shows them.
  var count = s.y.length, size = count < 60 ? 6 : count < 480 ? 4 : 2.5;
  var spots = '<path d="' + dots + '" stroke="' + s.color + '" stroke-width="' + size + '" stroke-linecap="round"/>';
  if (s.style === 'dots') return spots;
  return (s.style === 'line' && count <= 12 ? spots : '') + '<path d="' + out + '" fill="none" stroke="' + s.color + '" stroke-width="1.6"' +
      (s.style === 'dashes' ? ' stroke-dasharray="7 4"' : '') + '/>';
}

function band(s, xs, x, y, log) {
  if (!s.w) return '';
  var there = '', back = '';
  s.y.forEach(function(v, i) {
    if (v === null || s.w[i] === null || (log.x && xs[i] <= 0)) return;
    var low = Math.max(v - s.w[i], log.least), high = Math.min(v + s.w[i], log.most);
    if (log.y && low <= 0) low = v * 1e-3;
    there += (there ? 'L' : 'M') + x(xs[i]).toFixed(1) + ' ' + y(high).toFixed(1);
    back = 'L' + x(xs[i]).toFixed(1) + ' ' + y(low).toFixed(1) + back;
  });
  return there ? '<path d="' + there + back + 'Z" fill="' + s.color + '" fill-opacity="0.18"/>' : '';
}

function axisTicks(axis, range, count) {
  if (axis.names) return axis.names.map(function(n) { return {v: n[0], label: escape(n[1])}; });
  return window.unfurlTicks(range[0], range[1], axis.log, count).map(function(v) { return {v: v, label: word(v)}; });
}

function markersSvg(data, frame, x) {
  return window.unfurlPlaceMarkers(data.markers, frame.left, frame.width - frame.right, x).map(function(m) {
    var line = '<path d="M' + m.x.toFixed(1) + ' ' + frame.top + 'V' + (frame.height - frame.bottom) +
        '" stroke="#666666" stroke-dasharray="3 3" stroke-opacity="0.6"/>';
    return line + '<text x="' + (m.x + (m.flipped ? -4 : 4)).toFixed(1) + '" y="' + (frame.top + 9 + m.below) +
        '" text-anchor="' + (m.flipped ? 'end' : 'start') + '" font-size="11" fill="#444">' + escape(m.label) + '</text>';
  }).join('');
}

function shownOf(data, chart) {
  return data.series.filter(function(s, k) { return chart.visibility()[k]; });
}

// The chart as it is zoomed now, hidden series left out, within `frame` [px].
function plotSvg(data, chart, frame) {
  var shown = shownOf(data, chart), width = frame.width, height = frame.height;
  var left = frame.left, right = frame.right, top = frame.top, bottom = frame.bottom;
  var ranges = {x: chart.xAxisRange(), y: chart.yAxisRange()}, log = {x: data.x.log, y: data.y.log};
  log.least = data.y.least === undefined ? -Infinity : data.y.least;
  log.most = data.y.most === undefined ? Infinity : data.y.most;
  var x = place(ranges.x, log.x, left, width - right), y = place(ranges.y, log.y, height - bottom, top), svg = '';
  axisTicks(data.x, ranges.x, (width - left - right) / 95).forEach(function(tick) {
    var at = x(tick.v).toFixed(1);
    svg += '<path d="M' + at + ' ' + top + 'V' + (height - bottom) + '" stroke="#e2e2e2"/><text x="' + at + '" y="' +
        (height - bottom + 18) + '" text-anchor="middle">' + tick.label + '</text>';
  });
  axisTicks(data.y, ranges.y, (height - top - bottom) / 30).forEach(function(tick) {
    svg += '<path d="M' + left + ' ' + y(tick.v).toFixed(1) + 'H' + (width - right) + '" stroke="#e2e2e2"/><text x="' +
        (left - 7) + '" y="' + (y(tick.v) + 4).toFixed(1) + '" text-anchor="end">' + tick.label + '</text>';
  });
  svg += '<clipPath id="' + frame.name + '"><rect x="' + left + '" y="' + top + '" width="' + (width - left - right) +
      '" height="' + (height - top - bottom) + '"/></clipPath><g clip-path="url(#' + frame.name + ')">';
  shown.forEach(function(s) { svg += band(s, data.axes[s.axis], x, y, log); });
  shown.forEach(function(s) { svg += curve(s, data.axes[s.axis], x, y, log); });
  svg += markersSvg(data, frame, x) + '</g><rect x="' + left + '" y="' + top + '" width="' + (width - left - right) +
      '" height="' + (height - top - bottom) + '" fill="none" stroke="#555"/>';
  return svg + '<text x="' + (left + width - right) / 2 + '" y="' + (height - 12) + '" text-anchor="middle">' +
      escape(data.x.title) + '</text><text transform="translate(20 ' + (top + height - bottom) / 2 +
      ') rotate(-90)" text-anchor="middle">' + escape(data.y.title) + '</text>';
}

function wrapSvg(frame, inner) {
  return '<svg xmlns="http://www.w3.org/2000/svg" width="' + frame.width + '" height="' + frame.height + '" viewBox="0 0 ' +
      frame.width + ' ' + frame.height + '" font-family="Helvetica, Arial, DejaVu Sans, sans-serif" font-size="' +
      frame.font + '"><rect width="' + frame.width + '" height="' + frame.height + '" fill="#fff"/>' + inner + '</svg>';
}

// Room left of the axis: its title and its longest number or name [px].
function leftOf(data, chart, least) {
  var most = Math.max.apply(null, [0].concat(axisTicks(data.y, chart.yAxisRange(), 9).map(function(t) {
    return t.label.length;
  })));
  return Math.max(least, 40 + 7.5 * most);
}

// With title and keys, to be saved.
function chartSvg(title, data, chart) {
  var shown = shownOf(data, chart), top = 40 + 20 * Math.ceil(shown.length / 3);
  var frame = {name: 'area', width: 960, height: top + 416, left: leftOf(data, chart, 84), right: 20, top: top, bottom: 56, font: 13};
  var svg = '<text x="' + frame.left + '" y="22" font-size="16" font-weight="bold">' + escape(title) + '</text>';
  shown.forEach(function(s, k) {
    var at = frame.left + (k % 3) * (frame.width - frame.left - frame.right) / 3, line = 44 + 20 * Math.floor(k / 3);
    svg += '<path d="M' + at + ' ' + (line - 5) + 'h24" stroke="' + s.color + '" stroke-width="3"' +
        (s.style === 'line' ? '' : ' stroke-dasharray="' + (s.style === 'dots' ? '3 4' : '7 4') + '"') + '/><text x="' +
        (at + 30) + '" y="' + line + '">' + escape(s.name) + '</text>';
  });
  return wrapSvg(frame, svg + plotSvg(data, chart, frame));
}

// On paper charts are drawn by lines, as wide as the paper: what a canvas holds is as wide as the window was.
function drawForPaper(id, data, chart) {
  var holder = document.getElementById(id), paper = document.createElement('div');
  paper.className = 'printed';
  holder.after(paper);
  window.addEventListener('beforeprint', function() {
    var frame = {name: id + '-area', width: 674, height: Math.min(300, parseFloat(holder.style.height)),
                 left: leftOf(data, chart, 64), right: 12, top: 6, bottom: 44, font: 11};
    paper.innerHTML = wrapSvg(frame, plotSvg(data, chart, frame));
  });
  window.addEventListener('afterprint', function() { paper.textContent = ''; });
}

// A table that is wider than its panel would make a browser shrink the whole page.
window.addEventListener('beforeprint', function() {
  document.querySelectorAll('.table > table').forEach(function(table) {
    var room = table.parentNode.clientWidth, wide = table.offsetWidth;
    if (wide > room) table.style.zoom = String(room / wide);
  });
});
window.addEventListener('afterprint', function() {
  document.querySelectorAll('.table > table').forEach(function(table) { table.style.zoom = ''; });
});

function cell(value) {
  if (value === null || value === undefined || value !== value) return '';
  return typeof value === 'number' ? String(value) : '"' + String(value).replace(/"/g, '""') + '"';
}

function table(header, rows) {
  return [header].concat(rows).map(function(row) { return row.map(cell).join(',') + '\n'; }).join('');
}

function withUnit(name, unit) {
  return unit ? name + ' [' + unit + ']' : name;
}

// One row for each place on the x axis at which any series has a value.
function chartCsv(data) {
  var header = [data.x.title], rows = new Map(), width = 1;
  data.series.forEach(function(s) {
    header.push(withUnit(s.name, data.y.unit));
    if (s.w) header.push(withUnit(s.name + ', half width of the band', data.y.unit));
    data.axes[s.axis].forEach(function(x, i) {
      if (!rows.has(x)) rows.set(x, [x]);
      rows.get(x)[width] = s.y[i];
      if (s.w) rows.get(x)[width + 1] = s.w[i];
    });
    width += s.w ? 2 : 1;
  });
  var sorted = Array.from(rows.values()).sort(function(a, b) { return a[0] - b[0]; });
  return table(header, sorted.map(function(row) { return Array.from({length: width}, function(_, k) { return row[k]; }); }));
}

// A drawing of the page on its own: with the words' style, on white.
function drawingSvg(svg) {
  var copy = svg.cloneNode(true), box = svg.viewBox.baseVal;
  copy.setAttribute('xmlns', 'http://www.w3.org/2000/svg');
  copy.setAttribute('font-family', 'Helvetica, Arial, DejaVu Sans, sans-serif');
  copy.setAttribute('font-size', '12');
  copy.setAttribute('width', box.width);
  copy.setAttribute('height', box.height);
  copy.setAttribute('style', 'background: #fff');
  return new XMLSerializer().serializeToString(copy);
}

function save(kind, name, parts) {
  if (kind === 'CSV') return window.unfurlSave(new Blob([parts.csv()], {type: 'text/csv'}), name + '.csv');
  var svg = parts.svg();
  if (kind === 'SVG') return window.unfurlSave(new Blob([svg], {type: 'image/svg+xml'}), name + '.svg');
  var image = new Image();
  image.onload = function() {
    var canvas = document.createElement('canvas'), pen = canvas.getContext('2d');
    canvas.width = 2 * image.width;  // sharp on paper and on dense screens
    canvas.height = 2 * image.height;
    pen.fillStyle = '#fff';
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(image, 0, 0, canvas.width, canvas.height);
    canvas.toBlob(function(blob) { window.unfurlSave(blob, name + '.png'); });
  };
  image.src = 'data:image/svg+xml;charset=utf-8,' + encodeURIComponent(svg);
}

function offer(figure, parts) {
  var heading = figure.querySelector('h2, h3'), title = heading ? heading.textContent : document.title;
  var row = document.createElement('div');
  row.className = 'exports';
  ['CSV', 'SVG', 'PNG'].forEach(function(kind) {
    if (!parts[kind === 'PNG' ? 'svg' : kind.toLowerCase()]) return;
    var button = document.createElement('button');
    button.type = 'button';
    button.textContent = kind;
    button.setAttribute('aria-label', kind + ' of ' + title);
    button.addEventListener('click', function() {
      save(kind, title.toLowerCase().replace(/[^a-z0-9]+/g, '-').replace(/^-|-$/g, '') || 'figure', parts);
    });
    row.appendChild(button);
  });
  figure.appendChild(row);
}

document.querySelectorAll('figure.chart').forEach(function(figure) {
  var block = figure.querySelector('script.chart-data'), chart = (window.unfurlChartsById || {})[block.dataset.plot];
  if (!chart) return;
  var data = JSON.parse(block.textContent);
  drawForPaper(block.dataset.plot, data, chart);
  offer(figure, {
    csv: function() { return chartCsv(data); },
    svg: function() { return chartSvg(figure.querySelector('h2, h3') ? figure.querySelector('h2, h3').textContent : '', data, chart); }
  });
});
document.querySelectorAll('figure.paths').forEach(function(figure) {
  var svg = figure.querySelector('svg[viewBox]'), block = figure.querySelector('script.figure-data');
  if (!svg) return;
  var parts = {svg: function() { return drawingSvg(svg); }};
  if (block) {
    parts.csv = function() {
      var data = JSON.parse(block.textContent), count = data.columns.length ? data.columns[0].length : 0, rows = [];
      for (var i = 0; i < count; i++) rows.push(data.columns.map(function(c) { return c[i]; }));
      return table(data.header, rows);
    };
  }
  offer(figure, parts);
});
})();
