// Builds and draws a view in space with three.js: a box with axes, eyes with what they see, points,
// ellipsoids, lines, and the rays to a chosen point.
(function() {
'use strict';

function floats(text) {
  var letters = atob(text);
  var bytes = new Uint8Array(letters.length);
  for (var i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

function tone(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// The palette of the page's charts (report/chart.cc).
var palette =
    ['#0072b2', '#d55e00', '#009e73', '#aa4499', '#e69f00', '#56b4e9', '#777777', '#8c564b'];

// A value's share of its scale, in [0, 1]; NaN stays NaN.
function share(scale, value) {
  var s = scale.log ? Math.log(value / scale.low) / Math.log(scale.high / scale.low) :
                      (value - scale.low) / (scale.high - scale.low);
  return Math.max(0, Math.min(1, s));
}

function View(canvas, tags, data) {
  var context = canvas.getContext('webgl', {antialias: true, alpha: true, preserveDrawingBuffer: true});
  if (!context) throw new Error('no WebGL');
  var renderer = new THREE.WebGLRenderer({canvas: canvas, context: context});
  renderer.setClearColor(0x000000, 0);
  var scene = new THREE.Scene();
  var camera = new THREE.PerspectiveCamera(32, 1, 0.01, 1000);
  camera.up.set(0, 0, 1);
  var controls = new THREE.OrbitControls(camera, canvas);
  controls.enableKeys = false;    // ours are below: they turn instead of shifting
  controls.enableZoom = false;    // until the view has the focus: a wheel scrolls the page
  controls.screenSpacePanning = true;
  scene.add(new THREE.AmbientLight(0xffffff, 0.78));
  var lamp = new THREE.DirectionalLight(0xffffff, 0.3);  // little: the colour is a value
  scene.add(lamp);

  var low = new THREE.Vector3().fromArray(data.low), high = new THREE.Vector3().fromArray(data.high);
  var middle = low.clone().add(high).multiplyScalar(0.5);
  var whole = new THREE.Box3(low.clone(), high.clone());
  data.eyes.forEach(function(eye) {
    whole.expandByPoint(new THREE.Vector3().fromArray(eye.at));
  });
  var size = whole.getSize(new THREE.Vector3()).length();
  camera.near = size / 500;
  camera.far = size * 20;

  var colors = data.colors.map(function(c) {
    return new THREE.Color(c);
  });
  function colorAt(scale, value) {
    var s = share(scale, value);
    if (!isFinite(s)) return new THREE.Color(0x9a9a9a);
    var k = Math.min(colors.length - 2, Math.floor(s * (colors.length - 1)));
    return colors[k].clone().lerp(colors[k + 1], s * (colors.length - 1) - k);
  }

  var parts = {};
  function put(name, object) {
    if (parts[name]) {
      scene.remove(parts[name]);
      parts[name].traverse(function(o) {
        if (o.geometry) o.geometry.dispose();
        if (o.material) o.material.dispose();
      });
    }
    parts[name] = object;
    if (object) scene.add(object);
  }

  function lines(positions, color, opacity, dashed) {
    var geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(positions, 3));
    var options = {color: color, transparent: opacity < 1, opacity: opacity};
    if (dashed) options.dashSize = options.gapSize = size / 90;
    var object = new THREE.LineSegments(
        geometry, dashed ? new THREE.LineDashedMaterial(options) : new THREE.LineBasicMaterial(options));
    if (dashed) object.computeLineDistances();
    return object;
  }

  function sheet(positions, color, opacity) {
    var geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(positions, 3));
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({
      color: color, transparent: true, opacity: opacity, side: THREE.DoubleSide, depthWrite: false
    }));
  }

  function corner(k) {
    return [k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z];
  }

  function drawBox() {
    var edges = [];
    for (var k = 0; k < 8; k++) {
      [1, 2, 4].forEach(function(bit) {
        if (!(k & bit)) edges = edges.concat(corner(k), corner(k | bit));
      });
    }
    put('box', lines(edges, tone('--soft'), 0.6));
  }

  function drawEyes() {
    var group = new THREE.Group();
    data.eyes.forEach(function(eye, e) {
      var body = new THREE.Mesh(
          new THREE.SphereBufferGeometry(size / 110, 14, 10),
          new THREE.MeshLambertMaterial({color: palette[e % palette.length]}));
      body.position.fromArray(eye.at);
      group.add(body);
    });
    put('eyes', group);
  }

  function drawFields(shown) {
    var group = new THREE.Group();
    data.eyes.forEach(function(eye, e) {
      var edges = [], faces = [], n = eye.field.length;
      eye.field.forEach(function(at, k) {
        var next = eye.field[(k + 1) % n];
        edges = edges.concat(eye.at, at, at, next);
        faces = faces.concat(eye.at, at, next);
      });
      if (!n) return;
      group.add(lines(edges, palette[e % palette.length], 0.35));
      group.add(sheet(faces, palette[e % palette.length], 0.035));
    });
    put('fields', shown ? group : null);
  }

  function drawCurves(shown) {
    var group = new THREE.Group();
    data.lines.forEach(function(line) {
      var at = floats(line.at), pairs = [];
      for (var k = 0; k + 5 < at.length; k += 3) {
        var pair = Array.from(at.subarray(k, k + 6));
        if (pair.every(isFinite)) pairs = pairs.concat(pair);
      }
      group.add(lines(pairs, line.color, 0.7));
    });
    put('curves', shown ? group : null);
  }

  var disc = (function() {
    var small = document.createElement('canvas'), pen = small.getContext('2d');
    small.width = small.height = 32;
    pen.fillStyle = '#fff';
    pen.arc(16, 16, 15, 0, 2 * Math.PI);
    pen.fill();
    return new THREE.CanvasTexture(small);
  })();

  function drawCloud(k) {
    if (k < 0 || !data.clouds[k]) return put('cloud', null);
    var cloud = data.clouds[k], values = floats(cloud.values), tones = [];
    values.forEach(function(value) {
      var c = colorAt(cloud.scale, value);
      tones.push(c.r, c.g, c.b);
    });
    var geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(floats(cloud.at), 3));
    geometry.setAttribute('color', new THREE.Float32BufferAttribute(tones, 3));
    var dot = (values.length > 800 ? 5 : 9) * (window.devicePixelRatio || 1);
    put('cloud', new THREE.Points(geometry, new THREE.PointsMaterial({
      size: dot, sizeAttenuation: false, vertexColors: THREE.VertexColors, map: disc, alphaTest: 0.5
    })));
  }

  // All ellipsoids of a set as one mesh: a ball's points through each one's three semi-axes. One
  // sees through them where there are points.
  function drawEllipsoids(k, times, through) {
    if (k < 0 || !data.ellipsoids[k]) return put('ellipsoids', null);
    var set = data.ellipsoids[k], at = floats(set.at), axes = floats(set.axes), values = floats(set.values);
    // Some ten thousand corners in all: more take a thirtieth of a second without a graphics card.
    var many = values.length > 60;
    var ball = new THREE.SphereBufferGeometry(1, many ? 8 : 14, many ? 6 : 10), unit = ball.attributes.position.array;
    var positions = [], normals = [], tones = [], indices = [], count = unit.length / 3;
    values.forEach(function(value, i) {
      var color = colorAt(set.scale, value), a = axes.subarray(9 * i, 9 * i + 9);
      var squared = [0, 1, 2].map(function(j) {
        return Math.max(1e-30, a[3 * j] * a[3 * j] + a[3 * j + 1] * a[3 * j + 1] + a[3 * j + 2] * a[3 * j + 2]);
      });
      for (var v = 0; v < count; v++) {
        var normal = new THREE.Vector3();
        for (var c = 0; c < 3; c++) {
          var x = 0, n = 0;
          for (var j = 0; j < 3; j++) {
            x += unit[3 * v + j] * a[3 * j + c];
            n += unit[3 * v + j] * a[3 * j + c] / squared[j];
          }
          positions.push(at[3 * i + c] + times * x);
          normal.setComponent(c, n);
        }
        normal.normalize();
        normals.push(normal.x, normal.y, normal.z);
        tones.push(color.r, color.g, color.b);
      }
      ball.index.array.forEach(function(index) {
        indices.push(i * count + index);
      });
    });
    var geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(positions, 3));
    geometry.setAttribute('normal', new THREE.Float32BufferAttribute(normals, 3));
    geometry.setAttribute('color', new THREE.Float32BufferAttribute(tones, 3));
    geometry.setIndex(new THREE.Uint32BufferAttribute(indices, 1));
    put('ellipsoids', new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({
      vertexColors: THREE.VertexColors, transparent: through, opacity: through ? 0.45 : 1, depthWrite: !through
    })));
  }

  // From each eye that sees point `i` of a cloud to it; dashed where it was not believed.
  function drawRays(k, i) {
    var cloud = data.clouds[k];
    if (!cloud || i < 0) return put('rays', null);
    var at = Array.from(floats(cloud.at).subarray(3 * i, 3 * i + 3)), group = new THREE.Group();
    data.eyes.forEach(function(eye, e) {
      var refused = cloud.refused[i] >>> e & 1;
      if (!(cloud.seen[i] >>> e & 1) && !refused) return;
      var color = palette[e % palette.length];
      group.add(lines(eye.at.concat(at), color, 1, refused));
      if (!eye.across.some(Number)) return;
      var sides = [1, -1].map(function(sign) {
        return at.map(function(x, c) {
          return x + sign * eye.across[c];
        });
      });
      group.add(sheet(eye.at.concat(sides[0], sides[1]), color, refused ? 0.08 : 0.2));
    });
    var ring = new THREE.Mesh(
        new THREE.SphereBufferGeometry(size / 160, 12, 8),
        new THREE.MeshBasicMaterial({color: tone('--ink'), transparent: true, opacity: 0.55}));
    ring.position.fromArray(at);
    group.add(ring);
    put('rays', group);
  }

  // Words stand beside the canvas, not in it: sharp at any size, and read by whoever reads.
  var words = [];
  function word(text, at, dark) {
    words.push({text: text, at: new THREE.Vector3().fromArray(at), strong: dark});
  }
  function number(x) {
    return String(+x.toPrecision(3)).replace('-', '\u2212');
  }
  // Along the edges that the first view has in front, a little outside of them.
  var air = low.distanceTo(high) * 0.05;
  [[0, 1, 0, -air, -air], [1, 3, air, 0, -air], [0, 4, -air, -air, 0]].forEach(function(edge, k) {
    var a = corner(edge[0]), b = corner(edge[1]);
    function at(s) {
      return a.map(function(x, c) {
        return x + s * (b[c] - x) + edge[2 + c];
      });
    }
    word(number(data.low[k]), at(0.05));
    word(number(data.high[k]), at(0.95));
    word('xyz'[k] + ' [' + data.unit + ']', at(0.5), true);
  });
  data.eyes.forEach(function(eye) {
    word(eye.name, [eye.at[0], eye.at[1], eye.at[2] + size / 40], true);
  });
  words.forEach(function(w) {
    w.tag = document.createElement('span');
    w.tag.textContent = w.text;
    if (w.strong) w.tag.className = 'strong';
    tags.appendChild(w.tag);
  });

  function onScreen(at) {
    var p = at.clone().project(camera);
    return {x: (p.x + 1) / 2 * canvas.clientWidth, y: (1 - p.y) / 2 * canvas.clientHeight, front: p.z < 1};
  }

  var pending = false, pace = new UnfurlPace(render);
  function render(now) {
    pending = false;
    var width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    var ratio = (window.devicePixelRatio || 1) * pace.share(now);
    renderer.setPixelRatio(ratio);
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
      renderer.setSize(width, height, false);
    }
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    lamp.position.copy(camera.position).add(new THREE.Vector3(0, 0, size / 2));
    renderer.render(scene, camera);
    words.forEach(function(w) {
      var p = onScreen(w.at);
      var inside = p.front && p.x > 0 && p.x < width && p.y > 0 && p.y < height;
      w.tag.style.display = inside ? '' : 'none';
      w.tag.style.transform = 'translate(-50%,-50%) translate(' + p.x.toFixed(1) + 'px,' + p.y.toFixed(1) + 'px)';
    });
  }
  function soon() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(render);
  }

  // From where the still is drawn (report/space_svg.cc), with all of it in view.
  function home() {
    var azimuth = -60 * Math.PI / 180, elevation = 25 * Math.PI / 180;
    var near = new THREE.Vector3(
        Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation));
    var right = new THREE.Vector3(-Math.sin(azimuth), Math.cos(azimuth), 0), up = near.clone().cross(right);
    var corners = [0, 1, 2, 3, 4, 5, 6, 7].map(corner);
    data.eyes.forEach(function(eye) {
      corners = corners.concat([eye.at], eye.field);
    });
    corners = corners.map(function(at) {
      return new THREE.Vector3().fromArray(at);
    });
    var ends = [right, up].map(function(axis) {
      var s = corners.map(function(at) {
        return at.dot(axis);
      });
      return [Math.min.apply(null, s), Math.max.apply(null, s)];
    });
    var target = right.clone().multiplyScalar((ends[0][0] + ends[0][1]) / 2);
    target.addScaledVector(up, (ends[1][0] + ends[1][1]) / 2);
    target.addScaledVector(near, middle.dot(near));
    var aspect = Math.max(0.2, canvas.clientWidth / Math.max(1, canvas.clientHeight));
    var slope = Math.tan(camera.fov * Math.PI / 360), far = 0;
    corners.forEach(function(at) {
      var off = at.clone().sub(target);
      var least = Math.max(Math.abs(off.dot(right)) / aspect, Math.abs(off.dot(up))) / slope + off.dot(near);
      far = Math.max(far, least);
    });
    controls.target.copy(target);
    camera.position.copy(target).addScaledVector(near, 1.05 * far);  // room for words
    controls.update();
    soon();
  }

  // By angles [rad], and nearer by a factor.
  function turn(round, up, nearer) {
    var s = new THREE.Spherical(), offset = camera.position.clone().sub(controls.target);
    s.setFromVector3(new THREE.Vector3(offset.x, offset.z, -offset.y));
    s.theta += round;
    s.phi = Math.max(0.01, Math.min(Math.PI - 0.01, s.phi - up));
    s.radius /= nearer;
    var o = new THREE.Vector3().setFromSpherical(s);
    camera.position.set(o.x, -o.z, o.y).add(controls.target);
    controls.update();
    soon();
  }

  function still() {
    render();
    var copy = document.createElement('canvas'), ratio = canvas.width / canvas.clientWidth;
    copy.width = canvas.width;
    copy.height = canvas.height;
    var pen = copy.getContext('2d');
    pen.fillStyle = tone('--paper');
    pen.fillRect(0, 0, copy.width, copy.height);
    pen.drawImage(canvas, 0, 0);
    pen.scale(ratio, ratio);
    pen.fillStyle = tone('--ink');
    pen.font = '12px system-ui, "DejaVu Sans", sans-serif';
    pen.textAlign = 'center';
    pen.textBaseline = 'middle';
    words.forEach(function(w) {
      var p = onScreen(w.at);
      if (p.front) pen.fillText(w.text, p.x, p.y);
    });
    return copy;
  }

  controls.addEventListener('change', soon);
  drawBox();
  drawEyes();
  this.middle = middle;
  this.controls = controls;
  this.drawFields = drawFields;
  this.drawCurves = drawCurves;
  this.drawCloud = drawCloud;
  this.drawEllipsoids = drawEllipsoids;
  this.drawRays = drawRays;
  this.recolor = drawBox;
  this.soon = soon;
  this.render = render;
  this.home = home;
  this.turn = turn;
  this.still = still;
  this.onScreen = onScreen;
  this.floats = floats;
}

window.UnfurlSpaceView = View;
})();
