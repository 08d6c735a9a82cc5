#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace unfurl::data {
struct Provenance;
}

namespace unfurl::report {

// A page of panels as one HTML file that opens anywhere, without a network: the chart library, the
// style and the data are inside. It shows what it is given and knows nothing of what that means.
// All text is plain text; it is escaped here. The same calls give the same bytes.

// How a statement or a figure is coloured; each level has a sign of its own beside the colour.
enum class Level { kNeutral, kGood, kCare, kBad };

// Measured data are dots with a band, computed data a line: distinguishable without colour.
enum class Style { kLine, kDots, kDashes };

struct Axis {
  std::string label;  // "time"
  std::string unit;   // "s"; empty or "1" for none
  bool log = false;   // values <= 0 are left out
  // What the quantity cannot be below and above, where error bands end [unit].
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  // Of an axis that is no quantity: what stands where, instead of numbers; none on x [the axis'
  // unit].
  std::vector<std::pair<double, std::string>> names = {};
};

struct Series {
  std::string name;
  std::vector<double> x;  // rising; need not be shared between series [the axis' unit]
  std::vector<double> y;  // as many; NaN is a gap [the axis' unit]
  std::vector<double>
      half_width;  // of the error band around y, or empty; NaN: no band there [as y]
  Style style = Style::kLine;
  int color = -1;  // index into the palette of eight; -1: the next one
};

// A thin vertical line with words: an event in time, a peak in a spectrum.
struct Marker {
  double x = 0.0;  // [the axis' unit]
  std::string label;
  int color = -1;  // index into the palette; -1: grey
};

struct Chart {
  std::string title;
  std::string note;  // what is to be seen here, in a sentence or two; may be empty
  Axis x;
  Axis y;
  std::vector<Series> series;
  std::vector<Marker> markers;
  // Charts of one group zoom together along x; empty: alone. AddTimeSeries fills in "time".
  std::string group;
  int height_px = 280;
};

struct Table {
  std::string title;
  std::string note;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  // each as long as the header
  // Columns of text stand left, all others right; by default the first is text.
  std::vector<int> text_columns = {0};
};

// One large number with its name: "clearance", "0.005213 ± 0.000021 rad", "true 0.0052".
struct Figure {
  std::string name;
  std::string value;
  std::string note;
  Level level = Level::kNeutral;
};

struct Path {
  std::string name;
  std::vector<double> x;  // [axis unit]
  std::vector<double> y;  // NaN interrupts the line [the axis' unit]
  Style style = Style::kLine;
  int color = -1;
  bool ends = true;  // a ring where it starts, a disc where it ends
};

// Curves in a plane at equal scale, drawn as a still picture.
struct Paths {
  std::string title;
  std::string note;
  Axis x;
  Axis y;
  std::vector<Path> paths;
};

// A place with a value of its own, coloured by it; NaN: white.
struct MapDot {
  double x = 0.0, y = 0.0;  // [axis unit]
  double value = 0.0;       // [the map's unit]
  std::string label;        // shown under the pointer
  bool large = false;
};

struct MapPane {
  std::string title;  // "z = -0.7 m"
  std::vector<double>
      values;  // row by row from the lowest y, Map::columns each; NaN: left grey [the map's unit]
  std::vector<MapDot> dots;
};

// A quantity over a plane, by colour, in panes side by side (slices through a volume); still.
struct Map {
  std::string title;
  std::string note;
  Axis x, y, value;
  double x_low = 0.0, x_high = 1.0, y_low = 0.0,
         y_high = 1.0;  // what each pane spans [the axes' units]
  int columns = 0;      // of the grid of values
  // Ends of the colours; NaN: the least and the largest value.
  double low = std::numeric_limits<double>::quiet_NaN();   // [the map's unit]
  double high = std::numeric_limits<double>::quiet_NaN();  // [the map's unit]
  std::vector<MapPane> panes;
};

struct Motion;  // report/motion.h
struct Space;   // report/space.h

class Page {
 public:
  explicit Page(std::string title, std::string subtitle = {});

  // The statement in words, best first on a page. `details` are paragraphs.
  void AddWords(Level level, const std::string& headline,
                const std::vector<std::string>& details = {});
  // A heading between panels, with a paragraph that may be empty.
  void AddSection(const std::string& title, const std::string& words = {});
  void AddFigures(const std::vector<Figure>& figures);
  void AddTable(const Table& table);
  void AddTimeSeries(Chart chart);  // charts of time zoom together
  void AddSpectrum(Chart chart);    // so do spectra; logarithmic axes where the Axis says so
  void AddChart(const Chart& chart);
  void AddPaths(const Paths& paths);
  void AddMap(const Map& map);
  void AddMotion(Motion motion);  // its time is that of the charts of time
  void AddSpace(const Space& space);
  // `png` are the bytes of a PNG file; `alternative` says in words what it shows.
  void AddPicture(const std::string& title, const std::string& note,
                  std::span<const std::uint8_t> png, const std::string& alternative);
  // Who made the page, from what: name and value, at its foot.
  void AddOrigin(const std::string& name, const std::string& value);
  // The same of a whole record: program, command, inputs with their checksums.
  void AddOrigin(const data::Provenance& provenance);

  // A page that is written again and again while something goes on: the browser reads it again
  // every `every` [s], and says so when what it reads was `written` [s since 1970] too long ago.
  void FollowEvery(double every, double written);

  // Misuse (arrays of different lengths, x that falls, a row of the wrong length) throws Error when
  // it is added.
  std::string Html() const;
  void Write(const std::string& path) const;  // whole or not at all

 private:
  std::string title_;
  std::string subtitle_;
  std::string body_;  // with the place of each chart, whose size hangs on how many there are
  std::vector<Chart> charts_;  // in their order
  std::vector<std::pair<std::string, std::string>> origin_;
  double every_ = 0.0, written_ = 0.0;  // see FollowEvery [s]; 0: it is read once
  int drawings_ = 0;
  int motions_ = 0;
  int spaces_ = 0;
  int tables_ = 0;
};

}  // namespace unfurl::report
