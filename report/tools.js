// What the scripts of a page share.
(function() {
'use strict';

// Offers `blob` as a file, as a click on a link would.
window.unfurlSave = function(blob, name) {
  var link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(function() {
    URL.revokeObjectURL(link.href);
  }, 10000);
};

// A colour of the page's scheme by its name.
window.unfurlTone = function(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
};

// A curve's colour as it is seen on the page's ground; on paper it is the colour itself.
window.unfurlInk = function(color) {
  return window.unfurlTone('--s-' + color.slice(1)) || color;
};

// Before anything is printed the page takes paper's width and colours; a browser gives them only after scripts have
// drawn.
function toPaper(on) {
  document.documentElement.classList.toggle('printing', on);
  document.getElementById('paper').media = on ? 'all' : 'print';
}
window.addEventListener('beforeprint', function() { toPaper(true); });
window.addEventListener('afterprint', function() { toPaper(false); });

// Pixels of a canvas to one of the page's; a printer shows more than a screen.
window.unfurlFineness = function() {
  var screen = window.devicePixelRatio || 1;
  return document.documentElement.classList.contains('printing') ? Math.max(2, screen) : screen;
};

// Calls `draw` whenever the scheme of colours changes; `onPaper`: before and after printing, too.
window.unfurlWhenColoursChange = function(draw, onPaper) {
  if (onPaper) {
    window.addEventListener('beforeprint', draw);
    window.addEventListener('afterprint', draw);
  }
  if (window.matchMedia) window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
};

// Round values within [low, high]: 1, 2 or 5 times a power of ten apart, some `count` of them.
function evenTicks(low, high, count) {
  var raw = (high - low) / count, power = Math.pow(10, Math.floor(Math.log10(raw))), out = [];
  var step = [1, 2, 5, 10].map(function(f) { return f * power; }).find(function(s) { return s >= raw; });
  // Of a range of a few units in the last place k + 1 may be k.
  for (var k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && out.length < 100; k++) out.push(k * step);
  return out;
}

// On a logarithmic axis: 1, 2, 5 and 10 times a power of ten, powers of ten, or every so many of them, the most that
// `count` leaves room for; round values where the axis spans too little for two of those.
function logTicks(low, high, count) {
  function among(factors, every) {
    var out = [];
    for (var k = Math.floor(Math.log10(low)); k <= Math.log10(high) + 1e-9; k++) {
      if (k % every) continue;
      factors.forEach(function(f) {
        var v = +(f + 'e' + k);
        if (v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9)) out.push(v);
      });
    }
    return out;
  }
  var decades = Math.log10(high / low);
  // The nearest two decide: 1 and 2 are 0.3 of a power of ten apart.
  if (0.3 * count >= decades) {
    var close = among([1, 2, 5], 1);
    if (close.length > 2) return close;
    return evenTicks(low, high, count).filter(function(v) { return v > 0; });
  }
  return among([1], Math.ceil(decades / count));
}

window.unfurlTicks = function(low, high, log, count) {
  if (!(high > low) || !isFinite(high - low) || (log && !(low > 0))) return [];
  return log ? logTicks(low, high, Math.max(1, count)) : evenTicks(low, high, Math.max(1, count));
};

// What is wider than its frame says so, and can be scrolled by keys.
function markScrollers() {
  document.querySelectorAll('.table, .drawing').forEach(function(frame) {
    var wide = frame.scrollWidth > frame.clientWidth + 1;
    frame.classList.toggle('scrolls', wide);
    if (wide) frame.tabIndex = 0;
  });
}
markScrollers();
window.addEventListener('resize', markScrollers);
})();
