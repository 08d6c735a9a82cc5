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
})();
