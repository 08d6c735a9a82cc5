// Draws an instant of a moving picture: axes, bodies, beams, pins, marks and their paths.
(function() {
'use strict';

function floats(text) {
  var letters = atob(text);
  var bytes = new Uint8Array(letters.length);
  for (var i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

// The last index whose value is at most x; -1: none.
function before(xs, x) {
  var low = -1, high = xs.length;
  while (high - low > 1) {
    var middle = (low + high) >> 1;
    if (xs[middle] <= x)
      low = middle;
    else
      high = middle;
  }
  return low;
}

var tone = window.unfurlTone, ink = window.unfurlInk;

function short(value) {
  return String(+value.toPrecision(6)).replace('-', '\u2212');
}

// Of `data`, whose arrays it decodes, on `canvas`; `trails` says whether to draw the marks' paths.
function View(canvas, data, trails) {
  var context = canvas.getContext('2d');
  var t = floats(data.t);
  data.lines.forEach(function(l) {
    l.xy = floats(l.xy);
  });
  data.pins.forEach(function(p) {
    p.xy = floats(p.xy);
  });
  data.marks.forEach(function(m) {
    m.t = floats(m.t);
    m.xy = floats(m.xy);
  });
  var first = t[0], last = t[t.length - 1];
  // Steps of a frame are seen in the clock.
  var digits = Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(last - first))));
  var now = first, scale = 1, width = 0, height = 0;
  var pointer = null, seen = [];  // what is drawn and has a name

  // Points of a line at `now`, between the frames beside it.
  function pointsAt(xy, count) {
    var i = Math.max(0, Math.min(before(t, now), t.length - 2));
    var next = Math.min(i + 1, t.length - 1);
    var f = next > i ? Math.max(0, Math.min(1, (now - t[i]) / (t[next] - t[i]))) : 0;
    var out = new Array(2 * count), a = 2 * count * i, b = 2 * count * next;
    for (var k = 0; k < 2 * count; k++) out[k] = xy[a + k] + f * (xy[b + k] - xy[a + k]);
    return out;
  }

  // A beam with its distance from the chord multiplied.
  function bent(xy) {
    if (scale === 1) return xy;
    var n = xy.length / 2, out = new Array(xy.length);
    for (var k = 0; k < n; k++) {
      var s = n > 1 ? k / (n - 1) : 0;
      for (var c = 0; c < 2; c++) {
        var chord = xy[c] + s * (xy[2 * n - 2 + c] - xy[c]);
        out[2 * k + c] = chord + scale * (xy[2 * k + c] - chord);
      }
    }
    return out;
  }

  var margin = {left: 58, right: 14, top: 12, bottom: 40};
  function transform() {
    var w = width - margin.left - margin.right, h = height - margin.top - margin.bottom;
    var box = data.box, dx = box[1] - box[0], dy = box[3] - box[2];
    var k = Math.min(w / dx, h / dy);
    return {
      k: k,
      x: function(x) {
        return margin.left + w / 2 + k * (x - (box[0] + box[1]) / 2);
      },
      y: function(y) {
        return margin.top + h / 2 - k * (y - (box[2] + box[3]) / 2);
      },
      low: [(box[0] + box[1]) / 2 - w / 2 / k, (box[2] + box[3]) / 2 - h / 2 / k],
      high: [(box[0] + box[1]) / 2 + w / 2 / k, (box[2] + box[3]) / 2 + h / 2 / k]
    };
  }

  function stroke(xy, at) {
    context.beginPath();
    for (var k = 0; k < xy.length; k += 2) {
      if (k === 0)
        context.moveTo(at.x(xy[0]), at.y(xy[1]));
      else
        context.lineTo(at.x(xy[k]), at.y(xy[k + 1]));
    }
    context.stroke();
  }

  // Marks and joints take no more of the picture's area than thirty do, so that beams stay seen.
  var grain = Math.max(0.35, Math.min(1, Math.sqrt(30 / (data.marks.length + data.pins.length))));

  function disc(x, y, radius, fill, line) {
    context.beginPath();
    context.arc(x, y, radius * grain, 0, 2 * Math.PI);
    if (fill) {
      context.fillStyle = fill;
      context.fill();
    }
    if (line) {
      context.strokeStyle = line;
      context.stroke();
    }
  }

  function drawAxes(at) {
    context.font = '12px system-ui, "DejaVu Sans", sans-serif';
    context.lineWidth = 1;
    context.strokeStyle = tone('--line');
    context.fillStyle = tone('--soft');
    context.textAlign = 'center';
    context.textBaseline = 'top';
    window.unfurlTicks(at.low[0], at.high[0], false, Math.max(2, width / 110)).forEach(function(v) {
      var x = Math.round(at.x(v)) + 0.5;
      context.beginPath();
      context.moveTo(x, margin.top);
      context.lineTo(x, height - margin.bottom);
      context.stroke();
      context.fillText(short(v), x, height - margin.bottom + 5);
    });
    context.fillText(data.x, margin.left + (width - margin.left - margin.right) / 2, height - 17);
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    window.unfurlTicks(at.low[1], at.high[1], false, Math.max(2, height / 70)).forEach(function(v) {
      var y = Math.round(at.y(v)) + 0.5;
      context.beginPath();
      context.moveTo(margin.left, y);
      context.lineTo(width - margin.right, y);
      context.stroke();
      context.fillText(short(v), margin.left - 6, y);
    });
    context.save();
    context.translate(12, margin.top + (height - margin.top - margin.bottom) / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = 'center';
    context.fillText(data.y, 0, 0);
    context.restore();
  }

  function drawMarks(at) {
    data.marks.forEach(function(m) {
      var end = before(m.t, now);
      if (trails() && end > 0) {
        context.globalAlpha = 0.55;
        context.lineWidth = 1.2;
        context.strokeStyle = ink(m.color);
        if (m.measured) {
          for (var k = 0; k <= end; k++) {
            disc(at.x(m.xy[2 * k]), at.y(m.xy[2 * k + 1]), 1.2, ink(m.color), null);
          }
        } else {
          stroke(m.xy.subarray(0, 2 * end + 2), at);
        }
        context.globalAlpha = 1;
      }
      if (end < 0) return;
      // Straight between two samples; a gap in what was measured shows as one.
      var x = m.xy[2 * end], y = m.xy[2 * end + 1];
      var ahead = end + 1 < m.t.length ? m.t[end + 1] : Infinity;
      if (m.measured && ahead - m.t[end] > 3 * m.step && now - m.t[end] > m.step) return;
      if (ahead < Infinity) {
        var f = (now - m.t[end]) / (ahead - m.t[end]);
        x += f * (m.xy[2 * end + 2] - x);
        y += f * (m.xy[2 * end + 3] - y);
      }
      context.lineWidth = 2;
      if (m.measured) disc(at.x(x), at.y(y), 6, null, ink(m.color));
      else disc(at.x(x), at.y(y), 4, ink(m.color), null);
      seen.push({x: at.x(x), y: at.y(y), name: m.name});
    });
  }

  // The name of what the pointer is at.
  function drawName() {
    if (!pointer) return;
    var nearest = null, least = 14;  // pixels: a finger's or an unsteady hand's
    seen.forEach(function(s) {
      var d = Math.hypot(s.x - pointer.x, s.y - pointer.y);
      if (d <= least) nearest = s, least = d;
    });
    if (!nearest) return;
    var right = nearest.x < width / 2;
    write(nearest.name, nearest.x + (right ? 8 : -8), nearest.y - 20, right ? 'left' : 'right');
  }

  // On a piece of paper: what is drawn may pass there.
  function write(text, x, top, align) {
    context.font = '13px system-ui, "DejaVu Sans", sans-serif';
    context.textBaseline = 'top';
    context.textAlign = align;
    var w = context.measureText(text).width;
    context.fillStyle = tone('--paper');
    context.fillRect(align === 'left' ? x - 2 : x - w - 2, top - 2, w + 4, 17);
    context.fillStyle = tone('--ink');
    context.fillText(text, x, top);
  }

  function drawPins(at) {
    data.pins.forEach(function(p) {
      var xy = pointsAt(p.xy, 1), x = at.x(xy[0]), y = at.y(xy[1]);
      var latched = p.latched !== null && now >= p.latched;
      var touching = p.contacts.some(function(c) {
        return now >= c[0] && now <= c[1];
      });
      context.lineWidth = 1.6 * grain;
      seen.push({x: x, y: y, name: p.name});
      disc(x, y, 4.5, latched ? tone('--ink') : tone('--paper'), tone('--ink'));
      if (!touching) return;
      context.lineWidth = 2.5;
      disc(x, y, 9, null, ink('#d55e00'));
    });
  }

  function draw() {
    var ratio = window.unfurlFineness();
    width = canvas.clientWidth;
    height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = tone('--paper');
    context.fillRect(0, 0, width, height);
    var at = transform();
    drawAxes(at);
    context.save();
    context.beginPath();
    context.rect(
        margin.left, margin.top, width - margin.left - margin.right,
        height - margin.top - margin.bottom);
    context.clip();
    context.lineJoin = context.lineCap = 'round';
    data.lines.forEach(function(line) {
      var xy = pointsAt(line.xy, line.points);
      context.lineWidth = Math.max(1, (line.beam ? 3.5 : 2) * grain);
      context.strokeStyle = line.beam ? tone('--beam') : tone('--body');
      stroke(line.beam ? bent(xy) : xy, at);
      if (!line.beam) disc(at.x(xy[0]), at.y(xy[1]), 3, tone('--body'), null);
    });
    seen = [];
    drawPins(at);
    drawMarks(at);
    context.restore();
    drawName();
    write(
        't = ' + now.toFixed(digits) + ' s' + (scale === 1 ? '' : ', bending times ' + scale),
        margin.left + 8, margin.top + 6, 'left');
  }

  canvas.addEventListener('pointermove', function(event) {
    pointer = {x: event.offsetX, y: event.offsetY};
    draw();
  });
  canvas.addEventListener('pointerleave', function() {
    pointer = null;
    draw();
  });

  this.times = t;
  this.digits = digits;
  // At a time [s], with the bending of beams multiplied by `bending`.
  this.draw = function(time, bending) {
    now = time;
    scale = bending;
    draw();
  };
}

window.UnfurlMotionView = View;
})();
