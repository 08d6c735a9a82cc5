// How sharp a view in space is drawn while it moves: where a picture takes longer than a thirtieth
// of a second (graphics without a graphics card), with fewer pixels, and whole again at rest.
(function() {
'use strict';

var WANTED = 1000 / 30;  // [ms]
var MOVING = 250;        // from picture to picture at most, else the view was at rest [ms]
var COARSEST = 0.25;     // of the canvas' own pixels, along either side

// `draw` is called, without an argument, once the view is at rest.
function Pace(draw) {
  var share = 1, last = -Infinity, rest = 0;

  // Of the canvas' pixels: for a picture at `now` in a movement; none given: a picture at rest.
  this.share = function(now) {
    clearTimeout(rest);
    if (now === undefined) {
      share = 1;
      return share;
    }
    var took = now - last;
    last = now;
    if (took > MOVING) share = 1;
    // The time goes with the number of pixels, as far as it can be mended so.
    else if (took > WANTED) share = Math.max(COARSEST, 0.9 * Math.sqrt(WANTED / took) * share);
    if (share < 1) rest = setTimeout(draw, MOVING);
    return share;
  };
}

window.UnfurlPace = Pace;
})();
