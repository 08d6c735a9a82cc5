// Draws the page's charts from the data blocks beside them.
(function () {
  'use strict';

  // A tick or a value without the noise of binary fractions.
  function tidy(value, scale) {
    if (Math.abs(value) < 1e-9 * scale) return '0';
    var text = Math.abs(value) < 1e-4 ? value.toExponential(6).replace(/\.?0*e/, 'e')
      : String(+value.toPrecision(7));
    return text.replace('-', '\u2212').replace('e\u2212', 'e-');
  }

  // Places x series of their own stamps on one rising axis. A missing value (null) is bridged by
  // its series' line, a NaN breaks it.
  function merge(data) {
    var stamps = new Set();
    data.series.forEach(function (s) {
      data.axes[s.axis].forEach(function (x) { if (!data.x.log || x > 0) stamps.add(x); });
    });
    var xs = Array.from(stamps).sort(function (a, b) { return a - b; });
    var row = new Map();
    var bands = data.series.some(function (s) { return s.w; });
    var table = xs.map(function (x, i) {
      row.set(x, i);
      var cells = [x];
      data.series.forEach(function () { cells.push(bands ? [null, null, null] : null); });
      return cells;
    });
    data.series.forEach(function (s, k) {
      data.axes[s.axis].forEach(function (x, i) {
        if (data.x.log && x <= 0) return;
        var y = s.y[i] === null || (data.y.log && s.y[i] <= 0) ? NaN : s.y[i];
        var w = s.w && s.w[i] !== null ? s.w[i] : 0;
        var low = y - w;
        // On a logarithmic axis a band that reaches zero ends far below, not nowhere.
        if (data.y.log && low <= 0) low = y * 1e-3;
        table[row.get(x)][k + 1] = bands ? [low, y, y + w] : y;
      });
    });
    return {table: table, bands: bands};
  }

  function nearest(xs, x) {
    var low = 0, high = xs.length - 1;
    while (high - low > 1) {
      var middle = (low + high) >> 1;
      if (xs[middle] < x) low = middle; else high = middle;
    }
    return x - xs[low] <= xs[high] - x ? low : high;
  }

  // Vertical lines with words at their top, in as many rows as keep them apart.
  function drawMarkers(markers, context, area, g) {
    context.save();
    context.font = '11px system-ui, sans-serif';
    context.textBaseline = 'top';
    var ends = [];
    markers.slice().sort(function (a, b) { return a.x - b.x; }).forEach(function (m) {
      var x = Math.round(area.x + g.toPercentXCoord(m.x) * area.w) + 0.5;
      if (!(x >= area.x && x <= area.x + area.w)) return;
      var width = context.measureText(m.label).width + 8;
      var flipped = x + width > area.x + area.w;
      var left = flipped ? x - width : x;
      var line = 0;
      while (line < ends.length && ends[line] > left) line++;
      ends[line] = left + width;
      context.globalAlpha = 0.55;
      context.strokeStyle = m.color;
      context.setLineDash([3, 3]);
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
      context.globalAlpha = 1;
      context.fillStyle = m.color;
      context.textAlign = flipped ? 'right' : 'left';
      context.fillText(m.label, flipped ? x - 4 : x + 4, area.y + 3 + 13 * line);
    });
    context.restore();
  }

  function seriesOptions(s, count) {
    if (s.style === 'dots') {
      var few = count < 60;  // nobody finds single dots of three pixels
      return {color: s.color, strokeWidth: 0, drawPoints: true, pointSize: few ? 4 : 1.6};
    }
    return {color: s.color, strokeWidth: 1.6, strokePattern: s.style === 'dashes' ? [7, 4] : null};
  }

  function draw(block) {
    var data = JSON.parse(block.textContent);
    var id = block.dataset.plot;
    var holder = document.getElementById(id);
    var readout = document.getElementById(id + '-readout');
    var merged = merge(data);
    if (merged.table.length === 0) {
      holder.textContent = 'No data.';
      return null;
    }
    var options = {};
    data.series.forEach(function (s, k) { options['s' + k] = seriesOptions(s, data.axes[s.axis].length); });
    function ticks(axis) {
      return function (value, granularity, opts, g) {
        var range = axis === 'x' ? g.xAxisRange() : g.yAxisRange();
        return tidy(value, Math.abs(range[1] - range[0]));
      };
    }
    function unit(text) { return text ? '\u2009' + text : ''; }
    return new Dygraph(holder, merged.table, {
      labels: ['x'].concat(data.series.map(function (s, k) { return 's' + k; })),
      series: options,
      customBars: merged.bands,
      fillAlpha: 0.2,
      connectSeparatedPoints: true,
      legend: 'never',
      xlabel: data.x.title.replace(/[<>&]/g, ''),
      ylabel: data.y.title.replace(/[<>&]/g, ''),
      xLabelHeight: 20,
      yLabelWidth: 20,
      axisLabelFontSize: 12,
      axisLineColor: tone('--soft'),
      gridLineColor: tone('--line'),
      highlightCircleSize: 3,
      animatedZooms: false,
      yRangePad: 8 + (data.markers.length ? 20 : 0),
      xRangePad: data.x.log ? 0 : 4,  // a pad would take a logarithmic axis below zero
      logscale: false,
      axes: {
        x: {logscale: data.x.log, axisLabelFormatter: ticks('x'), pixelsPerLabel: 70},
        y: {logscale: data.y.log, axisLabelFormatter: ticks('y'), axisLabelWidth: 64, pixelsPerLabel: 26}
      },
      underlayCallback: function (context, area, g) {
        drawMarkers(data.markers, context, area, g);
      },
      highlightCallback: function (event, x) {
        var words = [tidy(x, 0) + unit(data.x.unit)];
        data.series.forEach(function (s, k) {
          var xs = data.axes[s.axis];
          if (xs.length === 0) return;
          var i = nearest(xs, x);
          if (s.y[i] === null) return;
          var word = s.name + ' ' + tidy(s.y[i], 0);
          if (s.w && s.w[i]) word += ' \u00b1 ' + tidy(s.w[i], 0);
          words.push(word + unit(data.y.unit));
        });
        readout.textContent = words.join('  \u00b7  ');
      },
      unhighlightCallback: function () { readout.textContent = ''; }
    });
  }

  function tone(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  var charts = {};
  var groups = {};
  document.querySelectorAll('script.chart-data').forEach(function (block) {
    var chart = draw(block);
    if (!chart) return;
    charts[block.dataset.plot] = chart;
    var group = JSON.parse(block.textContent).group;
    if (group) (groups[group] = groups[group] || []).push(chart);
  });
  Object.keys(groups).forEach(function (name) {
    if (groups[name].length > 1) {
      Dygraph.synchronize(groups[name], {zoom: true, range: false, selection: false});
    }
  });
  window.unfurlCharts = groups;  // by name, for what moves with them
  window.unfurlChartsById = charts;
  document.querySelectorAll('button.key').forEach(function (key) {
    key.addEventListener('click', function () {
      var chart = charts[key.dataset.plot];
      if (!chart) return;
      var hidden = key.classList.toggle('hidden');
      chart.setVisibility(+key.dataset.series, !hidden);
    });
  });
  // A printed page is narrower than the window.
  window.addEventListener('beforeprint', function () {
    Object.keys(charts).forEach(function (id) { charts[id].resize(); });
  });
})();
