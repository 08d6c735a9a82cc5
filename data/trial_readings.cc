#include "data/trial_readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "data/trial.h"

namespace unfurl::data {
namespace {

constexpr double kTrialReadingsNone = std::numeric_limits<double>::quiet_NaN();

// Flashes by time, then by slot in order of appearance; of each and by camera its readings.
class Flashes {
 public:
  using Key = std::pair<double, std::int32_t>;
  using Flash = std::map<std::size_t, std::vector<CellReading>>;  // readings by camera

  explicit Flashes(const CsvTable& table)
      : table_(table), time_(table.Require("time", "s")), mark_(table.Find("mark")) {
    if (mark_ >= 0) table.Require("mark", "");
    for (const std::string& comment : table.comments()) {
      if (comment.starts_with("marks:")) ReadMarks(comment.substr(6));
    }
  }

  Flash& At(std::size_t row) {
    const double t = table_.Number(row, time_);
    std::string name = mark_ >= 0 ? table_.Text(row, mark_) : "";
    const bool named = !name.empty();
    if (!named) {
      if (all_.empty()) {
        throw Error("a flash without its mark", table_.Where(row, std::max(mark_, 0)),
                    "name it, or state which marks are lit together: # marks: tip, root");
      }
      name = all_;
    } else if (const std::vector<std::string> marks = MarksOfSlot(name);
               HasRepeated(marks) || std::count(marks.begin(), marks.end(), "") > 0) {
      throw Error(fmt::format("'{}' names a mark twice, or none", name), table_.Where(row, mark_),
                  "join names of marks that are lit together by '+'");
    }
    const auto [other, first] = named_at_.insert({t, named});
    if (!first && other->second != named) {
      throw Error(fmt::format("at {} s some readings have a mark and some have none", t),
                  table_.Where(row, mark_),
                  "name the marks of all readings of a moment, or of none");
    }
    return flashes_[{t, SlotOf(name)}];
  }

  void Add(std::size_t row, int u_column, int s_column, std::size_t camera,
           const std::string& name) {
    Flash& flash = At(row);
    const CellReading cell = ReadReading(table_, row, u_column, s_column);
    if (std::isnan(cell.u_px)) return;
    std::vector<CellReading>& list = flash[camera];
    for (const CellReading& other : list) {
      if (other.u_px != cell.u_px) continue;
      throw Error(fmt::format("a reading of camera '{}' comes twice", name),
                  table_.Where(row, u_column), "give each reading once");
    }
    if (list.size() == kMostReadings) {
      throw Error(
          fmt::format("camera '{}' has more than {} readings in one flash", name, kMostReadings),
          table_.Where(row, u_column), "leave out the faint ones");
    }
    list.push_back(cell);
    most_ = std::max(most_, list.size());
  }

  void Fill(TrialReadings* out) const {
    out->slots = slots_;
    out->most = most_;
    const std::size_t cameras = out->cameras.size();
    out->u_px.assign(flashes_.size() * cameras * most_, kTrialReadingsNone);
    out->s_px = out->u_px;
    for (const auto& [key, flash] : flashes_) {
      const std::size_t at = out->size();
      out->t.push_back(key.first);
      out->slot.push_back(key.second);
      for (const auto& [camera, list] : flash) {
        for (std::size_t k = 0; k < list.size(); ++k) {
          out->u_px[(at * cameras + camera) * most_ + k] = list[k].u_px;
          out->s_px[(at * cameras + camera) * most_ + k] = list[k].s_px;
        }
      }
    }
  }

 private:
  static bool HasRepeated(const std::vector<std::string>& names) {
    return std::set<std::string>(names.begin(), names.end()).size() != names.size();
  }
  void ReadMarks(const std::string& text) {
    std::vector<std::string> marks;
    for (const std::string& mark : Split(text, ',')) marks.emplace_back(Trim(mark));
    if (HasRepeated(marks) || std::count(marks.begin(), marks.end(), "") > 0) {
      throw Error("names a mark twice, or none", table_.path() + ": # marks",
                  "list the marks that are lit together, as in '# marks: tip, root'");
    }
    all_ = marks[0];
    for (std::size_t k = 1; k < marks.size(); ++k) all_ += "+" + marks[k];
  }
  std::int32_t SlotOf(const std::string& name) {
    const auto [at, fresh] = number_.insert({name, static_cast<std::int32_t>(slots_.size())});
    if (fresh) slots_.push_back(name);
    return at->second;
  }
  const CsvTable& table_;
  int time_, mark_;
  std::string all_;  // slot of flashes that name no mark
  std::vector<std::string> slots_;
  std::map<std::string, std::int32_t> number_;
  std::map<Key, Flash> flashes_;
  std::map<double, bool> named_at_;
  std::size_t most_ = 1;
};

TrialReadings ReadTrialReadingsCsv(const std::string& path) {
  const CsvTable table = CsvTable::Load(path);
  TrialReadings out;
  Flashes flashes(table);
  if (table.Find("camera") >= 0) {
    const int camera = table.Require("camera", "");
    const int u = table.Require("u", "px"), s = table.Require("s", "px");
    std::map<std::string, std::size_t> number;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::string name = table.Text(row, camera);
      if (name.empty() && table.Empty(row, u) && table.Empty(row, s)) {
        flashes.At(row);  // that nobody saw
        continue;
      }
      const auto [at, fresh] = number.insert({name, out.cameras.size()});
      if (fresh) out.cameras.push_back(name);
      flashes.Add(row, u, s, at->second, name);
    }
    out.pixels = ReadPixels(table, out.cameras.size());
  } else {
    ReadingColumns columns = FindReadingColumns(table);
    if (columns.u.empty()) {
      throw Error("holds no readings", path,
                  "add columns 'u1 [px]', 's1 [px]', ..., or 'camera', 'u [px]', 's [px]'");
    }
    NameCameras(table, &columns);
    out.cameras = columns.cameras;
    out.pixels = columns.pixels;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      for (std::size_t c = 0; c < columns.u.size(); ++c) {
        flashes.Add(row, columns.u[c], columns.s[c], c, columns.cameras[c]);
      }
    }
  }
  flashes.Fill(&out);
  return out;
}

void RefuseShapes(const H5Reader& file, const TrialReadings& out) {
  const std::size_t n = out.size(), c = out.cameras.size();
  const std::vector<std::size_t> dims = file.Dims("/u");
  const bool flat = dims == std::vector<std::size_t>{n, c};
  const bool deep = dims.size() == 3 && dims[0] == n && dims[1] == c && dims[2] >= 1;
  const auto refuse = [&](bool whole, const char* name) {
    if (whole) return;
    file.Fail("does not have the size that the flashes and cameras ask for", name,
              "make the file again");
  };
  refuse(out.slot.size() == n, "/slot");
  refuse(out.pixels.empty() || out.pixels.size() == c, "/pixels");
  refuse(flat || deep, "/u");
  refuse(file.Dims("/s") == dims, "/s");
  if (deep && dims[2] > kMostReadings) {
    file.Fail(fmt::format("holds {} readings of a camera in one flash", dims[2]), "/u",
              fmt::format("leave out the faint ones: {} are looked at", kMostReadings));
  }
}

void RefuseFlashes(const H5Reader& file, const TrialReadings& out) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!std::isfinite(out.t[i]) || (i > 0 && out.t[i] < out.t[i - 1])) {
      file.Fail(fmt::format("flash {} is at {} s, before another or never", i + 1, out.t[i]), "/t",
                "give flashes in order of time");
    }
    if (out.slot[i] < 0 || static_cast<std::size_t>(out.slot[i]) >= out.slots.size()) {
      file.Fail(fmt::format("flash {} names slot {} of {}", i + 1, out.slot[i], out.slots.size()),
                "/slot", "make the file again");
    }
  }
  for (std::size_t k = 0; k < out.u_px.size(); ++k) {
    const double u = out.u_px[k], s = out.s_px[k];
    if (std::isnan(u) && std::isnan(s)) continue;
    if (std::isfinite(u) && IsReadingSigma(s)) continue;
    const std::size_t cell = k / out.most;
    file.Fail(
        fmt::format("flash {}, camera '{}': reading {} px with sigma {} px",
                    cell / out.cameras.size() + 1, out.cameras[cell % out.cameras.size()], u, s),
        "/s", "give each reading its standard deviation in pixels, or NaN for both");
  }
}

// Readings first, gaps last; each reading once.
void Pack(const H5Reader& file, TrialReadings* out) {
  for (std::size_t first = 0; first < out->u_px.size(); first += out->most) {
    std::size_t count = 0;
    for (std::size_t k = first; k < first + out->most; ++k) {
      const double u = out->u_px[k], s = out->s_px[k];
      out->u_px[k] = out->s_px[k] = kTrialReadingsNone;
      if (std::isnan(u)) continue;
      const auto begin = out->u_px.begin() + static_cast<std::ptrdiff_t>(first);
      const auto end = begin + static_cast<std::ptrdiff_t>(count);
      if (std::find(begin, end, u) != end) {
        file.Fail(fmt::format("flash {} holds the reading {} px twice",
                              first / out->most / out->cameras.size() + 1, u),
                  "/u", "give each reading once");
      }
      out->u_px[first + count] = u;
      out->s_px[first + count++] = s;
    }
  }
}

TrialReadings ReadTrialReadingsH5(const std::string& path) {
  const H5Reader file(path, kReadingsSchema, kReadingsVersion);
  TrialReadings out;
  out.cameras = file.ReadStrings("/cameras");
  out.slots = file.ReadStrings("/slots");
  out.t = file.ReadDoubles("/t", "s");
  out.slot = file.ReadInts("/slot");
  if (file.Has("/pixels")) {
    for (const std::int32_t pixels : file.ReadInts("/pixels")) out.pixels.push_back(pixels);
  }
  RefuseShapes(file, out);
  const std::vector<std::size_t> dims = file.Dims("/u");
  out.most = dims.size() == 3 ? dims[2] : 1;
  out.u_px = file.ReadDoubles("/u", "px");
  out.s_px = file.ReadDoubles("/s", "px");
  RefuseFlashes(file, out);
  Pack(file, &out);
  return out;
}

void RefuseNames(const TrialReadings& out) {
  const std::set<std::string> names(out.cameras.begin(), out.cameras.end());
  if (names.size() != out.cameras.size() || names.contains("")) {
    throw Error("names a camera twice, or not at all", out.path, "give each camera its own name");
  }
  for (std::size_t i = 0; !out.pixels.empty() && i < out.size(); ++i) {
    for (std::size_t c = 0; c < out.cameras.size(); ++c) {
      for (const double u : out.Readings(i, c)) {
        if (std::isnan(u) || out.pixels[c] <= 0 || (u >= -0.5 && u <= out.pixels[c] - 0.5)) {
          continue;
        }
        throw Error(fmt::format("camera '{}' reads {} px at {} s, but its row has {} pixels",
                                out.cameras[c], u, out.t[i], out.pixels[c]),
                    out.path, "correct the reading, or the stated pixels");
      }
    }
  }
}

}  // namespace

TrialReadings ReadTrialReadings(const std::string& path) {
  TrialReadings out = IsSurveyH5(path) ? ReadTrialReadingsH5(path) : ReadTrialReadingsCsv(path);
  out.path = path;
  if (out.size() == 0) throw Error("holds no flashes", path, "give some");
  RefuseNames(out);
  return out;
}

void WriteTrialReadings(const std::string& path, const TrialReadings& readings,
                        const Provenance& provenance) {
  H5Writer file(path, kReadingsSchema, kReadingsVersion, provenance);
  file.Write({"/cameras", "1", "cameras' names"}, readings.cameras);
  file.Write({"/slots", "1", "what may be lit: a mark, or several joined by +"}, readings.slots);
  file.Write({"/t", "s", "of each flash, its middle"}, readings.t);
  file.Write({"/slot", "1", "of each flash, what was lit: index into slots", {"/t"}},
             readings.slot);
  if (!readings.pixels.empty()) {
    file.Write({"/pixels", "1", "of each camera's row; 0: not stated", {"/cameras"}},
               std::vector<std::int32_t>(readings.pixels.begin(), readings.pixels.end()));
  }
  file.BareScale("/reading", readings.most);
  const std::vector<std::string> scales = {"/t", "/cameras", "/reading"};
  const std::vector<std::size_t> dims = {readings.size(), readings.cameras.size(), readings.most};
  file.Write({"/u", "px", "readings, flash x camera x reading; NaN: none", scales}, readings.u_px,
             dims);
  file.Write({"/s", "px", "their standard deviations", scales}, readings.s_px, dims);
  file.Commit();
}

void WriteTrialReadingsCsv(const std::string& path, const TrialReadings& readings) {
  // Cameras are told by their rows, in order of appearance; so are the comment's pixels.
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < readings.size() && order.size() < readings.cameras.size(); ++i) {
    for (std::size_t c = 0; c < readings.cameras.size(); ++c) {
      if (std::isnan(readings.Readings(i, c)[0]) || std::count(order.begin(), order.end(), c) > 0) {
        continue;
      }
      order.push_back(c);
    }
  }
  CsvWriter writer({{"time", "s"}, {"mark", ""}, {"camera", ""}, {"u", "px"}, {"s", "px"}});
  if (!readings.pixels.empty()) {
    std::string pixels;
    for (const std::size_t c : order) {
      pixels += fmt::format("{}{}", pixels.empty() ? "" : ", ", readings.pixels[c]);
    }
    writer.Comment("pixels: " + pixels);
  }
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const std::string t = fmt::format("{}", readings.t[i]);
    const std::string& mark = readings.slots[static_cast<std::size_t>(readings.slot[i])];
    bool seen = false;
    for (std::size_t c = 0; c < readings.cameras.size(); ++c) {
      for (std::size_t k = 0; k < readings.most; ++k) {
        const double u = readings.Readings(i, c)[k];
        if (std::isnan(u)) continue;
        seen = true;
        writer.Row({t, mark, readings.cameras[c], fmt::format("{}", u),
                    fmt::format("{}", readings.Sigmas(i, c)[k])});
      }
    }
    if (!seen) writer.Row({t, mark, "", "", ""});
  }
  WriteTextFile(path, writer.text());
}

}  // namespace unfurl::data
