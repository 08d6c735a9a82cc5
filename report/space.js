// The controls of views in space: what is shown, the chosen point, keys, a still.
(function() {
'use strict';

function tidy(value) {
  return String(+value.toPrecision(4)).replace('-', '\u2212');
}

function Panel(block) {
  var id = block.dataset.plot, data = JSON.parse(block.textContent);
  var panel = document.getElementById(id), canvas = panel.querySelector('canvas');
  function part(name) {
    return panel.querySelector('.' + name);
  }
  var view = new window.UnfurlSpaceView(canvas, part('tags'), data);
  panel.classList.add('runs');
  var cloud = data.clouds.length ? 0 : -1, set = data.ellipsoids.length ? 0 : -1, times = data.magnification;
  var chosen = -1;

  function bar(name, scale) {
    var holder = document.createElement('div'), strip = document.createElement('div'), ends = document.createElement('div');
    holder.className = 'scale';
    strip.className = 'strip';
    strip.style.background = 'linear-gradient(to right,' + data.colors.join(',') + ')';
    ends.className = 'ends';
    var middle = scale.log ? Math.sqrt(scale.low * scale.high) : (scale.low + scale.high) / 2;
    [scale.low, middle, scale.high].forEach(function(value) {
      var end = document.createElement('span');
      end.textContent = tidy(value);
      ends.appendChild(end);
    });
    holder.append(name + ': ' + scale.title, strip, ends);
    part('scales').appendChild(holder);
  }

  function showScales() {
    part('scales').textContent = '';
    if (cloud >= 0) bar(data.clouds[cloud].name, data.clouds[cloud].scale);
    if (set >= 0) bar(data.ellipsoids[set].name, data.ellipsoids[set].scale);
  }

  function names(bits) {
    return data.eyes
        .filter(function(eye, e) {
          return bits >>> e & 1;
        })
        .map(function(eye) {
          return eye.name;
        })
        .join(', ');
  }

  function choose(i) {
    chosen = i;
    view.drawRays(cloud, i);
    view.soon();
    if (!part('scrub')) return;
    part('scrub').value = String(i);
    if (cloud < 0 || i < 0) {
      part('chosen').textContent = '';
      return;
    }
    var from = data.clouds[cloud], value = view.floats(from.values)[i];
    var words = [from.labels[i]];
    if (isFinite(value)) words.push(from.scale.title.replace(/ \[.*$/, '') + ' ' + tidy(value) + (from.scale.unit ? '\u2009' + from.scale.unit : ''));
    if (from.seen[i]) words.push('seen by ' + names(from.seen[i]));
    if (from.refused[i]) words.push('not believed: ' + names(from.refused[i]));
    part('chosen').textContent = words.join('  \u00b7  ');
    part('scrub').setAttribute('aria-valuetext', words.join(', '));
  }

  function showCloud(k) {
    cloud = k;
    view.drawCloud(k);
    view.drawEllipsoids(set, times, cloud >= 0);
    showScales();
    if (!part('scrub')) return;
    var count = k < 0 ? 0 : data.clouds[k].labels.length;
    part('scrub').max = String(Math.max(0, count - 1));
    part('scrub').disabled = count === 0;
    if (count === 0) return choose(-1);
    // The largest value is what one looks for first.
    var values = view.floats(data.clouds[k].values), most = 0;
    values.forEach(function(value, i) {
      if (value > values[most] || !isFinite(values[most])) most = i;
    });
    choose(most);
  }

  function showSet() {
    view.drawEllipsoids(set, times, cloud >= 0);
    showScales();
    view.soon();
  }

  function on(name, event, act) {
    if (part(name)) part(name).addEventListener(event, act);
  }
  on('clouds', 'change', function() {
    showCloud(+part('clouds').value);
  });
  on('sets', 'change', function() {
    set = +part('sets').value;
    showSet();
  });
  on('fields', 'change', function() {
    view.drawFields(part('fields').checked);
    view.soon();
  });
  on('curves', 'change', function() {
    view.drawCurves(part('curves').checked);
    view.soon();
  });
  on('scrub', 'input', function() {
    choose(+part('scrub').value);
  });
  on('home', 'click', view.home);
  on('still-button', 'click', function() {
    view.still().toBlob(function(blob) {
      window.unfurlSave(blob, id + '.png');
    });
  });
  if (part('magnify')) {
    [0.1, 0.2, 0.5, 1, 2, 5, 10].forEach(function(factor) {
      var value = +(factor * data.magnification).toPrecision(2);
      var option = new Option('\u00d7' + value, String(value), factor === 1, factor === 1);
      if (factor === 1 || value >= 1) part('magnify').add(option);
    });
    on('magnify', 'change', function() {
      times = +part('magnify').value;
      showSet();
    });
  }

  // A click that is no turning chooses the nearest point.
  var down = null;
  canvas.addEventListener('mousedown', function(mouse) {
    canvas.focus({preventScroll: true});
    down = [mouse.clientX, mouse.clientY];
  });
  canvas.addEventListener('click', function(mouse) {
    if (cloud < 0 || (down && Math.hypot(mouse.clientX - down[0], mouse.clientY - down[1]) > 3)) return;
    var box = canvas.getBoundingClientRect(), at = view.floats(data.clouds[cloud].at), best = -1, least = 14;
    for (var i = 0; 3 * i < at.length; i++) {
      var p = view.onScreen(new THREE.Vector3(at[3 * i], at[3 * i + 1], at[3 * i + 2]));
      var distance = Math.hypot(p.x - mouse.clientX + box.left, p.y - mouse.clientY + box.top);
      if (p.front && distance < least) {
        least = distance;
        best = i;
      }
    }
    if (best >= 0) choose(best);
  });
  canvas.addEventListener('focus', function() {
    view.controls.enableZoom = true;
  });
  canvas.addEventListener('blur', function() {
    view.controls.enableZoom = false;
  });
  var step = 5 * Math.PI / 180;
  var keys = {
    ArrowLeft: function() { view.turn(-step, 0, 1); },
    ArrowRight: function() { view.turn(step, 0, 1); },
    ArrowUp: function() { view.turn(0, step, 1); },
    ArrowDown: function() { view.turn(0, -step, 1); },
    '+': function() { view.turn(0, 0, 1.15); },
    '=': function() { view.turn(0, 0, 1.15); },
    '-': function() { view.turn(0, 0, 1 / 1.15); },
    n: function() { next(1); },
    p: function() { next(-1); },
    Home: view.home
  };
  function next(by) {
    if (cloud < 0) return;
    var count = data.clouds[cloud].labels.length;
    choose((chosen + by + count) % count);
  }
  canvas.addEventListener('keydown', function(key) {
    if (!keys[key.key] || key.ctrlKey || key.metaKey || key.altKey) return;
    keys[key.key]();
    key.preventDefault();
  });

  window.addEventListener('resize', view.soon);
  if (window.matchMedia) {
    window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', function() {
      view.recolor();
      choose(chosen);
    });
  }
  view.drawFields(true);
  view.drawCurves(true);
  showCloud(cloud);
  view.home();
  this.view = view;
  this.choose = choose;
  this.chosen = function() {
    return chosen;
  };
}

window.unfurlSpaces = [];
document.querySelectorAll('script.space-data').forEach(function(block) {
  try {
    window.unfurlSpaces.push(new Panel(block));
  } catch (error) {
    if (error.message !== 'no WebGL') throw error;  // without it the still stays
  }
});
})();
