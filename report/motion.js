// Plays moving pictures, and keeps the charts of time at the same instant.
(function() {
'use strict';

function Player(block) {
  var id = block.dataset.plot;
  var data = JSON.parse(block.textContent);
  var panel = document.getElementById(id);
  var canvas = panel.querySelector('canvas');
  var part = function(name) {
    return panel.querySelector('.' + name);
  };
  var view = new window.UnfurlMotionView(canvas, data, function() {
    return part('trails').checked;
  });
  var t = view.times, first = t[0], last = t[t.length - 1], digits = view.digits;
  var now = first, playing = false, stamp = 0, scale = 1, recorder = null;
  var linked = [];

  function draw() {
    view.draw(now, scale);
  }

  function showTime() {
    part('scrub').value = String((now - first) / (last - first || 1));
    part('scrub').setAttribute('aria-valuetext', now.toFixed(digits) + ' seconds');
    part('clock').textContent = now.toFixed(digits) + '\u2009s';
    linked.forEach(function(link) {
      var x = link.chart.toDomXCoord(now), area = link.chart.getArea();
      var inside = x >= area.x && x <= area.x + area.w;
      link.line.style.display = inside ? 'block' : 'none';
      if (!inside) return;
      link.line.style.left = x + 'px';
      link.line.style.top = area.y + 'px';
      link.line.style.height = area.h + 'px';
    });
  }

  function seek(time) {
    now = Math.max(first, Math.min(last, time));
    draw();
    showTime();
  }

  function play(on) {
    playing = on;
    part('play').textContent = on ? '\u275a\u275a Pause' : '\u25b6 Play';
    if (!on) {
      if (recorder) recorder.stop();
      return;
    }
    if (now >= last) now = first;
    stamp = performance.now();
    requestAnimationFrame(step);
  }

  function step(clock) {
    if (!playing) return;
    seek(now + (clock - stamp) / 1000 * +part('speed').value);
    stamp = clock;
    if (now >= last && data.loops && !recorder) now = first;
    if (now >= last)
      play(false);
    else
      requestAnimationFrame(step);
  }

  function film() {
    var pieces = [];
    recorder = new MediaRecorder(canvas.captureStream(30), {mimeType: 'video/webm'});
    recorder.ondataavailable = function(event) {
      pieces.push(event.data);
    };
    recorder.onstop = function() {
      recorder = null;
      window.unfurlSave(new Blob(pieces, {type: 'video/webm'}), id + '.webm');
    };
    recorder.start();
    now = first;
    play(true);
  }

  // The event after `now`, or the one before it.
  function event(ahead) {
    var times = data.events.map(function(e) {
      return e.x;
    });
    var gap = 1e-6 * (last - first);
    var wanted = ahead ? times.find(function(x) {
      return x > now + gap;
    }) :
                         times.slice().reverse().find(function(x) {
                           return x < now - gap;
                         });
    play(false);
    seek(wanted === undefined ? (ahead ? last : first) : wanted);
  }

  part('play').addEventListener('click', function() {
    play(!playing);
  });
  part('previous').addEventListener('click', function() {
    event(false);
  });
  part('next').addEventListener('click', function() {
    event(true);
  });
  part('scrub').addEventListener('input', function() {
    play(false);
    seek(first + +part('scrub').value * (last - first));
  });
  part('bending').addEventListener('change', function() {
    scale = +part('bending').value;
    draw();
  });
  part('trails').addEventListener('change', draw);
  part('still').addEventListener('click', function() {
    canvas.toBlob(function(blob) {
      window.unfurlSave(blob, id + '-' + now.toFixed(digits) + 's.png');
    });
  });
  if (window.MediaRecorder && canvas.captureStream)
    part('film').addEventListener('click', film);
  else
    part('film').disabled = true;
  canvas.addEventListener('keydown', function(key) {
    var frame = (last - first) / Math.max(1, t.length - 1);
    if (key.key === ' ')
      play(!playing);
    else if (key.key === 'ArrowRight')
      seek(now + frame);
    else if (key.key === 'ArrowLeft')
      seek(now - frame);
    else if (key.key === 'n')
      event(true);
    else if (key.key === 'p')
      event(false);
    else
      return;
    key.preventDefault();
  });

  // Speeds around the one at which the whole takes some eight seconds; of a period one.
  var wanted = Math.log10((last - first) / (data.loops ? 1.5 : 8)), best = null;
  for (var power = Math.floor(wanted) - 1; power <= Math.ceil(wanted) + 1; power++) {
    [1, 2, 5].forEach(function(k) {
      var value = +(k * Math.pow(10, power)).toPrecision(1);
      var option = new Option('\u00d7' + value, String(value));
      part('speed').add(option);
      if (best === null || Math.abs(Math.log10(value) - wanted) < Math.abs(Math.log10(+best.value) - wanted)) {
        best = option;
      }
    });
  }
  best.selected = true;

  // A line in each chart of time; a click there comes here.
  var charts = (window.unfurlCharts && window.unfurlCharts[data.group]) || [];
  charts.forEach(function(chart) {
    var holder = chart.graphDiv, line = document.createElement('div');
    line.className = 'instant';
    holder.appendChild(line);
    linked.push({chart: chart, line: line});
    var down = 0;
    holder.addEventListener('mousedown', function(mouse) {
      down = mouse.clientX;
    });
    holder.addEventListener('mouseup', function(mouse) {
      if (Math.abs(mouse.clientX - down) > 3) return;
      play(false);
      seek(chart.toDataXCoord(mouse.clientX - holder.getBoundingClientRect().left));
    });
    chart.ready(showTime);
    // Charts that zoom together do so by this call back, too.
    var before = chart.getOption('drawCallback');
    chart.updateOptions({drawCallback: function(drawn, initial) {
      if (before) before(drawn, initial);
      showTime();
    }}, true);
  });

  window.addEventListener('resize', function() {
    draw();
    showTime();
  });
  window.unfurlWhenColoursChange(draw, true);
  panel.classList.add('runs');
  seek(first);
  this.seek = seek;
  this.time = function() {
    return now;
  };
}

window.unfurlPlayers = [];
document.querySelectorAll('script.motion-data').forEach(function(block) {
  window.unfurlPlayers.push(new Player(block));
});
})();
