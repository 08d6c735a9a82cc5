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

  function roomAround(xs, log) {
    if (xs.length === 0) return null;
    var low = xs[0], high = xs[xs.length - 1];
    if (log) {
      var air = high > low ? Math.pow(high / low, 0.015) : 1.1;
      return [low / air, high * air];
    }
    var half = Math.abs(low) * 0.1 || 0.5;
    return high > low ? null : [low - half, high + half];
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
        var low = y - w, high = y + w;
        if (data.y.least !== undefined) low = Math.max(low, data.y.least);
        if (data.y.most !== undefined) high = Math.min(high, data.y.most);
        // On a logarithmic axis a band that reaches zero ends far below, not nowhere.
        if (data.y.log && low <= 0) low = y * 1e-3;
        table[row.get(x)][k + 1] = bands ? [low, y, high] : y;
      });
    });
    // Rows without a value: room that a pad does not give, at both ends of a logarithmic axis and about a single place.
    var room = roomAround(xs, data.x.log);
    if (room) {
      var none = data.series.map(function () { return bands ? [null, null, null] : null; });
      table.unshift([room[0]].concat(none));
      table.push([room[1]].concat(none));
    }
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

  var markerFont = '11px system-ui, sans-serif', markerRow = 13, mostRows = 6;

  // Where each marker's words stand between `left` and `right` [px]: beside its line, in as many rows as keep them
  // apart; past the last row there is a line without words.
  function placeMarkers(markers, context, left, right, toX) {
    context.font = markerFont;
    var ends = [], out = [];
    markers.slice().sort(function (a, b) { return a.x - b.x; }).forEach(function (m) {
      var x = Math.round(toX(m.x)) + 0.5;
      if (!(x >= left && x <= right)) return;
      var width = context.measureText(m.label).width + 8;
      var flipped = x + width > right;
      var from = flipped ? x - width : x, row = 0;
      while (row < ends.length && ends[row] > from) row++;
      if (row < mostRows) ends[row] = from + width;
      out.push({x: x, label: m.label, color: window.unfurlInk(m.color), flipped: flipped, row: row});
    });
    return {places: out, rows: ends.length};
  }
  window.unfurlPlaceMarkers = function (markers, left, right, toX) {
    return placeMarkers(markers, document.createElement('canvas').getContext('2d'), left, right, toX).places.map(function (m) {
      return {x: m.x, label: m.row < mostRows ? m.label : '', flipped: m.flipped, below: 3 + markerRow * m.row};
    });
  };

  // Vertical lines with words at their top.
  function drawMarkers(markers, context, area, g) {
    context.save();
    context.textBaseline = 'top';
    var placed = placeMarkers(markers, context, area.x, area.x + area.w, function (x) {
      return area.x + g.toPercentXCoord(x) * area.w;
    }).places;
    placed.forEach(function (m) {
      context.globalAlpha = 0.55;
      context.strokeStyle = m.color;
      context.setLineDash([3, 3]);
      context.beginPath();
      context.moveTo(m.x, area.y);
      context.lineTo(m.x, area.y + area.h);
      context.stroke();
    });
    context.globalAlpha = 1;
    context.setLineDash([]);
    context.lineWidth = 3;
    context.lineJoin = 'round';
    context.strokeStyle = window.unfurlTone('--paper');
    placed.forEach(function (m) {
      if (m.row >= mostRows) return;
      var x = m.flipped ? m.x - 4 : m.x + 4, y = area.y + 3 + markerRow * m.row;
      context.textAlign = m.flipped ? 'right' : 'left';
      context.strokeText(m.label, x, y);  // the lines of others stop at the words
      context.fillStyle = m.color;
      context.fillText(m.label, x, y);
    });
    context.restore();
  }

  // Room above the curves for the words of all markers, before anything is drawn [px].
  function roomForMarkers(data, xs, width) {
    if (data.markers.length === 0) return 0;
    var low = xs[0], high = xs[xs.length - 1], log = data.x.log;
    var share = function (x) { return log ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low); };
    var context = document.createElement('canvas').getContext('2d');
    var rows = placeMarkers(data.markers, context, 0, width, function (x) { return share(x) * width; }).rows;
    return rows ? 7 + markerRow * rows : 0;
  }

  var few = 60;      // nobody finds so few dots where each has three pixels
  var single = 12;   // nor what a line makes of one value, or of some far apart
  function seriesOptions(s, count) {
    var color = window.unfurlInk(s.color);
    if (s.style === 'dots') {
      return {color: color, strokeWidth: 0, drawPoints: true, pointSize: count < few ? 4 : count < 8 * few ? 2.4 : 1.6};
    }
    var dashed = s.style === 'dashes';
    return {color: color, strokeWidth: 1.6, strokePattern: dashed ? [7, 4] : null,
            drawPoints: !dashed && count <= single, pointSize: 3};
  }

  // Ticks of a logarithmic axis; dygraphs' own are 3, 40, 500.
  function logTicker(low, high, pixels, options) {
    return window.unfurlTicks(low, high, true, pixels / options('pixelsPerLabel')).map(function (v) {
      return {v: v, label: tidy(v, 0)};
    });
  }

  // What the numbers beside the y axis need, and no less than all charts have.
  function labelRoom(chart, least) {
    var context = document.createElement('canvas').getContext('2d'), most = least;
    chart.graphDiv.querySelectorAll('.dygraph-axis-label-y').forEach(function (label) {
      context.font = getComputedStyle(label).font;
      most = Math.max(most, Math.ceil(context.measureText(label.textContent).width) + 24);  // a tick, and a letter's height of title
    });
    return most;
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
    var narrow = holder.clientWidth < 480, labelWidth = narrow ? 46 : 64;
    var xs = merged.table.map(function (row) { return row[0]; });
    var above = roomForMarkers(data, xs, holder.clientWidth - labelWidth - 24);
    var xAxis = {logscale: data.x.log, axisLabelFormatter: ticks('x'), pixelsPerLabel: narrow ? 45 : 70};
    var yAxis = {logscale: data.y.log, axisLabelFormatter: ticks('y'), axisLabelWidth: labelWidth, pixelsPerLabel: 26};
    if (data.x.log) xAxis.ticker = logTicker;
    if (data.y.log) yAxis.ticker = logTicker;
    if (data.y.names) {
      yAxis.ticker = function () { return data.y.names.map(function (n) { return {v: n[0], label: n[1].replace(/[<>&]/g, '')}; }); };
    }
    function unit(text) { return text ? '\u2009' + text : ''; }
    var all = {
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
      axisLineColor: window.unfurlTone('--soft'),
      gridLineColor: window.unfurlTone('--line'),
      highlightCircleSize: 3,
      animatedZooms: false,
      yRangePad: 8 + above + (data.y.names ? 16 : 0),  // rows stand clear of the frame
      xRangePad: data.x.log ? 0 : 4,  // a pad would take a logarithmic axis below zero
      logscale: false,
      axes: {x: xAxis, y: yAxis},
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
    };
    var chart = new Dygraph(holder, merged.table, all);
    yAxis.axisLabelWidth = labelRoom(chart, labelWidth);
    if (yAxis.axisLabelWidth > labelWidth) {  // made anew: a narrower plot leaves what was drawn beside it
      chart.destroy();
      chart = new Dygraph(holder, merged.table, all);
    }
    window.unfurlWhenColoursChange(function () {
      var series = {};
      data.series.forEach(function (s, k) { series['s' + k] = seriesOptions(s, data.axes[s.axis].length); });
      chart.updateOptions({series: series, axisLineColor: window.unfurlTone('--soft'), gridLineColor: window.unfurlTone('--line')});
    });
    return chart;
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
})();
